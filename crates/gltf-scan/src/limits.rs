//! The limits of a scan's size, and the check that names them.

use super::error::ScanError;

/// The largest scan that is read. Every refusal names the field and its value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScanLimits {
    /// Vertices of all drawn primitives together, instances counted.
    pub max_vertices: usize,
    /// Triangles of all drawn primitives together; instances and degenerate triangles count.
    pub max_faces: usize,
    /// Nodes of the default scene.
    pub max_nodes: usize,
    /// Primitives of all drawn meshes together; instances, points and lines count.
    pub max_primitives: usize,
    /// Numbers in all vertex attributes except positions together.
    pub max_attribute_values: usize,
    /// Sets of one primitive: of texture coordinates, of colours, and of joints with weights, each.
    pub max_attribute_sets: usize,
    /// Morph targets of one primitive; every patch of its mesh gets as many.
    pub max_morph_targets: usize,
    /// Bytes that the compressed streams of a scan decode to together.
    pub max_decoded_bytes: usize,
    /// Texels of one image that is decoded for the texture of a patch.
    pub max_image_texels: usize,
    /// Values in the JSON, keys included; an upper estimate, made before they are parsed.
    pub max_json_values: usize,
}

impl Default for ScanLimits {
    fn default() -> Self {
        Self {
            max_vertices: 6_000_000,
            max_faces: 10_000_000,
            max_nodes: 100_000,
            max_primitives: 10_000,
            max_attribute_values: 64_000_000,
            max_attribute_sets: 16,
            max_morph_targets: 1024,
            max_decoded_bytes: 1 << 29,
            max_image_texels: 1 << 27,
            max_json_values: 1_000_000,
        }
    }
}

/// One limit: a field of [`ScanLimits`] and its value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit {
    pub name: &'static str,
    pub allowed: usize,
}

impl Limit {
    /// Refuses a count above the limit; `pointer` is the JSON pointer of the place that exceeds it.
    pub fn check(self, found: usize, pointer: &str) -> Result<(), ScanError> {
        if found <= self.allowed {
            return Ok(());
        }
        Err(ScanError::Limit {
            pointer: pointer.into(),
            limit: self.name,
            allowed: self.allowed,
            found,
        })
    }
}
