//! A scan that is kept for editing: prepared once, then asked many times; it gives the same answers as single calls.

use std::sync::Arc;

use rayon::prelude::*;

use crate::addition::vertex_normals_at_seam;
use crate::call_pools::CallPools;
use crate::error::MendError;
use crate::mender::{Call, NetworkMender};
use crate::prepared_hole::PreparedHole;
use crate::scan_additions::ScanAdditions;
use crate::scan_holes::{FilledScan, ScanHoles};
use crate::session_description::{self, Described};
use darn_budget::Budget;
use darn_contract::port::{MapSpan, Mended};
use darn_contract::{Constraints, FieldError, Outcome, Search, v1};
use darn_geometry::mesh::Vec3;
use darn_gltf_scan::export::{ColouredMesh, MeshLook, NewMesh, coloured_meshes};
use darn_gltf_scan::{PatchPoint, PatchPrimitive, Scan};

/// A scan with its holes prepared, the mender that fills them, and the description of both.
pub struct ScanSession {
    scan: Scan,
    holes: ScanHoles,
    mender: Arc<NetworkMender>,
    described: Described,
}

impl ScanSession {
    /// Prepares the holes that the constraints choose and fills them once without anchors and edits.
    ///
    /// # Errors
    /// As [`mend`](crate::mend); and `Constraints` for anchors or edits, which belong to later requests.
    pub fn open(
        scan: Scan,
        constraints: &Constraints,
        mender: Arc<NetworkMender>,
        budget: &Budget,
    ) -> Result<ScanSession, MendError> {
        let entries = [
            ("/anchors", constraints.anchors.len()),
            ("/edits", constraints.edits.len()),
        ];
        let early: Vec<FieldError> = (entries.iter())
            .filter(|(_, count)| *count > 0)
            .map(|(pointer, _)| {
                let detail = "a session opens without them; send them to its inpaint";
                FieldError::new(*pointer, detail)
            })
            .collect();
        if !early.is_empty() {
            return Err(MendError::Constraints(early));
        }
        let call = Call {
            mender: &mender,
            budget,
        };
        let holes = ScanHoles::open(&scan, constraints, call)?;
        let described = session_description::described(&holes, &scan, call)?;
        Ok(ScanSession {
            scan,
            holes,
            mender,
            described,
        })
    }

    /// The session in the contract's words, without `id` and `idle_seconds`, which are the caller's to fill in.
    pub fn described(&self) -> v1::Session {
        v1::Session {
            bytes: self.bytes() as u64,
            ..self.described.session.clone()
        }
    }

    /// How its holes were filled when it was opened.
    pub fn outcome(&self) -> Outcome {
        self.described.outcome
    }

    /// Bytes of memory that it holds, estimated: half as much again as is counted, as allocators round up and sparse
    /// factors fill in. Measured: a thousand sessions counted at 4.2 MiB each took 6.0 MiB each.
    pub fn bytes(&self) -> usize {
        let holes: usize = self.holes.holes.iter().map(PreparedHole::bytes).sum();
        let described = session_description::bytes(&self.described.session);
        let counted = self.scan.bytes_held() + self.holes.bytes() + holes + described;
        counted + counted / 2
    }

    /// The threads of its calls.
    pub(crate) fn pools(&self) -> &CallPools {
        &self.mender.pools
    }

    /// A call to the session, with what it may cost.
    pub fn call<'a>(&'a self, budget: &'a Budget<'a>) -> SessionCall<'a> {
        SessionCall {
            session: self,
            call: Call {
                mender: &self.mender,
                budget,
            },
        }
    }

    fn report(&self, filled: FilledScan) -> v1::Report {
        let mut report = self.holes.report(&self.scan, filled);
        self.remove_preparation(&mut report);
        report
    }

    /// Removes the time of opening the session from a report.
    fn remove_preparation(&self, report: &mut v1::Report) {
        if let Some(timings) = &mut report.timings {
            timings.holes -= self.holes.prepare_ms;
            timings.total -= self.holes.prepare_ms + timings.weld + timings.loops;
            (timings.weld, timings.loops) = (0.0, 0.0);
        }
        for timings in report.holes.iter_mut().flat_map(|h| &mut h.timings) {
            (timings.region, timings.flatten, timings.raster) = (0.0, 0.0, 0.0);
        }
    }
}

/// The patches of a session's holes while something is dragged.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionDraft {
    /// The vertices of all patches, patch after patch, in order of hole id; scene space.
    pub positions: Vec<Vec3>,
    /// Their unit normals. At a seam they are those of patch and scan together.
    pub normals: Vec<Vec3>,
}

/// A session and what a call to it may cost.
#[derive(Clone, Copy)]
pub struct SessionCall<'a> {
    session: &'a ScanSession,
    call: Call<'a>,
}

impl<'a> SessionCall<'a> {
    /// The whole scan mended: the bytes that [`mend`](crate::mend) gives for the same constraints. Holes, weights and
    /// up are those of the opening where `constraints` leaves them out.
    ///
    /// # Errors
    /// As [`mend`](crate::mend).
    pub fn mended(&self, constraints: &Constraints) -> Result<Mended, MendError> {
        let filled = self.filled(constraints)?;
        let mut mended =
            self.session
                .holes
                .mended(&self.session.scan, filled, constraints.into(), self.call)?;
        self.session.remove_preparation(&mut mended.report);
        Ok(mended)
    }

    /// The patches alone, as a GLB with one mesh for each hole, in order of id, each in the base colour of its own images, or in its one
    /// colour; and the report, which says where the colours come from.
    ///
    /// # Errors
    /// As [`mend`](crate::mend).
    pub fn glb(&self, constraints: &Constraints) -> Result<(Vec<u8>, v1::Report), MendError> {
        let filled = self.filled(constraints)?;
        let ScanAdditions {
            primitives,
            mut report,
        } = (self.session.holes).additions(
            &self.session.scan,
            filled,
            constraints.texture,
            self.call,
        )?;
        self.session.remove_preparation(&mut report);
        Ok((glb(&self.session.scan, &primitives)?, report))
    }

    /// The positions of the patches' vertices in scene space: one list for each hole, in order of id, each in the order
    /// of its `patch_uvs`.
    ///
    /// # Errors
    /// As [`mend`](crate::mend).
    pub fn positions(
        &self,
        constraints: &Constraints,
    ) -> Result<(Vec<Vec<Vec3>>, v1::Report), MendError> {
        let filled = self.filled(constraints)?;
        let each = filled.holes.iter();
        let positions = each.map(|hole| hole.patch.positions.clone());
        Ok((positions.collect(), self.session.report(filled)))
    }

    /// The patches of the session's holes as a drag shows them: not measured, and without a report.
    ///
    /// # Errors
    /// As [`mend`](crate::mend).
    pub fn draft(&self, constraints: &Constraints) -> Result<SessionDraft, MendError> {
        let ScanSession {
            scan,
            holes,
            described,
            ..
        } = self.session;
        let listed = described.session.holes.iter().map(|hole| hole.id).collect();
        let drafts = holes.drafts_of(scan, constraints, &listed, self.call)?;
        let each = (drafts.par_iter())
            .map(|draft| vertex_normals_at_seam(&draft.patch, draft.hole.region()));
        let normals: Vec<Vec<Vec3>> = each.collect();
        Ok(SessionDraft {
            positions: (drafts.into_iter())
                .flat_map(|draft| draft.patch.positions)
                .collect(),
            normals: normals.concat().iter().map(Vec3::normalize).collect(),
        })
    }

    /// Searches where on a hole's grid a point in space belongs, with the weights of the opening.
    ///
    /// # Errors
    /// At `/hole` and `/start` when they do not fit; a failure of the network; `Exhausted`.
    pub fn optimize_anchor(&self, search: &Search) -> Result<v1::AnchorFound, MendError> {
        self.session.holes.search(search, self.call)
    }

    /// Some cells of the map of a search, a forward pass each.
    ///
    /// # Errors
    /// As [`SessionCall::optimize_anchor`].
    pub fn map_piece(&self, search: &Search, span: MapSpan) -> Result<v1::MapPiece, MendError> {
        self.session.holes.map_piece(search, span, self.call)
    }

    fn filled(&self, constraints: &Constraints) -> Result<FilledScan<'a>, MendError> {
        (self.session.holes).filled_with(&self.session.scan, constraints, self.call)
    }
}

/// Patches as a GLB: a mesh for each, in scene space, with its first texture coordinates and its own colour, where that is not the scan's.
fn glb(scan: &Scan, additions: &[PatchPrimitive]) -> Result<Vec<u8>, MendError> {
    let place = |point: &PatchPoint| -> [f32; 3] {
        match point {
            PatchPoint::New(p) => p.cast::<f32>().into(),
            PatchPoint::Scan(v) => (scan.surface.positions.get(*v as usize))
                .map_or([0.0; 3], |p| p.cast::<f32>().into()),
        }
    };
    let positions: Vec<Vec<[f32; 3]>> = additions
        .iter()
        .map(|a| a.points.iter().map(place).collect())
        .collect();
    let normals: Vec<Vec<[f32; 3]>> = additions
        .iter()
        .map(|a| {
            a.normals
                .iter()
                .map(|n| n.normalize().cast::<f32>().into())
                .collect()
        })
        .collect();
    let looks: Vec<MeshLook> = (additions.iter())
        .map(|addition| scan.mesh_look(addition))
        .collect::<Result<_, _>>()?;
    let fresh: Vec<ColouredMesh> = (additions.iter().zip(looks))
        .zip(positions.iter().zip(&normals))
        .map(|((addition, look), (positions, normals))| ColouredMesh {
            mesh: NewMesh {
                name: &addition.name,
                positions,
                normals,
                texcoords: addition.texcoords.first().map_or(&[], Vec::as_slice),
                faces: &addition.faces,
            },
            look,
        })
        .collect();
    Ok(coloured_meshes(&fresh)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{anchor_at, grab_at, mender, scan_of};
    use darn_contract::HoleSelector;
    use darn_geometry::mesh::shapes::holed_sheet;

    #[test]
    fn a_session_mends_and_refuses_as_a_single_call_does() {
        let scan = || scan_of(&holed_sheet(24, 0.15));
        let (mender, never) = (mender(), Budget::unlimited());
        let opening = Constraints::default();
        let session = ScanSession::open(scan(), &opening, Arc::clone(mender), never).unwrap();
        let hole = session.described().holes[0].id;
        let asked = Constraints {
            anchors: vec![anchor_at(Some(hole))],
            edits: vec![grab_at(None)],
            ..Constraints::default()
        };
        let no_such_hole = Constraints {
            holes: vec![HoleSelector::Id(77)],
            ..asked.clone()
        };
        let no_such_owner = Constraints {
            anchors: vec![anchor_at(Some(77))],
            ..asked.clone()
        };
        let no_such_weights = Constraints {
            weights: Some("silk".into()),
            ..asked.clone()
        };
        let requests = [opening, asked, no_such_hole, no_such_owner, no_such_weights];
        for constraints in requests {
            let kept = session.call(never).mended(&constraints);
            let single = crate::mend(&scan(), &constraints, mender);
            match (kept, single) {
                (Ok(kept), Ok(single)) => assert!(kept.bytes == single.bytes),
                (Err(kept), Err(single)) => assert_eq!(kept.to_string(), single.to_string()),
                _ => panic!("one of the two refused {constraints:?}"),
            }
        }
    }

    #[test]
    fn a_draft_has_the_vertices_of_the_patches() {
        let scan = scan_of(&holed_sheet(24, 0.15));
        let never = Budget::unlimited();
        let opening = Constraints::default();
        let session = ScanSession::open(scan, &opening, Arc::clone(mender()), never).unwrap();
        let hole = session.described().holes[0].id;
        let dragged = Constraints {
            anchors: vec![anchor_at(Some(hole))],
            edits: vec![grab_at(None)],
            ..Constraints::default()
        };
        for constraints in [opening, dragged.clone()] {
            let call = session.call(never);
            let draft = call.draft(&constraints).unwrap();
            let (positions, _) = call.positions(&constraints).unwrap();
            assert_eq!(draft.positions, positions.concat());
            assert_eq!(draft.normals.len(), draft.positions.len());
            assert!(draft.normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-9));
        }
        // Each draft of a drag starts from the one before: near the patches of the same constraints, if not at their bits.
        let call = session.call(never);
        for step in 1..=8 {
            let mut anchor = anchor_at(Some(hole));
            anchor.position[2] += 0.02 * f64::from(step);
            let constraints = Constraints {
                anchors: vec![anchor],
                ..Constraints::default()
            };
            let draft = call.draft(&constraints).unwrap().positions;
            let (positions, _) = call.positions(&constraints).unwrap();
            let farthest = (draft.iter().zip(positions.iter().flatten()))
                .map(|(a, b)| (a - b).norm())
                .fold(0.0, f64::max);
            // A tenth of an edge of the sheet, which has 24 squares a side.
            assert!(farthest < 0.1 / 24.0, "step {step}: {farthest}");
        }
        // A draft leaves nothing behind that a whole answer would take for its own.
        call.draft(&dragged).unwrap();
        let kept = call.mended(&dragged).unwrap();
        let single = crate::mend(&scan_of(&holed_sheet(24, 0.15)), &dragged, mender()).unwrap();
        assert!(kept.bytes == single.bytes);
        let elsewhere = Constraints {
            anchors: vec![anchor_at(Some(77))],
            ..Constraints::default()
        };
        assert!(session.call(never).draft(&elsewhere).is_err());
    }

    #[test]
    fn anchors_and_edits_are_refused_when_a_session_opens() {
        let asked = Constraints {
            anchors: vec![anchor_at(None)],
            edits: vec![grab_at(None)],
            ..Constraints::default()
        };
        let scan = scan_of(&holed_sheet(8, 0.15));
        let error = ScanSession::open(scan, &asked, Arc::clone(mender()), Budget::unlimited());
        let fields = error.err().expect("a refusal").fields();
        let pointers: Vec<&str> = fields.iter().map(|f| f.pointer.as_str()).collect();
        assert_eq!(pointers, ["/anchors", "/edits"]);
    }
}
