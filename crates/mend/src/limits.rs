//! The limits and options of a mend.

use darn_geometry::flatten::FlattenLimits;
use darn_geometry::patch::PatchOptions;
use darn_texture::Settings as TextureSettings;

use crate::edit::SearchOptions;

/// The limits and options of a mend.
#[derive(Debug, Clone, PartialEq)]
pub struct MendLimits {
    /// When a chart is refused.
    pub flatten: FlattenLimits,
    /// How a patch is made.
    pub patch: PatchOptions,
    /// How the network is asked for cloth that constraints moved.
    pub edited_fill: EditedFill,
    /// How far an anchor search goes.
    pub search: SearchOptions,
    /// Cells that an anchor search compares before its descents start.
    pub seeds: usize,
    /// Most holes of one request. All their charts, grids and patches are in memory together, about 0.7 MB each: the budget's
    /// memory ends larger requests earlier.
    pub holes: usize,
    /// Limits of the images of a patch's own.
    pub texture: TextureSettings,
}

impl Default for MendLimits {
    fn default() -> Self {
        MendLimits {
            flatten: FlattenLimits::default(),
            patch: PatchOptions::default(),
            edited_fill: EditedFill::default(),
            search: SearchOptions::default(),
            seeds: 16,
            holes: 10_000,
            texture: TextureSettings::default(),
        }
    }
}

/// How the network is asked for cloth that constraints moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EditedFill {
    /// The cloth is the network's answer to the grid with the moved cells marked as known.
    Plain,
    /// The cloth is the unedited cloth plus a difference: the network's answer to the moved cells minus its answer to
    /// the same cells unmoved. To mark a cell as known changes the answer a little by itself, which no constraint asked
    /// for.
    #[default]
    Difference,
}
