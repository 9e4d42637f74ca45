//! The cloth around a hole as rasters.

use darn_budget::Budget;

use crate::density;
use crate::features::{Feature, distance, feature, features};
use crate::frame::{Frame, NONE, bounds, owners};
use crate::input::{Cloth, PatchChart, Settings, TextureError};
use crate::mirror::{Reflection, reflection, widened};
use crate::offsets::{Known, spread};
use crate::resample::{OwnedRaster, Placed, resample};
use crate::seams::leave_cuts;

/// Nanoseconds of work for a texel of the raster.
const TEXEL_WORK: u64 = 40;

/// Texels at which a mirror image is compared with the cloth, about.
const COMPARED: usize = 20_000;
/// How much the cloth may differ from its mirror image, against unrelated places.
const ALIKE: f32 = 0.3;

/// The raster around a patch, and the reflection by which the cloth shows its images twice.
fn frame(
    cloth: &Cloth,
    patch: &PatchChart,
    settings: &Settings,
    budget: &Budget,
) -> Result<(Frame, Option<Reflection>), TextureError> {
    let frame = density::frame(cloth, patch, settings)?;
    let size = frame.step * frame.width.max(frame.height) as f64;
    let reflection = reflection(cloth, size, budget)?;
    let frame = reflection.map_or(frame, |r| widened(&frame, &r, settings.max_side as usize));
    Ok((frame, reflection))
}

/// The cloth in the raster. When the cloth shows its images twice, mirrored, there is a second page after the first: its mirror image.
pub(crate) struct Gathered {
    pub frame: Frame,
    /// Every layer, on all pages.
    pub layers: Vec<Vec<[u8; 4]>>,
    /// Which texels show cloth, on all pages.
    pub known: Vec<bool>,
    /// Which texels the patch covers and the cloth does not, on the first page.
    pub missing: Vec<bool>,
    /// Those of them that are to be filled. With a mirror image these are the texels of one side of the line that neither side shows.
    pub hole: Vec<bool>,
    /// Known texels of the first page within half of the patch's side around it.
    pub near: Vec<bool>,
    /// Of the known texels of the first page.
    pub features: Vec<Feature>,
    pub mirror: Option<Reflection>,
}

impl Gathered {
    /// Reads all images around the hole.
    pub(crate) fn new(
        cloth: &Cloth,
        patch: &PatchChart,
        settings: &Settings,
        budget: &Budget,
    ) -> Result<Gathered, TextureError> {
        let (frame, reflection) = frame(cloth, patch, settings, budget)?;
        budget.spend(TEXEL_WORK * frame.len() as u64)?;
        let owner = owners(&frame, &cloth.flat, &cloth.faces, budget)?;
        let of_patch = owners(&frame, &patch.flat, &patch.faces, budget)?;
        let missing: Vec<bool> = (owner.iter().zip(&of_patch))
            .map(|(cloth, patch)| *cloth == NONE && *patch != NONE)
            .collect();
        let mut gathered = Gathered {
            frame,
            layers: vec![Vec::new(); cloth.layers.len()],
            known: Vec::new(),
            hole: missing.clone(),
            missing,
            near: Vec::new(),
            features: Vec::new(),
            mirror: None,
        };
        gathered.add_page(cloth, &cloth.flat, &owner, budget)?;
        leave_cuts(cloth, &frame, &mut gathered.known, budget)?;
        if !gathered.known.contains(&true) {
            return Err(TextureError::Nothing("cloth in the raster"));
        }
        gathered.near = near(&frame, patch, &gathered.known);
        if let Some(reflection) = reflection {
            let flat: Vec<[f64; 2]> = cloth.flat.iter().map(|p| reflection.of(*p)).collect();
            let owner = owners(&frame, &flat, &cloth.faces, budget)?;
            gathered.add_page(cloth, &flat, &owner, budget)?;
            gathered.mirror(cloth, reflection);
        }
        gathered.features = features(
            &cloth.layers,
            &gathered.layers,
            &gathered.known[..frame.len()],
        );
        Ok(gathered)
    }

    /// What one page shows and the other does not goes to the other too, when they are alike.
    fn mirror(&mut self, cloth: &Cloth, reflection: Reflection) {
        let page = self.frame.len();
        let look = feature(&cloth.layers, &self.layers);
        let both: Vec<bool> = (0..page)
            .map(|k| self.near[k] && self.known[page + k])
            .collect();
        let both = spread(&both, COMPARED);
        let mean = |of: &dyn Fn(usize) -> f32| {
            both.iter().map(|k| of(*k)).sum::<f32>() / both.len().max(1) as f32
        };
        let differs = mean(&|k| distance(look(k), look(page + k)));
        let (one, two) = (both.len() / 3 + 1, both.len() / 2 + 1);
        let other = |k: usize| both[(both.partition_point(|b| *b < k) * one + two) % both.len()];
        let unrelated = mean(&|k| distance(look(k), look(other(k))));
        drop(look);
        if differs > ALIKE * unrelated + 1e-5 {
            self.known.truncate(page);
            self.layers
                .iter_mut()
                .for_each(|layer| layer.truncate(page));
            return;
        }
        for k in 0..page {
            let (from, to) = match (self.known[k], self.known[page + k]) {
                (true, false) => (k, page + k),
                (false, true) if self.missing[k] => (page + k, k),
                _ => continue,
            };
            self.known[to] = true;
            self.layers
                .iter_mut()
                .for_each(|layer| layer[to] = layer[from]);
        }
        let open = |k: usize| self.missing[k] && !self.known[k];
        let hole = |k: usize| {
            if !open(k) {
                return false;
            }
            let p = self
                .frame
                .centre(k % self.frame.width, k / self.frame.width);
            // Texels of the other side whose mirror image is not filled are filled themselves.
            let is_copied = || self.frame.texel(reflection.of(p)).is_some_and(open);
            reflection.side(p) >= 0.0 || !is_copied()
        };
        self.hole = (0..page).map(hole).collect();
        self.mirror = Some(reflection);
    }

    /// The other side of a mirrored hole copies what the mirror images of its texels copy, mirrored.
    pub(crate) fn copy_mirrored(&self, source: &mut [u32]) {
        let Some(reflection) = self.mirror else {
            return;
        };
        let (frame, page) = (&self.frame, self.frame.len());
        let centre = |at: usize| frame.centre(at % frame.width, at / frame.width);
        let texel = |p: [f64; 2]| frame.texel(p);
        let around = |at: usize| {
            [
                at,
                at + 1,
                at.wrapping_sub(1),
                at + frame.width,
                at.wrapping_sub(frame.width),
            ]
        };
        let found: Vec<(usize, u32)> = (0..page)
            .filter(|k| self.missing[*k] && !self.known[*k] && !self.hole[*k])
            .filter_map(|k| {
                let p = centre(k);
                let q = texel(reflection.of(p))?;
                // Beside the line the mirror image may be a texel of this side.
                let q =
                    (around(q).into_iter()).find(|q| source.get(*q).is_some_and(|s| *s != NONE))?;
                let s = source[q] as usize;
                // The movement, mirrored, so that a copy stays in one piece.
                let (from, to) = (reflection.of(centre(q)), reflection.of(centre(s)));
                let moved = texel([p[0] + to[0] - from[0], p[1] + to[1] - from[1]]);
                let shown = |at: &usize| *at < page && self.known[page + *at];
                let mirrored = moved.and_then(|moved| around(moved).into_iter().find(shown));
                // Beyond the raster: the texel itself, unmirrored.
                Some((k, mirrored.map_or(s, |at| page + at) as u32))
            })
            .collect();
        found.into_iter().for_each(|(k, s)| source[k] = s);
    }

    fn add_page(
        &mut self,
        cloth: &Cloth,
        flat: &[[f64; 2]],
        owner: &[u32],
        budget: &Budget,
    ) -> Result<(), TextureError> {
        let placed = Placed {
            flat,
            ..Placed::of(cloth)
        };
        let owned = OwnedRaster {
            frame: &self.frame,
            owners: owner,
        };
        for (layer, texels) in self.layers.iter_mut().enumerate() {
            texels.extend(resample(cloth, layer, &placed, &owned, budget)?);
        }
        self.known.extend(owner.iter().map(|o| *o != NONE));
        Ok(())
    }

    /// For the search of offsets.
    pub(crate) fn raster(&self) -> Known<'_> {
        Known {
            width: self.frame.width,
            height: self.frame.height,
            known: &self.known[..self.frame.len()],
            features: &self.features,
            hole: &self.hole,
        }
    }
}

fn near(frame: &Frame, patch: &PatchChart, known: &[bool]) -> Vec<bool> {
    let [low, high] = bounds(&patch.flat, &patch.faces);
    let reach = 0.5 * (high[0] - low[0]).max(high[1] - low[1]) / frame.step;
    let ([left, bottom], [right, top]) = (frame.texels(low), frame.texels(high));
    let mut near = vec![false; known.len()];
    let rows = near.chunks_mut(frame.width).zip(known.chunks(frame.width));
    for (y, (near, known)) in rows.enumerate() {
        let y = y as f64;
        if !(y > top - reach && y < bottom + reach) {
            continue;
        }
        for (x, (near, known)) in near.iter_mut().zip(known).enumerate() {
            let x = x as f64;
            *near = *known && x > left - reach && x < right + reach;
        }
    }
    near
}
