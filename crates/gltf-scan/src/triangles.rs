//! Triangles from index lists, strips and fans.

use gltf::json::mesh::{TRIANGLE_FAN, TRIANGLE_STRIP};

/// The indices of a primitive. In strips and fans, `restart` is an index that starts a new strip or fan: glTF forbids
/// it, but exports from other formats contain it.
pub(super) struct IndexList {
    /// The indices by threes; after the last of them come zeros.
    triples: Vec<[u32; 3]>,
    count: usize,
    pub restart: Option<u32>,
}

impl IndexList {
    /// So many zeros, without a restart.
    pub fn zeros(count: usize) -> Self {
        Self {
            triples: vec![[0; 3]; count.div_ceil(3)],
            count,
            restart: None,
        }
    }

    /// 0, 1, 2, …, so many, without a restart.
    pub fn counting(count: usize) -> Self {
        let mut list = Self::zeros(count);
        let slots = list.indices_mut().iter_mut();
        slots.zip(0..).for_each(|(slot, index)| *slot = index);
        list
    }

    /// The indices.
    pub fn indices(&self) -> &[u32] {
        &self.triples.as_flattened()[..self.count]
    }

    /// The indices, to be set.
    pub fn indices_mut(&mut self) -> &mut [u32] {
        &mut self.triples.as_flattened_mut()[..self.count]
    }

    /// The triangles in order, degenerate ones included. `mode` is the primitive's.
    pub fn triangles(mut self, mode: u32) -> Vec<[u32; 3]> {
        let pieces = (self.indices()).split(|index| Some(*index) == self.restart);
        match mode {
            TRIANGLE_STRIP => pieces.flat_map(strip).collect(),
            TRIANGLE_FAN => pieces.flat_map(fan).collect(),
            _ => {
                self.triples.truncate(self.count / 3);
                self.triples
            }
        }
    }
}

fn strip(indices: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    indices
        .array_windows::<3>()
        .enumerate()
        .map(|(i, &[a, b, c])| if i % 2 == 0 { [a, b, c] } else { [a, c, b] })
}

fn fan(indices: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let hub = indices.first().copied().unwrap_or_default();
    // glTF 2.0, 3.7.2.1: triangle i of a fan is (i + 1, i + 2, 0).
    indices
        .get(1..)
        .unwrap_or_default()
        .array_windows::<2>()
        .map(move |&[b, c]| [b, c, hub])
}
