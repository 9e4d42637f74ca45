//! Why a scan could not be read, or a patch could not be written.
//!
//! Every variant about the file carries an RFC 6901 pointer into its JSON, so that a person can find the place.

use darn_budget::Exhausted;
use darn_mesh_files::MeshFileError;

use super::content::SceneContent;
use super::json::JsonPlace;

/// Why a scan could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ScanError {
    /// The bytes are neither a GLB nor a JSON document, or are cut off.
    #[error("not a readable glTF at byte {offset}: {detail}")]
    Container {
        /// Where in the file, in bytes.
        offset: usize,
        /// What is wrong there.
        detail: String,
    },
    /// The JSON breaks a rule of glTF that matters here.
    #[error("{pointer}: {detail}")]
    Invalid {
        /// JSON pointer to the place.
        pointer: String,
        /// What is wrong there.
        detail: String,
    },
    /// A vertex index points past the end of its primitive's vertices.
    #[error(
        "{pointer}: element {element} is index {index}, but the primitive has {vertices} vertices"
    )]
    IndexOutOfRange {
        /// JSON pointer to the index accessor.
        pointer: String,
        /// Which element of the accessor.
        element: usize,
        /// The index found.
        index: u32,
        /// How many vertices the primitive has.
        vertices: usize,
    },
    /// A position that a triangle uses is NaN or infinite, as stored or once its node's transform is applied.
    #[error("{pointer}: position {element} is not finite")]
    NotFinite {
        /// JSON pointer to the POSITION accessor, or to the node whose transform overflows.
        pointer: String,
        /// Which element of the accessor.
        element: usize,
    },
    /// The geometry is stored by an extension in a version that is not decoded, or where triangles cannot be cut out.
    #[error(
        "{pointer}: the geometry is stored with {extension} in a way that is not supported here; export the scan without it"
    )]
    Unsupported {
        /// JSON pointer to the use of the extension.
        pointer: String,
        /// The extension's name.
        extension: &'static str,
    },
    /// A primitive is a Draco point cloud.
    #[error(
        "{pointer}: the Draco stream is a point cloud; only triangle meshes have holes to mend"
    )]
    PointCloud {
        /// JSON pointer to the use of the extension.
        pointer: String,
    },
    /// Data that the scan needs is in another file, which did not come with it; no file or URL is opened.
    #[error(
        "{pointer}: the data is in another file ({uri:?}) that did not come with the scan; send it as a part named by this URI, \
         send both in a zip, or send a GLB"
    )]
    External {
        /// JSON pointer to the URI.
        pointer: String,
        /// The URI's first characters.
        uri: String,
    },
    /// The scan exceeds a limit.
    #[error("{pointer}: {found} exceeds the limit {limit} = {allowed}")]
    Limit {
        /// JSON pointer to the place that exceeds it.
        pointer: String,
        /// The limit's name, a field of [`super::ScanLimits`].
        limit: &'static str,
        /// The limit's value.
        allowed: usize,
        /// What was found: the count up to this place, inclusive.
        found: usize,
    },
    /// An OBJ or a PLY that breaks a rule of its format.
    #[error(transparent)]
    MeshFile(MeshFileError),
    /// An OBJ or a PLY is to be written as a glTF.
    #[error("an OBJ or a PLY is written in its own format, not as a GLB")]
    NotPacked,
    /// Triangles are to be cut out of an OBJ or a PLY.
    #[error("triangles cannot be cut out of an OBJ or a PLY; send the scan as a glTF")]
    NotCut,
    /// The request's budget is exhausted.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
    /// The default scene draws no triangle.
    #[error("the default scene draws no triangles{content}; there is nothing to mend")]
    NoTriangles {
        /// What it draws.
        content: SceneContent,
    },
    /// A patch cannot be transformed to the space of a node whose transform is singular.
    #[error(
        "/nodes/{node}: the node's transform is singular; a patch cannot be written into its space"
    )]
    Singular {
        /// The node.
        node: usize,
    },
    /// A patch to append contradicts itself or the scan, or the meshes to write exceed the size of a GLB.
    #[error("addition {patch}: {detail}")]
    InvalidPatch {
        /// Which of the patches.
        patch: usize,
        /// What is wrong with it.
        detail: String,
    },
}

impl From<MeshFileError> for ScanError {
    fn from(error: MeshFileError) -> Self {
        match error {
            MeshFileError::Exhausted(exhausted) => Self::Exhausted(exhausted),
            error => Self::MeshFile(error),
        }
    }
}

impl ScanError {
    /// The error of a file that is not there; `uri` is the place of its URI.
    pub(super) fn external(uri: &JsonPlace<'_>) -> Self {
        const SHOWN: usize = 80;
        let text = uri.value.as_str().unwrap_or_default();
        Self::External {
            pointer: uri.pointer.clone(),
            uri: text.chars().take(SHOWN).collect(),
        }
    }

    /// The JSON pointer of the place in the scan, where there is one.
    #[cfg(test)]
    pub(crate) fn pointer(&self) -> Option<&str> {
        match self {
            Self::Invalid { pointer, .. }
            | Self::IndexOutOfRange { pointer, .. }
            | Self::NotFinite { pointer, .. }
            | Self::Unsupported { pointer, .. }
            | Self::PointCloud { pointer }
            | Self::External { pointer, .. }
            | Self::Limit { pointer, .. } => Some(pointer),
            Self::Container { .. }
            | Self::MeshFile(_)
            | Self::NotCut
            | Self::NotPacked
            | Self::Exhausted(_)
            | Self::NoTriangles { .. }
            | Self::Singular { .. }
            | Self::InvalidPatch { .. } => None,
        }
    }
}
