//! Why a scan could not be mended, and the code of each reason: a stable word for programs.

use darn_contract::{FieldError, v1};
use darn_geometry::flatten::FlattenError;
use darn_geometry::mesh::region::RegionError;
use darn_geometry::patch::PatchError;
use darn_gltf_scan::ScanError;
use darn_net::NetError;

/// Why a scan could not be mended.
#[derive(Debug, thiserror::Error)]
pub enum MendError {
    /// The bytes could not be read as a scan.
    #[error(transparent)]
    Unreadable(ScanError),
    /// Constraints that do not fit this scan.
    #[error("{} constraint(s) do not fit this scan: {}", .0.len(), listed(.0))]
    Constraints(Vec<FieldError>),
    /// Hard anchors that the cloth does not meet.
    #[error("{} anchor(s) cannot be met: {}", .0.len(), listed(.0))]
    OutOfReach(Vec<FieldError>),
    /// The scan has no hole to fill.
    #[error("the scan has no hole to fill{}", reasons(.skipped))]
    NoHoles {
        /// Its loops, and why each is left as it is.
        skipped: Vec<v1::Skipped>,
    },
    /// The request asks for more holes than are filled at once.
    #[error(
        "{found} holes are to be filled, and at most {limit} are at once; choose among them by `holes`"
    )]
    TooManyHoles {
        /// How many holes the request asks for.
        found: usize,
        /// How many are filled at once.
        limit: usize,
    },
    /// The hole's rim runs through an edge that more than two triangles share.
    #[error("hole {hole} runs through non-manifold edges; its rim is not a single closed line")]
    NonManifold {
        /// Id of the hole's loop.
        hole: u32,
    },
    /// The cloth around the hole is no disk.
    #[error("hole {hole}: {source}")]
    Region {
        /// Id of the hole's loop.
        hole: u32,
        /// Why.
        source: RegionError,
    },
    /// The cloth around the hole cannot be laid flat.
    #[error("hole {hole}: {source}")]
    Flatten {
        /// Id of the hole's loop.
        hole: u32,
        /// Why.
        source: FlattenError,
    },
    /// The cloth around the hole covers no two neighbouring cells of the grid.
    #[error(
        "hole {hole}: the cloth around it covers {known} of the grid's cells; too little is known to go on from"
    )]
    TooLittleKnown {
        /// Id of the hole's loop.
        hole: u32,
        /// Cells the cloth covers.
        known: usize,
    },
    /// No cell of the grid lies in the hole.
    #[error(
        "hole {hole} is so narrow that no cell of the grid lies in it; there is no place to search"
    )]
    NoCells {
        /// Id of the hole's loop.
        hole: u32,
    },
    /// The hole could not be meshed.
    #[error("hole {hole}: {source}")]
    Patch {
        /// Id of the hole's loop.
        hole: u32,
        /// Why.
        source: PatchError,
    },
    /// The network failed.
    #[error("the network failed: {0}")]
    Net(#[from] NetError),
    /// The patches could not be written.
    #[error("the patches could not be written: {0}")]
    Scan(#[from] ScanError),
    /// Nobody waits for the answer any more.
    #[error("nobody waits for the answer any more")]
    Abandoned,
    /// A picture could not be encoded.
    #[error("a picture could not be encoded: {0}")]
    Picture(image::ImageError),
}

impl MendError {
    /// The code of the error: a stable word for programs. No other place gives errors
    /// their codes.
    pub fn code(&self) -> &'static str {
        match self {
            MendError::Unreadable(error) => match error {
                ScanError::Container { .. } => "not_a_gltf",
                ScanError::Invalid { .. } => "invalid_gltf",
                ScanError::IndexOutOfRange { .. } => "index_out_of_range",
                ScanError::NotFinite { .. } => "position_not_finite",
                ScanError::Unsupported { .. } => "unsupported_extension",
                ScanError::External { .. } => "external_data",
                ScanError::Limit { .. } => "scan_too_large",
                ScanError::NoTriangles => "no_triangles",
                ScanError::Singular { .. } => "singular_transform",
                ScanError::Addition { .. } => "internal",
            },
            MendError::Constraints(_) => "constraints_do_not_fit",
            MendError::OutOfReach(_) => "anchor_out_of_reach",
            MendError::NoHoles { .. } => "no_holes",
            MendError::TooManyHoles { .. } => "too_many_holes",
            MendError::NonManifold { .. } => "non_manifold_rim",
            MendError::Region {
                source: RegionError::TooLarge { .. },
                ..
            } => "coordinates_too_large",
            MendError::Region { .. } => "not_a_disk",
            MendError::Flatten { .. } => "not_cloth_like",
            MendError::TooLittleKnown { .. } => "too_little_known",
            MendError::Patch {
                source: PatchError::RimCrosses,
                ..
            } => "rim_crosses_itself",
            MendError::Patch { .. } => "patch_degenerate",
            MendError::Scan(ScanError::Singular { .. }) => "singular_transform",
            MendError::NoCells { .. } => "hole_too_narrow",
            MendError::Net(_)
            | MendError::Scan(_)
            | MendError::Picture(_)
            | MendError::Abandoned => "internal",
        }
    }

    /// Whether the fault is darn's own; its text is not shown to callers.
    pub fn is_internal(&self) -> bool {
        self.code() == "internal"
    }

    /// The fields of the constraints that the error is about.
    pub fn fields(&self) -> Vec<FieldError> {
        match self {
            MendError::Constraints(fields) | MendError::OutOfReach(fields) => fields.clone(),
            _ => Vec::new(),
        }
    }
}

fn listed(fields: &[FieldError]) -> String {
    let each: Vec<String> = fields.iter().map(FieldError::to_string).collect();
    each.join("; ")
}

fn reasons(skipped: &[v1::Skipped]) -> String {
    match skipped {
        [] => ": its surface is closed, without any boundary loop".to_owned(),
        loops => {
            let each: Vec<String> = (loops.iter().take(5))
                .map(|l| format!("loop {} is left ({})", l.id, l.reason))
                .collect();
            let more = loops.len().saturating_sub(each.len());
            let rest = if more > 0 {
                format!("; and {more} more")
            } else {
                String::new()
            };
            format!(": {}{rest}", each.join("; "))
        }
    }
}
