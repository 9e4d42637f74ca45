//! What a request adds to a scan, and how it is written.

use std::time::Instant;

use crate::digests;
use crate::error::MendError;
use crate::mender::Call;
use crate::timings::milliseconds;
use darn_contract::port::{Mended, NewFile};
use darn_contract::{Constraints, PatchBuffer, TextureChoice, v1};
use darn_gltf_scan::{PatchPrimitive, Scan};

/// How patches are coloured and stored.
#[derive(Debug, Clone, Copy, Default)]
pub struct PatchChoices {
    /// Where their colours come from.
    pub texture: Option<TextureChoice>,
    /// Where they go.
    pub buffer: PatchBuffer,
}

impl From<&Constraints> for PatchChoices {
    fn from(asked: &Constraints) -> Self {
        Self {
            texture: asked.texture,
            buffer: asked.patch_buffer,
        }
    }
}

/// What a request adds to a scan.
pub struct ScanAdditions {
    /// The patches, in order of id.
    pub primitives: Vec<PatchPrimitive>,
    /// The report, without what writing adds.
    pub report: v1::Report,
}

impl ScanAdditions {
    /// The mended scan; `seen` is the scan without what the request cut out.
    ///
    /// # Errors
    /// When the patches cannot be written; `Exhausted`.
    pub fn written(
        mut self,
        scan: &Scan,
        seen: &Scan,
        buffer: PatchBuffer,
        call: Call,
    ) -> Result<Mended, MendError> {
        let started = Instant::now();
        call.budget.begin("writing", 0);
        let buffer = match buffer {
            PatchBuffer::Data => darn_gltf_scan::PatchBuffer::DataUri,
            PatchBuffer::File => darn_gltf_scan::PatchBuffer::File,
        };
        let written = seen.write_within(&self.primitives, buffer, call.budget)?;
        self.report.input = Some(digests::message(scan.digests().clone()));
        self.report.output = Some(digests::message(written.digests));
        if let Some(timings) = &mut self.report.timings {
            timings.write = milliseconds(started);
            timings.total += timings.write;
        }
        Ok(Mended {
            bytes: written.bytes,
            media_type: scan.container().media_type(),
            report: self.report,
            file: written.file.map(|file| NewFile {
                path: file.path,
                bytes: file.bytes,
            }),
        })
    }
}
