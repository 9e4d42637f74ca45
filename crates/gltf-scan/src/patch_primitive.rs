//! A patch as [`super::Scan::write`] takes it.

use darn_geometry::mesh::Vec3;
use serde_json::{Map, Value};

use super::patch_appearance::PatchAppearance;

/// A patch to append to the scan. Patches of the same mesh, material and attributes share a primitive.
///
/// Its attributes are those of the part whose material it takes: normals if that part has them, and, unless its appearance says
/// otherwise, as many texture coordinate and colour sets, each `[points.len()]`. On a skinned mesh its joints and weights come from the scan's
/// vertices among its points.
#[derive(Debug, Clone)]
pub struct PatchPrimitive {
    /// Index into `Scan::parts` of a part of the mesh and node that take the patch.
    pub part: usize,
    /// Index into `Scan::parts` of the part whose material is copied.
    pub material_of: usize,
    /// The patch's vertices.
    pub points: Vec<PatchPoint>,
    /// Triangles over `points`, counter-clockwise in scene space.
    pub faces: Vec<[u32; 3]>,
    /// Whether another primitive shows the patch's other side, as in scans that store each piece of cloth as two
    /// layers of triangles.
    pub both_sides: bool,
    /// Normals in scene space, `[points.len()]`, of any length except zero; not read if the part has none.
    pub normals: Vec<Vec3>,
    /// Per point the direction of +u in scene space and the handedness of the bitangent; empty unless a texture of its material needs them.
    pub tangents: Vec<[f32; 4]>,
    /// Texture coordinate sets.
    pub texcoords: Vec<Vec<[f32; 2]>>,
    /// Colour sets, linear RGBA.
    pub colors: Vec<Vec<[f32; 4]>>,
    /// How far each vertex may be off, a standard deviation in scene units, `[points.len()]`; empty where that is not known. Written as the attribute
    /// `_CONFIDENCE`.
    pub deviations: Vec<f32>,
    /// How it looks.
    pub appearance: PatchAppearance,
    /// Name of the new accessors and buffer views, if it has a primitive of its own.
    pub name: String,
    /// What is recorded about the patch alone: its entry of `holes` in `extras.darn` of its primitive.
    pub hole: Map<String, Value>,
    /// What is recorded about how it was made: members of the same `extras.darn`.
    pub method: Map<String, Value>,
}

/// Whether the extras of a primitive or a material say that it is darn's.
pub(super) fn is_reconstructed(extras: Option<&Value>) -> bool {
    extras.and_then(|extras| extras.pointer("/darn/reconstructed")) == Some(&Value::Bool(true))
}

/// A vertex of a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PatchPoint {
    /// A vertex of `Scan::surface`. Its stored position is copied bit for bit if it belongs to the node that takes the
    /// patch.
    Scan(u32),
    /// A point in scene space; it is transformed to the node's space and rounded to f32.
    New(Vec3),
}
