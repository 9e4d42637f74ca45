//! Total geodesic curvature of boundary loops: exact, and estimated where noise and folds distort the exact value.

use std::f64::consts::PI;

use super::curvature::{angle_defect, angle_defect_of};
use super::index::{HalfEdgeId, LoopId, VertexId};
use super::pairing::Paired;
use super::sparse::SparseValues;
use super::topology::Topology;
use super::{TriMesh, Vec3, corner_angle};

/// How often positions are averaged before the turning of a rough edge is measured.
const SMOOTHING: usize = 4;
/// The first ring of vertices behind a rough edge whose curves its turning is averaged over.
const FIRST_RING: usize = 2;
/// The last such ring.
const LAST_RING: usize = 3;
/// Radians of angle defect in the first ring below which an edge counts as smooth.
const SMOOTH: f64 = 1.0;
/// "Two loops are as near."
const NO_LOOP: LoopId = LoopId(u32::MAX);

/// Total geodesic curvature of a boundary loop, in radians: Σ (π − θᵥ), θᵥ the interior angle of the faces at v.
///
/// On developable cloth (Gauss–Bonnet) it is ≈ −2π for a hole, ≈ +2π for the outer boundary and ≈ 0 for the end of a
/// tube, whatever the loop's length or vertex count. It is exact, so noise of the mesh shows in it; judge a loop by
/// [`BoundaryLoop::turning`](super::loops::BoundaryLoop::turning).
///
/// ```
/// use std::f64::consts::TAU;
///
/// use darn_geometry::mesh::loops::boundary_loops;
/// use darn_geometry::mesh::shapes::holed_sheet;
/// use darn_geometry::mesh::turning::turning;
/// use darn_geometry::mesh::weld::weld;
///
/// let welded = weld(&holed_sheet(16, 0.2));
/// let topology = welded.topology();
/// let loops = boundary_loops(&welded.mesh, &topology);
/// let turnings: Vec<f64> = loops.iter().map(|rim| turning(&welded.mesh, &topology, &rim.half_edges)).collect();
/// assert!((turnings[0] - TAU).abs() < 1e-9, "the outer boundary");
/// assert!((turnings[1] + TAU).abs() < 1e-9, "the hole");
/// ```
pub fn turning(mesh: &TriMesh, topology: &Topology, half_edges: &[HalfEdgeId]) -> f64 {
    vertex_turnings(mesh, topology, half_edges).sum()
}

/// Geodesic curvature of a boundary loop at each of its vertices, radians: π − θᵥ, θᵥ the interior angle of the faces
/// at v.
pub(super) fn vertex_turnings(
    mesh: &TriMesh,
    topology: &Topology,
    half_edges: &[HalfEdgeId],
) -> impl Iterator<Item = f64> {
    half_edges.iter().map(|&h| {
        turning_after(topology, h, |e| {
            mesh.corner_angle(e.face().index(), e.corner())
        })
    })
}

/// π less the angles of the faces at the end of a boundary half-edge; `angle` is that of a face where a half-edge starts.
fn turning_after(topology: &Topology, h: HalfEdgeId, angle: impl Fn(HalfEdgeId) -> f64) -> f64 {
    PI - topology.fan_after(h).map(angle).sum::<f64>()
}

/// A vertex some rings away from the boundary, and the loop it is nearest to: [`NO_LOOP`] when two are as near.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct RingVertex {
    vertex: VertexId,
    nearest: LoopId,
}

/// Per boundary cycle the turning to judge it by; [`boundary_loops`](super::loops::boundary_loops) says how it is
/// estimated.
///
/// A vertex that is as near to two loops counts for neither.
pub(super) fn robust_turnings(
    mesh: &TriMesh,
    topology: &Topology,
    cycles: &[Vec<HalfEdgeId>],
) -> Vec<f64> {
    let boundary: Vec<RingVertex> = (0u32..)
        .map(LoopId)
        .zip(cycles)
        .flat_map(|(nearest, cycle)| {
            cycle.iter().map(move |&h| RingVertex {
                vertex: topology.origin(h),
                nearest,
            })
        })
        .collect();
    let mut roughness = vec![0.0; cycles.len()];
    for v in rings(topology, &boundary, 1).iter().skip(1).flatten() {
        if let Some(sum) = roughness.get_mut(v.nearest.index()) {
            *sum += angle_defect(mesh, topology, v.vertex).abs();
        }
    }
    let is_smooth = |l: usize| roughness[l] < SMOOTH;
    let estimates = if (0..cycles.len()).all(is_smooth) {
        Vec::new()
    } else {
        estimated_turnings(mesh, topology, cycles, &boundary)
    };
    (0..cycles.len())
        .map(|l| match estimates.get(l) {
            Some(&turning) if !is_smooth(l) => turning,
            _ => turning(mesh, topology, &cycles[l]),
        })
        .collect()
}

/// Per cycle the mean turning of the curves two and three rings behind it, on smoothed positions; `boundary` holds
/// all boundary vertices.
fn estimated_turnings(
    mesh: &TriMesh,
    topology: &Topology,
    cycles: &[Vec<HalfEdgeId>],
    boundary: &[RingVertex],
) -> Vec<f64> {
    // After SMOOTHING rounds a vertex is right as many rings from the last one that moves, and its angles need one
    // ring more.
    let rings = rings(topology, boundary, SMOOTHING + LAST_RING);
    let near: Vec<VertexId> = rings.iter().flatten().map(|v| v.vertex).collect();
    let smooth = Smoothed::of(mesh, topology, &near);
    let angle = |h: HalfEdgeId| smooth.angle(h);
    let turning = |cycle: &Vec<HalfEdgeId>| {
        let each = cycle.iter();
        each.map(|h| turning_after(topology, *h, angle)).sum()
    };
    let mut turnings: Vec<f64> = cycles.iter().map(turning).collect();
    for (depth, ring) in rings.iter().enumerate().skip(1).take(LAST_RING) {
        // The share of the curves that lie on this ring or behind it. By Gauss–Bonnet a curve turns by the boundary's
        // turning plus the angle defects between the two.
        let weight =
            (LAST_RING + 1 - depth.max(FIRST_RING)) as f64 / (LAST_RING + 1 - FIRST_RING) as f64;
        for v in ring {
            if let Some(turning) = turnings.get_mut(v.nearest.index()) {
                *turning += weight * angle_defect_of(topology, v.vertex, angle);
            }
        }
    }
    turnings
}

/// The vertices 0, 1, … `last` rings from the boundary, each ring ascending.
fn rings(topology: &Topology, boundary: &[RingVertex], last: usize) -> Vec<Vec<RingVertex>> {
    let mut seen = vec![false; topology.vertex_count()];
    let mut rings = vec![boundary.to_vec()];
    boundary.iter().for_each(|v| seen[v.vertex.index()] = true);
    for depth in 0..last {
        let mut claims: Vec<RingVertex> = Vec::new();
        for &RingVertex { vertex, nearest } in &rings[depth] {
            let outside = topology
                .face_neighbours(vertex)
                .filter(|n| !seen[n.index()]);
            claims.extend(outside.map(|vertex| RingVertex { vertex, nearest }));
        }
        claims.sort_unstable();
        claims.dedup();
        let ring: Vec<RingVertex> = claims
            .chunk_by(|a, b| a.vertex == b.vertex)
            .map(|group| RingVertex {
                vertex: group[0].vertex,
                nearest: if group.len() == 1 {
                    group[0].nearest
                } else {
                    NO_LOOP
                },
            })
            .collect();
        ring.iter().for_each(|v| seen[v.vertex.index()] = true);
        rings.push(ring);
    }
    rings
}

/// A mesh some of whose vertices moved; holds no copy of the others.
struct Smoothed<'a> {
    mesh: &'a TriMesh,
    /// Per vertex its place in `moved`, or [`UNMOVED`].
    number: SparseValues<u32>,
    moved: Vec<Vec3>,
}

/// "The vertex lies where the mesh has it."
const UNMOVED: u32 = u32::MAX;

impl<'a> Smoothed<'a> {
    /// The mesh with the vertices `near` the boundary averaged [`SMOOTHING`] times with their neighbours: boundary
    /// vertices along the boundary only, so that loops stay loops.
    fn of(mesh: &'a TriMesh, topology: &Topology, near: &[VertexId]) -> Self {
        // The neighbours of every vertex in one list; `ends` tells where each vertex's end.
        let (mut averaged, mut ends) = (Vec::new(), Vec::with_capacity(near.len()));
        for &v in near {
            let start = averaged.len();
            for h in topology.leaving(v) {
                let back = h.previous();
                let on_boundary = |h: HalfEdgeId| topology.twin(h).is_none();
                averaged.extend(on_boundary(h).then(|| topology.target(h)));
                averaged.extend(on_boundary(back).then(|| topology.origin(back)));
            }
            if averaged.len() == start {
                averaged.extend(topology.neighbours(v));
            }
            ends.push(averaged.len());
        }
        let mut out = Smoothed {
            mesh,
            number: SparseValues::new(mesh.positions.len(), UNMOVED),
            moved: near.iter().map(|v| mesh.positions[v.index()]).collect(),
        };
        for (number, v) in (0u32..).zip(near) {
            out.number[v.index()] = number;
        }
        for _ in 0..SMOOTHING {
            let mut start = 0;
            let averages = near.iter().zip(&ends).map(|(&v, &end)| {
                let neighbours = &averaged[start..end];
                start = end;
                let sum: Vec3 = neighbours.iter().map(|n| out.position(n.0)).sum();
                (out.position(v.0) + sum / neighbours.len() as f64) * 0.5
            });
            out.moved = averages.collect();
        }
        out
    }

    #[inline]
    fn position(&self, vertex: u32) -> Vec3 {
        match self.number[vertex as usize] {
            UNMOVED => self.mesh.positions[vertex as usize],
            number => self.moved[number as usize],
        }
    }

    /// The angle of a face where one of its half-edges starts, radians.
    fn angle(&self, h: HalfEdgeId) -> f64 {
        let corners = self.mesh.faces[h.face().index()];
        corner_angle(corners.map(|v| self.position(v)), h.corner())
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::shapes::{jitter, sheet};
    use crate::mesh::weld::weld;

    fn kinds(soup: &TriMesh) -> Vec<LoopKind> {
        let mesh = weld(soup).mesh;
        let loops = boundary_loops(&mesh, &Topology::new(&mesh));
        loops.iter().map(|l| l.kind).collect()
    }

    /// A square of side 1.4 with a round hole, turned by `angle` (so that its edges are stairs) and folded along y.
    fn folded(angle: f64, fold: impl Fn(f64) -> f64) -> TriMesh {
        let (sin, cos) = angle.sin_cos();
        let keep = move |u: f64, v: f64| {
            let (x, y) = (u - 0.5, v - 0.5);
            let (a, b) = (cos * x - sin * y, sin * x + cos * y);
            a.hypot(b) > 0.14 && a.abs().max(b.abs()) < 0.35
        };
        sheet(70, keep, |u, v| {
            Vec3::new(1.4 * u, 1.4 * v, fold(1.4 * u - 0.7))
        })
    }

    /// Whether one loop is a hole and all others are outer boundaries.
    fn has_one_hole(soup: &TriMesh) -> bool {
        let found = kinds(soup);
        let holes = found.iter().filter(|&&k| k == LoopKind::Hole).count();
        let outer = found.iter().filter(|&&k| k == LoopKind::Outer).count();
        holes == 1 && outer == found.len() - 1
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn folds_do_not_change_the_kind_of_a_loop(
            angle in 0.0..PI,
            depth in 0.0..0.3f64,
            k in 5.0..50.0f64,
            phase in 0.0..TAU,
            noise in prop_oneof![Just(0.0), 0.0..0.1f64],
            seed: u64,
        ) {
            let soup = folded(angle, |x| depth * (k * x + phase).sin());
            prop_assert!(has_one_hole(&jitter(&soup, 0.02 * noise, seed)));
        }
    }

    #[test]
    fn the_edge_of_a_sharply_folded_sheet_is_not_a_hole() {
        for (depth, k) in [(0.08, 40.0), (0.12, 40.0), (0.25, 40.0), (0.3, 50.0)] {
            let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
            let soup = sheet(60, keep, |u, v| Vec3::new(u, v, depth * f64::sin(k * u)));
            for noise in [0.0, 0.1, 0.3] {
                let found = kinds(&jitter(&soup, noise / 60.0, 7));
                assert_eq!(found, [LoopKind::Outer, LoopKind::Hole], "{depth} {k}");
            }
        }
    }

    #[test]
    fn a_small_hole_in_a_coarse_ball_is_a_hole() {
        let mut ball = sheet(
            24,
            |_, _| true,
            |u, v| {
                let (long, lat) = (if u == 1.0 { 0.0 } else { TAU * u }, PI * v);
                if v == 1.0 {
                    return -Vec3::z();
                }
                Vec3::new(lat.sin() * long.cos(), lat.sin() * long.sin(), lat.cos())
            },
        );
        ball.faces.drain(600..602);
        assert_eq!(kinds(&ball), [LoopKind::Hole]);
    }
}
