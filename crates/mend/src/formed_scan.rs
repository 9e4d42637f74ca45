//! A scan that came as a zip, in the form that is asked for.

use crate::digests::file_digests;
use crate::error::MendError;
use darn_budget::Budget;
use darn_contract::port::ScanForm;
use darn_contract::v1;
use darn_gltf_scan::{Container, ScanLimits, repacked};

/// A scan in some form.
pub struct FormedScan {
    /// The file.
    pub bytes: Vec<u8>,
    /// Its container.
    pub container: Container,
    /// Its digests, where it is another glTF than the one in the zip: packed with its files.
    pub digests: Option<v1::FileDigests>,
}

/// The scan of a zip in the form that is asked for.
///
/// # Errors
/// A file is missing that a GLB must hold; `Exhausted`.
pub fn formed(
    zip: Vec<u8>,
    form: ScanForm,
    limits: &ScanLimits,
    budget: &Budget<'_>,
) -> Result<FormedScan, MendError> {
    let container = match form {
        ScanForm::AsReceived => {
            return Ok(FormedScan {
                bytes: zip,
                container: Container::Zip,
                digests: None,
            });
        }
        ScanForm::Gltf => Container::Gltf,
        ScanForm::Glb => Container::Glb,
    };
    let (container, bytes) =
        repacked(zip, container, limits, budget).map_err(MendError::unreadable)?;
    Ok(FormedScan {
        digests: (form == ScanForm::Glb).then(|| file_digests(&bytes)),
        bytes,
        container,
    })
}
