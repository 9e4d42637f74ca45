//! A patch as it is added to a mesh file.

/// A patch to add. Its attributes are `[points.len()]` or empty.
#[derive(Debug, Clone, Default)]
pub struct AddedPatch {
    /// Its name, for people; without line breaks.
    pub name: String,
    /// The material of the cloth around it, as [`FaceGroup`](crate::FaceGroup) names it.
    pub material: Option<String>,
    /// Its vertices.
    pub points: Vec<AddedPoint>,
    /// Unit normals.
    pub normals: Vec<[f64; 3]>,
    /// Texture coordinates, v upwards.
    pub texcoords: Vec<[f64; 2]>,
    /// Colours, 0 to 1, as the file stores them.
    pub colours: Vec<[f32; 4]>,
    /// Triangles over the points.
    pub faces: Vec<[u32; 3]>,
}

/// A vertex of a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AddedPoint {
    /// A vertex of the file, by its number.
    Old(u32),
    /// A new one.
    New([f64; 3]),
}

impl AddedPatch {
    /// Per point its number in the file, where the new ones follow on `next`; and the points that are new, by index.
    pub(crate) fn numbered(&self, next: u32) -> (Vec<u32>, Vec<usize>) {
        let mut new = Vec::new();
        let mut number = |(index, point): (usize, &AddedPoint)| match point {
            AddedPoint::Old(vertex) => *vertex,
            AddedPoint::New(_) => {
                new.push(index);
                next + new.len() as u32 - 1
            }
        };
        let numbers = self.points.iter().enumerate().map(&mut number).collect();
        (numbers, new)
    }

    /// The place of a new point.
    pub(crate) fn place(&self, index: usize) -> [f64; 3] {
        match self.points.get(index) {
            Some(AddedPoint::New(place)) => *place,
            _ => [0.0; 3],
        }
    }
}
