//! Why a scan could not be mended, and the stable word programs know each reason by.

use darn_contract::{Code, FieldError, codes, v1};
use darn_geometry::flatten::FlattenError;
use darn_geometry::mesh::region::RegionError;
use darn_geometry::patch::PatchError;
use darn_gltf_scan::ScanError;
use darn_net::NetError;

/// Why a scan could not be mended.
#[derive(Debug, thiserror::Error)]
pub enum MendError {
    /// Constraints that do not fit this scan.
    #[error("{} constraint(s) do not fit this scan: {}", .0.len(), told(.0))]
    Constraints(Vec<FieldError>),
    /// Hard anchors that the cloth does not meet.
    #[error("{} anchor(s) cannot be met: {}", .0.len(), told(.0))]
    OutOfReach(Vec<FieldError>),
    /// Nothing to fill.
    #[error("the scan has no hole to fill{}", left(.skipped))]
    NoHoles {
        /// Its loops and why they are left as they are.
        skipped: Vec<v1::Skipped>,
    },
    /// More holes than are filled at once.
    #[error(
        "{found} holes are to be filled, and at most {limit} are at once; choose among them by `holes`"
    )]
    TooManyHoles {
        /// Holes to fill.
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
    /// No disk of cloth around the hole.
    #[error("hole {hole}: {source}")]
    Region {
        /// Id of the hole's loop.
        hole: u32,
        /// Why.
        source: RegionError,
    },
    /// The cloth around the hole does not lie flat.
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
    /// The hole is so small that no cell of the grid lies in it.
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
    /// Its row in the table of error codes.
    pub fn code(&self) -> Code {
        match self {
            MendError::Constraints(_) => codes::CONSTRAINTS_DO_NOT_FIT,
            MendError::OutOfReach(_) => codes::ANCHOR_OUT_OF_REACH,
            MendError::NoHoles { .. } => codes::NO_HOLES,
            MendError::TooManyHoles { .. } => codes::TOO_MANY_HOLES,
            MendError::NonManifold { .. } => codes::NON_MANIFOLD_RIM,
            MendError::Region {
                source: RegionError::TooLarge { .. },
                ..
            } => codes::COORDINATES_TOO_LARGE,
            MendError::Region { .. } => codes::NOT_A_DISK,
            MendError::Flatten { .. } => codes::NOT_CLOTH_LIKE,
            MendError::TooLittleKnown { .. } => codes::TOO_LITTLE_KNOWN,
            MendError::Patch {
                source: PatchError::RimCrosses,
                ..
            } => codes::RIM_CROSSES_ITSELF,
            MendError::Patch { .. } => codes::PATCH_DEGENERATE,
            MendError::Scan(ScanError::Singular { .. }) => codes::SINGULAR_TRANSFORM,
            MendError::NoCells { .. } => codes::HOLE_TOO_NARROW,
            MendError::Net(_)
            | MendError::Scan(_)
            | MendError::Picture(_)
            | MendError::Abandoned => codes::INTERNAL,
        }
    }

    /// The constraints it is about.
    pub fn fields(&self) -> Vec<FieldError> {
        match self {
            MendError::Constraints(fields) | MendError::OutOfReach(fields) => fields.clone(),
            _ => Vec::new(),
        }
    }
}

fn told(fields: &[FieldError]) -> String {
    let each: Vec<String> = fields
        .iter()
        .map(|f| format!("{}: {}", f.pointer, f.detail))
        .collect();
    each.join("; ")
}

fn left(skipped: &[v1::Skipped]) -> String {
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
