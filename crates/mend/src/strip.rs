//! Takes everything out of a scan that darn put in.

use bytes::Bytes;
use darn_budget::Budget;
use darn_contract::port::{ScanForm, Stripped};
use darn_contract::v1;
use darn_gltf_scan::{Container, ScanLimits, stripped};

use crate::VERSION;
use crate::digests;
use crate::error::MendError;
use crate::formed_scan::{FormedScan, formed};

/// Takes everything out of a scan that darn put in: a GLB; a glTF, whose other files are not needed; or a zip, which
/// comes back in the form that is asked for.
///
/// # Errors
/// A scan that is not readable or has nothing of darn's; `Exhausted`.
pub fn strip(
    scan: impl Into<Bytes>,
    form: ScanForm,
    limits: &ScanLimits,
    budget: &Budget<'_>,
) -> Result<Stripped, MendError> {
    let found = stripped(scan, limits, budget).map_err(MendError::unreadable)?;
    let found = found.ok_or(MendError::NothingToStrip)?;
    let mut report = v1::StripReport {
        version: VERSION.to_owned(),
        exact: found.exact,
        mends: found.mends as u32,
        patches: found.marks.patches as u32,
        cuts: found.marks.cuts as u32,
        notes: found.notes,
        input: Some(digests::message(found.input)),
        output: Some(digests::message(found.output)),
    };
    let scan = match found.container {
        Container::Zip => formed(found.bytes, form, limits, budget)?,
        container => FormedScan {
            bytes: found.bytes,
            container,
            digests: None,
        },
    };
    report.output = scan.digests.or(report.output);
    budget.check_output(scan.bytes.len())?;
    Ok(Stripped {
        bytes: scan.bytes,
        media_type: scan.container.media_type(),
        report,
    })
}

#[cfg(test)]
mod tests {
    use darn_contract::{Constraints, Cut, HoleSelector};
    use darn_geometry::mesh::shapes::{holed_sheet, sheet};
    use darn_geometry::mesh::{TriMesh, Vec3};
    use darn_gltf_scan::Scan;

    use super::*;
    use crate::digests::file_digests;
    use crate::testing::{mender, scan_of};

    fn mended(scan: &[u8], constraints: &Constraints) -> Vec<u8> {
        let scan = Scan::read(scan.to_vec(), &ScanLimits::default()).unwrap();
        crate::mend(&scan, constraints, &**mender()).unwrap().bytes
    }

    fn bytes_of(mesh: &TriMesh) -> Vec<u8> {
        scan_of(mesh).write(&[]).unwrap()
    }

    fn ball(center: [f64; 3]) -> Constraints {
        let cut = Cut::Ball {
            center,
            radius: 0.07,
        };
        Constraints {
            holes: vec![HoleSelector::Cut(cut)],
            ..Constraints::default()
        }
    }

    /// A sheet with nine holes.
    fn sieve() -> TriMesh {
        let near = |x: f64| (3.0 * x).fract() - 0.5;
        let keep = |u: f64, v: f64| near(u).hypot(near(v)) > 0.2;
        sheet(36, keep, |u, v| Vec3::new(u, v, 0.02 * (7.0 * u).sin()))
    }

    #[test]
    fn stripping_undoes_mends_and_cuts_of_any_number_and_order() {
        let all = Constraints::default();
        let one = Constraints {
            holes: vec![HoleSelector::Id(2)],
            ..Constraints::default()
        };
        // Beside the holes, over a patch, and across its seam.
        let cuts = [[0.2, 0.2, 0.0], [0.5, 0.5, 0.0], [0.62, 0.5, 0.0]].map(ball);
        for (mesh, mends) in [
            (holed_sheet(24, 0.15), vec![&all]),
            (holed_sheet(24, 0.15), vec![&all, &cuts[1], &cuts[0]]),
            (holed_sheet(24, 0.15), vec![&cuts[0], &all, &cuts[2]]),
            (sieve(), vec![&one, &all]),
        ] {
            let before = bytes_of(&mesh);
            let mut bytes = before.clone();
            for constraints in &mends {
                bytes = mended(&bytes, constraints);
            }
            let form = ScanForm::AsReceived;
            let limits = ScanLimits::default();
            let found = strip(bytes, form, &limits, Budget::unlimited()).unwrap();
            assert!(found.report.exact, "{:?}", found.report);
            assert!(found.bytes == before);
            assert_eq!(found.report.mends as usize, mends.len());
            assert!(found.report.patches > 0);
            let output = found.report.output.unwrap();
            assert_eq!(output.sha256, file_digests(&before).sha256);
        }
    }

    #[test]
    fn the_holes_of_a_sieve_share_a_primitive() {
        let bytes = mended(&bytes_of(&sieve()), &Constraints::default());
        let scan = Scan::read(bytes, &ScanLimits::default()).unwrap();
        let patches = scan.parts.iter().filter(|part| part.reconstructed);
        assert_eq!(patches.count(), 1);
    }

    #[test]
    fn a_scan_that_darn_never_saw_has_nothing_to_strip() {
        let before = bytes_of(&holed_sheet(12, 0.2));
        let limits = ScanLimits::default();
        let error = strip(before, ScanForm::AsReceived, &limits, Budget::unlimited()).unwrap_err();
        assert_eq!(error.code(), darn_contract::codes::NOTHING_TO_STRIP);
    }
}
