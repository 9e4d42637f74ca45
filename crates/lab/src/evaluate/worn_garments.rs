//! Which loops of worn garments would be closed by default: openings that are taken for holes, and holes that are taken for openings.

use std::fmt::Write as _;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::error::EvaluateError;
use super::garment_rows::{ListFunction, loop_centroid, nearest, on_rim};
use super::wear::{EdgeWear, Wear};
use crate::garments::set::GarmentCase;
use darn_geometry::mesh::loops::{BoundaryLoop, boundary_loops};
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec3};

/// What is closed and missed by default on a set of garments to which one thing happened.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct WornRow {
    /// What happened.
    pub wear: String,
    /// Openings, on the intact garments and on those with a hole.
    pub openings: usize,
    /// Of these, those that would be closed.
    pub closed: usize,
    /// Holes.
    pub holes: usize,
    /// Of these, those that would be left.
    pub missed: usize,
}

/// A garment before anything happened to it.
struct Unworn<'a> {
    mesh: &'a TriMesh,
    /// Centroid of the hole's rim; `None` on an intact garment.
    hole: Option<Vec3>,
    loops: Vec<BoundaryLoop>,
}

impl Unworn<'_> {
    fn is_hole(&self, l: &BoundaryLoop) -> bool {
        self.hole.is_some_and(|hole| l.centroid == hole)
    }

    /// Adds what would be closed and missed of it after something happened.
    fn count(
        &self,
        worn: &TriMesh,
        list: ListFunction,
        row: &mut WornRow,
    ) -> Result<(), EvaluateError> {
        let found = list(worn)?;
        for l in &self.loops {
            let filled = nearest(&found, &l.centroid).is_some_and(|l| l.filled_by_default);
            if self.is_hole(l) {
                row.holes += 1;
                row.missed += usize::from(!filled);
            } else {
                row.openings += 1;
                row.closed += usize::from(filled);
            }
        }
        Ok(())
    }
}

/// Counts what a list of loops closes and misses on garments, intact and with each of their holes, after every kind of wear.
///
/// Loops are told by their centroids: a worn loop is that of the garment before whose centroid is nearest.
///
/// # Errors
/// A list of loops that cannot be made.
pub fn over_worn_garments(
    cases: &[GarmentCase],
    list: ListFunction,
    seed: u64,
    done: &dyn Fn(),
) -> Result<Vec<WornRow>, EvaluateError> {
    let named = |wear: String| WornRow {
        wear,
        openings: 0,
        closed: 0,
        holes: 0,
        missed: 0,
    };
    let mut whole: Vec<WornRow> = Wear::ALL.iter().map(|w| named(w.name())).collect();
    let mut edges: Vec<WornRow> = (EdgeWear::ALL.iter())
        .map(|w| named(w.name().into()))
        .collect();
    for case in cases {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ case.record.seed);
        for garment in unworn(case) {
            for (wear, row) in Wear::ALL.iter().zip(&mut whole) {
                garment.count(&wear.of(garment.mesh, &mut rng), list, row)?;
            }
            let openings = garment.loops.iter().filter(|l| !garment.is_hole(l));
            for edge in openings {
                for (wear, row) in EdgeWear::ALL.iter().zip(&mut edges) {
                    let worn = wear.of(garment.mesh, &edge.vertices, &mut rng);
                    garment.count(&worn, list, row)?;
                }
            }
        }
        done();
    }
    whole.append(&mut edges);
    Ok(whole)
}

fn unworn(case: &GarmentCase) -> Vec<Unworn<'_>> {
    let loops = |mesh: &TriMesh| boundary_loops(mesh, &Topology::new(mesh));
    let mut all = vec![Unworn {
        mesh: &case.intact,
        hole: None,
        loops: loops(&case.intact),
    }];
    for (record, hole) in case.record.holes.iter().zip(&case.holes) {
        let at = on_rim(&hole.mesh, &hole.lost, &Vec3::from(record.centroid));
        all.push(Unworn {
            mesh: &hole.mesh,
            hole: Some(loop_centroid(&hole.mesh, &at)),
            loops: loops(&hole.mesh),
        });
    }
    all
}

/// A Markdown table of such rows.
pub fn worn_table(rows: &[WornRow]) -> String {
    let mut text =
        String::from("| garments | openings | closed | holes | missed |\n|---|---|---|---|---|\n");
    for row in rows {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} |",
            row.wear, row.openings, row.closed, row.holes, row.missed
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::ListedLoop;
    use crate::garments::{GarmentKind, set};
    use darn_geometry::mesh::loops::LoopKind;

    #[test]
    fn every_loop_of_every_worn_garment_is_counted() {
        let case = set::case(1, GarmentKind::Skirt, 0).expect("a skirt");
        let list = |mesh: &TriMesh| {
            let loops = boundary_loops(mesh, &Topology::new(mesh));
            let listed = |l: &BoundaryLoop| ListedLoop {
                id: l.id.0,
                filled_by_default: l.kind == LoopKind::Hole,
                centroid: l.centroid,
                length: l.length,
                turning: l.turning,
            };
            Ok(loops.iter().map(listed).collect())
        };
        let rows = over_worn_garments(std::slice::from_ref(&case), &list, 1, &|| {}).expect("rows");
        let garments = 1 + case.holes.len();
        let openings = case.record.openings.len();
        let (edges, whole) = (&rows[Wear::ALL.len()..], &rows[..Wear::ALL.len()]);
        for row in whole {
            assert_eq!(
                (row.openings, row.holes),
                (garments * openings, case.holes.len()),
                "{row:?}"
            );
        }
        for row in edges {
            let expected = (garments * openings * openings, case.holes.len() * openings);
            assert_eq!((row.openings, row.holes), expected, "{row:?}");
        }
        assert_eq!((rows[0].closed, rows[0].missed), (0, 0), "{rows:?}");
        assert_eq!(worn_table(&rows).lines().count(), 2 + rows.len());
    }

    #[test]
    fn wear_takes_triangles_and_leaves_one_piece() {
        let case = set::case(1, GarmentKind::Skirt, 0).expect("a skirt");
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let loops = boundary_loops(&case.intact, &Topology::new(&case.intact));
        let trimmed = Wear::Trimmed {
            share: 0.5,
            times: 1,
        }
        .of(&case.intact, &mut rng);
        let torn = EdgeWear::Torn.of(&case.intact, &loops[0].vertices, &mut rng);
        let bitten = EdgeWear::Bitten.of(&case.intact, &loops[0].vertices, &mut rng);
        for worn in [&trimmed, &torn, &bitten] {
            assert_eq!(Topology::new(worn).components, 1);
            let left = worn.faces.len() as f64 / case.intact.faces.len() as f64;
            assert!((0.7..0.999).contains(&left), "{left}");
        }
    }
}
