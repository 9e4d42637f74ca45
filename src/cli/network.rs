//! The networks of a command: the shipped weights, which are built into the binary, or weights files.

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

/// The shipped weights by file name; the first are the default.
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
/// The file of the default weights, in a directory too.
const STANDARD: &str = "standard.safetensors";

/// The file of the shipped default weights.
pub fn standard() -> &'static [u8] {
    SHIPPED[0].1
}

/// Loads the networks that the settings name, or the shipped ones.
///
/// Of a directory it loads all files whose names end in `.safetensors`; `standard.safetensors` must be there and is the
/// default.
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

/// The weights files in a directory: the default first, the others sorted by name.
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

/// All threads share the work: copies of a grid, places of a search, and the layers of a single grid.
fn options() -> EngineOptions {
    EngineOptions {
        isa: None,
        threads: rayon::current_num_threads(),
    }
}

/// A network on the backend that the settings name.
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

/// A network on darn's own engine: a build without burn has no other backend.
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
    fn the_shipped_networks_have_the_names_of_their_files() {
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
