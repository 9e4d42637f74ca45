//! The mesh of a file.

use std::collections::HashMap;

use crate::MeshFileLimits;
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

/// A mesh that is read, within its limits.
pub(crate) struct MeshBuilder {
    /// The mesh so far.
    pub mesh: FileMesh,
    limits: MeshFileLimits,
    /// Triangles so far.
    faces: usize,
    group_of: HashMap<Option<String>, usize>,
    /// The group of the last polygon: mostly that of the next one, too.
    last_group: usize,
}

impl MeshBuilder {
    /// Nothing read yet.
    pub fn new(limits: MeshFileLimits) -> Self {
        MeshBuilder {
            mesh: FileMesh::default(),
            limits,
            faces: 0,
            group_of: HashMap::new(),
            last_group: 0,
        }
    }

    /// Checks a number of vertices.
    ///
    /// # Errors
    /// `Limit`.
    pub fn check_vertices(&self, found: usize) -> Result<(), MeshFileError> {
        limited("vertices", "max_vertices", self.limits.max_vertices, found)
    }

    /// The fewest corners of a polygon that there is no room for any more.
    pub fn too_many_corners(&self) -> usize {
        (self.limits.max_faces - self.faces).saturating_add(3)
    }

    /// Counts the triangles of a polygon of so many corners; there are none of fewer than three.
    ///
    /// # Errors
    /// `Limit`.
    pub fn count_polygon(&mut self, corners: usize) -> Result<(), MeshFileError> {
        self.faces += corners.saturating_sub(2);
        limited("triangles", "max_faces", self.limits.max_faces, self.faces)
    }

    /// Adds the triangles of a polygon that was counted, as a fan.
    ///
    /// # Errors
    /// `Limit` for a material too many.
    pub fn push_polygon(
        &mut self,
        material: Option<&str>,
        corners: &[Corner],
    ) -> Result<(), MeshFileError> {
        let [first, rest @ ..] = corners else {
            return Ok(());
        };
        if rest.len() < 2 {
            return Ok(());
        }
        let group = self.group(material)?;
        let fan = rest.windows(2).map(|pair| [*first, pair[0], pair[1]]);
        self.mesh.groups[group].faces.extend(fan);
        Ok(())
    }

    /// The index of a material's group, which is new if none has it yet.
    fn group(&mut self, material: Option<&str>) -> Result<usize, MeshFileError> {
        let last = self.mesh.groups.get(self.last_group);
        if last.is_some_and(|group| group.material.as_deref() == material) {
            return Ok(self.last_group);
        }
        let material = material.map(str::to_owned);
        let next = self.mesh.groups.len();
        let group = *self.group_of.entry(material.clone()).or_insert(next);
        if group == next {
            limited(
                "materials",
                "max_primitives",
                self.limits.max_materials,
                next + 1,
            )?;
            self.mesh.groups.push(FaceGroup {
                material,
                faces: Vec::new(),
            });
        }
        self.last_group = group;
        Ok(group)
    }
}

fn limited(
    what: &'static str,
    limit: &'static str,
    allowed: usize,
    found: usize,
) -> Result<(), MeshFileError> {
    if found <= allowed {
        return Ok(());
    }
    Err(MeshFileError::Limit {
        what,
        limit,
        allowed,
        found,
    })
}
