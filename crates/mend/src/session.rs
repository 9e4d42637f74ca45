//! A scan that is kept for editing: owned, prepared once, asked many times; the same answers as single calls.

use std::sync::Arc;

use super::opened::{Opened, Patched};
use super::prepared::Prepared;
use super::{Call, MendError, NetworkMender, picture};
use darn_contract::port::{Cancellation, Mended};
use darn_contract::{Constraints, FieldError, Search, v1};
use darn_geometry::mesh::{Vec2, Vec3};
use darn_gltf_scan::export::{NewMesh, meshes};
use darn_gltf_scan::{PatchPoint, PatchPrimitive, Scan};

/// A scan with its holes laid flat.
pub struct ScanSession {
    scan: Scan,
    opened: Opened,
    mender: Arc<NetworkMender>,
    described: v1::Session,
}

impl ScanSession {
    /// Prepares the holes that `asked` chooses and fills them once without constraints.
    ///
    /// # Errors
    /// As [`mend`](super::mend); and when `asked` has anchors or edits, which belong to what is asked of the session later.
    pub fn open(
        scan: Scan,
        asked: &Constraints,
        mender: Arc<NetworkMender>,
        cancellation: Cancellation,
    ) -> Result<ScanSession, MendError> {
        let entries = [
            ("/anchors", asked.anchors.len()),
            ("/edits", asked.edits.len()),
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
            cancellation,
        };
        let opened = Opened::new(&scan, asked, call)?;
        let described = described(&opened, &scan, call)?;
        Ok(ScanSession {
            scan,
            opened,
            mender,
            described,
        })
    }

    /// What it is; `id` and `idle_seconds` are whoever keeps it to fill in.
    pub fn described(&self) -> v1::Session {
        v1::Session {
            bytes: self.bytes() as u64,
            ..self.described.clone()
        }
    }

    /// Bytes of memory it holds, about, and rather more than less: half as much again as is counted. Allocators round up, and factors fill
    /// in more than is foreseen: a thousand abandoned sessions of 4.2 MiB took 6.0 each.
    pub fn bytes(&self) -> usize {
        let holes: usize = self.opened.holes.iter().map(Prepared::bytes).sum();
        let described: usize = self.described.holes.iter().map(hole_bytes).sum();
        let counted = self.scan.bytes_held() + self.opened.cloth.bytes() + holes + described;
        counted + counted / 2
    }

    /// A call to the session, with its caller's cancellation check.
    pub fn call<'a>(&'a self, cancellation: Cancellation<'a>) -> SessionCall<'a> {
        SessionCall {
            session: self,
            call: Call {
                mender: &self.mender,
                cancellation,
            },
        }
    }

    fn reported(&self, patched: Patched) -> v1::Report {
        let mut report = self.opened.report(&self.scan, patched);
        self.forget_preparation(&mut report);
        report
    }

    /// Takes out of a report the time that was spent when the session was opened.
    fn forget_preparation(&self, report: &mut v1::Report) {
        if let Some(timings) = &mut report.timings {
            timings.holes -= self.opened.prepare_ms;
            timings.total -= self.opened.prepare_ms + timings.weld + timings.loops;
            (timings.weld, timings.loops) = (0.0, 0.0);
        }
        for timings in report.holes.iter_mut().flat_map(|h| &mut h.timings) {
            (timings.region, timings.flatten, timings.raster) = (0.0, 0.0, 0.0);
        }
    }
}

/// A call to a session.
#[derive(Clone, Copy)]
pub struct SessionCall<'a> {
    session: &'a ScanSession,
    call: Call<'a>,
}

impl<'a> SessionCall<'a> {
    /// The whole scan mended: the bytes that [`mend`](super::mend) gives for the same constraints.
    ///
    /// What the opening chose (holes, weights, up) may be left out of `constraints`.
    ///
    /// # Errors
    /// As [`mend`](super::mend), `Abandoned` among them.
    pub fn mended(&self, constraints: &Constraints) -> Result<Mended, MendError> {
        let mut mended = self
            .session
            .opened
            .mended(&self.session.scan, constraints, self.call)?;
        self.session.forget_preparation(&mut mended.report);
        Ok(mended)
    }

    /// The patches alone, as a GLB with one mesh for each hole, in order of id.
    ///
    /// # Errors
    /// As [`mend`](super::mend), `Abandoned` among them.
    pub fn glb(&self, constraints: &Constraints) -> Result<(Vec<u8>, v1::Report), MendError> {
        let patched = self.patched(constraints)?;
        let additions = self
            .session
            .opened
            .additions(&self.session.scan, &patched)?;
        let bytes = glb(&self.session.scan, &additions)?;
        Ok((bytes, self.session.reported(patched)))
    }

    /// The positions of the patches' vertices, hole after hole in order of id, each in the order of its `patch_uvs`.
    ///
    /// # Errors
    /// As [`mend`](super::mend), `Abandoned` among them.
    pub fn positions(
        &self,
        constraints: &Constraints,
    ) -> Result<(Vec<Vec<Vec3>>, v1::Report), MendError> {
        let patched = self.patched(constraints)?;
        let each = patched.holes.iter();
        let positions = each.map(|(_, made)| made.patch.positions.clone());
        Ok((positions.collect(), self.session.reported(patched)))
    }

    /// Searches where on a hole's grid a point in space belongs, with the weights of the opening.
    ///
    /// # Errors
    /// At `/hole` and `/start` when they do not fit, and whatever the network fails with.
    pub fn optimize_anchor(&self, search: &Search) -> Result<v1::AnchorFound, MendError> {
        self.session.opened.search(search, self.call)
    }

    fn patched(&self, constraints: &Constraints) -> Result<Patched<'a>, MendError> {
        (self.session.opened).patched(&self.session.scan, constraints, self.call)
    }
}

/// What stays the same, and the cloth as it is without constraints.
fn described(opened: &Opened, scan: &Scan, call: Call) -> Result<v1::Session, MendError> {
    let patched = opened.patched(scan, &Constraints::default(), call)?;
    let mut holes = Vec::new();
    for (prepared, made) in &patched.holes {
        let unedited = prepared.unedited(&patched.inpainter, &call.mender.limits)?;
        let patch = &made.patch;
        let rim = patch.rim.len();
        let uv = |p: &Vec2| <[f64; 2]>::from(prepared.chart.frame.uv(*p));
        let png = picture::chart(prepared, patch).map_err(MendError::Picture)?;
        holes.push(v1::SessionHole {
            id: prepared.id,
            rim_positions: flat(&patch.positions[..rim]),
            rim_uvs: patch.flat[..rim].iter().flat_map(uv).collect(),
            grid_positions: flat(&unedited.filled),
            hole_cells: prepared.cells.indices().iter().map(|k| *k as u32).collect(),
            patch_faces: patch.faces.iter().flatten().copied().collect(),
            patch_uvs: patch.flat.iter().flat_map(uv).collect(),
            chart_png: png.into(),
            report: Some(made.report.clone()),
        });
    }
    let report = opened.report(scan, patched);
    Ok(v1::Session {
        holes,
        skipped: report.skipped,
        weights: report.weights,
        notes: report.notes,
        ..Default::default()
    })
}

fn flat(points: &[Vec3]) -> Vec<f64> {
    points.iter().flat_map(|p| [p.x, p.y, p.z]).collect()
}

fn hole_bytes(hole: &v1::SessionHole) -> usize {
    let numbers = hole.rim_positions.len()
        + hole.rim_uvs.len()
        + hole.grid_positions.len()
        + hole.patch_uvs.len();
    8 * numbers + 4 * (hole.hole_cells.len() + hole.patch_faces.len()) + hole.chart_png.len()
}

/// Patches as meshes of their own, in scene space, with the scan's first texture coordinates carried on.
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
    let fresh: Vec<NewMesh> = (additions.iter().zip(positions.iter().zip(&normals)))
        .map(|(addition, (positions, normals))| NewMesh {
            name: &addition.name,
            positions,
            normals,
            texcoords: addition.texcoords.first().map_or(&[], Vec::as_slice),
            faces: &addition.faces,
        })
        .collect();
    Ok(meshes(&fresh)?)
}
