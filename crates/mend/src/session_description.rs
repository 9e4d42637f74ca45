//! What a session tells of itself: what stays the same whatever the constraints, and the cloth without any.

use crate::error::MendError;
use crate::hole_report::FilledHole;
use crate::mender::Call;
use crate::picture;
use crate::scan_holes::{FilledScan, ScanHoles};
use darn_contract::{Outcome, v1};
use darn_geometry::mesh::index::VertexId;
use darn_geometry::mesh::{Vec2, Vec3};
use darn_gltf_scan::{PatchPrimitive, Scan};

/// What a session tells of itself.
pub struct Described {
    /// The session in the contract's words, without `id` and `idle_seconds`.
    pub session: v1::Session,
    /// How its holes were filled.
    pub outcome: Outcome,
}

/// Describes a session.
///
/// # Errors
/// A hole that cannot be filled, a chart that cannot be drawn; `Exhausted`.
pub fn described(opened: &ScanHoles, scan: &Scan, call: Call) -> Result<Described, MendError> {
    let filled = opened.filled(call)?;
    let mut holes = Vec::with_capacity(filled.holes.len());
    for hole in &filled.holes {
        holes.push(hole_described(opened, scan, &filled, hole, call)?);
    }
    let report = opened.report(scan, filled);
    let outcome = Outcome::of(&report);
    let skipped = report.skipped.into_iter().map(|loop_| v1::Skipped {
        rim_positions: rim_of(opened, loop_.id),
        ..loop_
    });
    let session = v1::Session {
        holes,
        skipped: skipped.collect(),
        weights: report.weights,
        notes: report.notes,
        cut_faces: cut_faces(opened, scan),
        ..Default::default()
    };
    Ok(Described { session, outcome })
}

/// Bytes of memory of a description.
pub fn bytes(described: &v1::Session) -> usize {
    let rims = described.skipped.iter().map(|s| 8 * s.rim_positions.len());
    let holes: usize = described.holes.iter().map(hole_bytes).sum();
    holes + rims.sum::<usize>() + 8 * described.cut_faces.len()
}

fn hole_described(
    opened: &ScanHoles,
    scan: &Scan,
    filled: &FilledScan,
    filled_hole: &FilledHole,
    call: Call,
) -> Result<v1::SessionHole, MendError> {
    let FilledHole {
        hole,
        patch,
        deviations,
        report,
    } = filled_hole;
    let rim = patch.rim.len();
    let dressed = (opened.patch_source(scan, filled, call.budget)).dressed(filled_hole)?;
    let material = scan.parts[dressed.primitive.material_of].material;
    let every = v1::SessionHole {
        id: hole.id(),
        rim_positions: flat(&patch.positions[..rim]),
        patch_faces: patch.faces.iter().flatten().copied().collect(),
        report: Some(report.clone()),
        surface: Some(surface(dressed.vertex_of, dressed.primitive, material)),
        ..v1::SessionHole::default()
    };
    let Some(hole) = hole.charted() else {
        return Ok(every);
    };
    let unedited = hole.unedited(&filled.inpainter, call)?;
    let uv = |p: &Vec2| <[f64; 2]>::from(hole.chart.frame.uv(*p));
    let png = picture::chart_png(hole, patch).map_err(MendError::Picture)?;
    let known = hole.grid.known.iter().zip(0u32..);
    Ok(v1::SessionHole {
        rim_uvs: patch.flat[..rim].iter().flat_map(uv).collect(),
        grid_positions: flat(&unedited.filled),
        hole_cells: hole.cells.indices().iter().map(|k| *k as u32).collect(),
        known_cells: known.filter(|(known, _)| **known).map(|(_, k)| k).collect(),
        chart_side: hole.chart.frame.side,
        patch_uvs: patch.flat.iter().flat_map(uv).collect(),
        patch_deviations: deviations.clone(),
        chart_png: png.into(),
        ..every
    })
}

/// A patch's surface as the scan's own look goes on in it.
fn surface(
    vertices: Vec<u32>,
    primitive: PatchPrimitive,
    material: Option<usize>,
) -> v1::PatchSurface {
    let texcoords = primitive.texcoords.into_iter().next();
    let colors = primitive.colors.into_iter().next();
    v1::PatchSurface {
        vertices,
        faces: primitive.faces.into_iter().flatten().collect(),
        texcoords: texcoords.into_iter().flatten().flatten().collect(),
        colors: colors.into_iter().flatten().flatten().collect(),
        material: material.map(|index| index as u32),
    }
}

/// The positions of a loop's vertices.
fn rim_of(opened: &ScanHoles, id: u32) -> Vec<f64> {
    let welded = &opened.welded;
    let rim = welded.loops.get(id as usize);
    let vertices = rim.map_or(&[][..], |rim| &rim.vertices);
    let at = |v: &VertexId| welded.surface.mesh.positions[v.index()];
    flat(&vertices.iter().map(at).collect::<Vec<_>>())
}

/// The middle of every triangle that was cut out.
fn cut_faces(opened: &ScanHoles, scan: &Scan) -> Vec<f64> {
    // What is left has the scan's order.
    let mut left = opened.seen(scan).surface.faces.iter().peekable();
    let every = scan.surface.faces.iter();
    let cut = every.filter(|face| left.next_if_eq(face).is_none());
    let middle = |face: &[u32; 3]| {
        let corners = face.map(|v| scan.surface.positions[v as usize]);
        (corners[0] + corners[1] + corners[2]) / 3.0
    };
    flat(&cut.map(middle).collect::<Vec<_>>())
}

/// `x, y, z` of each point, one after another.
fn flat(points: &[Vec3]) -> Vec<f64> {
    points.iter().flat_map(|p| [p.x, p.y, p.z]).collect()
}

/// Bytes of memory of a hole's description.
fn hole_bytes(hole: &v1::SessionHole) -> usize {
    let numbers = hole.rim_positions.len()
        + hole.rim_uvs.len()
        + hole.grid_positions.len()
        + hole.patch_uvs.len();
    let short = hole.patch_deviations.len()
        + hole.hole_cells.len()
        + hole.known_cells.len()
        + hole.patch_faces.len();
    let surface = hole.surface.as_ref().map_or(0, |surface| {
        surface.vertices.len()
            + surface.faces.len()
            + surface.texcoords.len()
            + surface.colors.len()
    });
    8 * numbers + 4 * (short + surface) + hole.chart_png.len()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::session::ScanSession;
    use crate::testing::{mender, scan_of};
    use darn_budget::Budget;
    use darn_contract::port::MapSpan;
    use darn_contract::{Constraints, Cut, HoleSelector, Search, v1};
    use darn_geometry::mesh::shapes::holed_sheet;

    fn opened(holes: Vec<HoleSelector>) -> ScanSession {
        let constraints = Constraints {
            holes,
            ..Constraints::default()
        };
        let scan = scan_of(&holed_sheet(24, 0.15));
        ScanSession::open(
            scan,
            &constraints,
            Arc::clone(mender()),
            Budget::unlimited(),
        )
        .unwrap()
    }

    fn distance(a: &[f64], b: &[f64]) -> f64 {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>().sqrt()
    }

    #[test]
    fn uvs_times_the_charts_side_are_the_lengths_that_the_report_measures_by() {
        let session = opened(Vec::new());
        let described = session.described();
        let hole = &described.holes[0];
        let positions = (session
            .call(Budget::unlimited())
            .positions(&Constraints::default()))
        .unwrap()
        .0;
        let (mut sum, mut edges) = (0.0, 0);
        let rim = hole.rim_positions.len() / 3;
        let uv = |v: u32| &hole.patch_uvs[2 * v as usize..][..2];
        for face in hole.patch_faces.chunks_exact(3) {
            for (a, b) in [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])] {
                if a.max(b) as usize >= rim {
                    let place = |v: u32| <[f64; 3]>::from(positions[0][v as usize]);
                    let flat = distance(uv(a), uv(b)) * hole.chart_side;
                    sum += distance(&place(a), &place(b)) / flat;
                    edges += 1;
                }
            }
        }
        let report = hole.report.as_ref().and_then(|report| report.patch.clone());
        assert!((sum / f64::from(edges) - report.unwrap().stretch_mean).abs() < 1e-9);
    }

    #[test]
    fn every_cell_of_the_chart_is_known_or_in_the_hole_but_not_both() {
        let hole = opened(Vec::new()).described().holes.remove(0);
        let both = hole
            .known_cells
            .iter()
            .filter(|k| hole.hole_cells.contains(k));
        assert_eq!(both.count(), 0);
        let grid = hole.report.unwrap().grid.unwrap();
        assert!((hole.known_cells.len() as f64 / 4096.0 - grid.known).abs() < 1e-9);
    }

    #[test]
    fn a_surface_names_a_vertex_of_the_patch_for_each_corner() {
        let hole = opened(Vec::new()).described().holes.remove(0);
        let surface = hole.surface.unwrap();
        let corners = surface.vertices.len() as u32;
        assert!(surface.faces.iter().all(|corner| *corner < corners));
        let vertex = |corner: &u32| surface.vertices[*corner as usize];
        let faces: Vec<u32> = surface.faces.iter().map(vertex).collect();
        assert_eq!(faces, hole.patch_faces);
    }

    #[test]
    fn skipped_loops_have_their_rims_and_cut_triangles_their_middles() {
        let whole = opened(Vec::new()).described();
        assert!(whole.cut_faces.is_empty());
        let border = &whole.skipped[0];
        assert!(border.rim_positions.len() >= 3 * 24);
        let cut = Cut::Rims(vec![whole.holes[0].id]);
        let described = opened(vec![HoleSelector::Cut(cut)]).described();
        let report = described.holes[0].report.clone().unwrap();
        let faces = report.cut.unwrap().faces as usize;
        assert_eq!(described.cut_faces.len(), 3 * faces);
        // Each of them touched the rim.
        let rim = &whole.holes[0].rim_positions;
        let most = described.cut_faces.chunks_exact(3).map(|middle| {
            let away = rim.chunks_exact(3).map(|p| distance(p, middle));
            away.fold(f64::INFINITY, f64::min)
        });
        assert!(most.fold(0.0, f64::max) < 2.0 / 24.0);
    }

    #[test]
    fn the_pieces_of_a_map_are_the_map() {
        let session = opened(Vec::new());
        let call = session.call(Budget::unlimited());
        let search = Search {
            hole: None,
            target: [0.5, 0.5, 0.2],
            start: None,
            exhaustive: false,
            map: true,
            map_gradient: false,
        };
        let whole = call.optimize_anchor(&search).unwrap().map;
        let mut pieces = vec![f64::NAN; 4096];
        let (mut first, mut total) = (0, 1);
        while first < total {
            let piece: v1::MapPiece = call
                .map_piece(&search, MapSpan { first, count: 16 })
                .unwrap();
            total = piece.total as usize;
            for (cell, loss) in piece.cells.iter().zip(&piece.losses) {
                assert!(pieces[*cell as usize].is_nan(), "each cell comes once");
                pieces[*cell as usize] = *loss;
            }
            first += piece.cells.len();
        }
        for (whole, piece) in whole.iter().zip(&pieces) {
            assert!(whole == piece || whole.is_nan() && piece.is_nan());
        }
    }
}
