//! Boundary loops and what they are: a hole, the outer boundary, or the end of a tube.

use super::collar::collar_turnings;
use super::topology::{NONE, Topology, next};
use super::{TriMesh, Vec3, unit_for};

/// What a boundary loop bounds, told by its total geodesic curvature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LoopKind {
    /// Turning below −π: cloth surrounds it.
    Hole,
    /// Turning above +π: it surrounds the cloth.
    Outer,
    /// In between: a sleeve's end, a cuff, the mouth of a sack.
    TubeEnd,
}

/// One closed boundary of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct BoundaryLoop {
    /// Its place in the list; ids follow the smallest vertex of each loop.
    pub id: u32,
    /// Its vertices along the boundary half-edges (the cloth on the left), from the smallest on.
    pub vertices: Vec<u32>,
    /// `half_edges[i]` runs from `vertices[i]` to `vertices[i + 1]`.
    pub half_edges: Vec<u32>,
    /// Length, scene units.
    pub length: f64,
    /// Centroid of the curve (each edge weighs its length), scene space.
    pub centroid: Vec3,
    /// Area of the flattest surface across it (half the length of Σ pᵢ × pᵢ₊₁), scene units squared.
    pub area: f64,
    /// Total geodesic curvature, radians, at the edge of calm cloth and just inside that of rough cloth; see [`boundary_loops`].
    pub turning: f64,
    /// What it is.
    pub kind: LoopKind,
    /// The component of the mesh it bounds.
    pub component: u32,
    /// Whether it runs along an edge where other faces could not be joined.
    pub non_manifold: bool,
}

/// Every boundary loop of a welded mesh, in an order that depends only on the mesh.
///
/// `turning` is one of two estimates. Where the ring of vertices behind the edge holds less than one radian of angle defect (absolute,
/// summed), it is the exact [`turning`] of the edge: noise would show there, so there is none, however sharp the folds, and no
/// curvature of a dome is taken for the loop's.
///
/// Elsewhere the bare edge is no use: noise of a tenth of the edge length crumples it, and its angles then only grow, by several π
/// over a long loop; even noise-free simulated cloth frays enough to hide an outer boundary. What the edge gains, the curvature just
/// behind it loses (Gauss–Bonnet), so there it is the mean over the curves two and three rings inside, on cloth smoothed four times.
/// Both numbers matter: the edge is smoothed along itself only, which leaves a band of false curvature as many rings wide as
/// there are smoothings, strong where sharp folds meet the edge. The mean over the first three rings after eight smoothings reads the
/// outer boundary of a sheet folded to `0.25 sin 40x`, sixty vertices a side, as −3.8 rad.
///
/// On draped sheets with vertex noise up to 0.3 of the edge length it stays above +1.4π for outer boundaries and below −1.5π for
/// holes; on such sheets folded up to `0.3 sin 50x` likewise. Folds that steep across the diagonals of the triangulation are no longer
/// cloth (half a radian of defect a vertex): there a hole may pass for a tube's end.
///
/// Every loop is judged by itself. A component may have several outer boundaries or none (a strongly saddle-shaped or a closed
/// surface does); none of them is ever taken for a hole for want of another.
pub fn boundary_loops(mesh: &TriMesh, topology: &Topology) -> Vec<BoundaryLoop> {
    let mut cycles = walk(&topology.twin, |h| topology.from(h));
    cycles.sort_by_key(|c| c.first().map(|&h| (topology.from(h), h)));
    let turnings = collar_turnings(mesh, topology, &cycles);
    cycles
        .into_iter()
        .zip(turnings)
        .enumerate()
        .map(|(id, (half_edges, turning))| {
            let mut described = describe(mesh, topology, half_edges);
            described.id = id as u32;
            described.turning = turning;
            described.kind = kind(turning);
            described
        })
        .collect()
}

/// Everything about a loop but its id and what it is.
fn describe(mesh: &TriMesh, topology: &Topology, half_edges: Vec<u32>) -> BoundaryLoop {
    let vertices: Vec<u32> = half_edges.iter().map(|&h| topology.from(h)).collect();
    let (mut length, mut moment, mut area) = (0.0, Vec3::zeros(), Vec3::zeros());
    let origin = vertices
        .first()
        .map_or(Vec3::zeros(), |&v| mesh.positions[v as usize]);
    let place = |v: u32| mesh.positions[v as usize] - origin;
    let unit = unit_for(
        vertices
            .iter()
            .map(|&v| place(v).amax())
            .fold(0.0, f64::max),
    );
    for &h in &half_edges {
        let a = place(topology.from(h)) / unit;
        let b = place(topology.to(h)) / unit;
        let edge = (b - a).norm();
        length += edge;
        moment += (a + b) * (0.5 * edge);
        area += a.cross(&b) * 0.5;
    }
    BoundaryLoop {
        id: 0,
        length: (length * unit).min(f64::MAX),
        centroid: if length > 0.0 {
            origin + moment / length * unit
        } else {
            origin
        },
        area: (area.norm() * unit * unit).min(f64::MAX),
        turning: 0.0,
        kind: kind(0.0),
        component: half_edges
            .first()
            .map_or(0, |&h| topology.component[h as usize / 3]),
        non_manifold: half_edges
            .iter()
            .any(|h| topology.non_manifold.binary_search(h).is_ok()),
        vertices,
        half_edges,
    }
}

fn kind(turning: f64) -> LoopKind {
    if turning < -std::f64::consts::PI {
        LoopKind::Hole
    } else if turning > std::f64::consts::PI {
        LoopKind::Outer
    } else {
        LoopKind::TubeEnd
    }
}

/// Total geodesic curvature of a boundary loop, in radians: Σ (π − θᵥ), θᵥ the interior angle of the faces at v.
///
/// On developable cloth (Gauss–Bonnet) it is ≈ −2π for a hole, ≈ +2π for the outer boundary and ≈ 0 for the end of a tube,
/// whatever the loop's length or vertex count. Exact, and so as noisy as the mesh; [`BoundaryLoop::turning`] is the one to judge by.
pub fn turning(mesh: &TriMesh, topology: &Topology, half_edges: &[u32]) -> f64 {
    half_edges
        .iter()
        .map(|&h| {
            let angles: f64 = fan_after(&topology.twin, h)
                .map(|e| mesh.corner_angle(e as usize / 3, e as usize % 3))
                .sum();
            std::f64::consts::PI - angles
        })
        .sum()
}

/// The half-edges that leave the end of boundary half-edge `h`, from its own face to the next boundary half-edge.
fn fan_after(twin: &[u32], h: u32) -> impl Iterator<Item = u32> + '_ {
    std::iter::successors(Some(next(h)), |&e| match twin[e as usize] {
        NONE => None,
        t => Some(next(t)),
    })
}

/// The boundary loops as cycles of half-edges, each from its smallest vertex on.
pub(super) fn walk(twin: &[u32], from: impl Fn(u32) -> u32) -> Vec<Vec<u32>> {
    let mut seen = vec![false; twin.len()];
    let mut loops = Vec::new();
    for first in (0..twin.len() as u32).filter(|&h| twin[h as usize] == NONE) {
        let mut cycle = Vec::new();
        let mut h = first;
        while !seen[h as usize] {
            seen[h as usize] = true;
            cycle.push(h);
            // The fan never returns to its start: its first half-edge follows one without a twin.
            h = fan_after(twin, h).last().unwrap_or(h);
        }
        let start = (0..cycle.len()).min_by_key(|&i| (from(cycle[i]), cycle[i]));
        if let Some(start) = start {
            cycle.rotate_left(start);
            loops.push(cycle);
        }
    }
    loops
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use proptest::prelude::*;

    use super::*;
    use crate::mesh::curvature::angle_defects;
    use crate::mesh::shapes::{holed_sheet, shaken, sheet, together, tube};
    use crate::mesh::weld::weld;

    fn loops_of(soup: &TriMesh) -> (TriMesh, Topology, Vec<BoundaryLoop>) {
        let mesh = weld(soup).mesh;
        let topology = Topology::new(&mesh);
        let loops = boundary_loops(&mesh, &topology);
        (mesh, topology, loops)
    }

    fn kinds(soup: &TriMesh) -> Vec<LoopKind> {
        loops_of(soup).2.iter().map(|l| l.kind).collect()
    }

    /// A sheet rolled up loosely and rippled: developable along u, so its loops turn as flat ones do.
    fn rolled(n: usize, hole: f64, bend: f64) -> TriMesh {
        let keep = move |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > hole;
        sheet(n, keep, |u, v| {
            Vec3::new((bend * u).sin() / bend, v, (bend * u).cos() / bend)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn a_flat_hole_turns_minus_two_pi(n in 8usize..24, hole in 0.1..0.35) {
            let (mesh, topology, loops) = loops_of(&holed_sheet(n, hole));
            prop_assert_eq!(loops.len(), 2);
            for (l, expected) in loops.iter().zip([TAU, -TAU]) {
                prop_assert!((turning(&mesh, &topology, &l.half_edges) - expected).abs() < 1e-9);
                prop_assert!((l.turning - expected).abs() < 0.3 * PI, "{}", l.turning);
            }
        }

        #[test]
        fn noise_does_not_change_what_a_loop_is(n in 16usize..28, noise in 0.0..0.3f64, bend in 0.5..4.0, seed: u64) {
            let soup = shaken(&rolled(n, 0.22, bend), noise / n as f64, seed);
            prop_assert_eq!(kinds(&soup), [LoopKind::Outer, LoopKind::Hole]);
        }

        #[test]
        fn a_tube_has_two_ends_and_its_hole_is_a_hole(n in 12usize..24, noise in 0.0..0.2f64, seed: u64) {
            let keep = |u: f64, v: f64| (u - 0.5).abs() > 0.15 || (v - 0.5).abs() > 0.15;
            let mut found = kinds(&shaken(&tube(n, keep), noise / n as f64, seed));
            found.sort_unstable_by_key(|&k| k == LoopKind::TubeEnd);
            prop_assert_eq!(found, [LoopKind::Hole, LoopKind::TubeEnd, LoopKind::TubeEnd]);
        }

        #[test]
        fn gauss_bonnet_holds_for_every_component(n in 4usize..12, seed: u64, noise in 0.0..0.4f64) {
            let size = noise / n as f64;
            let cap = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, u * u - 2.0 * v * v + 5.0));
            let both = together(&together(&holed_sheet(n, 0.25), &tube(n, |_, _| true)), &cap);
            let (mesh, topology, loops) = loops_of(&shaken(&both, size, seed));
            let defects = angle_defects(&mesh, &topology);
            let mut totals = vec![0.0; topology.components];
            let mut seen = vec![false; mesh.positions.len()];
            for (f, face) in mesh.faces.iter().enumerate() {
                for &v in face {
                    if !std::mem::replace(&mut seen[v as usize], true) {
                        totals[topology.component[f] as usize] += defects[v as usize];
                    }
                }
            }
            for l in &loops {
                totals[l.component as usize] += turning(&mesh, &topology, &l.half_edges);
            }
            // A ring, a ring and a disk.
            for (total, euler) in totals.iter().zip([0.0, 0.0, 1.0]) {
                prop_assert!((total - TAU * euler).abs() < 1e-9, "{totals:?}");
            }
        }

        #[test]
        fn loops_partition_the_boundary(n in 4usize..12, hole in 0.05..0.45) {
            let (_, topology, loops) = loops_of(&holed_sheet(n, hole));
            let mut found: Vec<u32> = loops.iter().flat_map(|l| l.half_edges.clone()).collect();
            found.sort_unstable();
            let boundary: Vec<u32> =
                (0..topology.twin.len() as u32).filter(|&h| topology.twin[h as usize] == NONE).collect();
            prop_assert_eq!(found, boundary);
        }
    }

    #[test]
    fn a_missing_triangle_is_a_hole() {
        let mut soup = sheet(
            9,
            |_, _| true,
            |u, v| Vec3::new(u, v, 0.1 * (5.0 * u).sin()),
        );
        soup.faces.remove(81);
        let (_, _, loops) = loops_of(&soup);
        let found: Vec<_> = loops.iter().map(|l| (l.kind, l.vertices.len())).collect();
        assert_eq!(found, [(LoopKind::Outer, 36), (LoopKind::Hole, 3)]);
    }

    #[test]
    fn ears_on_the_rim_leave_a_hole_a_hole() {
        let mut soup = holed_sheet(16, 0.25);
        let (mesh, topology, loops) = loops_of(&soup);
        // An ear on every third edge of the rim, leaning into the hole.
        for h in loops[1].half_edges.iter().step_by(3) {
            let (a, b) = (
                mesh.positions[topology.from(*h) as usize],
                mesh.positions[topology.to(*h) as usize],
            );
            let tip = (a + b) * 0.5 + (loops[1].centroid - a) * 0.1;
            let first = soup.positions.len() as u32;
            soup.positions.extend([b, a, tip]);
            soup.faces.push([first, first + 1, first + 2]);
        }
        let (_, _, loops) = loops_of(&soup);
        assert_eq!(loops.len(), 2);
        assert_eq!(loops[1].kind, LoopKind::Hole);
    }

    #[test]
    fn length_area_and_centroid_are_those_of_the_curve() {
        let soup = sheet(
            10,
            |u, v| !(0.2..0.6).contains(&u) || !(0.3..0.8).contains(&v),
            |u, v| Vec3::new(u, 2.0, v),
        );
        let (_, _, loops) = loops_of(&soup);
        assert!((loops[1].length - 1.8).abs() < 1e-12);
        assert!((loops[1].area - 0.2).abs() < 1e-12);
        assert!((loops[1].centroid - Vec3::new(0.4, 2.0, 0.55)).norm() < 1e-12);
    }

    #[test]
    fn the_size_of_a_sheet_does_not_change_what_its_loops_are() {
        for size in [1e-200, 1e-30, 1e30, 1e200, 1e300] {
            let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
            let soup = sheet(16, keep, |u, v| {
                Vec3::new(u, v, 0.1 * (9.0 * u).sin()) * size
            });
            let (_, _, loops) = loops_of(&soup);
            let found: Vec<_> = loops.iter().map(|l| l.kind).collect();
            assert_eq!(found, [LoopKind::Outer, LoopKind::Hole], "{size}");
            assert!(
                loops
                    .iter()
                    .all(|l| l.length.is_finite() && l.area.is_finite())
            );
            assert!((loops[1].centroid / size - Vec3::new(0.5, 0.5, -0.1)).norm() < 0.1);
        }
    }

    #[test]
    fn half_edges_join_the_vertices_in_order() {
        let (_, topology, loops) = loops_of(&holed_sheet(8, 0.3));
        for l in &loops {
            for (i, &h) in l.half_edges.iter().enumerate() {
                assert_eq!(topology.from(h), l.vertices[i]);
                assert_eq!(topology.to(h), l.vertices[(i + 1) % l.vertices.len()]);
            }
            assert_eq!(l.vertices.iter().min(), l.vertices.first());
        }
    }
}
