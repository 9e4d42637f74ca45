//! Bounding boxes of faces in a binary tree, split at the median of the longest side.

use super::{TriMesh, Vec3};

/// Faces in a leaf, at most.
const LEAF: usize = 4;

/// An axis-parallel box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    /// Least coordinates.
    pub low: Vec3,
    /// Largest coordinates.
    pub high: Vec3,
}

impl Bounds {
    /// The box of a face; `None` when a corner is not finite.
    pub(crate) fn of(mesh: &TriMesh, face: u32) -> Option<Bounds> {
        let [a, b, c] = mesh.triangle(face as usize);
        let finite = [a, b, c].iter().all(|p| p.iter().all(|x| x.is_finite()));
        finite.then(|| Bounds {
            low: a.inf(&b).inf(&c),
            high: a.sup(&b).sup(&c),
        })
    }

    /// Whether two boxes have a point in common.
    pub(crate) fn meets(&self, other: &Bounds) -> bool {
        (0..3).all(|d| self.low[d] <= other.high[d] && other.low[d] <= self.high[d])
    }

    /// The box around two boxes.
    pub(crate) fn merged(self, other: Bounds) -> Bounds {
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

/// Boxes and what is in them, in a tree.
pub(super) struct Tree {
    /// In preorder.
    nodes: Vec<Node>,
    /// Leaf by leaf.
    items: Vec<(Bounds, u32)>,
}

struct Node {
    bounds: Bounds,
    /// The first node that is not below this one.
    skip: usize,
    /// The items of a leaf; empty above leaves.
    items: (usize, usize),
}

impl Tree {
    /// A tree of the given boxes. O(n log n).
    pub(super) fn new(mut items: Vec<(Bounds, u32)>) -> Tree {
        let mut nodes = Vec::with_capacity(items.len());
        grow(&mut nodes, &mut items, 0);
        Tree { nodes, items }
    }

    /// The box of everything; `None` for an empty tree.
    pub(super) fn bounds(&self) -> Option<&Bounds> {
        self.nodes.first().map(|n| &n.bounds)
    }

    /// Calls `found` with every face whose box meets the given one.
    pub(super) fn meeting(&self, bounds: &Bounds, mut found: impl FnMut(u32)) {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !node.bounds.meets(bounds) {
                at = node.skip;
                continue;
            }
            let (first, end) = node.items;
            for (own, face) in &self.items[first..end] {
                if own.meets(bounds) {
                    found(*face);
                }
            }
            at += 1;
        }
    }
}

/// Appends the nodes of `items`, which start at `offset` among all; recursion is as deep as the tree, which halving keeps flat.
fn grow(nodes: &mut Vec<Node>, items: &mut [(Bounds, u32)], offset: usize) {
    let Some(bounds) = items.iter().map(|i| i.0).reduce(Bounds::merged) else {
        return;
    };
    let own = nodes.len();
    let leaf = items.len() <= LEAF;
    nodes.push(Node {
        bounds,
        skip: 0,
        items: if leaf {
            (offset, offset + items.len())
        } else {
            (0, 0)
        },
    });
    if !leaf {
        let axis = (bounds.high - bounds.low).imax();
        let half = items.len() / 2;
        let middle = |item: &(Bounds, u32)| (item.0.middle(axis), item.1);
        items.select_nth_unstable_by(half, |a, b| {
            let (a, b) = (middle(a), middle(b));
            a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
        });
        let (left, right) = items.split_at_mut(half);
        grow(nodes, left, offset);
        grow(nodes, right, offset + half);
    }
    let end = nodes.len();
    nodes[own].skip = end;
}
