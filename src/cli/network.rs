//! The networks a command works with: the shipped weights, built into the binary, or files of one's own.

use super::failure::{Failure, OrFail};
use super::files;
use darn::mend::{Limits, Mender};
use darn::net::{BackendKind, Network, Networks, Settings};
use darn::serve::{Autodiff, Backend, NetworkArgs};
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
pub fn mender(args: &NetworkArgs) -> Result<Mender, Failure> {
    let settings = settings(args.backend, args.autodiff)?;
    let load =
        |bytes: &[u8], name: &str| Network::load(bytes, settings).or_fail(format!("load {name}"));
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
    Ok(Mender {
        networks: Networks::new(default, networks.collect()),
        limits: Limits::default(),
    })
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

/// What runs and what differentiates.
fn settings(backend: Backend, autodiff: Autodiff) -> Result<Settings, Failure> {
    let name = match backend {
        Backend::Engine => "engine",
        Backend::Flex => "flex",
        Backend::Ndarray => "ndarray",
    };
    // A build without a backend does not know its name.
    let backend: BackendKind = name
        .parse()
        .map_err(|error: darn::net::NetError| Failure::Usage(error.to_string()))?;
    let autodiff = match (autodiff, backend) {
        (Autodiff::Burn, BackendKind::Engine) => Some(BackendKind::Flex),
        _ => None,
    };
    // Copies of a grid, and places of a search, are shared out to all threads; a single grid's layers, too.
    let threads = rayon::current_num_threads();
    Ok(Settings {
        backend,
        autodiff,
        engine: darn::net::engine::Options { isa: None, threads },
    })
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
