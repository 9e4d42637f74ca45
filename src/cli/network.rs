//! The network a command works with: the shipped weights, built into the binary, or a file of one's own.

use super::failure::{Failure, OrFail};
use super::files;
use darn::mend::{Limits, Mender};
use darn::net::{BackendKind, Network};
use darn::serve::Backend;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The weights that are used when none are named.
const SHIPPED: &[u8] = include_bytes!("../../weights/standard.safetensors");
/// Their file's name in a directory of weights.
const STANDARD: &str = "standard.safetensors";

#[derive(Debug, clap::Args)]
pub struct NetworkArgs {
    /// Directory or file of the weights; left out, the shipped ones
    #[arg(long, env = "DARN_WEIGHTS", value_name = "PATH")]
    weights: Option<PathBuf>,
    /// What runs the network
    #[arg(
        long,
        env = "DARN_BACKEND",
        value_name = "NAME",
        default_value = "flex"
    )]
    backend: Backend,
}

impl NetworkArgs {
    /// Loads the network these settings name.
    pub fn mender(&self) -> Result<Mender, Failure> {
        mender(self.weights.as_deref(), self.backend)
    }
}

/// Loads the network from `weights`, a file or a directory with `standard.safetensors` in it, or the shipped one.
pub fn mender(weights: Option<&Path>, backend: Backend) -> Result<Mender, Failure> {
    let (bytes, name) = match weights {
        None => (Cow::Borrowed(SHIPPED), "the shipped weights".to_owned()),
        Some(path) => {
            let file = if path.is_dir() {
                path.join(STANDARD)
            } else {
                path.to_owned()
            };
            (Cow::Owned(files::read(&file)?), file.display().to_string())
        }
    };
    let network = Network::load(&bytes, kind(backend)?).or_fail(format!("load {name}"))?;
    Ok(Mender {
        network,
        limits: Limits::default(),
    })
}

fn kind(backend: Backend) -> Result<BackendKind, Failure> {
    let name = match backend {
        Backend::Flex => "flex",
        Backend::Ndarray => "ndarray",
    };
    // A build without a backend does not know its name.
    name.parse()
        .map_err(|error: darn::net::NetError| Failure::Usage(error.to_string()))
}
