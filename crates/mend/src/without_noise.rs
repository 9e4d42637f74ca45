//! Prepares cloth without the scanner's noise, and with it where that fails.

use std::cell::Cell;

use crate::error::MendError;
use darn_budget::{Budget, Exhausted};
use darn_geometry::mesh::TriMesh;
use darn_geometry::mesh::denoise::denoise;

/// Takes the scanner's noise off a mesh; `None` where it has none, or where the noise is to stay.
pub type Denoise<'a> = &'a dyn Fn(&TriMesh) -> Result<Option<TriMesh>, Exhausted>;

/// The result for the cloth without the scanner's noise; where that fails with an error that other cloth may not have, for the
/// cloth as it was scanned.
pub fn without_noise<T>(
    budget: &Budget,
    may_differ: impl Fn(&MendError) -> bool,
    attempt: impl Fn(Denoise) -> Result<T, MendError>,
) -> Result<T, MendError> {
    let noisy = Cell::new(false);
    let denoise = |mesh: &TriMesh| {
        let smooth = denoise(mesh, budget)?;
        noisy.set(noisy.get() || smooth.is_some());
        Ok(smooth)
    };
    match attempt(&denoise) {
        Err(error) if noisy.get() && may_differ(&error) => {
            attempt(&|_| Ok(None)).map_err(|_| error)
        }
        outcome => outcome,
    }
}
