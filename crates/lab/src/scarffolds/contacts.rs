//! Contacts of the sheet with itself.
//!
//! Every vertex is a ball; the balls of vertices that are not neighbours are kept one fabric thickness apart. With a thickness above the
//! circumradius of half a cell (0.71 spacings) a vertex cannot pass through the middle of a cell. Pairs are searched once in a few steps,
//! with a margin. They are listed by index, so the order of corrections is fixed.

use super::field::{InverseMasses, VertexField, inverse_mass, slot};
use super::lattice::{SIDE, SPACING, VERTICES, Vec3f};

/// Near pairs of vertices, kept between two searches.
#[derive(Debug, Clone)]
pub(super) struct SelfContacts {
    thickness: f32,
    /// Slots of the two vertices.
    pairs: Vec<(u32, u32)>,
    /// By bucket: its last vertex.
    head: Vec<u32>,
    /// By vertex: the one before it in the same bucket.
    next: Vec<u32>,
    /// How much closer two vertices may still come before a pair is missed, metres.
    slack: f32,
}

const BUCKETS: usize = 8192;
const NONE: u32 = u32::MAX;
/// Pairs are listed up to this much beyond the thickness, metres.
const SLACK: f32 = 0.8 * SPACING;

impl SelfContacts {
    /// No contacts yet, for layers of `thickness` metres.
    pub(super) fn new(thickness: f32) -> Self {
        Self {
            thickness,
            pairs: Vec::new(),
            head: vec![NONE; BUCKETS],
            next: vec![NONE; VERTICES],
            slack: 0.0,
        }
    }

    /// Searches again if vertices, each moved by at most `moved` metres along an axis since the last call, may have used up the slack.
    pub(super) fn search_when_due(&mut self, positions: &VertexField, moved: f32) {
        self.slack -= 2.0 * moved;
        if self.slack <= 0.0 {
            self.search(positions);
        }
    }

    /// Lists the pairs that may touch before the next search.
    pub(super) fn search(&mut self, positions: &VertexField) {
        let reach = self.thickness + SLACK;
        let scale = 1.0 / reach;
        let cell = |p: &Vec3f| [p.x, p.y, p.z].map(|x| (x * scale).floor() as i32);
        self.slack = SLACK;
        self.pairs.clear();
        self.head.fill(NONE);
        let points = positions.points();
        for (k, p) in points.iter().enumerate() {
            let c = cell(p);
            let mut seen = [NONE; 27];
            let mut count = 0;
            for n in 0..27 {
                let b = bucket([c[0] + n % 3 - 1, c[1] + n / 3 % 3 - 1, c[2] + n / 9 - 1]);
                let mut other = self.head[b];
                if other == NONE || seen[..count].contains(&(b as u32)) {
                    continue; // Two cells may share a bucket: its list is read once.
                }
                seen[count] = b as u32;
                count += 1;
                while other != NONE {
                    let o = other as usize;
                    if (points[o] - p).norm_squared() < reach * reach && !neighbours(o, k) {
                        self.pairs.push((slot(o) as u32, slot(k) as u32));
                    }
                    other = self.next[o];
                }
            }
            let own = bucket(c);
            self.next[k] = self.head[own];
            self.head[own] = k as u32;
        }
    }

    /// Pushes apart the pairs that are too close and slows their sliding. `before` holds the positions at the start of the step.
    pub(super) fn separate(
        &self,
        positions: &mut VertexField,
        before: &VertexField,
        masses: &InverseMasses,
        friction: f32,
    ) {
        let least = self.thickness * self.thickness;
        for &(a, b) in &self.pairs {
            let (a, b) = (a as usize, b as usize);
            let (pa, pb) = (positions.at(a), positions.at(b));
            let d = pb - pa;
            let near2 = d.norm_squared();
            if near2 >= least || near2 < 1.0e-14 {
                continue;
            }
            let (wa, wb) = (inverse_mass(masses, a), inverse_mass(masses, b));
            let near = near2.sqrt();
            let depth = self.thickness - near;
            let normal = d * (1.0 / near);
            let slide = (pb - before.at(b)) - (pa - before.at(a));
            let slide = slide - normal * normal.dot(&slide);
            let push = (normal * depth - slide * friction_share(&slide, friction * depth))
                * (1.0 / (wa + wb).max(1.0e-6));
            positions.set(a, &(pa - push * wa));
            positions.set(b, &(pb + push * wb));
        }
    }
}

/// The share of a slide that friction takes back, when it may take back `most` metres.
pub(crate) fn friction_share(slide: &Vec3f, most: f32) -> f32 {
    let far = slide.norm_squared().sqrt();
    if far > 1.0e-9 {
        (most / far).min(1.0)
    } else {
        0.0
    }
}

/// Hash of a cell in space.
fn bucket(cell: [i32; 3]) -> usize {
    let h = (cell[0] as u32).wrapping_mul(73_856_093)
        ^ (cell[1] as u32).wrapping_mul(19_349_663)
        ^ (cell[2] as u32).wrapping_mul(83_492_791);
    (h ^ (h >> 13)) as usize % BUCKETS
}

fn neighbours(a: usize, b: usize) -> bool {
    let near = |p: usize, q: usize| p.abs_diff(q) <= 1;
    near(a % SIDE, b % SIDE) && near(a / SIDE, b / SIDE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn point(range: f32) -> impl Strategy<Value = Vec3f> {
        proptest::array::uniform3(-range..range).prop_map(Vec3f::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

        #[test]
        fn the_search_finds_every_near_pair_once(points in proptest::collection::vec(point(0.15), VERTICES)) {
            let mut contacts = SelfContacts::new(0.8 * SPACING);
            contacts.search(&VertexField::from_points(&points));
            let found: BTreeSet<(u32, u32)> = contacts.pairs.iter().copied().collect();
            prop_assert_eq!(found.len(), contacts.pairs.len());
            let reach = 0.8 * SPACING * 0.999;
            for b in (0..VERTICES).step_by(17) {
                for a in 0..b {
                    let near = (points[a] - points[b]).norm() < reach && !neighbours(a, b);
                    prop_assert!(!near || found.contains(&(slot(a) as u32, slot(b) as u32)));
                }
            }
        }
    }
}
