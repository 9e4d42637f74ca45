//! The port's [`Mender`] on loaded networks: reads the scan, mends it, and turns errors into refusals.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use darn_budget::Budget;
use darn_contract::port::{
    EditSession, HolesQuery, MapSpan, Mended, Mender, PatchForm, Patches, Refusal, ScanForm,
    Stripped,
};
use darn_contract::{Constraints, Outcome, Search, error_chain, v1};
use darn_geometry::mesh::Vec3;
use darn_gltf_scan::{Container, Scan};

use crate::error::MendError;
use crate::formed_scan::formed;
use crate::inpainter::weights_of;
use crate::mender::{Call, NetworkMender};
use crate::session::{ScanSession, SessionDraft};
use crate::timings::add_read_time;

/// The scan that the warm-up mends: a real one, small.
const EXAMPLE: &[u8] = include_bytes!("../../../examples/scarf_hole.glb");

/// A mender behind the port; sessions share it.
#[derive(Debug, Clone)]
pub struct SharedMender(pub Arc<NetworkMender>);

impl SharedMender {
    /// Reads a scan; also returns how long that took.
    fn scan(&self, bytes: Bytes, budget: &Budget) -> Result<(Scan, Duration), Refusal> {
        let started = Instant::now();
        budget.begin("reading", 0);
        let scan = Scan::read_within(bytes, &self.0.scan_limits, budget)
            .map_err(|error| refusal(MendError::unreadable(error)))?;
        Ok((scan, started.elapsed()))
    }

    fn call<'a>(&'a self, budget: &'a Budget<'a>) -> Call<'a> {
        Call {
            mender: &self.0,
            budget,
        }
    }
}

impl Mender for SharedMender {
    fn inpaint(
        &self,
        scan: Bytes,
        constraints: &Constraints,
        budget: &Budget<'_>,
    ) -> Result<Mended, Refusal> {
        self.0.pools.run(budget, || {
            let (scan, read) = self.scan(scan, budget)?;
            let mut mended = crate::mend(&scan, constraints, self.call(budget)).map_err(refusal)?;
            add_read_time(&mut mended.report.timings, read);
            Ok(mended)
        })
    }

    fn repacked(
        &self,
        mended: Mended,
        form: ScanForm,
        budget: &Budget<'_>,
    ) -> Result<Mended, Refusal> {
        if mended.media_type != Container::Zip.media_type() {
            return Ok(mended);
        }
        let limits = &self.0.scan_limits;
        let scan = formed(mended.bytes, form, limits, budget).map_err(refusal)?;
        let mut report = mended.report;
        report.output = scan.digests.or(report.output);
        Ok(Mended {
            bytes: scan.bytes,
            media_type: scan.container.media_type(),
            report,
            file: None,
        })
    }

    fn strip(&self, scan: Bytes, form: ScanForm, budget: &Budget<'_>) -> Result<Stripped, Refusal> {
        crate::strip(scan, form, &self.0.scan_limits, budget).map_err(refusal)
    }

    fn optimize_anchor(
        &self,
        scan: Bytes,
        search: &Search,
        budget: &Budget<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        self.0.pools.run(budget, || {
            let (scan, _) = self.scan(scan, budget)?;
            crate::optimize_anchor(&scan, search, self.call(budget)).map_err(refusal)
        })
    }

    fn mend_to_target(
        &self,
        scan: Bytes,
        search: &Search,
        budget: &Budget<'_>,
    ) -> Result<Mended, Refusal> {
        self.0.pools.run(budget, || {
            let (scan, read) = self.scan(scan, budget)?;
            let mut mended =
                crate::mend_to_target(&scan, search, self.call(budget)).map_err(refusal)?;
            add_read_time(&mut mended.report.timings, read);
            Ok(mended)
        })
    }

    fn open(
        &self,
        scan: Bytes,
        constraints: &Constraints,
        budget: &Budget<'_>,
    ) -> Result<Box<dyn EditSession>, Refusal> {
        let session = self.0.pools.run(budget, || {
            let (scan, _) = self.scan(scan, budget)?;
            ScanSession::open(scan, constraints, Arc::clone(&self.0), budget).map_err(refusal)
        })?;
        Ok(Box::new(session))
    }

    fn find_holes(
        &self,
        scan: Bytes,
        wanted: HolesQuery,
        budget: &Budget<'_>,
    ) -> Result<v1::HolesReport, Refusal> {
        self.0.pools.run(budget, || {
            let (scan, read) = self.scan(scan, budget)?;
            let mut found = crate::find_holes(&scan, wanted, budget).map_err(refusal)?;
            add_read_time(&mut found.timings, read);
            Ok(found)
        })
    }

    fn weights(&self) -> Vec<v1::Weights> {
        self.0.networks.cards().map(weights_of).collect()
    }

    fn warm_up(&self) -> Result<(), Refusal> {
        self.inpaint(
            Bytes::from_static(EXAMPLE),
            &Constraints::default(),
            Budget::unlimited(),
        )
        .map(drop)
    }
}

impl EditSession for ScanSession {
    fn described(&self) -> v1::Session {
        ScanSession::described(self)
    }

    fn outcome(&self) -> Outcome {
        ScanSession::outcome(self)
    }

    fn bytes(&self) -> usize {
        ScanSession::bytes(self)
    }

    fn patches(
        &self,
        constraints: &Constraints,
        form: PatchForm,
        budget: &Budget<'_>,
    ) -> Result<Patches, Refusal> {
        let call = self.call(budget);
        let (bytes, report) = self.pools().run(budget, || match form {
            PatchForm::Glb => call.glb(constraints).map_err(refusal),
            PatchForm::Positions => {
                let (positions, report) = call.positions(constraints).map_err(refusal)?;
                Ok((packed(positions.iter().flatten()), report))
            }
        })?;
        Ok(Patches { bytes, report })
    }

    fn draft(&self, constraints: &Constraints, budget: &Budget<'_>) -> Result<Vec<u8>, Refusal> {
        let draft = (self.pools()).run(budget, || self.call(budget).draft(constraints));
        let SessionDraft { positions, normals } = draft.map_err(refusal)?;
        Ok(packed(positions.iter().chain(&normals)))
    }

    fn mended(&self, constraints: &Constraints, budget: &Budget<'_>) -> Result<Mended, Refusal> {
        let mended = self
            .pools()
            .run(budget, || self.call(budget).mended(constraints));
        mended.map_err(refusal)
    }

    fn optimize_anchor(
        &self,
        search: &Search,
        budget: &Budget<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        let found = (self.pools()).run(budget, || self.call(budget).optimize_anchor(search));
        found.map_err(refusal)
    }

    fn map_piece(
        &self,
        search: &Search,
        span: MapSpan,
        budget: &Budget<'_>,
    ) -> Result<v1::MapPiece, Refusal> {
        let piece = (self.pools()).run(budget, || self.call(budget).map_piece(search, span));
        piece.map_err(refusal)
    }
}

/// `x, y, z` of each vector as little-endian f32.
fn packed<'a>(vectors: impl Iterator<Item = &'a Vec3>) -> Vec<u8> {
    let numbers = vectors.flat_map(|v| [v.x, v.y, v.z]);
    numbers.flat_map(|x| (x as f32).to_le_bytes()).collect()
}

/// An error as the port hands it on.
fn refusal(error: MendError) -> Refusal {
    Refusal {
        code: error.code(),
        detail: error_chain(&error),
        fields: error.fields(),
        outcome: error.outcome(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_contract::codes;
    use darn_geometry::mesh::index::LoopId;
    use darn_geometry::mesh::region::RegionError;

    #[test]
    fn a_refusal_has_the_codes_of_its_error_and_names_a_cause_once() {
        let error = MendError::Region {
            hole: 3,
            source: RegionError::TooLarge {
                rim: LoopId(3),
                coordinate: 1e120,
                limit: 1e100,
            },
        };
        let text = error.to_string();
        let refusal = refusal(error);
        assert_eq!(refusal.code, codes::COORDINATES_TOO_LARGE);
        assert_eq!(refusal.detail, text);
    }

    #[test]
    fn a_refusal_says_how_it_went_where_it_came_as_far_as_the_holes() {
        let outcome = |error| refusal(error).outcome.map(|outcome| outcome.to_string());
        let narrow = || MendError::NoCells { hole: 3 };
        let none = MendError::NoneFilled {
            holes: 2,
            first: Box::new(narrow()),
        };
        let nothing = MendError::NoHoles {
            skipped: Vec::new(),
        };
        assert_eq!(outcome(narrow()).unwrap(), "filled=0 skipped=1 doubtful=0");
        assert_eq!(outcome(none).unwrap(), "filled=0 skipped=2 doubtful=0");
        assert_eq!(outcome(nothing).unwrap(), "filled=0 skipped=0 doubtful=0");
        assert_eq!(outcome(MendError::NothingToStrip), None);
    }
}
