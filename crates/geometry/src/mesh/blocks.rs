//! Boxes of blocks of faces: what lies near a place is found without a look at every face of a large mesh.

use rayon::prelude::*;

use super::TriMesh;
use super::bounds::Bounds;

/// Faces of a block. Faces that follow each other in a file mostly lie side by side.
const BLOCK: usize = 128;
/// Nanoseconds of work a block in a search.
const BLOCK_WORK: u64 = 10;

/// The boxes of the blocks of a mesh.
#[derive(Debug, Clone, Default)]
pub struct FaceBlocks {
    /// `None` for a block none of whose faces has a box.
    blocks: Vec<Option<Bounds>>,
    faces: usize,
}

impl FaceBlocks {
    /// The boxes of a mesh. O(faces).
    pub fn new(mesh: &TriMesh) -> FaceBlocks {
        let faces = mesh.faces.len();
        let of_block = |first: usize| {
            let faces = first..faces.min(first + BLOCK);
            let boxes = faces.filter_map(|f| Bounds::of_face(mesh, f));
            boxes.reduce(Bounds::merged)
        };
        FaceBlocks {
            blocks: (0..faces.div_ceil(BLOCK))
                .into_par_iter()
                .map(|block| of_block(BLOCK * block))
                .collect(),
            faces,
        }
    }

    /// The faces of the blocks that meet a box, ascending: all faces with finite corners that meet it, and some others.
    pub(crate) fn near<'a>(&'a self, place: &'a Bounds) -> impl Iterator<Item = usize> + 'a {
        let blocks = self.blocks.iter().enumerate();
        let meeting = blocks.filter(|(_, block)| block.is_some_and(|b| b.meets(place)));
        meeting.flat_map(|(k, _)| BLOCK * k..self.faces.min(BLOCK * (k + 1)))
    }

    /// Nanoseconds of work of a search for what is near a place.
    pub fn search_work(&self) -> u64 {
        BLOCK_WORK * self.blocks.len() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Vec3;
    use crate::mesh::shapes::sheet;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_face_that_meets_a_box_is_near_it(
            low in prop::array::uniform3(-0.2..1.0f64), size in prop::array::uniform3(0.0..0.5f64), n in 1usize..20,
        ) {
            let mesh = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.1 * (9.0 * u).sin()));
            let low = Vec3::from(low);
            let place = Bounds { low, high: low + Vec3::from(size) };
            let near: Vec<usize> = FaceBlocks::new(&mesh).near(&place).collect();
            prop_assert!(near.is_sorted());
            for face in 0..mesh.faces.len() {
                let meets = Bounds::of_face(&mesh, face).is_some_and(|b| b.meets(&place));
                prop_assert!(!meets || near.binary_search(&face).is_ok());
            }
        }
    }
}
