//! Which faces are joined at edges that more than two share, at seams that nearly meet, and where neighbours face
//! opposite ways.

use darn_budget::{Exhausted, Steps};

use super::border::{FOLDED, PlacedFaces};
use super::index::{FaceId, HalfEdgeId};
use super::pairing::{EdgesByPlace, Paired, Twins};
use super::topology::face_components;

/// Faces at one edge up to which pairs are chosen among them; where more meet, none is joined.
const MAX_FACES: usize = 16;
/// Cosine between two faces up to which one continues the other at an edge that more than two share: no sharper than a
/// fold of 60 degrees.
const CONTINUES: f64 = 0.5;
/// The same for a face that hangs on the edge alone: it must lie all but flat to be more of the sheet, and no fin.
const FLAT: f64 = -0.9;
/// What running the same way along an edge counts against a pair, as a cosine.
const SAME_WAY: f64 = 0.02;
/// Nanoseconds of work a pair of faces at an edge.
const PAIR_WORK: u64 = 60;

/// Half-edges in pairs, and those that could not be.
#[derive(Debug, Default)]
pub(super) struct Joints {
    /// The pairs that run against each other.
    pub twins: Twins,
    /// The pairs that run the same way: one of their faces is to be turned.
    pub same_way: Vec<[HalfEdgeId; 2]>,
    /// All half-edges of each edge that more than two share, or two that are no pair.
    pub crowded: Vec<Vec<HalfEdgeId>>,
}

/// Chooses the pairs. `is_exact` tells whether two half-edges share their ends exactly, and not within a tolerance.
///
/// Two half-edges that are alone on an edge and run against each other are a pair, unless they only nearly meet and one
/// face lies on the other: those are two skins. Two that run the same way are a pair where the faces continue each
/// other. Where more meet, the pairs that continue each other most smoothly are chosen, faces that hang on the edge
/// alone last.
///
/// # Errors
/// `Exhausted`.
pub(super) fn joints(
    placed: PlacedFaces,
    is_exact: impl Fn(HalfEdgeId, HalfEdgeId) -> bool,
    steps: &mut Steps,
) -> Result<Joints, Exhausted> {
    let origins = placed.faces.as_flattened();
    let place: Vec<u32> = (0..placed.positions.len() as u32).collect();
    let mut twins = Twins::unpaired(origins.len());
    let mut doubtful: Vec<Vec<HalfEdgeId>> = Vec::new();
    for group in EdgesByPlace::new(origins, &place).groups() {
        match *group {
            [g, h] if placed.from(g) != placed.from(h) && is_exact(g, h) => twins.join(g, h),
            _ => doubtful.push(group.to_vec()),
        }
    }
    let mut found = Joints {
        twins,
        ..Joints::default()
    };
    let mut shared: Vec<HalfEdgeId> = doubtful.iter().flatten().copied().collect();
    shared.sort_unstable();
    for group in doubtful {
        steps.take(PAIR_WORK * (group.len() * group.len().min(MAX_FACES)) as u64)?;
        let free =
            |h: HalfEdgeId| found.twins.twin(h).is_none() && shared.binary_search(&h).is_err();
        let hangs = |h: &HalfEdgeId| free(h.next()) && free(h.previous());
        let pairs = chosen(placed, &group, hangs, &is_exact);
        let is_crowded = group.len() > 2 || pairs.is_empty();
        if is_crowded {
            found.crowded.push(group);
        }
        for [g, h] in pairs {
            if placed.from(g) == placed.from(h) {
                found.same_way.push([g, h]);
            } else {
                found.twins.join(g, h);
            }
        }
    }
    Ok(found)
}

/// The pairs among the half-edges at one edge.
fn chosen(
    placed: PlacedFaces,
    group: &[HalfEdgeId],
    hangs: impl Fn(&HalfEdgeId) -> bool,
    is_exact: impl Fn(HalfEdgeId, HalfEdgeId) -> bool,
) -> Vec<[HalfEdgeId; 2]> {
    if group.len() > MAX_FACES {
        return Vec::new();
    }
    let wings: Vec<_> = group.iter().map(|h| placed.wing(*h)).collect();
    let hanging: Vec<bool> = group.iter().map(&hangs).collect();
    // Faces that hang on this edge alone are left out where two others meet.
    let firm = hanging.iter().filter(|hangs| !**hangs).count();
    let left_out = |k: usize| group.len() > 2 && firm >= 2 && hanging[k];
    let mut candidates = Vec::new();
    for i in 0..group.len() {
        for j in i + 1..group.len() {
            let cosine = wings[i].dot(&wings[j]);
            let same_way = placed.from(group[i]) == placed.from(group[j]);
            let most = match (group.len() > 2, same_way, is_exact(group[i], group[j])) {
                (true, ..) if hanging[i] != hanging[j] => FLAT,
                (true, ..) => CONTINUES,
                (_, true, _) => 0.0,
                (_, _, false) => FOLDED,
                (..) => 1.0,
            };
            if cosine <= most && !left_out(i) && !left_out(j) {
                let against = if same_way { SAME_WAY } else { 0.0 };
                candidates.push((cosine + against, [i, j]));
            }
        }
    }
    candidates.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    let mut taken = vec![false; group.len()];
    let mut pairs = Vec::new();
    for (_, [i, j]) in candidates {
        if !taken[i] && !taken[j] {
            (taken[i], taken[j]) = (true, true);
            pairs.push([group[i], group[j]]);
        }
    }
    pairs
}

/// Which faces are to be turned so that joined faces face the same way, and which of the pairs that run the same way
/// can then be joined; a Möbius strip stays cut there.
pub(super) struct Turning {
    /// Per face whether it is turned. Of each component the larger part keeps its side.
    pub turned: Vec<bool>,
    /// The pairs to join, as half-edges of the faces before they are turned.
    pub joined: Vec<[HalfEdgeId; 2]>,
    /// The pairs that stay apart.
    pub apart: Vec<[HalfEdgeId; 2]>,
}

/// Decides which faces to turn. Near linear.
pub(super) fn turning(joints: &Joints) -> Turning {
    let (component, count) = face_components(&joints.twins);
    let mut sides = Sides::new(count);
    let of = |h: HalfEdgeId| component[h.face().index()];
    let (joined, apart): (Vec<[HalfEdgeId; 2]>, Vec<[HalfEdgeId; 2]>) = (joints.same_way.iter())
        .copied()
        .partition(|[g, h]| sides.oppose(of(*g), of(*h)));
    let mut faces = vec![0usize; count];
    component.iter().for_each(|&c| faces[c as usize] += 1);
    // Per root, the faces on its side and on the other.
    let mut weights = vec![[0usize; 2]; count];
    let found: Vec<(u32, bool)> = (0..count as u32).map(|c| sides.find(c)).collect();
    for (&(root, other), own) in found.iter().zip(&faces) {
        weights[root as usize][usize::from(other)] += own;
    }
    // On a tie the component with the lowest face keeps its side; the root is the lowest.
    let turns = |c: u32| {
        let (root, other) = found[c as usize];
        let [same, opposite] = weights[root as usize];
        other == (same >= opposite)
    };
    Turning {
        turned: component.iter().map(|&c| turns(c)).collect(),
        joined,
        apart,
    }
}

/// Components with sides: which must face opposite ways.
struct Sides {
    parent: Vec<u32>,
    /// Whether a component faces the other way than its parent.
    opposite: Vec<bool>,
}

impl Sides {
    fn new(count: usize) -> Sides {
        Sides {
            parent: (0..count as u32).collect(),
            opposite: vec![false; count],
        }
    }

    /// The root of a component, and whether it faces the other way than its root.
    fn find(&mut self, component: u32) -> (u32, bool) {
        let (mut at, mut other) = (component, false);
        while self.parent[at as usize] != at {
            let up = self.parent[at as usize];
            // Half of the path is cut at each search, so that paths stay short.
            self.opposite[at as usize] ^= self.opposite[up as usize];
            self.parent[at as usize] = self.parent[up as usize];
            other ^= self.opposite[at as usize];
            at = self.parent[at as usize];
        }
        (at, other)
    }

    /// Lets two components face opposite ways; false where they already face the same way.
    fn oppose(&mut self, one: u32, other: u32) -> bool {
        let ((a, a_other), (b, b_other)) = (self.find(one), self.find(other));
        if a == b {
            return a_other != b_other;
        }
        let (low, high) = (a.min(b), a.max(b));
        self.parent[high as usize] = low;
        self.opposite[high as usize] = a_other == b_other;
        true
    }
}

/// Per half-edge of a face its number once the face is turned.
pub(super) fn turned_half_edge(half_edge: HalfEdgeId, turned: &[bool]) -> HalfEdgeId {
    let face: FaceId = half_edge.face();
    if turned[face.index()] {
        face.half_edges()[2 - half_edge.corner()]
    } else {
        half_edge
    }
}
