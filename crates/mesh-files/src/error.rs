//! Why a mesh file could not be read.

use darn_budget::Exhausted;

/// Why a mesh file could not be read. Lines are counted from 1.
#[derive(Debug, thiserror::Error)]
pub enum MeshFileError {
    /// A line of text breaks a rule of the format.
    #[error("line {line}: {detail}")]
    Line {
        /// The line.
        line: usize,
        /// What is wrong there.
        detail: String,
    },
    /// The file ends before all of its elements are there.
    #[error("the file ends in its element {element:?}: row {row} of {rows} is not complete")]
    Truncated {
        /// The element's name in the header.
        element: String,
        /// The row that is not complete, from 0.
        row: usize,
        /// How many rows the header declares.
        rows: usize,
    },
    /// A row of a binary element has a value that cannot be.
    #[error("row {row} of the element {element:?}: {detail}")]
    Row {
        /// The element's name in the header.
        element: String,
        /// The row, from 0.
        row: usize,
        /// What is wrong there.
        detail: String,
    },
    /// The file has more of something than is read.
    #[error("the file has {found} {what}; the limit {limit} = {allowed}")]
    Limit {
        /// What there is too much of.
        what: &'static str,
        /// The limit's name.
        limit: &'static str,
        /// The limit's value.
        allowed: usize,
        /// How much there is, or a lower bound.
        found: usize,
    },
    /// The request's budget is exhausted.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
}

impl MeshFileError {
    pub(crate) fn line(line: usize, detail: impl Into<String>) -> Self {
        MeshFileError::Line {
            line,
            detail: detail.into(),
        }
    }
}
