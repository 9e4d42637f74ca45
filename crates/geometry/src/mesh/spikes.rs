//! Spikes and threads at a rim: pieces that hang on the cloth by one edge and are long against it.
//!
//! Scanners and meshers draw such triangles from the edge of the cloth to stray points. They are no cloth: two of them
//! cross each other, and a patch that meets their tips is stretched.

use std::collections::{HashMap, HashSet};

use darn_budget::{Budget, Exhausted, Steps};

use super::TriMesh;
use super::index::{FaceId, HalfEdgeId, VertexId};
use super::loops::BoundaryLoop;
use super::topology::Topology;

/// Least length of a spike ÷ width of its neck. Triangles of a scan are seldom half as long.
const NARROW: f64 = 2.0;
/// Least length of a spike ÷ median edge of the cloth at the rim: short teeth belong to a ragged tear. With 2, teeth of clean cuts through a
/// triangulation are taken for spikes.
const LONG: f64 = 2.5;
/// A piece is a tongue of the cloth, and no spike, where none of its edges is longer than this many median edges of the cloth at the rim, …
const CLOTH_EDGE: f64 = 1.75;
/// … nowhere two of its triangles meet, nor it and the cloth at its neck, at a larger angle than 30° (its cosine), …
const LEAST_SMOOTH: f64 = 0.866;
/// … and it is no longer than this many median edges: longer ones are threads.
const LONGEST_TONGUE: f64 = 6.0;
/// Nanoseconds of work a rim vertex or face.
const STEP_WORK: u64 = 100;

/// The faces of all spikes and threads at a rim, ascending: pieces beyond an inner edge between two of its vertices
/// (their neck) of at least twice the length of the neck and two and a half times that of the cloth's edges. Half of its border
/// is a piece's length. Tongues of cloth, whose triangles are like those around and go on from them smoothly, are none.
///
/// # Errors
/// `Exhausted`.
pub fn spikes(
    mesh: &TriMesh,
    topology: &Topology,
    rim: &BoundaryLoop,
    budget: &Budget,
) -> Result<Vec<FaceId>, Exhausted> {
    let mut steps = Steps::of(budget);
    let place = |v: VertexId| mesh.positions[v.index()];
    let count = rim.vertices.len();
    let index: HashMap<VertexId, usize> = rim
        .vertices
        .iter()
        .enumerate()
        .map(|(k, v)| (*v, k))
        .collect();
    let mut along = vec![0.0];
    for h in &rim.half_edges {
        let edge = place(topology.target(*h)) - place(topology.origin(*h));
        along.push(along[along.len() - 1] + edge.norm());
    }
    let whole = along[count];
    let median = median_edge(mesh, topology, rim);
    let long = LONG * median;
    let mut found = Vec::new();
    for (to, v) in rim.vertices.iter().enumerate() {
        for neck in topology.leaving(*v) {
            steps.take(STEP_WORK)?;
            // The piece lies left of the neck, which runs from the end of its stretch of the rim to the start.
            let from = match index.get(&topology.target(neck)) {
                Some(from) if topology.twin(neck).is_some() => *from,
                _ => continue,
            };
            let border = along[to] - along[from] + if from > to { whole } else { 0.0 };
            let length = 0.5 * border;
            let width = (place(topology.target(neck)) - place(*v)).norm();
            if length < (NARROW * width).max(long) || border > 0.5 * whole {
                continue;
            }
            let most = 2 * ((to + count - from) % count);
            if let Some(piece) = piece_beyond(topology, neck, most) {
                steps.take(STEP_WORK * piece.len() as u64)?;
                let is_tongue =
                    length <= LONGEST_TONGUE * median && is_cloth(mesh, topology, &piece, median);
                if !is_tongue {
                    found.extend(piece);
                }
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

/// The faces left of an inner half-edge; `None` when there are more than `most`: the edge cuts nothing off.
fn piece_beyond(topology: &Topology, neck: HalfEdgeId, most: usize) -> Option<Vec<FaceId>> {
    let mut piece = vec![neck.face()];
    let mut met = HashSet::from([neck.face()]);
    let mut next = 0;
    while next < piece.len() {
        for h in piece[next].half_edges() {
            let beyond = topology.twin(h).map(HalfEdgeId::face);
            if let Some(f) = beyond.filter(|_| h != neck)
                && met.insert(f)
            {
                piece.push(f);
                if piece.len() > most {
                    return None;
                }
            }
        }
        next += 1;
    }
    Some(piece)
}

/// Whether triangles are as large as others with edges of this length, and go on smoothly from each other and from the cloth they hang on.
fn is_cloth(mesh: &TriMesh, topology: &Topology, piece: &[FaceId], median: f64) -> bool {
    let normal = |f: FaceId| {
        let [a, b, c] = mesh.triangle(f.index());
        (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE)
    };
    piece.iter().all(|f| {
        f.half_edges().iter().all(|h| {
            let ends = [topology.origin(*h), topology.target(*h)];
            let [from, to] = ends.map(|v| mesh.positions[v.index()]);
            let beyond = topology.twin(*h).map(HalfEdgeId::face);
            let is_smooth = beyond.is_none_or(|beyond| match (normal(*f), normal(beyond)) {
                (Some(own), Some(other)) => own.dot(&other) >= LEAST_SMOOTH,
                _ => false,
            });
            is_smooth && (to - from).norm() <= CLOTH_EDGE * median
        })
    })
}

/// Median length of the inner edges at a rim, scene units; 0 without any. Most of them are edges of the cloth even
/// where every edge of the rim is a spike's.
fn median_edge(mesh: &TriMesh, topology: &Topology, rim: &BoundaryLoop) -> f64 {
    let place = |v: VertexId| mesh.positions[v.index()];
    let inner = rim.vertices.iter().flat_map(|v| topology.leaving(*v));
    let inner = inner.filter(|h| topology.twin(*h).is_some());
    let mut edges: Vec<f64> = inner
        .map(|h| (place(topology.target(h)) - place(topology.origin(h))).norm())
        .collect();
    let middle = edges.len() / 2;
    if edges.is_empty() {
        return 0.0;
    }
    *edges.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Vec3;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::region::BoundedMesh;
    use crate::mesh::shapes::{fray, holed_sheet, jitter, sheet};
    use crate::mesh::sound_hole::SoundHole;
    use crate::mesh::weld::weld;

    /// The spikes at the hole of a mesh, and the hole without them.
    fn without_spikes(soup: &TriMesh) -> (Vec<FaceId>, Option<SoundHole>) {
        let mesh = weld(soup).mesh;
        let topology = Topology::new(&mesh);
        let loops = boundary_loops(&mesh, &topology);
        let rim = loops
            .iter()
            .find(|l| l.kind != LoopKind::Outer)
            .expect("a hole");
        let found = spikes(&mesh, &topology, rim, Budget::unlimited()).expect("no limits");
        let whole = BoundedMesh {
            mesh: &mesh,
            topology: &topology,
            loops: &loops,
        };
        let sound = SoundHole::without(&whole, rim, found.clone(), Budget::unlimited());
        (found, sound.expect("no limits"))
    }

    fn in_the_middle(p: &Vec3) -> bool {
        (p.x - 0.5).hypot(p.y - 0.5) < 0.45
    }

    /// A sheet with a hole into which a tongue of the cloth reaches, one square wide and `length` squares long, bent up at its neck.
    fn with_tongue(length: usize, bend: f64) -> TriMesh {
        let side = 24.0;
        let keep = |u: f64, v: f64| {
            let (i, j) = ((u * side) as usize, (v * side) as usize);
            let in_hole = (8..16).contains(&i) && (8..16).contains(&j);
            !in_hole || (i == 12 && j < 8 + length)
        };
        sheet(24, keep, |u, v| {
            let (beside, along) = ((side * u - 12.5).abs(), side * v - 8.0);
            match beside < 0.6 && (0.1..length as f64 + 0.1).contains(&along) {
                true => Vec3::new(side * u, 8.0 + along * bend.cos(), along * bend.sin()),
                false => Vec3::new(side * u, side * v, 0.0),
            }
        })
    }

    #[test]
    fn a_tongue_of_the_cloth_is_no_spike_unless_it_stands_up_or_is_a_thread() {
        for length in [3, 5] {
            assert_eq!(without_spikes(&with_tongue(length, 0.0)).0, []);
            assert_eq!(without_spikes(&with_tongue(length, 0.3)).0, []);
            let standing = without_spikes(&with_tongue(length, 1.2)).0;
            assert_eq!(standing.len(), 2 * length);
        }
        assert_eq!(without_spikes(&with_tongue(7, 0.0)).0.len(), 14);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn spikes_are_found_and_nothing_else(n in 16usize..32, length in 4.5..9.0f64, seed: u64, noise in 0.0..0.1f64) {
            let clean = jitter(&holed_sheet(n, 0.25), noise / n as f64, seed);
            prop_assert_eq!(without_spikes(&clean).0, []);
            let spiked = fray(&clean, in_the_middle, length / n as f64, seed);
            let (found, sound) = without_spikes(&spiked);
            // They come last in the soup, and so in the welded mesh.
            let expected: Vec<FaceId> = (clean.faces.len()..spiked.faces.len()).map(|f| FaceId(f as u32)).collect();
            let mesh = weld(&clean).mesh;
            let loops = boundary_loops(&mesh, &Topology::new(&mesh));
            let hole = loops.iter().find(|l| l.kind == LoopKind::Hole).expect("a hole");
            prop_assert!(expected.iter().all(|f| found.contains(f)));
            // An ear of the cloth that a spike hangs on comes off with it.
            let ears: Vec<FaceId> = found.iter().copied().filter(|f| !expected.contains(f)).collect();
            for ear in &ears {
                let on_rim = |v: &u32| hole.vertices.contains(&VertexId(*v));
                prop_assert!(mesh.faces[ear.index()].iter().all(on_rim), "{ear} is no ear");
            }
            let sound = sound.expect("a hole");
            prop_assert_eq!(&sound.left, &found);
            // The sound rim is the rim of the clean sheet without these ears.
            let lengths = |loops: &[BoundaryLoop]| {
                let mut lengths: Vec<usize> = loops.iter().map(|l| l.vertices.len()).collect();
                lengths.sort_unstable();
                lengths
            };
            let (sound, clean) = (lengths(&sound.loops), lengths(&loops));
            prop_assert_eq!(sound.len(), clean.len());
            prop_assert!(sound.iter().zip(&clean).all(|(s, c)| s <= c && s + 2 * ears.len() >= *c), "{sound:?} {clean:?}");
        }
    }
}
