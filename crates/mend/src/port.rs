//! The port's [`Mender`] on loaded networks: reads the scan, mends it, and sorts refusals by whose fault they are.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use darn_contract::port::{Cancellation, EditSession, Mended, Mender, PatchForm, Patches, Refusal};
use darn_contract::{Constraints, Search, codes, error_chain, v1};
use darn_gltf_scan::{Scan, ScanError};

use super::{Call, MendError, NetworkMender, ScanSession, add_read_time};

/// The scan of the warm-up mend: small, and whole and real.
const EXAMPLE: &[u8] = include_bytes!("../../../examples/scarf_hole.glb");

/// A mender that sessions share, behind the port.
#[derive(Debug, Clone)]
pub struct SharedMender(pub Arc<NetworkMender>);

impl SharedMender {
    /// A scan, and how long reading it took.
    fn scan(&self, bytes: Bytes) -> Result<(Scan, Duration), Refusal> {
        let started = Instant::now();
        let scan = Scan::read(bytes, &self.0.scan_limits).map_err(|error| of_scan(&error))?;
        Ok((scan, started.elapsed()))
    }

    fn call<'a>(&'a self, cancellation: Cancellation<'a>) -> Call<'a> {
        Call {
            mender: &self.0,
            cancellation,
        }
    }
}

impl Mender for SharedMender {
    fn inpaint(
        &self,
        scan: Bytes,
        constraints: &Constraints,
        cancellation: Cancellation<'_>,
    ) -> Result<Mended, Refusal> {
        let (scan, read) = self.scan(scan)?;
        let mut mended =
            super::mend(&scan, constraints, self.call(cancellation)).map_err(of_mend)?;
        add_read_time(&mut mended.report.timings, read);
        Ok(mended)
    }

    fn optimize_anchor(
        &self,
        scan: Bytes,
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        let (scan, _) = self.scan(scan)?;
        super::optimize_anchor(&scan, search, self.call(cancellation)).map_err(of_mend)
    }

    fn mend_to_target(
        &self,
        scan: Bytes,
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<Mended, Refusal> {
        let (scan, read) = self.scan(scan)?;
        let mut mended =
            super::mend_to_target(&scan, search, self.call(cancellation)).map_err(of_mend)?;
        add_read_time(&mut mended.report.timings, read);
        Ok(mended)
    }

    fn open(
        &self,
        scan: Bytes,
        constraints: &Constraints,
        cancellation: Cancellation<'_>,
    ) -> Result<Box<dyn EditSession>, Refusal> {
        let (scan, _) = self.scan(scan)?;
        let session = ScanSession::open(scan, constraints, Arc::clone(&self.0), cancellation);
        Ok(Box::new(session.map_err(of_mend)?))
    }

    fn find_holes(&self, scan: Bytes) -> Result<v1::HolesReport, Refusal> {
        let (scan, read) = self.scan(scan)?;
        let mut found = super::find_holes(&scan);
        add_read_time(&mut found.timings, read);
        Ok(found)
    }

    fn warm_up(&self) -> Result<(), Refusal> {
        self.inpaint(
            Bytes::from_static(EXAMPLE),
            &Constraints::default(),
            Cancellation::NEVER,
        )
        .map(drop)
    }
}

impl EditSession for ScanSession {
    fn described(&self) -> v1::Session {
        ScanSession::described(self)
    }

    fn bytes(&self) -> usize {
        ScanSession::bytes(self)
    }

    fn patches(
        &self,
        constraints: &Constraints,
        form: PatchForm,
        cancellation: Cancellation<'_>,
    ) -> Result<Patches, Refusal> {
        let call = self.call(cancellation);
        let (bytes, report) = match form {
            PatchForm::Glb => call.glb(constraints).map_err(of_mend)?,
            PatchForm::Positions => {
                let (positions, report) = call.positions(constraints).map_err(of_mend)?;
                let numbers = positions.iter().flatten().flat_map(|p| [p.x, p.y, p.z]);
                let bytes = numbers.flat_map(|x| (x as f32).to_le_bytes());
                (bytes.collect(), report)
            }
        };
        Ok(Patches { bytes, report })
    }

    fn mended(
        &self,
        constraints: &Constraints,
        cancellation: Cancellation<'_>,
    ) -> Result<Mended, Refusal> {
        self.call(cancellation).mended(constraints).map_err(of_mend)
    }

    fn optimize_anchor(
        &self,
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        let found = self.call(cancellation).optimize_anchor(search);
        found.map_err(of_mend)
    }
}

fn of_scan(error: &ScanError) -> Refusal {
    let code = match error {
        ScanError::Container { .. } => codes::NOT_A_GLTF,
        ScanError::Invalid { .. } => codes::INVALID_GLTF,
        ScanError::IndexOutOfRange { .. } => codes::INDEX_OUT_OF_RANGE,
        ScanError::NotFinite { .. } => codes::POSITION_NOT_FINITE,
        ScanError::Unsupported { .. } => codes::UNSUPPORTED_EXTENSION,
        ScanError::External { .. } => codes::EXTERNAL_DATA,
        ScanError::Limit { .. } => codes::SCAN_TOO_LARGE,
        ScanError::NoTriangles => codes::NO_TRIANGLES,
        ScanError::Singular { .. } => codes::SINGULAR_TRANSFORM,
        ScanError::InvalidPatch { .. } => codes::INTERNAL,
    };
    Refusal::new(code, error.to_string())
}

fn of_mend(error: MendError) -> Refusal {
    Refusal {
        code: error.code(),
        detail: error_chain(&error),
        fields: error.fields(),
    }
}
