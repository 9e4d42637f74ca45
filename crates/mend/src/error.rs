//! Why a scan could not be mended, and the code of each reason: a stable word for programs.

use darn_budget::Exhausted;
use darn_contract::{Code, FieldError, Outcome, codes, v1};
use darn_geometry::flatten::FlattenError;
use darn_geometry::mesh::region::RegionError;
use darn_geometry::patch::PatchError;
use darn_gltf_scan::{MeshFileError, ScanError};
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
    /// The scan has nothing of darn's.
    #[error("the scan has no patch, cut or record of darn's; there is nothing to strip")]
    NothingToStrip,
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
    /// The patch of the hole is no plausible cloth.
    #[error(
        "hole {hole}: its patch is no plausible cloth: {}; `acceptDoubtful` applies it all the same", .doubts.join("; ")
    )]
    NoPlausibleFill {
        /// Id of the hole's loop.
        hole: u32,
        /// Why, with numbers.
        doubts: Vec<String>,
        /// What was measured of the patch.
        patch: Box<v1::PatchReport>,
    },
    /// The hole needs more work than one of several may take.
    #[error("hole {hole}: {source}")]
    Costly {
        /// Id of the hole's loop.
        hole: u32,
        /// Its share.
        source: Exhausted,
    },
    /// No hole could be filled, and there are several.
    #[error("none of the {holes} holes could be filled; {first}")]
    NoneFilled {
        /// How many holes were tried.
        holes: usize,
        /// Why the first of them could not be filled.
        first: Box<MendError>,
    },
    /// The network failed.
    #[error("the network failed: {0}")]
    Net(#[from] NetError),
    /// The patches could not be written.
    #[error("the patches could not be written: {0}")]
    Scan(ScanError),
    /// The request's budget is exhausted, or nobody waits for the answer any more.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
    /// A picture could not be encoded.
    #[error("a picture could not be encoded: {0}")]
    Picture(image::ImageError),
}

/// The row in the table of codes of a scan that cannot be read.
pub fn reading_code(error: &ScanError) -> Code {
    match error {
        ScanError::Container { .. } => codes::NOT_A_GLTF,
        ScanError::Invalid { .. } => codes::INVALID_GLTF,
        ScanError::IndexOutOfRange { .. } => codes::INDEX_OUT_OF_RANGE,
        ScanError::NotFinite { .. } => codes::POSITION_NOT_FINITE,
        ScanError::Unsupported { .. } => codes::UNSUPPORTED_EXTENSION,
        ScanError::External { .. } => codes::EXTERNAL_DATA,
        ScanError::Limit { .. } | ScanError::MeshFile(MeshFileError::Limit { .. }) => {
            codes::SCAN_TOO_LARGE
        }
        ScanError::MeshFile(_) => codes::INVALID_MESH_FILE,
        ScanError::NoTriangles { .. } | ScanError::PointCloud { .. } => codes::NO_TRIANGLES,
        ScanError::Singular { .. } => codes::SINGULAR_TRANSFORM,
        ScanError::Exhausted(exhausted) => exhausted_code(exhausted),
        ScanError::NotCut | ScanError::NotPacked | ScanError::InvalidPatch { .. } => {
            codes::INTERNAL
        }
    }
}

fn exhausted_code(exhausted: &Exhausted) -> Code {
    match exhausted {
        Exhausted::Work { .. } | Exhausted::Share { .. } => codes::TOO_MUCH_WORK,
        Exhausted::Memory { .. } => codes::TOO_MUCH_MEMORY,
        Exhausted::MemoryFull { .. } => codes::MEMORY_FULL,
        Exhausted::Output { .. } => codes::ANSWER_TOO_LARGE,
        // A caller who has left reads no code; one who still waits would wait for longer than the deadline.
        Exhausted::Cancelled => codes::DEADLINE_EXCEEDED,
    }
}

impl From<ScanError> for MendError {
    fn from(error: ScanError) -> MendError {
        match error {
            ScanError::Exhausted(exhausted) => MendError::Exhausted(exhausted),
            error => MendError::Scan(error),
        }
    }
}

impl MendError {
    /// The error of a scan that could not be read.
    pub fn unreadable(error: ScanError) -> MendError {
        match error {
            ScanError::Exhausted(exhausted) => MendError::Exhausted(exhausted),
            error => MendError::Unreadable(error),
        }
    }

    /// The error of a hole without a region.
    pub fn region(hole: u32) -> impl Fn(RegionError) -> MendError {
        move |source| match source {
            RegionError::Exhausted(exhausted) => MendError::Exhausted(exhausted),
            source => MendError::Region { hole, source },
        }
    }

    /// The error of a hole whose region cannot be laid flat.
    pub fn flatten(hole: u32) -> impl Fn(FlattenError) -> MendError {
        move |source| match source {
            FlattenError::Exhausted(exhausted) => MendError::Exhausted(exhausted),
            source => MendError::Flatten { hole, source },
        }
    }

    /// The error of a hole that cannot be meshed.
    pub fn patch(hole: u32) -> impl Fn(PatchError) -> MendError {
        move |source| match source {
            PatchError::Exhausted(exhausted) => MendError::Exhausted(exhausted),
            source => MendError::Patch { hole, source },
        }
    }

    /// The error's row in the table of codes. This is the only place that gives errors of mending their codes.
    pub fn code(&self) -> Code {
        match self {
            MendError::Unreadable(error) => reading_code(error),
            MendError::Constraints(_) => codes::CONSTRAINTS_DO_NOT_FIT,
            MendError::OutOfReach(_) => codes::ANCHOR_OUT_OF_REACH,
            MendError::NoHoles { .. } => codes::NO_HOLES,
            MendError::NothingToStrip => codes::NOTHING_TO_STRIP,
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
            MendError::NoPlausibleFill { .. } => codes::NO_PLAUSIBLE_FILL,
            MendError::NoneFilled { first, .. } => first.code(),
            MendError::Exhausted(exhausted)
            | MendError::Costly {
                source: exhausted, ..
            } => exhausted_code(exhausted),
            MendError::Net(_) | MendError::Scan(_) | MendError::Picture(_) => codes::INTERNAL,
        }
    }

    /// The hole that the error is about, where the other holes of the scan can be filled all the same.
    pub fn hole(&self) -> Option<u32> {
        match self {
            MendError::NonManifold { hole }
            | MendError::Region { hole, .. }
            | MendError::Flatten { hole, .. }
            | MendError::TooLittleKnown { hole, .. }
            | MendError::NoCells { hole }
            | MendError::Patch { hole, .. }
            | MendError::Costly { hole, .. }
            | MendError::NoPlausibleFill { hole, .. } => Some(*hole),
            _ => None,
        }
    }

    /// How the mend went, where it came as far as the scan's holes: none of them was filled.
    pub fn outcome(&self) -> Option<Outcome> {
        let skipped = match self {
            MendError::NoHoles { .. } => 0,
            MendError::NoneFilled { holes, .. } => *holes,
            error => error.hole().map(|_| 1)?,
        };
        Some(Outcome {
            skipped,
            ..Outcome::default()
        })
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
