//! The networks a command works with: the shipped weights, built into the binary, or files of one's own.

use super::failure::{Failure, OrFail};
use super::files;
use crate::settings::{Autodiff, Backend, NetworkArgs};
#[cfg(feature = "burn")]
use darn_lab::unet::{BackendKind, BackendSettings, load_network};
use darn_mend::NetworkMender;
use darn_net::engine::EngineOptions;
use darn_net::{NetError, Network, Networks};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// The weights that are used when none are named; the first are the default ones.
const SHIPPED: [(&str, &[u8]); 3] = [
    (
        STANDARD,
        include_bytes!("../../weights/standard.safetensors"),
    ),
    (
        "gravity.safetensors",
        include_bytes!("../../weights/gravity.safetensors"),
    ),
    (
        "interpen.safetensors",
        include_bytes!("../../weights/interpen.safetensors"),
    ),
];
/// The default weights' file in a directory of weights.
const STANDARD: &str = "standard.safetensors";

/// The default weights as shipped.
pub fn standard() -> &'static [u8] {
    SHIPPED[0].1
}

/// Loads the networks that were asked for, or the shipped ones.
///
/// Of a directory, all files whose name ends in `.safetensors`: `standard.safetensors`, which must be there, is the default.
pub fn mender(args: &NetworkArgs) -> Result<NetworkMender, Failure> {
    let load = |bytes: &[u8], name: &str| loaded(bytes, args).or_fail(format!("load {name}"));
    let networks: Result<Vec<Network>, Failure> = match &args.weights {
        None => (SHIPPED.par_iter())
            .map(|(name, bytes)| load(bytes, &format!("the shipped {name}")))
            .collect(),
        Some(path) if path.is_dir() => (in_directory(path)?.iter())
            .map(|file| load(&files::read(file)?, &file.display().to_string()))
            .collect(),
        Some(file) => load(&files::read(file)?, &file.display().to_string()).map(|n| vec![n]),
    };
    let mut networks = networks?.into_iter();
    let default = networks
        .next()
        .ok_or_else(|| Failure::Usage("there are no weights".into()))?;
    let networks = Networks::new(default, networks.collect());
    Ok(NetworkMender::new(networks))
}

/// The weights in a directory, the default ones first, the others by name.
fn in_directory(path: &Path) -> Result<Vec<PathBuf>, Failure> {
    let name = path.display();
    let entries = std::fs::read_dir(path).or_fail(format!("read {name}"))?;
    let mut others = Vec::new();
    for entry in entries {
        let file = entry.or_fail(format!("read {name}"))?.path();
        let is_weights = file.extension().is_some_and(|e| e == "safetensors");
        if is_weights && file.file_name().is_some_and(|n| n != STANDARD) {
            others.push(file);
        }
    }
    others.sort();
    others.insert(0, path.join(STANDARD));
    Ok(others)
}

/// Copies of a grid, and places of a search, are divided among all threads; a single grid's layers, too.
fn options() -> EngineOptions {
    EngineOptions {
        isa: None,
        threads: rayon::current_num_threads(),
    }
}

/// A network that computes as the settings say.
#[cfg(feature = "burn")]
fn loaded(bytes: &[u8], args: &NetworkArgs) -> Result<Network, NetError> {
    let backend = match args.backend {
        Backend::Engine => BackendKind::Engine,
        Backend::Flex => BackendKind::Flex,
        Backend::Ndarray => BackendKind::Ndarray,
    };
    let autodiff = match (args.autodiff, backend) {
        (Autodiff::Burn, BackendKind::Engine) => Some(BackendKind::Flex),
        _ => None,
    };
    let settings = BackendSettings {
        backend,
        autodiff,
        engine: options(),
    };
    load_network(bytes, settings)
}

/// A network on darn's own engine: a build without burn has no other.
#[cfg(not(feature = "burn"))]
fn loaded(bytes: &[u8], args: &NetworkArgs) -> Result<Network, NetError> {
    let NetworkArgs {
        backend: Backend::Engine,
        autodiff: Autodiff::Engine,
        ..
    } = args;
    Network::load(bytes, options())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_weights_are_called_as_their_files_are() {
        let args = NetworkArgs {
            weights: None,
            backend: Backend::Engine,
            autodiff: Autodiff::Engine,
        };
        let Ok(mender) = mender(&args) else {
            panic!("the shipped weights do not load");
        };
        let files = SHIPPED.map(|(file, _)| file.trim_end_matches(".safetensors"));
        assert_eq!(mender.networks.names(), files);
        assert_eq!(mender.networks.default().card().name, "standard");
    }
}
