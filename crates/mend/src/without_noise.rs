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

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::mesh::Vec3;
    use darn_geometry::mesh::shapes::{jitter, sheet};
    use darn_geometry::patch::PatchError;

    #[test]
    fn the_cloth_with_its_noise_is_tried_last() {
        let clean = sheet(30, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
        let noisy = jitter(&clean, 0.3 / 30.0, 7);
        let crosses = || MendError::Patch {
            hole: 1,
            source: PatchError::RimCrosses,
        };
        let crosses_rim = |error: &MendError| matches!(error, MendError::Patch { .. });
        let tries = Cell::new(0);
        // Fails where noise was taken off.
        let fails_if_denoised = |scan: &TriMesh| {
            tries.set(0);
            without_noise(Budget::unlimited(), crosses_rim, |denoise| {
                tries.set(tries.get() + 1);
                match denoise(scan)? {
                    None => Ok("as scanned"),
                    Some(_) => Err(crosses()),
                }
            })
        };
        assert_eq!(fails_if_denoised(&clean).ok(), Some("as scanned"));
        assert_eq!(tries.get(), 1);
        assert_eq!(fails_if_denoised(&noisy).ok(), Some("as scanned"));
        assert_eq!(tries.get(), 2);
        let always_fails = |scan: &TriMesh, error: fn() -> MendError| {
            tries.set(0);
            without_noise(
                Budget::unlimited(),
                crosses_rim,
                |denoise| -> Result<(), MendError> {
                    tries.set(tries.get() + 1);
                    denoise(scan)?;
                    Err(error())
                },
            )
        };
        assert!(always_fails(&noisy, crosses).is_err() && tries.get() == 2);
        // A second try would not help cloth that has no noise, nor after another error.
        assert!(always_fails(&clean, crosses).is_err() && tries.get() == 1);
        let other = || MendError::NonManifold { hole: 1 };
        assert!(always_fails(&noisy, other).is_err() && tries.get() == 1);
    }
}
