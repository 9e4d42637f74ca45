//! Reads OBJ and PLY meshes, and writes them back with patches added and nothing else changed.
//!
//! Both are read by hand, as no library keeps what is needed to write the same bytes again: the vertices' own numbers, and the
//! properties that no reader knows. A patch is added behind what is there: to an OBJ as a block of lines at its end, to a PLY as
//! rows at the end of its vertices and faces, named in a comment. [`without_patches`] takes both out again, to the byte.
//!
//! OBJ (Wavefront, Appendix B1): `v` with or without colours, `vt`, `vn`, `f` with polygons and relative indices, `usemtl`;
//! everything else is left as it is. PLY (Turk 1994): ASCII and both binary byte orders, any elements and properties; the faces'
//! `vertex_indices`, and texture coordinates of vertices or of faces' corners.
//!
//! The crate opens no file, and asks the [`Budget`] as it reads.

mod added;
mod error;
#[cfg(test)]
mod laws;
mod mesh;
mod mtl;
mod obj;
mod ply;
mod ply_header;
mod ply_rows;
mod ply_write;
mod text;

use bytes::Bytes;
use darn_budget::Budget;

pub use added::{AddedPatch, AddedPoint};
pub use error::MeshFileError;
pub use mesh::{Corner, FaceGroup, FileMesh};
pub use mtl::{material_images, material_libraries};

use obj::ObjFile;
use ply::PlyFile;

/// A format of mesh files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// The Polygon File Format.
    Ply,
}

impl MeshFormat {
    /// The format of a file by its first bytes; `None` if it is neither.
    pub fn of(bytes: &[u8]) -> Option<MeshFormat> {
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            return Some(MeshFormat::Ply);
        }
        obj::looks_like_one(bytes).then_some(MeshFormat::Obj)
    }

    /// The media type. That of OBJ is registered; PLY has none, so that this is the one that programs use.
    pub fn media_type(self) -> &'static str {
        match self {
            MeshFormat::Obj => "model/obj",
            MeshFormat::Ply => "model/ply",
        }
    }
}

/// The largest mesh that is read.
#[derive(Debug, Clone, Copy)]
pub struct MeshFileLimits {
    /// Vertices.
    pub max_vertices: usize,
    /// Triangles; a polygon counts as the triangles that it is cut into.
    pub max_faces: usize,
    /// Materials.
    pub max_materials: usize,
}

/// A mesh file that was read.
#[derive(Debug, Clone)]
pub struct MeshFile {
    mesh: FileMesh,
    layout: Layout,
}

#[derive(Debug, Clone)]
enum Layout {
    Obj(ObjFile),
    Ply(Box<PlyFile>),
}

impl MeshFile {
    /// Reads a mesh file.
    ///
    /// # Errors
    /// See [`MeshFileError`]. A mesh without faces is no error here.
    pub fn read(
        bytes: Bytes,
        format: MeshFormat,
        limits: MeshFileLimits,
        budget: &Budget<'_>,
    ) -> Result<MeshFile, MeshFileError> {
        Ok(match format {
            MeshFormat::Obj => {
                let (mesh, file) = obj::read(bytes, limits, budget)?;
                MeshFile {
                    mesh,
                    layout: Layout::Obj(file),
                }
            }
            MeshFormat::Ply => {
                let (mesh, file) = ply::read(bytes, limits, budget)?;
                MeshFile {
                    mesh,
                    layout: Layout::Ply(file.into()),
                }
            }
        })
    }

    /// The mesh.
    pub fn mesh(&self) -> &FileMesh {
        &self.mesh
    }

    /// The file as it was read.
    pub fn bytes(&self) -> &Bytes {
        match &self.layout {
            Layout::Obj(file) => &file.bytes,
            Layout::Ply(file) => &file.bytes,
        }
    }

    /// Its format.
    pub fn format(&self) -> MeshFormat {
        match self.layout {
            Layout::Obj(_) => MeshFormat::Obj,
            Layout::Ply(_) => MeshFormat::Ply,
        }
    }

    /// The file with patches added; without patches the bytes that were read. `sha256` is the digest of the file as it was
    /// read, which goes into the mark of the patches.
    pub fn with_patches(&self, patches: &[AddedPatch], sha256: &str) -> Vec<u8> {
        if patches.is_empty() {
            return self.bytes().to_vec();
        }
        match &self.layout {
            Layout::Obj(file) => file.with_patches(&self.mesh, patches, sha256),
            Layout::Ply(file) => file.with_patches(&self.mesh, patches, sha256),
        }
    }
}

/// A file without the patches of its last mend.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unpatched {
    /// The file.
    pub bytes: Vec<u8>,
    /// How many patches it had.
    pub patches: usize,
    /// The digest that the file had before that mend: if these bytes have another one, something else was changed, too.
    pub sha256: String,
}

/// A file without the patches of its last mend; `None` if it has none, or was changed behind them.
pub fn without_patches(bytes: &[u8], format: MeshFormat) -> Option<Unpatched> {
    match format {
        MeshFormat::Obj => obj::without_patches(bytes),
        MeshFormat::Ply => ply_write::without_patches(bytes),
    }
}
