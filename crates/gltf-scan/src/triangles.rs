//! Triangles from index lists, strips and fans.

use gltf::json::mesh::{TRIANGLE_FAN, TRIANGLE_STRIP};

/// The indices of a primitive. In strips and fans, `restart` is an index that starts a new strip or fan: glTF forbids
/// it, but exports from other formats contain it.
pub(super) struct IndexList {
    pub indices: Vec<u32>,
    pub restart: Option<u32>,
}

impl IndexList {
    /// The triangles in order, degenerate ones included. `mode` is the primitive's.
    pub fn triangles(&self, mode: u32) -> Vec<[u32; 3]> {
        let pieces = self.indices.split(|index| Some(*index) == self.restart);
        match mode {
            TRIANGLE_STRIP => pieces.flat_map(strip).collect(),
            TRIANGLE_FAN => pieces.flat_map(fan).collect(),
            _ => self.indices.as_chunks::<3>().0.to_vec(),
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
