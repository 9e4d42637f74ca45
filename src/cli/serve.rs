//! `darn serve`: the service.

use super::bridge::Bridge;
use super::failure::{Failure, OrFail};
use super::network;
use darn::scan::Limits;
use darn::serve::{ServeArgs, start_logging};
use std::sync::Arc;

pub fn run(settings: &ServeArgs) -> Result<(), Failure> {
    start_logging(&settings.log, settings.log_format)
        .map_err(|error| Failure::Usage(format!("--log {}: {error}", settings.log)))?;
    if let Some(threads) = settings.threads {
        (rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global())
        .or_fail("start threads")?;
    }
    let mender = network::mender(&settings.network)?;
    let limits = Limits {
        max_faces: settings.max_faces,
        max_vertices: settings.max_vertices,
        ..Limits::default()
    };
    darn::serve::run(
        settings,
        Arc::new(Bridge {
            mender: Arc::new(mender),
            limits,
        }),
    )
    .or_fail("serve")
}
