//! The port's [`Mender`] on loaded networks: reads the scan, mends it, and turns errors into refusals.

use std::error::Error;
use std::sync::Arc;
use std::time::{Duration, Instant};

use darn_contract::port::{
    Cancellation, Class, EditSession, Mended, Mender, PatchForm, Patches, Refusal,
};
use darn_contract::{Constraints, Search, v1};
use darn_gltf_scan::{Scan, ScanError};

use crate::error::MendError;
use crate::mender::{Call, NetworkMender};
use crate::session::ScanSession;
use crate::timings::add_read_time;

/// The scan that the warm-up mends: a real one, small.
const EXAMPLE: &[u8] = include_bytes!("../../../examples/scarf_hole.glb");

/// A mender behind the port; sessions share it.
#[derive(Debug, Clone)]
pub struct SharedMender(pub Arc<NetworkMender>);

impl SharedMender {
    /// Reads a scan; also returns how long that took.
    fn scan(&self, bytes: &[u8]) -> Result<(Scan, Duration), Refusal> {
        let started = Instant::now();
        let scan = Scan::read(bytes, &self.0.scan_limits)
            .map_err(|error| refusal(MendError::Unreadable(error)))?;
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
        scan: &[u8],
        constraints: &Constraints,
        cancellation: Cancellation<'_>,
    ) -> Result<Mended, Refusal> {
        let (scan, read) = self.scan(scan)?;
        let mut mended =
            crate::mend(&scan, constraints, self.call(cancellation)).map_err(refusal)?;
        add_read_time(&mut mended.report.timings, read);
        Ok(mended)
    }

    fn optimize_anchor(
        &self,
        scan: &[u8],
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        let (scan, _) = self.scan(scan)?;
        crate::optimize_anchor(&scan, search, self.call(cancellation)).map_err(refusal)
    }

    fn mend_to_target(
        &self,
        scan: &[u8],
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<Mended, Refusal> {
        let (scan, read) = self.scan(scan)?;
        let mut mended =
            crate::mend_to_target(&scan, search, self.call(cancellation)).map_err(refusal)?;
        add_read_time(&mut mended.report.timings, read);
        Ok(mended)
    }

    fn open(
        &self,
        scan: &[u8],
        constraints: &Constraints,
        cancellation: Cancellation<'_>,
    ) -> Result<Box<dyn EditSession>, Refusal> {
        let (scan, _) = self.scan(scan)?;
        let session = ScanSession::open(scan, constraints, Arc::clone(&self.0), cancellation);
        Ok(Box::new(session.map_err(refusal)?))
    }

    fn find_holes(&self, scan: &[u8]) -> Result<v1::HolesReport, Refusal> {
        let (scan, read) = self.scan(scan)?;
        let mut found = crate::find_holes(&scan);
        add_read_time(&mut found.timings, read);
        Ok(found)
    }

    fn warm_up(&self) -> Result<(), Refusal> {
        self.inpaint(EXAMPLE, &Constraints::default(), Cancellation::NEVER)
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
            PatchForm::Glb => call.glb(constraints).map_err(refusal)?,
            PatchForm::Positions => {
                let (positions, report) = call.positions(constraints).map_err(refusal)?;
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
        self.call(cancellation).mended(constraints).map_err(refusal)
    }

    fn optimize_anchor(
        &self,
        search: &Search,
        cancellation: Cancellation<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        let found = self.call(cancellation).optimize_anchor(search);
        found.map_err(refusal)
    }
}

/// A refusal's code and fields are the error's; its class says whether the bytes, the scan or darn is at fault.
fn refusal(error: MendError) -> Refusal {
    let class = match &error {
        MendError::Unreadable(ScanError::Container { .. } | ScanError::Invalid { .. }) => {
            Class::Malformed
        }
        MendError::Unreadable(ScanError::Limit { .. }) => Class::TooLarge,
        error if error.is_internal() => Class::Internal,
        _ => Class::Unprocessable,
    };
    Refusal {
        class,
        code: error.code(),
        detail: told(&error),
        fields: error.fields(),
    }
}

/// An error and its causes in one line.
fn told(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let more = cause.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        next = cause.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::mesh::region::RegionError;

    #[test]
    fn a_cause_that_the_error_names_already_is_told_once() {
        let error = MendError::Region {
            hole: 3,
            source: RegionError::TooLarge {
                rim: 3,
                coordinate: 1e120,
                limit: 1e100,
            },
        };
        let text = error.to_string();
        let refusal = refusal(error);
        assert_eq!(refusal.class, Class::Unprocessable);
        assert_eq!(refusal.code, "coordinates_too_large");
        assert_eq!(refusal.detail, text);
    }

    #[test]
    fn unreadable_bytes_and_a_scan_that_is_too_large_have_classes_of_their_own() {
        let class = |error| refusal(MendError::Unreadable(error)).class;
        let cut_off = ScanError::Container {
            offset: 12,
            detail: "the file ends".into(),
        };
        let too_large = ScanError::Limit {
            pointer: "/nodes".into(),
            limit: "nodes",
            allowed: 1,
            found: 2,
        };
        assert_eq!(class(cut_off), Class::Malformed);
        assert_eq!(class(too_large), Class::TooLarge);
        assert_eq!(class(ScanError::NoTriangles), Class::Unprocessable);
    }
}
