//! What the service is given to mend with: reads the scan, mends it, and sorts refusals by whose fault they are.

use darn::contract::{Constraints, v1};
use darn::mend::{self, MendError, Mender};
use darn::scan::{Limits, Scan, ScanError};
use darn::serve::{Class, Mended, Menders, Refusal};
use std::error::Error;
use std::time::Instant;

/// The scan of the warm-up mend: small, and whole and real.
const EXAMPLE: &[u8] = include_bytes!("../../examples/scarf_hole.glb");

/// A mender behind the service's seam.
pub struct Bridge {
    /// What mends.
    pub mender: Mender,
    /// What a scan may cost.
    pub limits: Limits,
}

impl Bridge {
    fn scan(&self, bytes: &[u8]) -> Result<Scan, Refusal> {
        Scan::read(bytes, &self.limits).map_err(|error| of_scan(&error))
    }
}

impl Menders for Bridge {
    fn inpaint(&self, scan: &[u8], constraints: &Constraints) -> Result<Mended, Refusal> {
        let started = Instant::now();
        let scan = self.scan(scan)?;
        let read = started.elapsed();
        let mended = mend::mend(&scan, constraints, &self.mender)
            .map_err(|error| of_mend(&error))?
            .with_read_time(read);
        Ok(Mended {
            bytes: mended.bytes,
            report: mended.report,
        })
    }

    fn find_holes(&self, scan: &[u8]) -> Result<v1::HolesReport, Refusal> {
        let started = Instant::now();
        let scan = self.scan(scan)?;
        let read = started.elapsed().as_secs_f64() * 1e3;
        let mut found =
            mend::find_holes(&scan, &self.mender.limits).map_err(|error| of_mend(&error))?;
        if let Some(timings) = &mut found.timings {
            timings.read = read;
            timings.total += read;
        }
        Ok(found)
    }

    fn warm_up(&self) -> Result<(), Refusal> {
        self.inpaint(EXAMPLE, &Constraints::default()).map(drop)
    }
}

/// The bytes decide between "not a scan" and "a scan that cannot be mended".
fn of_scan(error: &ScanError) -> Refusal {
    let (class, code) = match error {
        ScanError::Container { .. } => (Class::Malformed, "not_a_gltf"),
        ScanError::Invalid { .. } => (Class::Malformed, "invalid_gltf"),
        ScanError::IndexOutOfRange { .. } => (Class::Unprocessable, "index_out_of_range"),
        ScanError::NotFinite { .. } => (Class::Unprocessable, "position_not_finite"),
        ScanError::Unsupported { .. } => (Class::Unprocessable, "unsupported_extension"),
        ScanError::External { .. } => (Class::Unprocessable, "external_data"),
        ScanError::Limit { .. } => (Class::TooLarge, "scan_too_large"),
        ScanError::NoTriangles => (Class::Unprocessable, "no_triangles"),
        ScanError::Singular { .. } => (Class::Unprocessable, "singular_transform"),
        ScanError::Addition { .. } => (Class::Internal, "internal"),
    };
    Refusal {
        class,
        code,
        detail: error.to_string(),
        fields: Vec::new(),
    }
}

fn of_mend(error: &MendError) -> Refusal {
    let class = if error.is_internal() {
        Class::Internal
    } else {
        Class::Unprocessable
    };
    Refusal {
        class,
        code: error.code(),
        detail: told(error),
        fields: error.fields(),
    }
}

/// An error and its causes in one line.
fn told(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let more = cause.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        next = cause.source();
    }
    text
}
