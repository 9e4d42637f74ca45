//! What a scene draws in place of triangles, for the refusal of a scan that has none.

use std::collections::BTreeMap;
use std::fmt;

use gltf::json::mesh::{POINTS, TRIANGLE_FAN, TRIANGLE_STRIP, TRIANGLES};

use super::error::ScanError;
use super::json::JsonPlace;

/// Extensions of primitives that hold something else than their mode says.
const SPLATS: &str = "KHR_gaussian_splatting";
const VOXELS: &str = "EXT_primitive_voxels";

/// What a primitive without triangles draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Drawn {
    Points,
    Lines,
    Splats,
    Voxels,
    NoPositions,
    Unknown,
}

/// The primitives without triangles that a scene draws.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SceneContent {
    primitives: BTreeMap<Drawn, usize>,
    /// Meshes in the file, drawn or not.
    meshes: usize,
}

impl SceneContent {
    /// Nothing drawn yet, of a file with so many meshes.
    pub(super) fn of(meshes: usize) -> Self {
        Self {
            primitives: BTreeMap::new(),
            meshes,
        }
    }

    /// Counts a primitive that draws no triangles; `mode` is its mode.
    pub(super) fn count(&mut self, primitive: &JsonPlace<'_>, mode: u32) -> Result<(), ScanError> {
        let drawn = match mode {
            _ if primitive.extension(SPLATS)?.is_some() => Drawn::Splats,
            _ if primitive.extension(VOXELS)?.is_some() => Drawn::Voxels,
            POINTS => Drawn::Points,
            1..=3 => Drawn::Lines,
            TRIANGLES | TRIANGLE_STRIP | TRIANGLE_FAN => Drawn::NoPositions,
            _ => Drawn::Unknown,
        };
        *self.primitives.entry(drawn).or_default() += 1;
        Ok(())
    }
}

impl fmt::Display for SceneContent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.primitives.is_empty() && self.meshes > 0 {
            return write!(f, "; the file has {} mesh(es) outside of it", self.meshes);
        }
        for (index, (drawn, count)) in self.primitives.iter().enumerate() {
            let what = match drawn {
                Drawn::Points => "points",
                Drawn::Lines => "lines",
                Drawn::Splats => "Gaussian splats (KHR_gaussian_splatting)",
                Drawn::Voxels => "voxels (EXT_primitive_voxels)",
                Drawn::NoPositions => "triangles without positions",
                Drawn::Unknown => "a mode that glTF does not have",
            };
            let before = if index == 0 { ", only " } else { " and " };
            write!(f, "{before}{count} primitive(s) of {what}")?;
        }
        Ok(())
    }
}
