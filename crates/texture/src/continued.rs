//! Texture coordinates that go on from the rim: the patch as it shows the scan's own images.

use darn_budget::{Budget, Exhausted};
use rayon::prelude::*;

use crate::completion::Completion;
use crate::features::{Feature, distance, features};
use crate::frame::{NONE, owners};
use crate::input::{CornerTexcoords, TextureError};
use crate::offsets::{Offset, spread};
use crate::resample::{Placed, resample};

/// The patch with places in the scan's images, as `Source::texcoords` of the cloth count them.
#[derive(Debug, Clone, Default)]
pub struct ContinuedPatch {
    /// Positions in the chart.
    pub flat: Vec<[f64; 2]>,
    /// Triangles as indices into `flat`.
    pub faces: Vec<[u32; 3]>,
    /// Per face: index into the cloth's materials.
    pub material_of: Vec<u32>,
    /// Sets of texture coordinates per face.
    pub texcoords: Vec<CornerTexcoords>,
    /// Per face: vertex colours at its corners; empty when there are none.
    pub colours: Vec<[[f32; 4]; 3]>,
}

/// How much the continued images look like the cloth around the hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContinuedScore {
    /// How unlike the cloth at the repeats of its pattern the patch is: root mean square over places of the hole, of the most alike repeat; 0 to about 1.
    pub hole: f64,
    /// The same of the cloth around the hole itself.
    pub cloth: f64,
}

/// The patch may be this many times as unlike as the cloth is to itself.
const MOST_RATIO: f64 = 1.35;
/// Differences that nobody sees.
const UNSEEN: f64 = 0.012;
/// Places that are compared, in the hole and in the cloth each.
const PLACES: usize = 360;
/// Texels from the middle of a compared window to its sides, and between its samples.
const REACH: i32 = 6;
const STEP: usize = 3;
/// Nanoseconds of work for a place and an offset.
const PLACE_WORK: u64 = 120;

impl ContinuedScore {
    /// Whether continuing is as good as a texture of the patch's own.
    pub fn is_as_good(&self) -> bool {
        self.hole <= MOST_RATIO * self.cloth + UNSEEN
    }
}

impl ContinuedPatch {
    fn placed(&self) -> Placed<'_> {
        Placed {
            flat: &self.flat,
            faces: &self.faces,
            material_of: &self.material_of,
            texcoords: &self.texcoords,
            colours: &self.colours,
        }
    }

    fn check(&self, materials: usize, sets: usize) -> Result<(), TextureError> {
        let count = self.faces.len();
        let lengths = self.material_of.len() == count
            && self.texcoords.len() >= sets
            && self.texcoords.iter().all(|set| set.len() == count)
            && (self.colours.is_empty() || self.colours.len() == count);
        let indices = (self.faces.iter().flatten()).all(|v| (*v as usize) < self.flat.len())
            && self.material_of.iter().all(|m| (*m as usize) < materials);
        if lengths && indices {
            return Ok(());
        }
        Err(TextureError::Inconsistent(
            "arrays of the continued patch contradict each other",
        ))
    }
}

impl Completion<'_> {
    /// Every layer of a continued patch at the texels of the raster, with the cloth around it as it is.
    fn continued_layers(
        &self,
        continued: &ContinuedPatch,
        budget: &Budget,
    ) -> Result<Vec<Vec<[u8; 4]>>, TextureError> {
        continued.check(self.cloth.materials.len(), self.cloth.texcoords.len())?;
        let mut owner = owners(
            &self.gathered.frame,
            &continued.flat,
            &continued.faces,
            budget,
        )?;
        (owner.iter_mut().zip(&self.gathered.missing))
            .filter(|(_, missing)| !**missing)
            .for_each(|(o, _)| *o = NONE);
        let layer = |layer: usize| -> Result<Vec<[u8; 4]>, Exhausted> {
            let mut texels = resample(
                self.cloth,
                layer,
                &continued.placed(),
                (&self.gathered.frame, &owner),
                budget,
            )?;
            for (at, texel) in texels
                .iter_mut()
                .enumerate()
                .filter(|(at, _)| !self.gathered.missing[*at])
            {
                *texel = self.gathered.layers[layer][at];
            }
            Ok(texels)
        };
        (0..self.gathered.layers.len())
            .map(|k| Ok(layer(k)?))
            .collect()
    }

    /// Compares a continued patch with the cloth at the repeats of its pattern.
    ///
    /// A window of the patch that shows cloth in phase is alike to the known cloth at one of the dominant offsets; one that shows another place of an
    /// atlas, unused texels or a pattern that is torn at the rim is not.
    ///
    /// # Errors
    /// `Inconsistent`, `Exhausted`.
    pub fn score_continued(
        &self,
        continued: &ContinuedPatch,
        budget: &Budget,
    ) -> Result<ContinuedScore, TextureError> {
        let layers = self.continued_layers(continued, budget)?;
        let shown: Vec<bool> = (self.gathered.known.iter().zip(&self.gathered.missing))
            .map(|(k, h)| *k || *h)
            .collect();
        let look = self.unshaded(features(&self.cloth.layers, &layers, &shown), &shown);
        let holes = spread(&self.gathered.missing, PLACES);
        let cloth = spread(&self.gathered.near, PLACES);
        budget.spend(PLACE_WORK * ((holes.len() + cloth.len()) * self.offsets.len()) as u64)?;
        let mean = |places: &[usize]| {
            let all: Vec<f64> = places
                .par_iter()
                .filter_map(|at| self.most_alike(&look, &shown, *at))
                .collect();
            (all.iter().sum::<f64>() / all.len().max(1) as f64).sqrt()
        };
        Ok(ContinuedScore {
            hole: mean(&holes),
            cloth: mean(&cloth),
        })
    }

    /// The least mean squared difference of a window with the known cloth at any offset.
    fn most_alike(&self, look: &[Feature], shown: &[bool], at: usize) -> Option<f64> {
        let raster = self.gathered.raster();
        let window: Vec<usize> = (-REACH..=REACH)
            .step_by(STEP)
            .flat_map(|y| (-REACH..=REACH).step_by(STEP).map(move |x| [x, y]))
            .filter_map(|[x, y]| {
                let c = (at % raster.width) as i32 + x;
                let r = (at / raster.width) as i32 + y;
                let inside =
                    c >= 0 && r >= 0 && c < raster.width as i32 && r < raster.height as i32;
                inside.then(|| r as usize * raster.width + c as usize)
            })
            .filter(|k| shown[*k])
            .collect();
        let difference = |offset: Offset| {
            let (mut sum, mut count) = (0.0f64, 0usize);
            for k in &window {
                let Some(source) = raster.source(*k, offset) else {
                    continue;
                };
                sum += f64::from(distance(look[*k], raster.features[source]));
                count += 1;
            }
            (2 * count > window.len()).then(|| sum / count as f64)
        };
        self.offsets
            .iter()
            .filter_map(|c| difference(c.offset))
            .min_by(f64::total_cmp)
    }

    /// The base picture (first layer) of a continued patch over the image that [`Completion::texture`] gives: for comparisons.
    ///
    /// # Errors
    /// `Inconsistent`, `Exhausted`.
    pub fn continued_image(
        &self,
        continued: &ContinuedPatch,
        budget: &Budget,
    ) -> Result<Vec<[u8; 4]>, TextureError> {
        let layers = self.continued_layers(continued, budget)?;
        let cut = self.cut();
        Ok((0..cut.len())
            .map(|k| layers[0][cut.texel(k, self.gathered.frame.width)])
            .collect())
    }
}
