//! The whole service around a mender that returns every scan unchanged.
//!
//! ```sh
//! cargo run -p darn-serve --example echo -- --listen 127.0.0.1:8080
//! curl --data-binary @scan.glb -H 'content-type: model/gltf-binary' 127.0.0.1:8080/inpaint > same.glb
//! ```

use std::sync::Arc;

use bytes::Bytes;
use clap::Parser;
use darn_budget::Budget;
use darn_contract::port::{EditSession, HolesQuery, Mended, Mender, Refusal, ScanForm, Stripped};
use darn_contract::{Constraints, Search, codes, v1};
use darn_serve::{LogDelivery, LogError, ServeArgs, ServeError, run, start_logging};

#[derive(Parser)]
struct Args {
    #[command(flatten)]
    serve: ServeArgs,
}

struct Echo;

impl Mender for Echo {
    fn weights(&self) -> Vec<v1::Weights> {
        Vec::new()
    }

    fn inpaint(&self, scan: Bytes, _: &Constraints, _: &Budget<'_>) -> Result<Mended, Refusal> {
        let bytes = scan.into();
        let report = v1::Report::default();
        Ok(Mended {
            bytes,
            media_type: "model/gltf-binary",
            report,
            file: None,
        })
    }

    fn strip(&self, _: Bytes, _: ScanForm, _: &Budget<'_>) -> Result<Stripped, Refusal> {
        let nothing = "this mender puts nothing in";
        Err(Refusal::new(codes::NOTHING_TO_STRIP, nothing))
    }

    fn find_holes(
        &self,
        _: Bytes,
        _: HolesQuery,
        _: &Budget<'_>,
    ) -> Result<v1::HolesReport, Refusal> {
        Ok(v1::HolesReport::default())
    }

    fn optimize_anchor(
        &self,
        _: Bytes,
        _: &Search,
        _: &Budget<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        Err(no_holes())
    }

    fn mend_to_target(&self, _: Bytes, _: &Search, _: &Budget<'_>) -> Result<Mended, Refusal> {
        Err(no_holes())
    }

    fn open(
        &self,
        _: Bytes,
        _: &Constraints,
        _: &Budget<'_>,
    ) -> Result<Box<dyn EditSession>, Refusal> {
        Err(no_holes())
    }

    fn warm_up(&self) -> Result<(), Refusal> {
        Ok(())
    }
}

fn no_holes() -> Refusal {
    Refusal::new(codes::NO_HOLES, "this mender finds no holes")
}

/// Why this example ended.
#[derive(Debug, thiserror::Error)]
enum EchoError {
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Serve(#[from] ServeError),
}

fn main() -> Result<(), EchoError> {
    let args = Args::parse().serve;
    let _log = start_logging(&args.log, args.log_format, LogDelivery::Queued)?;
    Ok(run(&args, Arc::new(Echo))?)
}
