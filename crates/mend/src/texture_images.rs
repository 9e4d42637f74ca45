//! The images of a scan that the patches of one request need, each decoded once.

use std::collections::BTreeMap;
use std::sync::Arc;

use darn_budget::{Budget, Exhausted};
use darn_gltf_scan::{ClothLook, DecodedImage, ImageError, ScanLimits};

use crate::addition::PatchSource;
use crate::texture_cloth::Images;

/// The images of a scan that the patches of one request need.
#[derive(Default)]
pub struct ImageCache {
    /// The images that were decoded.
    pub decoded: Images,
    /// Why an image was not decoded.
    refused: BTreeMap<usize, String>,
    /// The looks of the cloth around holes: mostly the same.
    looks: Vec<Arc<ClothLook>>,
}

impl ImageCache {
    /// The same look, if it is known.
    pub fn shared(&mut self, look: ClothLook) -> Arc<ClothLook> {
        if let Some(known) = self.looks.iter().find(|known| ***known == look) {
            return Arc::clone(known);
        }
        self.looks.push(Arc::new(look));
        Arc::clone(&self.looks[self.looks.len() - 1])
    }

    /// Decodes an image unless that was done before; `Err` inside is why it cannot be.
    ///
    /// # Errors
    /// `Exhausted`, unless it is this image that is too large.
    pub fn decode(
        &mut self,
        index: usize,
        source: &PatchSource,
        limits: &ScanLimits,
    ) -> Result<Result<(), String>, Exhausted> {
        if self.decoded.contains_key(&index) {
            return Ok(Ok(()));
        }
        if let Some(reason) = self.refused.get(&index) {
            return Ok(Err(reason.clone()));
        }
        let reason = match source.scan.image(index, limits, source.budget) {
            Ok(image) => {
                self.decoded.insert(index, Arc::new(image));
                return Ok(Ok(()));
            }
            Err(ImageError::Exhausted(memory @ Exhausted::Memory { .. })) => {
                format!("/images/{index}: {memory}")
            }
            Err(ImageError::Exhausted(exhausted)) => return Err(exhausted),
            Err(ImageError::Unreadable(reason)) => reason,
        };
        self.refused.insert(index, reason.clone());
        Ok(Err(reason))
    }

    /// Gives back the memory of the images.
    pub fn release(self, budget: &Budget) {
        let held = |image: &Arc<DecodedImage>| image.bytes_held();
        budget.release(self.decoded.values().map(held).sum());
    }
}
