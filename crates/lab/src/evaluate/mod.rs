//! Evaluation: fills of held-out samples and mends of whole scans, measured against the known truth.
//!
//! [`run`] measures a network beside smooth fills and the truth on cases from [`draw`]; [`over_scans`] and
//! [`over_garments`] measure scans and garments mended end to end; [`over_worn_garments`] counts what a list of loops takes for holes;
//! [`cell_errors`] measures errors beside what the network's answers show of them, and [`calibrated`] fits the weights' error model to them;
//! [`of_samples`] and [`of_flattened`] compare the holes of training samples with those of flattened scans. The network and the mender are
//! functions that the caller passes in, sheets come from the caller, and results are values: no files, no training, no HTTP.

mod alternative_fills;
mod cases;
mod cell_errors;
mod charts;
mod error;
mod garment_rows;
mod grid_shares;
mod hole_kind;
mod metrics;
mod patched;
mod report;
mod scan_rows;
mod shaded_views;
mod surface_distance;
mod sweep;
mod wear;
mod worn_garments;

#[cfg(test)]
mod tests;

pub use alternative_fills::{
    AlternativeFills, AlternativesFunction, alternative_fills, alternatives_table,
};
pub use cases::{EvaluationCase, HoleSize, draw};
pub use cell_errors::{
    CalibrationSets, CellError, ErrorCoverage, calibrated, cell_errors, coverage, coverage_table,
};
pub use charts::picture;
pub use error::EvaluateError;
pub use garment_rows::{
    AskedHole, GarmentMender, GarmentReport, GarmentRow, ListFunction, ListedLoop, OpeningRow,
    over_garments,
};
pub use grid_shares::{GridShares, of_flattened, of_samples};
pub use hole_kind::HoleKind;
pub use metrics::FillMetrics;
pub use report::{AngleDefects, EvaluationReport, EvaluationRow, EvaluationStage, FillMethod};
pub use scan_rows::{
    MendFunction, ScanMetrics, ScanRow, SyntheticScanOptions, over_scans, scan_table,
};
pub use sweep::{EvaluationPlan, FillFunction, run};
pub use worn_garments::{WornRow, over_worn_garments, worn_table};
