//! What the service is given to mend with: reads the scan, mends it, and sorts refusals by whose fault they are.

use darn::contract::{Constraints, Search, v1};
use darn::mend::{self, Call, MendError, Mender, Session};
use darn::scan::{Limits, Scan, ScanError};
use darn::serve::{Class, Kept, Mended, Menders, PatchForm, Patches, Refusal, Wanted};
use std::error::Error;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The scan of the warm-up mend: small, and whole and real.
const EXAMPLE: &[u8] = include_bytes!("../../examples/scarf_hole.glb");

/// A mender behind the service's seam.
pub struct Bridge {
    /// What mends; sessions share it.
    pub mender: Arc<Mender>,
    /// What a scan may cost.
    pub limits: Limits,
}

impl Bridge {
    /// A scan, and how long reading it took.
    fn scan(&self, bytes: &[u8]) -> Result<(Scan, Duration), Refusal> {
        let started = Instant::now();
        let scan = Scan::read(bytes, &self.limits).map_err(|error| of_scan(&error))?;
        Ok((scan, started.elapsed()))
    }

    fn call<'a>(&'a self, wanted: Wanted<'a>) -> Call<'a> {
        let mender = &self.mender;
        Call { mender, wanted }
    }
}

impl Menders for Bridge {
    fn inpaint(
        &self,
        scan: &[u8],
        constraints: &Constraints,
        wanted: Wanted<'_>,
    ) -> Result<Mended, Refusal> {
        let (scan, read) = self.scan(scan)?;
        let mended = mend::mend(&scan, constraints, self.call(wanted));
        mended
            .map(|m| passed(m.with_read_time(read)))
            .map_err(of_mend)
    }

    fn optimize_anchor(
        &self,
        scan: &[u8],
        search: &Search,
        wanted: Wanted<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        let (scan, _) = self.scan(scan)?;
        mend::optimize_anchor(&scan, search, self.call(wanted)).map_err(of_mend)
    }

    fn mend_to_target(
        &self,
        scan: &[u8],
        search: &Search,
        wanted: Wanted<'_>,
    ) -> Result<Mended, Refusal> {
        let (scan, read) = self.scan(scan)?;
        let mended = mend::mend_to_target(&scan, search, self.call(wanted));
        mended
            .map(|m| passed(m.with_read_time(read)))
            .map_err(of_mend)
    }

    fn open(
        &self,
        scan: &[u8],
        constraints: &Constraints,
        wanted: Wanted<'_>,
    ) -> Result<Box<dyn Kept>, Refusal> {
        let (scan, _) = self.scan(scan)?;
        let session = Session::open_while(wanted, scan, constraints, Arc::clone(&self.mender));
        Ok(Box::new(Held(session.map_err(of_mend)?)))
    }

    fn find_holes(&self, scan: &[u8]) -> Result<v1::HolesReport, Refusal> {
        let (scan, read) = self.scan(scan)?;
        let mut found = mend::find_holes(&scan, &self.mender.limits).map_err(of_mend)?;
        if let Some(timings) = &mut found.timings {
            timings.read = read.as_secs_f64() * 1e3;
            timings.total += timings.read;
        }
        Ok(found)
    }

    fn warm_up(&self) -> Result<(), Refusal> {
        self.inpaint(EXAMPLE, &Constraints::default(), &|| true)
            .map(drop)
    }
}

/// A session behind the service's seam.
struct Held(Session);

impl Kept for Held {
    fn described(&self) -> v1::Session {
        self.0.described()
    }

    fn bytes(&self) -> usize {
        self.0.bytes()
    }

    fn patches(
        &self,
        constraints: &Constraints,
        form: PatchForm,
        wanted: Wanted<'_>,
    ) -> Result<Patches, Refusal> {
        let turn = self.0.turn(wanted);
        let (bytes, report) = match form {
            PatchForm::Glb => turn.glb(constraints).map_err(of_mend)?,
            PatchForm::Positions => {
                let (positions, report) = turn.positions(constraints).map_err(of_mend)?;
                let numbers = positions.iter().flatten().flat_map(|p| [p.x, p.y, p.z]);
                let bytes = numbers.flat_map(|x| (x as f32).to_le_bytes());
                (bytes.collect(), report)
            }
        };
        Ok(Patches { bytes, report })
    }

    fn mended(&self, constraints: &Constraints, wanted: Wanted<'_>) -> Result<Mended, Refusal> {
        let mended = self.0.turn(wanted).mended(constraints);
        mended.map(passed).map_err(of_mend)
    }

    fn optimize_anchor(
        &self,
        search: &Search,
        wanted: Wanted<'_>,
    ) -> Result<v1::AnchorFound, Refusal> {
        let found = self.0.turn(wanted).optimize_anchor(search);
        found.map_err(of_mend)
    }
}

/// A mended scan in the service's words.
fn passed(mended: mend::Mended) -> Mended {
    Mended {
        bytes: mended.bytes,
        report: mended.report,
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

fn of_mend(error: MendError) -> Refusal {
    let class = if error.is_internal() {
        Class::Internal
    } else {
        Class::Unprocessable
    };
    Refusal {
        class,
        code: error.code(),
        detail: told(&error),
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
