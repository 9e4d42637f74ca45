//! `darn serve`: the service.

use super::failure::{Failure, OrFail};
use super::network;
use crate::allocator;
use crate::settings::ServeCommand;
use darn_mend::{NetworkMender, SharedMender};
use darn_serve::{LogDelivery, LogError, ServeError, start_logging, start_traces};
use std::sync::Arc;

/// Runs `darn serve`.
pub fn run(settings: &ServeCommand) -> Result<(), Failure> {
    let serve = &settings.serve;
    let _log =
        start_logging(&serve.log, serve.log_format, LogDelivery::Queued).map_err(|error| {
            match error {
                LogError::Filter(error) => Failure::Usage(format!("--log {}: {error}", serve.log)),
                LogError::Thread(_) => Failure::Failed {
                    doing: "start logging".to_owned(),
                    cause: error.into(),
                },
            }
        })?;
    // Sends its last spans before the log ends.
    let _traces = start_traces().or_fail("send traces (OTEL_EXPORTER_OTLP_…)")?;
    // Here and not at the first mend, where an error would be a panic. 0: as many as processors.
    (rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads.unwrap_or(0))
        .build_global())
    .or_fail("start the threads of mends (DARN_THREADS)")?;
    let mut mender = NetworkMender {
        scan_limits: settings.size.limits(),
        ..network::mender(&settings.network)?
    };
    settings.texture.apply(&mut mender);
    let mender = Arc::new(mender);
    let idle = Arc::clone(&mender);
    allocator::give_back_when_idle(move |unused| idle.release_idle(unused));
    match darn_serve::run(serve, Arc::new(SharedMender(mender))) {
        // Settings that are wrong, as those that clap refuses.
        Err(
            error @ (ServeError::Exposed { .. }
            | ServeError::Keys(_)
            | ServeError::Tls(_)
            | ServeError::Webhooks(_)
            | ServeError::AloneWithoutWorkers),
        ) => Err(Failure::Usage(error.to_string())),
        outcome => outcome.or_fail("serve"),
    }
}
