//! The whole way from a cloth and a patch to the patch's images.

use darn_budget::Budget;

use crate::compose::{ComposedLayer, Cut, Field, compose};
use crate::density;
use crate::features::Feature;
use crate::frame::{Frame, bounds};
use crate::gather::Gathered;
use crate::input::{Cloth, LayerKind, PatchChart, Settings, TextureError};
use crate::labels::choose;
use crate::mirror::{self, shows_both_sides};
use crate::offsets::{Candidate, spread};
use crate::search::{Found, search, unshade};
use crate::shading::Shading;

/// Bytes that a texel of the raster needs without its layers, and for each layer; and one of the patch while a layer is blended.
const TEXEL_BYTES: usize = 64;
const LAYER_BYTES: usize = 8;
const BLEND_BYTES: usize = 120;
/// Bytes for the search, which is done in a raster of a fixed size, and for choosing.
const SEARCH_BYTES: usize = 24 << 20;

/// A patch's images, one for each layer of the cloth, and where its vertices lie in them.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchTexture {
    /// Columns of every image.
    pub width: u32,
    /// Rows of every image.
    pub height: u32,
    /// Per layer: `width` × `height` texels, row by row, encoded as the layer's kind says.
    pub layers: Vec<Vec<[u8; 4]>>,
    /// Per vertex of the patch. u goes along +x of the chart and v along −y, so the tangent is the chart's x axis.
    pub texcoords: Vec<[f32; 2]>,
    /// The chart's point at u = v = 0.
    pub corner: [f64; 2],
    /// Length of a texel in the chart.
    pub step: f64,
}

impl PatchTexture {
    /// Where a point of the chart lies in the images. A patch that is folded anew keeps its images and asks for its vertices again.
    pub fn texcoord(&self, p: [f64; 2]) -> [f32; 2] {
        let x = (p[0] - self.corner[0]) / (self.step * f64::from(self.width));
        let y = (self.corner[1] - p[1]) / (self.step * f64::from(self.height));
        [x as f32, y as f32]
    }
}

/// A hole with the offsets at which the cloth around it may be like itself, found once for all layers.
pub struct Completion<'a> {
    pub(crate) cloth: &'a Cloth<'a>,
    pub(crate) patch: &'a PatchChart,
    pub(crate) settings: Settings,
    pub(crate) gathered: Gathered,
    /// Offsets at which the cloth may be like itself.
    pub(crate) offsets: Vec<Candidate>,
    /// Few of them that together suit every place of the hole.
    candidates: Vec<Candidate>,
    /// Mean squared difference of unrelated places of the cloth.
    pub(crate) unserved: f32,
    /// The light over the cloth, which the features are without.
    shading: Option<Shading>,
    bytes: usize,
}

/// Bytes that the completion of a patch needs at once, from above.
///
/// # Errors
/// `Nothing`, `Inconsistent`, `NoDensity`.
pub fn estimated_bytes(
    cloth: &Cloth,
    patch: &PatchChart,
    settings: &Settings,
) -> Result<usize, TextureError> {
    cloth.check()?;
    patch.check()?;
    let frame = density::frame(cloth, patch, settings)?;
    let cut = cut(&frame, patch, settings);
    let layers = LAYER_BYTES * cloth.layers.len();
    let widened = match shows_both_sides(cloth) {
        true => mirror::most_texels(&frame, settings.max_side as usize),
        false => frame.len(),
    };
    Ok(SEARCH_BYTES + widened * (TEXEL_BYTES + layers) + cut.len() * (BLEND_BYTES + layers))
}

/// The part of the raster that the patch's image is.
pub(crate) fn cut(frame: &Frame, patch: &PatchChart, settings: &Settings) -> Cut {
    let [low, high] = bounds(&patch.flat, &patch.faces);
    let margin = f64::from(settings.margin);
    let [left, top] = frame
        .texels([low[0], high[1]])
        .map(|x| (x - margin).floor().max(0.0) as usize);
    let [right, bottom] = frame
        .texels([high[0], low[1]])
        .map(|x| (x + margin).ceil().max(1.0) as usize);
    let (left, top) = (left.min(frame.width - 1), top.min(frame.height - 1));
    Cut {
        left,
        top,
        width: right.min(frame.width) - left,
        height: bottom.min(frame.height) - top,
    }
}

impl<'a> Completion<'a> {
    /// Reads the cloth's images and finds the offsets at which the cloth is like itself. Its memory is held in the budget until
    /// [`Completion::release`].
    ///
    /// # Errors
    /// `Nothing`, `Inconsistent`, `NoDensity`; `Exhausted`.
    pub fn new(
        cloth: &'a Cloth<'a>,
        patch: &'a PatchChart,
        settings: &Settings,
        budget: &Budget,
    ) -> Result<Completion<'a>, TextureError> {
        let bytes = estimated_bytes(cloth, patch, settings)?;
        budget.hold(bytes)?;
        let found = Completion::found(cloth, patch, settings, budget);
        match found {
            Ok(completion) => Ok(Completion {
                bytes,
                ..completion
            }),
            Err(error) => {
                budget.release(bytes);
                Err(error)
            }
        }
    }

    fn found(
        cloth: &'a Cloth<'a>,
        patch: &'a PatchChart,
        settings: &Settings,
        budget: &Budget,
    ) -> Result<Completion<'a>, TextureError> {
        let mut gathered = Gathered::new(cloth, patch, settings, budget)?;
        let Found {
            candidates,
            all,
            unserved,
            shading,
        } = search(&mut gathered, budget)?;
        Ok(Completion {
            cloth,
            patch,
            settings: *settings,
            gathered,
            offsets: all,
            candidates,
            unserved,
            shading,
            bytes: 0,
        })
    }

    /// Gives the memory back to the budget that it was taken from.
    pub fn release(self, budget: &Budget) {
        budget.release(self.bytes);
    }

    /// Features in even light.
    pub(crate) fn unshaded(&self, mut features: Vec<Feature>, shown: &[bool]) -> Vec<Feature> {
        if let Some(shading) = &self.shading {
            unshade(&mut features, shown, shading, self.gathered.frame.width);
        }
        features
    }

    pub(crate) fn cut(&self) -> Cut {
        cut(&self.gathered.frame, self.patch, &self.settings)
    }

    /// Which texels of the patch's image are filled, and which show the cloth around it.
    pub fn masks(&self) -> [Vec<bool>; 2] {
        let cut = self.cut();
        let (missing, known) = (&self.gathered.missing, &self.gathered.known);
        let texel = |k: usize| cut.texel(k, self.gathered.frame.width);
        let of = |mask: &dyn Fn(usize) -> bool| (0..cut.len()).map(|k| mask(texel(k))).collect();
        [of(&|at| missing[at]), of(&|at| known[at] && !missing[at])]
    }

    /// Length of a texel in the chart.
    pub fn step(&self) -> f64 {
        self.gathered.frame.step
    }

    /// The chart's points at the middles of the texels of the patch's image.
    pub fn places(&self) -> Vec<[f64; 2]> {
        let (cut, frame) = (self.cut(), &self.gathered.frame);
        (0..cut.len())
            .map(|k| cut.texel(k, frame.width))
            .map(|at| frame.centre(at % frame.width, at / frame.width))
            .collect()
    }

    /// The patch's images: chooses where each texel of the hole is copied from, and copies it in all layers.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn texture(&self, budget: &Budget) -> Result<PatchTexture, TextureError> {
        let cut = self.cut();
        let raster = self.gathered.raster();
        let labelling = choose(&raster, &self.candidates, self.unserved, budget)?;
        let field = Field::new(&self.gathered, &labelling, budget)?;
        let samples = spread(&self.gathered.near, 1200);
        let layers = (self.cloth.layers.iter().zip(&self.gathered.layers))
            .map(|(kind, layer)| {
                // The light of a mirrored image is mirrored with it.
                let shaded = self.gathered.mirror.is_none()
                    && matches!(kind, LayerKind::BaseColour | LayerKind::Colour);
                let shading = shaded
                    .then(|| Field::shading(&raster, &labelling, layer, &samples))
                    .flatten();
                let layer = ComposedLayer {
                    kind: *kind,
                    texels: layer,
                    shading: shading.as_ref(),
                };
                Ok(compose(&self.gathered, &field, &layer, &cut, budget)?)
            })
            .collect::<Result<Vec<_>, TextureError>>()?;
        let frame = &self.gathered.frame;
        let mut texture = PatchTexture {
            width: cut.width as u32,
            height: cut.height as u32,
            layers,
            texcoords: Vec::new(),
            corner: [
                frame.origin[0] + cut.left as f64 * frame.step,
                frame.origin[1] - cut.top as f64 * frame.step,
            ],
            step: frame.step,
        };
        texture.texcoords = self
            .patch
            .flat
            .iter()
            .map(|p| texture.texcoord(*p))
            .collect();
        Ok(texture)
    }
}
