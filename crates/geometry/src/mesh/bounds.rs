//! Axis-parallel bounding boxes of faces, and a binary tree of them, split at the median of the longest side.

use std::ops::Range;

use super::{TriMesh, Vec3};

/// Faces in a leaf, at most.
const LEAF: usize = 4;

/// An axis-parallel box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    /// Least coordinates.
    pub low: Vec3,
    /// Greatest coordinates.
    pub high: Vec3,
}

impl Bounds {
    /// The box of a face; `None` when a corner is not finite.
    pub fn of_face(mesh: &TriMesh, face: usize) -> Option<Bounds> {
        let [a, b, c] = mesh.triangle(face);
        let finite = [a, b, c].iter().all(|p| p.iter().all(|x| x.is_finite()));
        finite.then(|| Bounds {
            low: a.inf(&b).inf(&c),
            high: a.sup(&b).sup(&c),
        })
    }

    /// The box of some points; `None` without points.
    pub fn of(points: &[Vec3]) -> Option<Bounds> {
        let boxes = points.iter().map(|p| Bounds { low: *p, high: *p });
        boxes.reduce(Bounds::merged)
    }

    /// Whether a point lies in it.
    pub fn contains(&self, point: &Vec3) -> bool {
        (0..3).all(|d| self.low[d] <= point[d] && point[d] <= self.high[d])
    }

    /// Whether two boxes have a point in common.
    pub fn meets(&self, other: &Bounds) -> bool {
        (0..3).all(|d| self.low[d] <= other.high[d] && other.low[d] <= self.high[d])
    }

    /// The smallest box around both.
    pub fn merged(self, other: Bounds) -> Bounds {
        Bounds {
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
        }
    }

    /// The middle along an axis; halved first so that it cannot overflow.
    fn middle(&self, axis: usize) -> f64 {
        0.5 * self.low[axis] + 0.5 * self.high[axis]
    }
}

/// Diagonal of the box of some points; 0 without points.
pub fn diagonal(points: &[Vec3]) -> f64 {
    Bounds::of(points).map_or(0.0, |b| (b.high - b.low).norm())
}

/// A face and its box.
#[derive(Debug, Clone, Copy)]
pub(super) struct BoundedFace {
    /// The box.
    pub bounds: Bounds,
    /// The face.
    pub face: u32,
}

/// Faces in a tree of boxes.
pub(super) struct BoxTree {
    /// In preorder.
    nodes: Vec<Node>,
    /// Leaf by leaf.
    items: Vec<BoundedFace>,
}

struct Node {
    bounds: Bounds,
    /// The first node that is not below this one.
    skip: usize,
    /// The items of a leaf; empty above leaves.
    items: Range<usize>,
}

impl BoxTree {
    /// A tree of the given faces. O(n log n).
    pub fn new(mut items: Vec<BoundedFace>) -> BoxTree {
        let mut nodes = Vec::with_capacity(items.len());
        grow(&mut nodes, &mut items, 0);
        BoxTree { nodes, items }
    }

    /// The box of everything; `None` for an empty tree.
    pub fn bounds(&self) -> Option<&Bounds> {
        self.nodes.first().map(|n| &n.bounds)
    }

    /// Calls `found` with every face whose box meets the given one.
    pub fn meeting(&self, bounds: &Bounds, mut found: impl FnMut(u32)) {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !node.bounds.meets(bounds) {
                at = node.skip;
                continue;
            }
            for item in &self.items[node.items.clone()] {
                if item.bounds.meets(bounds) {
                    found(item.face);
                }
            }
            at += 1;
        }
    }
}

/// Appends the nodes of `items`, which start at `offset` among all. The recursion is log₂ n deep: each step halves
/// the items.
fn grow(nodes: &mut Vec<Node>, items: &mut [BoundedFace], offset: usize) {
    let Some(bounds) = items.iter().map(|i| i.bounds).reduce(Bounds::merged) else {
        return;
    };
    let own = nodes.len();
    let leaf = items.len() <= LEAF;
    nodes.push(Node {
        bounds,
        skip: 0,
        items: if leaf {
            offset..offset + items.len()
        } else {
            0..0
        },
    });
    if !leaf {
        let axis = (bounds.high - bounds.low).imax();
        let half = items.len() / 2;
        items.select_nth_unstable_by(half, |a, b| {
            let middles = a.bounds.middle(axis).total_cmp(&b.bounds.middle(axis));
            middles.then(a.face.cmp(&b.face))
        });
        let (left, right) = items.split_at_mut(half);
        grow(nodes, left, offset);
        grow(nodes, right, offset + half);
    }
    let end = nodes.len();
    nodes[own].skip = end;
}
