//! Contacts of a garment with itself: vertices that are not near along the cloth are kept one thickness apart.
//!
//! As in `scarffolds::contacts`, pairs are searched once in a few steps, with a margin, and listed in a fixed order; here the cloth is any
//! triangle mesh, so "near along the cloth" is two edges.

use crate::scarffolds::contacts::friction_share;
use crate::scarffolds::lattice::Vec3f;

/// Near pairs of vertices, kept between two searches.
#[derive(Debug, Clone)]
pub(super) struct MeshContacts {
    thickness: f32,
    /// Pairs are listed up to this much beyond the thickness, metres.
    slack: f32,
    left: f32,
    pairs: Vec<(u32, u32)>,
    /// Per vertex the vertices within two edges, ascending.
    near: Vec<Vec<u32>>,
}

impl MeshContacts {
    /// No contacts yet.
    pub(super) fn new(vertices: usize, edges: &[[u32; 2]], thickness: f32) -> Self {
        let mut next = vec![Vec::new(); vertices];
        for &[a, b] in edges {
            next[a as usize].push(b);
            next[b as usize].push(a);
        }
        let within_two = |v: usize| {
            let mut all: Vec<u32> = next[v].clone();
            all.extend(next[v].iter().flat_map(|w| &next[*w as usize]));
            all.push(v as u32);
            all.sort_unstable();
            all.dedup();
            all
        };
        Self {
            thickness,
            slack: 0.8 * thickness,
            left: 0.0,
            pairs: Vec::new(),
            near: (0..vertices).map(within_two).collect(),
        }
    }

    /// Searches again if vertices that each moved at most `moved` metres since the last call may have used up the slack.
    pub(super) fn search_when_due(&mut self, positions: &[Vec3f], moved: f32) {
        self.left -= 2.0 * moved;
        if self.left <= 0.0 {
            self.search(positions);
        }
    }

    /// Lists the pairs that may touch before the next search.
    pub(super) fn search(&mut self, positions: &[Vec3f]) {
        self.left = self.slack;
        self.pairs.clear();
        let reach = self.thickness + self.slack;
        let cell = |p: &Vec3f| [p.x, p.y, p.z].map(|x| (x / reach).floor() as i32);
        let mut order: Vec<([i32; 3], u32)> = (positions.iter().zip(0..))
            .map(|(p, v)| (cell(p), v))
            .collect();
        order.sort_unstable();
        for (v, p) in (0u32..).zip(positions) {
            let c = cell(p);
            // Cells that follow each other along the last axis are one stretch of the sorted list.
            for n in 0..9 {
                let (x, y) = (c[0] + n % 3 - 1, c[1] + n / 3 - 1);
                let from = order.partition_point(|(k, _)| *k < [x, y, c[2] - 1]);
                let stretch = order[from..]
                    .iter()
                    .take_while(|(k, _)| *k <= [x, y, c[2] + 1]);
                for &(_, w) in stretch {
                    if w > v
                        && (positions[w as usize] - p).norm_squared() < reach * reach
                        && self.near[v as usize].binary_search(&w).is_err()
                    {
                        self.pairs.push((v, w));
                    }
                }
            }
        }
    }

    /// Pushes apart the pairs that are too close and slows their sliding. `before` holds the positions at the start of the step.
    pub(super) fn separate(
        &self,
        positions: &mut [Vec3f],
        before: &[Vec3f],
        inverse_masses: &[f32],
        friction: f32,
    ) {
        let least = self.thickness * self.thickness;
        for &(a, b) in &self.pairs {
            let (a, b) = (a as usize, b as usize);
            let d = positions[b] - positions[a];
            let near2 = d.norm_squared();
            if near2 >= least || near2 < 1.0e-14 {
                continue;
            }
            let (wa, wb) = (inverse_masses[a], inverse_masses[b]);
            if wa + wb == 0.0 {
                continue;
            }
            let near = near2.sqrt();
            let (normal, depth) = (d / near, self.thickness - near);
            let slide = (positions[b] - before[b]) - (positions[a] - before[a]);
            let slide = slide - normal * normal.dot(&slide);
            let push =
                (normal * depth - slide * friction_share(&slide, friction * depth)) / (wa + wb);
            positions[a] -= push * wa;
            positions[b] += push * wb;
        }
    }
}
