//! The offsets of a gathered cloth, found again in even light when it is unevenly lit.

use darn_budget::{Budget, Exhausted};

use crate::correlation::{SelfDifference, self_difference};
use crate::features::Feature;
use crate::gather::Gathered;
use crate::offsets::{Candidate, dominant_offsets, minima};
use crate::shading::{Pair, Shading};

/// Nanoseconds of work for one search.
const SEARCH_WORK: u64 = 60_000_000;
/// Texels along the longer side of the rasters in which repeats are looked for: in the smaller one a weave does not hide the pattern that is on it.
const REDUCED: [usize; 2] = [256, 64];
/// Offsets, and texels for each, that tell the light.
const LIGHT_OFFSETS: usize = 24;
const LIGHT_SAMPLES: usize = 400;

/// What a search found.
pub(crate) struct Found {
    /// Few offsets that together suit every place of the hole.
    pub candidates: Vec<Candidate>,
    /// All offsets that were looked at closely.
    pub all: Vec<Candidate>,
    /// Mean squared difference of unrelated places of the cloth.
    pub unserved: f32,
    /// The light over the cloth, which the features are without now.
    pub shading: Option<Shading>,
}

/// Finds the dominant offsets; takes uneven light out of the features.
pub(crate) fn search(gathered: &mut Gathered, budget: &Budget) -> Result<Found, Exhausted> {
    let mut reduced = reduced(gathered, budget)?;
    let shading = gathered
        .mirror
        .is_none()
        .then(|| light(&reduced[0]))
        .flatten();
    if let Some(shading) = &shading {
        let mut features = std::mem::take(&mut gathered.features);
        unshade(
            &mut features,
            &gathered.known[..gathered.frame.len()],
            shading,
            gathered.frame.width,
        );
        gathered.features = features;
        reduced = self::reduced(gathered, budget)?;
    }
    budget.spend(SEARCH_WORK)?;
    let unserved = 2.0 * reduced[0].variance + 1e-6;
    let [candidates, all] =
        dominant_offsets(&gathered.raster(), &reduced, &gathered.near, unserved);
    Ok(Found {
        candidates,
        all,
        unserved,
        shading,
    })
}

/// Where the cloth agrees with itself.
fn reduced(gathered: &Gathered, budget: &Budget) -> Result<[SelfDifference; 2], Exhausted> {
    budget.spend(SEARCH_WORK)?;
    let raster = gathered.raster();
    let (features, known) = (raster.features, raster.known);
    Ok(REDUCED.map(|most| self_difference(features, known, gathered.frame.width, most)))
}

/// Takes light out of the features of the texels that are `shown`.
pub(crate) fn unshade(features: &mut [Feature], shown: &[bool], shading: &Shading, width: usize) {
    for (at, feature) in features.iter_mut().enumerate().filter(|(at, _)| shown[*at]) {
        let light = shading.at([(at % width) as f32, (at / width) as f32]);
        (0..4).for_each(|k| feature[k] -= light[k]);
    }
}

/// The shading of the features, from the offsets that look best. (Mirrored images have none: their light is mirrored too.)
fn light(level: &SelfDifference) -> Option<Shading> {
    let cells: Vec<usize> = (0..level.cells.len())
        .filter(|at| level.cells[*at].is_some())
        .collect();
    let step = (cells.len() / LIGHT_SAMPLES).max(1) | 1;
    let columns = level.columns as i32;
    // The middle of a cell, in texels.
    let place = |at: usize| {
        let of = |x: usize| (x as f32 + 0.5) * level.scale as f32 - 0.5;
        [of(at % level.columns), of(at / level.columns)]
    };
    let mut pairs = Vec::new();
    for [dx, dy] in minima(level).into_iter().take(LIGHT_OFFSETS) {
        for at in cells.iter().step_by(step) {
            let (x, y) = (
                (at % level.columns) as i32 + dx,
                (at / level.columns) as i32 + dy,
            );
            if x < 0 || y < 0 || x >= columns {
                continue;
            }
            let to = (y * columns + x) as usize;
            if let (Some(a), Some(Some(b))) = (level.cells[*at], level.cells.get(to)) {
                let change = std::array::from_fn(|k| b[k] - a[k]);
                pairs.push(Pair {
                    from: place(*at),
                    to: place(to),
                    change,
                });
            }
        }
    }
    let rows = level.cells.len() / level.columns;
    Shading::fit(&pairs, level.scale * level.columns.max(rows))
}
