//! Distances along the surface.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::topology::{Topology, next, previous};
use super::{TriMesh, Vec3};

/// Distance along the surface from the nearest source to every vertex, scene units; infinite where no path leads.
///
/// Fast marching on the triangles (Kimmel & Sethian 1998): Dijkstra along edges, improved by letting a straight front cross each
/// face. Never longer than the way along edges; within a few percent of the true distance on scan-like triangles. O(n log n).
/// Sources that do not exist are ignored.
pub fn geodesic_distance(mesh: &TriMesh, topology: &Topology, sources: &[u32]) -> Vec<f64> {
    geodesic_distance_within(mesh, topology, sources, f64::INFINITY)
}

/// [`geodesic_distance`] as far as `limit`, infinite beyond; costs only what lies within.
pub fn geodesic_distance_within(
    mesh: &TriMesh,
    topology: &Topology,
    sources: &[u32],
    limit: f64,
) -> Vec<f64> {
    let mut distance = vec![f64::INFINITY; mesh.positions.len()];
    let mut done = vec![false; mesh.positions.len()];
    let mut queue = BinaryHeap::new();
    for &s in sources {
        if let Some(d) = distance.get_mut(s as usize) {
            *d = 0.0;
            queue.push(Arrival {
                distance: 0.0,
                vertex: s,
            });
        }
    }
    while let Some(Arrival {
        vertex,
        distance: arrived,
    }) = queue.pop()
    {
        if arrived > limit {
            break;
        }
        if std::mem::replace(&mut done[vertex as usize], true) {
            continue;
        }
        let from = distance[vertex as usize];
        for &h in topology.leaving(vertex) {
            let (a, b) = (topology.from(next(h)), topology.from(previous(h)));
            for (goal, other) in [(a, b), (b, a)] {
                if done[goal as usize] {
                    continue;
                }
                let [here, there, p] = [vertex, other, goal].map(|v| mesh.positions[v as usize]);
                let mut best = from + (p - here).norm();
                if done[other as usize]
                    && let Some(d) = front(here - p, there - p, from, distance[other as usize])
                {
                    best = best.min(d);
                }
                if best < distance[goal as usize] {
                    distance[goal as usize] = best;
                    queue.push(Arrival {
                        distance: best,
                        vertex: goal,
                    });
                }
            }
        }
    }
    for (d, done) in distance.iter_mut().zip(done) {
        if !done {
            *d = f64::INFINITY;
        }
    }
    distance
}

/// When a straight front that passes `a` at `ta` and `b` at `tb` (both seen from the third corner) reaches that corner,
/// coming through the side between them; `None` when it comes from elsewhere.
fn front(a: Vec3, b: Vec3, ta: f64, tb: f64) -> Option<f64> {
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

/// A vertex in the queue; the nearest comes out first, among equals the lower-numbered.
#[derive(PartialEq)]
struct Arrival {
    distance: f64,
    vertex: u32,
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
    use crate::mesh::shapes::{shaken, sheet};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn on_a_plane_it_is_the_straight_distance(n in 10usize..25, noise in 0.0..0.2f64, seed: u64, pick: prop::sample::Index) {
            let mut mesh = shaken(&sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0)), noise / n as f64, seed);
            for p in &mut mesh.positions {
                p.z = 0.0;
            }
            let source = pick.index(mesh.positions.len());
            let topology = Topology::new(&mesh);
            let distance = geodesic_distance(&mesh, &topology, &[source as u32]);
            for (p, d) in mesh.positions.iter().zip(&distance) {
                let straight = (p - mesh.positions[source]).norm();
                prop_assert!(*d > straight - 1e-9 - 0.02 * straight && *d < 1.15 * straight + 0.5 / n as f64, "{d} {straight}");
            }
        }

        #[test]
        fn a_straight_front_stays_straight(n in 4usize..16) {
            let mesh = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
            let sources: Vec<u32> = (0..=n as u32).collect();
            let distance = geodesic_distance(&mesh, &Topology::new(&mesh), &sources);
            for (p, d) in mesh.positions.iter().zip(&distance) {
                prop_assert!((p.y - d).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn nothing_is_reached_from_nowhere() {
        let mesh = sheet(2, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
        let distance = geodesic_distance(&mesh, &Topology::new(&mesh), &[77]);
        assert!(distance.iter().all(|d| d.is_infinite()));
    }

    #[test]
    fn a_limit_only_forgets_what_is_farther() {
        let mesh = sheet(12, |_, _| true, |u, v| Vec3::new(u, v, u * v));
        let topology = Topology::new(&mesh);
        let all = geodesic_distance(&mesh, &topology, &[3]);
        for (near, all) in geodesic_distance_within(&mesh, &topology, &[3], 0.4)
            .iter()
            .zip(all)
        {
            assert_eq!(*near, if all <= 0.4 { all } else { f64::INFINITY });
        }
    }
}
