//! From lists, strips and fans to triangles.

use gltf::json::mesh::{TRIANGLE_FAN, TRIANGLE_STRIP};

/// Indices with, in strips and fans, a value that starts anew (not allowed by glTF, but met in exports from other formats).
pub(super) struct Runs {
    pub indices: Vec<u32>,
    pub restart: Option<u32>,
}

impl Runs {
    /// The triangles in order, degenerate ones included.
    pub fn triangles(&self, mode: u32) -> Vec<[u32; 3]> {
        let runs = self.indices.split(|index| Some(*index) == self.restart);
        match mode {
            TRIANGLE_STRIP => runs.flat_map(strip).collect(),
            TRIANGLE_FAN => runs.flat_map(fan).collect(),
            _ => self.indices.as_chunks::<3>().0.to_vec(),
        }
    }
}

fn strip(run: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    run.array_windows::<3>()
        .enumerate()
        .map(|(i, &[a, b, c])| if i % 2 == 0 { [a, b, c] } else { [a, c, b] })
}

fn fan(run: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let hub = run.first().copied().unwrap_or_default();
    // glTF 2.0, 3.7.2.1: triangle i of a fan is (i + 1, i + 2, 0).
    run.get(1..)
        .unwrap_or_default()
        .array_windows::<2>()
        .map(move |&[b, c]| [b, c, hub])
}
