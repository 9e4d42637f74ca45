//! Boundary loops and what they bound: a hole, a finished opening, the cloth itself, or the end of a tube.

use std::f64::consts::PI;

use super::index::{HalfEdgeId, LoopId, VertexId};
use super::openings::{Evidence, verdicts};
use super::pairing::Paired;
use super::topology::Topology;
use super::turning::robust_turnings;
use super::{TriMesh, Vec3, unit_for};

/// Sweeps in the search for a loop's diameter.
const SWEEPS: usize = 4;

/// What a boundary loop bounds, decided by its total geodesic curvature, and by [`Evidence`] where cloth surrounds it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LoopKind {
    /// Turning below −π: cloth surrounds it, and it is damage.
    Hole,
    /// Turning below −π: cloth surrounds it, and it was made so: a neck, a buttonhole, the mouth of a bag.
    Opening,
    /// Turning above +π: it surrounds the cloth.
    Outer,
    /// Turning in between: the end of a sleeve, a cuff, the opening of a sack.
    TubeEnd,
}

/// One closed boundary of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct BoundaryLoop {
    /// Its index in the list; ids follow the smallest vertex of each loop.
    pub id: LoopId,
    /// Its vertices along the boundary half-edges (the cloth on the left), from the smallest on.
    pub vertices: Vec<VertexId>,
    /// `half_edges[i]` runs from `vertices[i]` to `vertices[i + 1]`.
    pub half_edges: Vec<HalfEdgeId>,
    /// Length, scene units.
    pub length: f64,
    /// Centroid of the curve (each edge weighs its length), scene space.
    pub centroid: Vec3,
    /// Area of the flattest surface across it (half the length of Σ pᵢ × pᵢ₊₁), scene units squared.
    pub area: f64,
    /// Total geodesic curvature, radians: of the loop itself where the cloth there is smooth, of curves just inside
    /// where it is rough; see [`boundary_loops`].
    pub turning: f64,
    /// What it bounds.
    pub kind: LoopKind,
    /// Largest distance between two of its vertices, scene units, found by `diameter` in a few sweeps.
    pub diameter: f64,
    /// Probability of the kind, 0.5 to 1, of a hole, an opening, or a tube's end that may be a hole; 1 for others.
    pub confidence: f64,
    /// What the kind of a hole or an opening rests on, and of a tube's end that may be a hole.
    pub evidence: Vec<Evidence>,
    /// The component of the mesh it bounds; see [`Topology::component`].
    pub component: u32,
    /// Whether most of its edges are such where other faces were not joined: then it is no border of cloth.
    pub non_manifold: bool,
}

/// Every boundary loop of a welded mesh, in an order that depends only on the mesh.
///
/// [`BoundaryLoop::turning`] is one of two estimates:
///
/// - Where the first ring of vertices behind the loop has less than one radian of angle defect (sum of absolute
///   values), the loop is smooth and its exact [`turning`](super::turning::turning) counts. This holds for sharp
///   folds, too, and keeps the curvature of a dome out of the loop's value.
/// - Elsewhere the exact value is unusable: noise of a tenth of the edge length adds several π over a long loop, and
///   frayed simulated cloth hides an outer boundary even without noise. What the loop gains, the cloth just behind it
///   loses (Gauss–Bonnet), so the mean turning of the curves two and three rings inside counts, on positions smoothed
///   four times. Both numbers matter: loops are smoothed along themselves only, which leaves a band of false
///   curvature as many rings wide as there are smoothings. The mean over the first three rings after eight smoothings
///   reads the outer boundary of a sheet folded to `0.25 sin 40x`, sixty vertices a side, as −3.8 rad.
///
/// On draped sheets with vertex noise up to 0.3 of the edge length, and on such sheets folded up to `0.3 sin 50x`,
/// the estimate stays above +1.4π for outer boundaries and below −1.5π for holes. Folds that steep across the
/// diagonals of the triangulation (half a radian of defect per vertex) are no longer developable: there a hole may be
/// classified as a tube end.
///
/// Every loop is classified by itself. A component may have several outer boundaries or none (a strongly
/// saddle-shaped or a closed surface); none of them is classified as a hole because another is missing.
pub fn boundary_loops(mesh: &TriMesh, topology: &Topology) -> Vec<BoundaryLoop> {
    let mut cycles = topology.boundary_cycles(|h| topology.origin(h));
    cycles.sort_by_key(|c| c.first().map(|&h| (topology.origin(h), h)));
    let turnings = robust_turnings(mesh, topology, &cycles);
    let mut loops: Vec<BoundaryLoop> = (0u32..)
        .map(LoopId)
        .zip(cycles.into_iter().zip(turnings))
        .map(|(id, (half_edges, turning))| BoundaryLoop {
            id,
            turning,
            kind: kind(turning),
            ..measured(mesh, topology, half_edges)
        })
        .collect();
    let verdicts = verdicts(mesh, topology, &loops);
    for (l, verdict) in loops.iter_mut().zip(verdicts) {
        if let Some(verdict) = verdict {
            l.kind = verdict.kind;
            l.confidence = verdict.confidence;
            l.evidence = verdict.evidence;
        }
    }
    loops
}

impl BoundaryLoop {
    /// Whether cloth surrounds it: a hole or an opening.
    pub fn is_surrounded(&self) -> bool {
        matches!(self.kind, LoopKind::Hole | LoopKind::Opening)
    }
}

/// Largest distance between two of the points, by a few sweeps: each goes to the point farthest from the last one. Exact
/// but for shapes of almost constant width, where it is a few per cent short.
fn diameter(points: &[Vec3]) -> f64 {
    let Some(mut from) = points.first().copied() else {
        return 0.0;
    };
    let mut longest = 0.0;
    for _ in 0..SWEEPS {
        let farthest = |a: &&Vec3, b: &&Vec3| {
            let (a, b) = ((*a - from).norm_squared(), (*b - from).norm_squared());
            a.total_cmp(&b)
        };
        let Some(to) = points.iter().max_by(farthest) else {
            break;
        };
        longest = f64::max(longest, (to - from).norm());
        from = *to;
    }
    longest
}

impl BoundaryLoop {
    /// The same loop along other half-edges: id, turning and kind stay, everything else is measured.
    pub(super) fn along(
        &self,
        mesh: &TriMesh,
        topology: &Topology,
        half_edges: Vec<HalfEdgeId>,
    ) -> BoundaryLoop {
        BoundaryLoop {
            id: self.id,
            turning: self.turning,
            kind: self.kind,
            ..measured(mesh, topology, half_edges)
        }
    }
}

/// A loop with its measures; its id, turning and kind are left for the caller to set.
fn measured(mesh: &TriMesh, topology: &Topology, half_edges: Vec<HalfEdgeId>) -> BoundaryLoop {
    let vertices: Vec<VertexId> = half_edges.iter().map(|&h| topology.origin(h)).collect();
    let (mut length, mut moment, mut area) = (0.0, Vec3::zeros(), Vec3::zeros());
    let origin = vertices
        .first()
        .map_or(Vec3::zeros(), |v| mesh.positions[v.index()]);
    let place = |v: VertexId| mesh.positions[v.index()] - origin;
    let unit = unit_for(
        vertices
            .iter()
            .map(|&v| place(v).amax())
            .fold(0.0, f64::max),
    );
    let scaled: Vec<Vec3> = vertices.iter().map(|&v| place(v) / unit).collect();
    for &h in &half_edges {
        let a = place(topology.origin(h)) / unit;
        let b = place(topology.target(h)) / unit;
        let edge = (b - a).norm();
        length += edge;
        moment += (a + b) * (0.5 * edge);
        area += a.cross(&b) * 0.5;
    }
    BoundaryLoop {
        id: LoopId(0),
        length: (length * unit).min(f64::MAX),
        centroid: if length > 0.0 {
            origin + moment / length * unit
        } else {
            origin
        },
        area: (area.norm() * unit * unit).min(f64::MAX),
        turning: 0.0,
        kind: kind(0.0),
        diameter: (diameter(&scaled) * unit).min(f64::MAX),
        confidence: 1.0,
        evidence: Vec::new(),
        component: half_edges
            .first()
            .map_or(0, |h| topology.component(h.face())),
        non_manifold: {
            let unjoined = |h: &&HalfEdgeId| topology.non_manifold.binary_search(h).is_ok();
            2 * half_edges.iter().filter(unjoined).count() > half_edges.len()
        },
        vertices,
        half_edges,
    }
}

fn kind(turning: f64) -> LoopKind {
    if turning < -PI {
        LoopKind::Hole
    } else if turning > PI {
        LoopKind::Outer
    } else {
        LoopKind::TubeEnd
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::mesh::curvature::angle_defect;
    use crate::mesh::shapes::{concat, holed_sheet, jitter, sheet, tube};
    use crate::mesh::turning::turning;
    use crate::mesh::weld::weld;

    fn loops_of(soup: &TriMesh) -> (Arc<TriMesh>, Topology, Vec<BoundaryLoop>) {
        let mesh = weld(soup).mesh;
        let topology = Topology::new(&mesh);
        let loops = boundary_loops(&mesh, &topology);
        (mesh, topology, loops)
    }

    fn kinds(soup: &TriMesh) -> Vec<LoopKind> {
        loops_of(soup).2.iter().map(|l| l.kind).collect()
    }

    /// A sheet with a hole, rolled up loosely: it is developable, so its loops turn as flat ones do.
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
        fn noise_does_not_change_the_kind_of_a_loop(n in 16usize..28, noise in 0.0..0.3f64, bend in 0.5..4.0, seed: u64) {
            let soup = jitter(&rolled(n, 0.22, bend), noise / n as f64, seed);
            prop_assert_eq!(kinds(&soup), [LoopKind::Outer, LoopKind::Hole]);
        }

        #[test]
        fn a_tube_has_two_ends_and_its_hole_is_a_hole(n in 12usize..24, noise in 0.0..0.2f64, seed: u64) {
            let keep = |u: f64, v: f64| (u - 0.5).abs() > 0.15 || (v - 0.5).abs() > 0.15;
            let mut found = kinds(&jitter(&tube(n, keep), noise / n as f64, seed));
            found.sort_unstable_by_key(|&k| k == LoopKind::TubeEnd);
            prop_assert_eq!(found, [LoopKind::Hole, LoopKind::TubeEnd, LoopKind::TubeEnd]);
        }

        #[test]
        fn gauss_bonnet_holds_for_every_component(n in 4usize..12, seed: u64, noise in 0.0..0.4f64) {
            let size = noise / n as f64;
            let cap = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, u * u - 2.0 * v * v + 5.0));
            let both = concat(&concat(&holed_sheet(n, 0.25), &tube(n, |_, _| true)), &cap);
            let (mesh, topology, loops) = loops_of(&jitter(&both, size, seed));
            let boundary = topology.boundary_vertices();
            let mut totals = vec![0.0; topology.components];
            for v in (0..mesh.positions.len() as u32).map(VertexId).filter(|v| !boundary[v.index()]) {
                let face = topology.faces_at(v).next().expect("welded meshes have no unused vertex");
                totals[topology.component(face) as usize] += angle_defect(&mesh, &topology, v);
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
            let mut found: Vec<HalfEdgeId> = loops.iter().flat_map(|l| l.half_edges.clone()).collect();
            found.sort_unstable();
            let boundary: Vec<HalfEdgeId> = topology.boundary().collect();
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
    fn single_triangles_on_the_rim_do_not_change_the_kind() {
        let mut soup = holed_sheet(16, 0.25);
        let (mesh, topology, loops) = loops_of(&soup);
        // A triangle on every third edge of the rim, pointing into the hole.
        for h in loops[1].half_edges.iter().step_by(3) {
            let (a, b) = (
                mesh.positions[topology.origin(*h).index()],
                mesh.positions[topology.target(*h).index()],
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
    fn the_size_of_a_sheet_does_not_change_the_kinds_of_its_loops() {
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
                assert_eq!(topology.origin(h), l.vertices[i]);
                assert_eq!(topology.target(h), l.vertices[(i + 1) % l.vertices.len()]);
            }
            assert_eq!(l.vertices.iter().min(), l.vertices.first());
        }
    }
}
