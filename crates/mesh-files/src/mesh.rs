//! The mesh of a file.

use std::collections::HashMap;

use crate::error::MeshFileError;

/// A mesh as its file has it: the numbers of vertices, texture coordinates and normals are the file's, from 0.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FileMesh {
    /// Positions, in the file's units.
    pub positions: Vec<[f64; 3]>,
    /// Per vertex its colour, 0 to 1, as stored; empty without.
    pub colours: Vec<[f32; 4]>,
    /// Texture coordinates, v upwards.
    pub texcoords: Vec<[f64; 2]>,
    /// Normals.
    pub normals: Vec<[f64; 3]>,
    /// The triangles by material, in the order of each material's first face.
    pub groups: Vec<FaceGroup>,
}

/// The triangles of one material, in the file's order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FaceGroup {
    /// The material's name (OBJ) or number (PLY's `texnumber`).
    pub material: Option<String>,
    /// The triangles; polygons are cut into fans.
    pub faces: Vec<[Corner; 3]>,
}

/// A corner of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Corner {
    /// Index into [`FileMesh::positions`].
    pub position: u32,
    /// Index into [`FileMesh::texcoords`].
    pub texcoord: Option<u32>,
    /// Index into [`FileMesh::normals`].
    pub normal: Option<u32>,
}

impl FileMesh {
    /// The largest extent along an axis.
    pub(crate) fn extent(&self) -> f64 {
        let along = |d: usize| {
            let each = || self.positions.iter().map(|p| p[d]);
            each().fold(f64::MIN, f64::max) - each().fold(f64::MAX, f64::min)
        };
        (0..3).map(along).fold(0.0, f64::max)
    }
}

/// Largest coordinate that is read: differences of two are floats of 32 bits.
pub(crate) const LARGEST: f64 = 1e30;

/// The groups of a mesh by their materials.
pub(crate) struct Groups {
    by_material: HashMap<Option<String>, usize>,
    most: usize,
}

impl Groups {
    /// No groups yet, and at most so many.
    pub fn up_to(most: usize) -> Self {
        Groups {
            by_material: HashMap::new(),
            most,
        }
    }

    /// The index of a material's group, which is new if none has it yet.
    ///
    /// # Errors
    /// `Limit`.
    pub fn of(
        &mut self,
        material: Option<&str>,
        mesh: &mut FileMesh,
    ) -> Result<usize, MeshFileError> {
        let material = material.map(str::to_owned);
        let next = mesh.groups.len();
        let group = *self.by_material.entry(material.clone()).or_insert(next);
        if group == next {
            if next == self.most {
                return Err(MeshFileError::Limit {
                    what: "materials",
                    limit: "max_primitives",
                    allowed: self.most,
                    found: next + 1,
                });
            }
            mesh.groups.push(FaceGroup {
                material,
                faces: Vec::new(),
            });
        }
        Ok(group)
    }
}
