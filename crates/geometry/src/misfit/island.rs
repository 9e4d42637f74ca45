//! Where a loose piece of cloth belongs on the chart of the hole that it lies in.
//!
//! The piece has no connection to the cloth around, so its place is read off a smooth fill of the hole: its vertices
//! are projected onto the fill, and the piece, laid flat by itself, is moved and turned to fit the projections. It is
//! an island of the cloth when cloth can join it with the rim without stretching; scraps that float above or below
//! cannot be joined so.

use rstar::RTree;
use rstar::primitives::GeomWithData;

use crate::flatten::Chart;
use crate::grid::{SIDE, cell_centre};
use crate::mesh::curvature::vertex_normals;
use crate::mesh::layers::FEWEST_FACES;
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};
use crate::patch::{Outline, across};

/// Largest mean distance of an island from the fill ÷ its extent.
const FAR: f64 = 0.2;
/// Least mean cosine of the angle between the normals of an island and of the fill.
const TURNED: f64 = 0.7;
/// Largest root mean square distance of an island, laid flat, from its projections ÷ its extent.
const MISPLACED: f64 = 0.15;
/// Largest median of distance in space ÷ on the chart from an island to the rim.
const STRETCHED: f64 = 1.2;

/// A chart with its hole filled.
#[derive(Debug, Clone, Copy)]
pub struct FilledChart<'a> {
    /// The cloth around the hole, and the islands found so far.
    pub region: &'a Region,
    /// Its chart.
    pub chart: &'a Chart,
    /// A position for every cell, scene space.
    pub filled: &'a [Vec3],
    /// The cells in the hole.
    pub hole: &'a [usize],
}

/// The vertices of a loose piece on the chart of a hole, where the piece belongs to the hole's cloth; `own` is the
/// piece's own chart.
pub fn place_island(hole: &FilledChart, island: &Region, own: &Chart) -> Option<Vec<Vec2>> {
    if island.mesh.faces.len() < FEWEST_FACES {
        return None;
    }
    let projected = projections(hole, island)?;
    let placed = fitted(&own.flat, &projected)?;
    joins(hole, island, &placed).then_some(placed)
}

/// The vertices of a piece on the chart, each where the fill of the hole is nearest to it; `None` where the piece lies
/// far from the fill, or faces elsewhere.
fn projections(hole: &FilledChart, island: &Region) -> Option<Vec<Vec2>> {
    let cell = |k: &usize| GeomWithData::new(<[f64; 3]>::from(hole.filled[*k]), *k);
    let cells = RTree::bulk_load(hole.hole.iter().map(cell).collect());
    let normals = vertex_normals(&island.mesh);
    let (mut far, mut facing) = (0.0, 0.0);
    let mut projected = Vec::with_capacity(normals.len());
    for (p, normal) in island.mesh.positions.iter().zip(&normals) {
        let nearest = cells.nearest_neighbor(&(*p).into())?.data;
        let up = cell_normal(hole.filled, nearest);
        let offset = p - hole.filled[nearest];
        far += offset.dot(&up).abs();
        facing += normal.dot(&up);
        projected.push(hole.chart.frame.point(cell_centre(nearest)));
    }
    let count = normals.len() as f64;
    (far <= FAR * extent(&island.mesh.positions) * count && facing >= TURNED * count)
        .then_some(projected)
}

/// The unit normal of a filled grid at a cell.
fn cell_normal(filled: &[Vec3], cell: usize) -> Vec3 {
    let along = |step: usize, at: usize| {
        let before = if at > 0 { cell - step } else { cell };
        let after = if at + 1 < SIDE { cell + step } else { cell };
        filled[after] - filled[before]
    };
    let (u, v) = (along(1, cell % SIDE), along(SIDE, cell / SIDE));
    u.cross(&v).try_normalize(0.0).unwrap_or_else(Vec3::zeros)
}

/// Larger side of the box of some points.
fn extent(points: &[Vec3]) -> f64 {
    let low = points.iter().fold(Vec3::repeat(f64::MAX), |m, p| m.inf(p));
    let high = points.iter().fold(Vec3::repeat(f64::MIN), |m, p| m.sup(p));
    (high - low).max()
}

/// Points moved and turned, so that they are nearest to others (least squares); `None` where they stay far away.
fn fitted(points: &[Vec2], to: &[Vec2]) -> Option<Vec<Vec2>> {
    let count = points.len() as f64;
    let (from, middle) = (
        points.iter().sum::<Vec2>() / count,
        to.iter().sum::<Vec2>() / count,
    );
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (p, q) in points.iter().zip(to) {
        cosine += (p - from).dot(&(q - middle));
        sine += (p - from).perp(&(q - middle));
    }
    let turn = nalgebra::Rotation2::new(sine.atan2(cosine));
    let placed: Vec<Vec2> = points.iter().map(|p| middle + turn * (p - from)).collect();
    let square: f64 = placed
        .iter()
        .zip(to)
        .map(|(p, q)| (p - q).norm_squared())
        .sum();
    let size = points.iter().map(|p| (p - from).norm()).fold(0.0, f64::max);
    ((square / count).sqrt() <= 2.0 * MISPLACED * size).then_some(placed)
}

/// Whether cloth can join a placed piece with the rim.
fn joins(hole: &FilledChart, island: &Region, placed: &[Vec2]) -> bool {
    let around: Vec<u32> = hole.region.rim.iter().rev().copied().collect();
    let lines = hole.region.islands.iter();
    let lines: Vec<Vec<u32>> = lines
        .map(|line| line.iter().rev().copied().collect())
        .collect();
    let known: Vec<u32> = around
        .iter()
        .chain(lines.iter().flatten())
        .copied()
        .collect();
    let own = || island.outer.iter().rev();
    let mut flat: Vec<Vec2> = known.iter().map(|v| hole.chart.flat[*v as usize]).collect();
    flat.extend(own().map(|v| placed[*v as usize]));
    let mut space: Vec<Vec3> = known
        .iter()
        .map(|v| hole.region.mesh.positions[*v as usize])
        .collect();
    space.extend(own().map(|v| island.mesh.positions[*v as usize]));
    let counts: Vec<usize> = lines
        .iter()
        .map(Vec::len)
        .chain([island.outer.len()])
        .collect();
    let outline = Outline::new(flat.clone(), &counts);
    let mut stretches: Vec<f64> = (across(&outline).into_iter())
        .filter(|(a, b)| *a < known.len() && *b >= known.len())
        .map(|(a, b)| (space[a] - space[b]).norm() / (flat[a] - flat[b]).norm())
        .collect();
    let middle = stretches.len() / 2;
    !stretches.is_empty()
        && *stretches.select_nth_unstable_by(middle, f64::total_cmp).1 <= STRETCHED
}

#[cfg(test)]
mod tests {
    use darn_budget::Budget;
    use proptest::prelude::*;

    use super::*;
    use crate::flatten::{FlattenLimits, flatten, raster};
    use crate::grid::CELLS;
    use crate::mesh::island::loose_piece;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::region::{BoundedMesh, grow};
    use crate::mesh::shapes::sheet;
    use crate::mesh::weld::weld;
    use crate::polygon::inside;

    /// Places the island of a sheet with a round hole and a round island in it, the island lifted by `lift`, on a fill
    /// that is the sheet's surface.
    fn placed(
        n: usize,
        lift: f64,
        place: impl Fn(f64, f64) -> Vec3,
    ) -> Option<(Chart, Region, Vec<Vec2>)> {
        let round = |u: f64, v: f64| (u - 0.5).hypot(v - 0.52);
        let keep = |u: f64, v: f64| round(u, v) > 0.3 || round(u, v) < 0.12;
        let soup = sheet(n, keep, |u, v| {
            let up = if round(u, v) < 0.2 { lift } else { 0.0 };
            place(u, v) + Vec3::z() * up
        });
        let mesh = weld(&soup).mesh;
        let topology = weld(&soup).topology();
        let loops = boundary_loops(&mesh, &topology);
        let whole = BoundedMesh {
            mesh: &mesh,
            topology: &topology,
            loops: &loops,
        };
        let hole = loops
            .iter()
            .find(|l| l.kind == LoopKind::Hole)
            .expect("a hole");
        let region = grow(&whole, hole.id, 0.2, Budget::unlimited()).expect("a region");
        let loose = loops
            .iter()
            .find(|l| l.component != hole.component)
            .expect("an island");
        let island = loose_piece(&whole, loose.id, Budget::unlimited())
            .expect("no limits")
            .expect("a disk");
        let lay = |region| {
            flatten(region, &FlattenLimits::default(), Budget::unlimited()).expect("a chart")
        };
        let (chart, own) = (lay(&region), lay(&island));
        // The whole sheet without its hole, unrolled into the same chart: the fill that a perfect network would give.
        let rim: Vec<Vec2> = region.rim.iter().map(|v| chart.uv(*v)).collect();
        let cells: Vec<usize> = (0..CELLS)
            .filter(|k| inside(&rim, cell_centre(*k)))
            .collect();
        let known = raster(&region.mesh, &chart);
        let plate = crate::smooth::smooth(
            &known.positions,
            &known.known,
            &{
                let mut open = vec![false; CELLS];
                cells.iter().for_each(|k| open[*k] = !known.known[*k]);
                open
            },
            crate::smooth::Smooth::ThinPlate,
            1,
        )?;
        let hole = FilledChart {
            region: &region,
            chart: &chart,
            filled: &plate,
            hole: &cells,
        };
        let flat = place_island(&hole, &island, &own)?;
        Some((chart.clone(), region.clone().with_island(&island), flat))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        #[test]
        fn an_island_is_found_at_its_place(n in 24usize..40, bend in 0.2..2.0f64) {
            let rolled = |u: f64, v: f64| Vec3::new((bend * u).sin() / bend, v, (bend * u).cos() / bend);
            let found = placed(n, 0.0, rolled);
            prop_assert!(found.is_some());
            let (chart, region, flat) = found.expect("found");
            let first = region.mesh.positions.len() - flat.len();
            // Distances on the chart from the island to the cloth around are those along the roll.
            let unrolled = |p: &Vec3| Vec2::new(p.x.atan2(p.z) / bend, p.y);
            for (p, q) in region.mesh.positions[first..].iter().zip(&flat) {
                for v in &region.rim {
                    let there = &region.mesh.positions[*v as usize];
                    let (own, on_chart) = ((unrolled(p) - unrolled(there)).norm(), (q - chart.flat[*v as usize]).norm());
                    prop_assert!((own - on_chart).abs() < 1.5 / n as f64, "{own} {on_chart}");
                }
            }
        }

        #[test]
        fn a_scrap_that_floats_is_no_island(n in 24usize..40, lift in 0.25..1.0f64, below: bool) {
            let lift = if below { -lift } else { lift };
            prop_assert!(placed(n, lift, |u, v| Vec3::new(u, v, 0.0)).is_none());
        }
    }
}
