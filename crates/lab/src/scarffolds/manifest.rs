//! What is recorded of a set of sheets and of each sheet in it.

use super::scene::Scene;
use serde::{Deserialize, Serialize};

/// Version of the generator: raised whenever the same seed gives other sheets.
pub const VERSION: u32 = 2;

/// How a sheet was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SheetRecord {
    /// Its index in the tensor.
    pub index: usize,
    /// The scene that was simulated.
    pub scene: Scene,
    /// Scenes before it that were dropped for self-intersection.
    pub dropped_crossing: u32,
    /// Scenes before it that were dropped for stretch.
    pub dropped_strain: u32,
    /// Root mean square of (length / rest length − 1) over the edges along u and v.
    pub strain: f64,
}

/// The contents of `manifest.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`VERSION`] of the generator.
    pub version: u32,
    /// The seed of the whole set.
    pub seed: u64,
    /// The set in numbers.
    pub summary: SheetSetSummary,
    /// One record for each sheet, in the tensor's order.
    pub sheets: Vec<SheetRecord>,
}

/// A set of sheets in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SheetSetSummary {
    /// Sheets kept.
    pub sheets: usize,
    /// Scenes dropped for self-intersection.
    pub dropped_crossing: usize,
    /// Scenes dropped for stretch.
    pub dropped_strain: usize,
    /// Share of all simulated scenes dropped for self-intersection.
    pub crossing_share: f64,
    /// Root mean square of the sheets' strains.
    pub strain: f64,
}

impl SheetSetSummary {
    /// The summary of a set with these records.
    pub(super) fn of(records: &[SheetRecord]) -> Self {
        let crossing: usize = records.iter().map(|r| r.dropped_crossing as usize).sum();
        let strained: usize = records.iter().map(|r| r.dropped_strain as usize).sum();
        let simulated = (records.len() + crossing + strained).max(1);
        let strain2: f64 = records.iter().map(|r| r.strain * r.strain).sum();
        Self {
            sheets: records.len(),
            dropped_crossing: crossing,
            dropped_strain: strained,
            crossing_share: crossing as f64 / simulated as f64,
            strain: (strain2 / records.len().max(1) as f64).sqrt(),
        }
    }
}
