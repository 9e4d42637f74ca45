//! Distance along the surface.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use darn_budget::{Budget, Exhausted, Steps};

use super::index::VertexId;
use super::sparse::SparseValues;
use super::topology::Topology;
use super::{TriMesh, Vec3};

/// Distance along the surface from the nearest source to every vertex, scene units; infinite beyond `limit` and where
/// no path leads.
///
/// Fast marching on the triangles (Kimmel & Sethian 1998): Dijkstra along edges, improved by letting a straight front
/// cross each face. Never longer than the shortest path along edges; within a few per cent of the true distance on
/// scan-like triangles. O(n log n) in the vertices within `limit`. Sources that do not exist are ignored.
///
/// # Errors
/// `Exhausted`.
pub(super) fn geodesic_distance(
    mesh: &TriMesh,
    topology: &Topology,
    sources: &[VertexId],
    limit: f64,
    budget: &Budget,
) -> Result<SparseValues<f64>, Exhausted> {
    let vertices = mesh.positions.len();
    let mut steps = Steps::of(budget);
    let mut distance = SparseValues::new(vertices, f64::INFINITY);
    let mut done = SparseValues::new(vertices, false);
    let mut queue = BinaryHeap::new();
    for &s in sources.iter().filter(|s| s.index() < vertices) {
        distance[s.index()] = 0.0;
        queue.push(Arrival {
            distance: 0.0,
            vertex: s,
        });
    }
    while let Some(Arrival {
        vertex,
        distance: arrived,
    }) = queue.pop()
    {
        if arrived > limit {
            break;
        }
        if std::mem::replace(&mut done[vertex.index()], true) {
            continue;
        }
        let from = distance[vertex.index()];
        let leaving = topology.leaving(vertex);
        steps.take(FAN_WORK * leaving.len() as u64)?;
        for h in leaving {
            let (a, b) = (topology.target(h), topology.origin(h.previous()));
            for (goal, other) in [(a, b), (b, a)] {
                if done[goal.index()] {
                    continue;
                }
                let [here, there, p] = [vertex, other, goal].map(|v| mesh.positions[v.index()]);
                let mut best = from + (p - here).norm();
                if done[other.index()]
                    && let Some(d) =
                        front_arrival(here - p, there - p, from, distance[other.index()])
                {
                    best = best.min(d);
                }
                if best < distance[goal.index()] {
                    distance[goal.index()] = best;
                    queue.push(Arrival {
                        distance: best,
                        vertex: goal,
                    });
                }
            }
        }
    }
    let seen: Vec<usize> = distance.written().take_while(|v| *v < vertices).collect();
    for v in seen.into_iter().filter(|v| !done[*v]) {
        distance[v] = f64::INFINITY;
    }
    Ok(distance)
}

/// Nanoseconds of work a half-edge.
const FAN_WORK: u64 = 40;

/// The time at which a straight front of speed 1 reaches the third corner of a face, when it passes the other two at
/// `ta` and `tb`; `a` and `b` are their positions relative to the third. `None` when the front does not come through
/// the side between them.
fn front_arrival(a: Vec3, b: Vec3, ta: f64, tb: f64) -> Option<f64> {
    // With E = [a b], Q = (EᵀE)⁻¹ the gradient is E Q (t − p·1); its length is 1.
    let (aa, ab, bb) = (a.dot(&a), a.dot(&b), b.dot(&b));
    let det = aa * bb - ab * ab;
    if det <= 1e-12 * aa * bb {
        return None;
    }
    let (q11, q12, q22) = (bb / det, -ab / det, aa / det);
    let (one, mixed) = (q11 + 2.0 * q12 + q22, ta * (q11 + q12) + tb * (q12 + q22));
    let square = ta * ta * q11 + 2.0 * ta * tb * q12 + tb * tb * q22 - 1.0;
    let root = mixed * mixed - one * square;
    if root < 0.0 {
        return None;
    }
    let p = (mixed + root.sqrt()) / one;
    let (da, db) = (ta - p, tb - p);
    (q11 * da + q12 * db < 0.0 && q12 * da + q22 * db < 0.0).then_some(p)
}

/// A vertex in the queue; the nearest is popped first, among equals the lower-numbered.
#[derive(PartialEq)]
struct Arrival {
    distance: f64,
    vertex: VertexId,
}

impl Eq for Arrival {}

impl Ord for Arrival {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .distance
            .total_cmp(&self.distance)
            .then(other.vertex.cmp(&self.vertex))
    }
}

impl PartialOrd for Arrival {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::shapes::{jitter, sheet};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn on_a_plane_it_is_the_straight_distance(n in 10usize..25, noise in 0.0..0.2f64, seed: u64, pick: prop::sample::Index) {
            let mut mesh = jitter(&sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0)), noise / n as f64, seed);
            for p in &mut mesh.positions {
                p.z = 0.0;
            }
            let source = pick.index(mesh.positions.len());
            let topology = Topology::new(&mesh);
            let distance = geodesic_distance(&mesh, &topology, &[VertexId(source as u32)], f64::INFINITY, Budget::unlimited()).unwrap();
            for (v, p) in mesh.positions.iter().enumerate() {
                let d = distance[v];
                let straight = (p - mesh.positions[source]).norm();
                prop_assert!(d > straight - 1e-9 - 0.02 * straight && d < 1.15 * straight + 0.5 / n as f64, "{d} {straight}");
            }
        }

        #[test]
        fn a_straight_front_stays_straight(n in 4usize..16) {
            let mesh = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
            let sources: Vec<VertexId> = (0..=n as u32).map(VertexId).collect();
            let distance = geodesic_distance(&mesh, &Topology::new(&mesh), &sources, f64::INFINITY, Budget::unlimited()).unwrap();
            for (v, p) in mesh.positions.iter().enumerate() {
                prop_assert!((p.y - distance[v]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn without_a_source_nothing_is_reached() {
        let mesh = sheet(2, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
        let distance = geodesic_distance(
            &mesh,
            &Topology::new(&mesh),
            &[VertexId(77)],
            f64::INFINITY,
            Budget::unlimited(),
        )
        .unwrap();
        assert!((0..mesh.positions.len()).all(|v| distance[v].is_infinite()));
    }

    #[test]
    fn a_limit_only_leaves_out_what_is_farther() {
        let mesh = sheet(12, |_, _| true, |u, v| Vec3::new(u, v, u * v));
        let topology = Topology::new(&mesh);
        let all = geodesic_distance(
            &mesh,
            &topology,
            &[VertexId(3)],
            f64::INFINITY,
            Budget::unlimited(),
        )
        .unwrap();
        let near = geodesic_distance(&mesh, &topology, &[VertexId(3)], 0.4, Budget::unlimited());
        let near = near.unwrap();
        for v in 0..mesh.positions.len() {
            let (near, all) = (near[v], all[v]);
            assert_eq!(near, if all <= 0.4 { all } else { f64::INFINITY });
        }
    }
}
