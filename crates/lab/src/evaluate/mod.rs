//! What fills are worth: held-out samples, simple fills to compare with, measures, tables, curves; and whether training masks are like real ones.
//! A fill is any function from grids to positions; this room does not know the network, and what it measures is a pure function of its input.
//! No files, no training, no HTTP: sheets come from the caller, and tables go back to it.

mod cases;
mod masks;
mod measure;
mod patched;
mod picture;
mod report;
mod scans;
mod sweep;

#[cfg(test)]
mod tests;

pub use cases::{Case, Size, draw};
pub use masks::{Cut, Shares, of_flattened, of_samples};
pub use measure::{Measured, Measures, measure};
pub use patched::patched;
pub use picture::picture;
pub use report::{Fill, Report, Row, Stage};
pub use scans::{Mend, ScanRow, Scanner, over_scans, scan_table};
pub use sweep::{Plan, run};

use darn_geometry::grid::NormalGrid;

/// Fills grids in the network's units: one list of positions for each grid, all cells.
pub type Filler<'a> =
    &'a (dyn Fn(&[NormalGrid]) -> Result<Vec<Vec<[f32; 3]>>, EvaluateError> + Sync);

/// Why nothing could be measured.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    #[error("the {fill} system of sample {sample} cannot be solved")]
    Singular { fill: &'static str, sample: usize },
    #[error("sample {sample} has too little known cloth")]
    TooLittleKnown { sample: usize },
    #[error("the network: {0}")]
    Filler(Box<dyn std::error::Error + Send + Sync>),
    #[error("a scan: {0}")]
    Mender(Box<dyn std::error::Error + Send + Sync>),
    #[error("there is nothing to measure: {0}")]
    Nothing(&'static str),
}
