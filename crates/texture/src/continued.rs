//! Texture coordinates that go on from the rim: the patch as it shows the scan's own images.

use darn_budget::{Budget, Exhausted};
use rayon::prelude::*;

use crate::completion::Completion;
use crate::features::{Feature, distance, features};
use crate::frame::{NONE, owners};
use crate::input::{CornerTexcoords, TextureError};
use crate::offsets::{Offset, spread};
use crate::resample::{OwnedRaster, Placed, resample};

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
    /// How unlike places of the cloth are that have nothing to do with each other.
    pub unrelated: f64,
    /// Whether the patch's coordinates go on as one map with the cloth's.
    pub is_one_map: bool,
    /// Whether they are laid in folds, or stretched to several times their length.
    pub is_folded: bool,
    /// Whether the patch is about as bright and as varied as the cloth near it.
    pub shows_as_much: bool,
}

/// The patch may be this many times as unlike as the cloth is to itself.
const MOST_RATIO: f64 = 1.35;
/// The same where the coordinates go on as one map: a border or a large print in the hole may be unlike all that is around it.
const MOST_RATIO_OF_MAP: f64 = 2.6;
/// A patch is related to the cloth up to this share of what unrelated places differ by, and may be unrelated from the second one on. (On one map that shows
/// the rim drawn inwards, or another fabric, it is 0.44 to 3.)
const RELATED: f64 = 0.4;
const NOT_UNRELATED: f64 = 0.55;
/// Cloth that differs from itself at its repeats by this share of what unrelated places differ by has none.
const WITHOUT_REPEATS: f64 = 0.34;
/// How far the map of a face of the patch may be from the cloth's mean map, as a share of that.
const MOST_CHANGE: f64 = 0.35;
/// How far the mean of the patch's features may be from the cloth's, and how much of the cloth's deviation it must have, in the cloth's standard
/// deviations: an unused part of an image is plain.
const MOST_SHIFT: f64 = 1.0;
const LEAST_DEVIATION: f64 = 0.6;
/// Twice the area of a face's map against the squares of its lengths: less than that of a stretch of one and a half, and it is drawn out.
const LEAST_ROUND: f64 = 0.92;
/// Share of the patch's area that must have the cloth's map.
const LEAST_ALIKE: f64 = 0.97;
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
        let within = |ratio: f64| self.hole <= ratio * self.cloth + UNSEEN;
        let is_related = self.hole <= RELATED * self.unrelated;
        match (self.is_one_map, self.shows_as_much) {
            (true, true) => {
                let is_alike = self.hole <= NOT_UNRELATED * self.unrelated;
                is_related || within(MOST_RATIO) || (within(MOST_RATIO_OF_MAP) && is_alike)
            }
            (true, false) => within(MOST_RATIO),
            // Drawn-out cloth without repeats is as near to the truth as any other.
            (false, true) if self.is_folded => {
                within(MOST_RATIO) && self.cloth >= WITHOUT_REPEATS * self.unrelated
            }
            (false, true) => within(MOST_RATIO) && is_related,
            (false, false) => false,
        }
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
                &OwnedRaster {
                    frame: &self.gathered.frame,
                    owners: &owner,
                },
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
            unrelated: f64::from(self.unserved).sqrt(),
            is_one_map: self.is_one_map(continued),
            is_folded: self.is_folded(continued),
            shows_as_much: self.shows_as_much(&look),
        })
    }

    /// Whether the hole is about as bright and as varied as the cloth near it.
    fn shows_as_much(&self, look: &[Feature]) -> bool {
        let of = |mask: &[bool]| {
            let shown = || look.iter().zip(mask).filter(|(_, shown)| **shown);
            let count = shown().count().max(1) as f64;
            let mean = [0, 1, 2, 3]
                .map(|k: usize| shown().map(|(f, _)| f64::from(f[k])).sum::<f64>() / count);
            let square =
                |f: &Feature| -> f64 { (0..4).map(|k| (f64::from(f[k]) - mean[k]).powi(2)).sum() };
            let deviation = (shown().map(|(f, _)| square(f)).sum::<f64>() / count).sqrt();
            (mean, deviation)
        };
        let (hole, cloth) = (of(&self.gathered.missing), of(&self.gathered.near));
        let shift = (0..4)
            .map(|k| (hole.0[k] - cloth.0[k]).powi(2))
            .sum::<f64>();
        shift.sqrt() <= MOST_SHIFT * cloth.1 && hole.1 >= LEAST_DEVIATION * cloth.1
    }

    /// Whether a part of a continued patch lies on another one in the image, or is drawn out along a line: as where both sides of a fold of the image meet
    /// in the hole.
    fn is_folded(&self, continued: &ContinuedPatch) -> bool {
        let mut sets = self.cloth.materials.iter().flatten();
        let Some(source) = sets.find(|source| source.image.is_some()) else {
            return false;
        };
        let all: Vec<([f64; 4], f64)> = maps(&continued.placed(), source.texcoords).collect();
        let det = |[ux, vx, uy, vy]: &[f64; 4]| ux * vy - vx * uy;
        let turned: f64 = all.iter().map(|(map, area)| area * det(map).signum()).sum();
        let area: f64 = all.iter().map(|(_, area)| area).sum();
        let is_drawn = |map: &[f64; 4]| {
            let squares: f64 = map.iter().map(|x| x * x).sum();
            // At a ratio r of the two lengths it is 2 r / (1 + r²).
            2.0 * det(map) * turned.signum() < LEAST_ROUND * squares
        };
        let drawn = all.iter().filter(|(map, _)| is_drawn(map));
        drawn.map(|(_, area)| area).sum::<f64>() > (1.0 - LEAST_ALIKE) * area
    }

    /// Whether a continued patch has the map of the cloth around it: from the chart to the coordinates, in one piece.
    fn is_one_map(&self, continued: &ContinuedPatch) -> bool {
        let mut places = std::collections::BTreeSet::new();
        let is_whole = (continued.flat.iter()).all(|p| places.insert(p.map(f64::to_bits)));
        let mut materials = self.cloth.material_of.iter().chain(&continued.material_of);
        let first = materials.next();
        let is_one_material = materials.all(|material| Some(material) == first);
        let mut sets = self.cloth.materials.iter().flatten();
        let Some(source) = sets.find(|source| source.image.is_some()) else {
            return false;
        };
        let set = source.texcoords;
        let of_cloth = maps(&Placed::of(self.cloth), set);
        let (mut mean, mut area) = ([0.0; 4], 0.0);
        for (map, own) in of_cloth {
            (0..4).for_each(|k| mean[k] += own * map[k]);
            area += own;
        }
        let mean = mean.map(|x| x / area);
        let size = |map: [f64; 4]| map.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (mut alike, mut all) = (0.0, 0.0);
        for (map, own) in maps(&continued.placed(), set) {
            let change = size([0, 1, 2, 3].map(|k: usize| map[k] - mean[k]));
            all += own;
            if change < MOST_CHANGE * size(mean) {
                alike += own;
            }
        }
        is_whole && is_one_material && alike >= LEAST_ALIKE * all
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

/// Per face the derivatives of the texture coordinates in the chart (∂u/∂x, ∂v/∂x, ∂u/∂y, ∂v/∂y), and its area in the chart.
fn maps<'p>(placed: &Placed<'p>, set: usize) -> impl Iterator<Item = ([f64; 4], f64)> + use<'p> {
    let (flat, faces) = (placed.flat, placed.faces);
    let texcoords = placed.texcoords.get(set).map_or(&[][..], Vec::as_slice);
    faces
        .iter()
        .zip(texcoords)
        .filter_map(move |(face, corners)| {
            let [a, b, c] = face.map(|v| flat[v as usize]);
            let (e, f) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
            let doubled = e[0] * f[1] - e[1] * f[0];
            let change =
                |k: usize, of: usize| f64::from(corners[k][of]) - f64::from(corners[0][of]);
            let along = |of: usize| {
                let (s, t) = (change(1, of), change(2, of));
                [
                    (s * f[1] - t * e[1]) / doubled,
                    (t * e[0] - s * f[0]) / doubled,
                ]
            };
            let ([ux, uy], [vx, vy]) = (along(0), along(1));
            let map = [ux, vx, uy, vy];
            (map.iter().all(|x| x.is_finite())).then_some((map, doubled.abs()))
        })
}
