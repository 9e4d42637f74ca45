//! Which offset each place of the hole is copied from.
//!
//! A first choice is made for squares of places by minimal cuts ([`crate::expansion`]). Then every place chooses again, in rounds: the offset whose copy of
//! the surroundings looks most like what is there, through smaller and smaller windows, in which what is nearer to the rim counts more. The sum over a
//! window of squared differences at one offset comes from a summed-area table, so that a round costs O(places × offsets) whatever the windows' sizes.

use darn_budget::{Budget, Exhausted};
use rayon::prelude::*;

use crate::expansion::{Field, Sites};
use crate::features::{Feature, distance};

use crate::offsets::{Candidate, Known, Offset};

/// No label: nothing known is at any offset.
pub(crate) const UNLABELLED: u8 = u8::MAX;
/// Nanoseconds of work for a place and an offset in one round.
const PLACE_WORK: u64 = 14;
/// Places along the hole's longer side, about.
const PLACES: usize = 96;
/// Weight of what was chosen before against what is known, at the rim.
const CHOSEN_WEIGHT: f32 = 0.5;
/// Places inwards over which that weight falls to 1/e.
const FADE: f32 = 9.0;
/// Weight of what offsets promise over all of the cloth, against what a window shows.
const PRIOR: f32 = 0.02;
/// Reach of the windows of the rounds, as a share of the places along a side, and least reach.
const ROUNDS: [f32; 1] = [0.0];
const LEAST_REACH: usize = 3;

/// Places of the hole and around it: every `stride`-th texel of `columns` × `rows`.
pub(crate) struct Places {
    pub stride: usize,
    pub columns: usize,
    pub rows: usize,
    /// Texel of the raster of the first place.
    first: [usize; 2],
    width: usize,
}

impl Places {
    /// Places over the hole and a border of a sixth of its side.
    fn over(raster: &Known) -> Places {
        let mut low = [raster.width, raster.height];
        let mut high = [0, 0];
        for at in (0..raster.hole.len()).filter(|at| raster.hole[*at]) {
            let p = [at % raster.width, at / raster.width];
            for k in 0..2 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k] + 1);
            }
        }
        if high == [0, 0] {
            // Nothing to fill: one place.
            (low, high) = ([0, 0], [1, 1]);
        }
        let side = (high[0] - low[0]).max(high[1] - low[1]);
        let stride = side.div_ceil(PLACES);
        let border = (side / 6).max(12);
        let size = [raster.width, raster.height];
        let from = [0, 1].map(|k: usize| low[k].min(size[k] - 1).saturating_sub(border));
        let count =
            [0, 1].map(|k: usize| ((high[k] + border).min(size[k]) - from[k]).div_ceil(stride));
        Places {
            stride,
            columns: count[0].max(1),
            rows: count[1].max(1),
            first: from,
            width: raster.width,
        }
    }

    fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// The texel of a place. Neighbouring places are not exactly a stride apart, so that a weave is seen at all its phases.
    fn texel(&self, place: usize, height: usize) -> usize {
        let (c, r) = (place % self.columns, place / self.columns);
        let shake = |k: usize| (k.wrapping_mul(0x9E37_79B9) >> 13) % self.stride;
        let x = (self.first[0] + c * self.stride + shake(place)).min(self.width - 1);
        let y = (self.first[1] + r * self.stride + shake(place + 7919)).min(height - 1);
        y * self.width + x
    }

    /// Columns and rows from the first place's cell's middle, for a texel.
    fn cell(&self, at: usize) -> [f32; 2] {
        let middle = 0.5 * (self.stride as f32 - 1.0);
        let of = |x: usize, first: usize| (x as f32 - first as f32 - middle) / self.stride as f32;
        [
            of(at % self.width, self.first[0]),
            of(at / self.width, self.first[1]),
        ]
    }
}

/// The cost of every offset at every place, and the offsets.
pub(crate) struct Labelling {
    pub offsets: Vec<Offset>,
    pub places: Places,
    /// Per place: the offset with the least cost among those that lead to known cloth.
    pub labels: Vec<u8>,
    /// Per offset, per place.
    pub costs: Vec<Vec<f32>>,
}

/// Chooses among offsets for all places.
pub(crate) fn choose(
    raster: &Known,
    candidates: &[Candidate],
    unserved: f32,
    budget: &Budget,
) -> Result<Labelling, Exhausted> {
    let places = Places::over(raster);
    let texels: Vec<usize> = (0..places.len())
        .map(|p| places.texel(p, raster.height))
        .collect();
    let depths = depths(raster, &texels, places.columns);
    let longest = places.columns.max(places.rows) as f32;
    let field = Field {
        raster,
        texels: &texels,
        columns: places.columns,
        candidates,
        unserved,
    };
    let first = match candidates {
        [] => vec![UNLABELLED; texels.len()],
        _ => Sites::new(&field, budget)?.labels(budget)?,
    };
    let mut labelling = Labelling {
        labels: first,
        costs: Vec::new(),
        offsets: candidates.iter().map(|c| c.offset).collect(),
        places,
    };
    for share in ROUNDS {
        let reach = ((share * longest) as usize).max(LEAST_REACH);
        let round = Round {
            raster,
            texels: &texels,
            depths: &depths,
            reach,
        };
        labelling.costs = round.costs(&labelling, candidates, budget)?;
        labelling.labels = (texels.iter().enumerate())
            .map(|(place, texel)| labelling.best(raster, place, *texel))
            .collect();
    }
    Ok(labelling)
}

/// Distance of each place from the cloth, in places (two sweeps with steps of 1 and √2).
fn depths(raster: &Known, texels: &[usize], columns: usize) -> Vec<f32> {
    let far = texels.len() as f32;
    let mut depths: Vec<f32> = (texels.iter())
        .map(|at| if raster.known[*at] { 0.0 } else { far })
        .collect();
    let rows = texels.len() / columns;
    let diagonal = std::f32::consts::SQRT_2;
    let mut step = |place: usize, back: bool| {
        let (c, r) = ((place % columns) as i64, (place / columns) as i64);
        let sign = if back { 1 } else { -1 };
        for (dx, dy, length) in [
            (1, 0, 1.0),
            (0, 1, 1.0),
            (1, 1, diagonal),
            (-1, 1, diagonal),
        ] {
            let (x, y) = (c + sign * dx, r + sign * dy);
            if x >= 0 && y >= 0 && x < columns as i64 && y < rows as i64 {
                let other = depths[y as usize * columns + x as usize] + length;
                depths[place] = depths[place].min(other);
            }
        }
    };
    (0..texels.len()).for_each(|place| step(place, false));
    (0..texels.len()).rev().for_each(|place| step(place, true));
    depths
}

impl Labelling {
    /// The offset with the least cost at a place, of those that lead to known cloth.
    fn best(&self, raster: &Known, place: usize, texel: usize) -> u8 {
        let mut best = (f32::INFINITY, UNLABELLED);
        if !raster.hole[texel] {
            return UNLABELLED;
        }
        for (label, offset) in self.offsets.iter().enumerate() {
            let cost = self.costs[label][place];
            if cost < best.0 && raster.source(texel, *offset).is_some() {
                best = (cost, label as u8);
            }
        }
        best.1
    }

    /// The label of a texel of the hole: of those chosen at the places around, the one whose cost between them is least.
    pub(crate) fn label(&self, raster: &Known, texel: usize) -> u8 {
        let [x, y] = self.places.cell(texel);
        let (columns, rows) = (self.places.columns, self.places.rows);
        let clamp = |x: f32, end: usize| (x.floor().max(0.0) as usize).min(end.saturating_sub(2));
        let (c, r) = (clamp(x, columns), clamp(y, rows));
        let (s, t) = (
            (x - c as f32).clamp(0.0, 1.0),
            (y - r as f32).clamp(0.0, 1.0),
        );
        let (right, below) = (usize::from(columns > 1), columns * usize::from(rows > 1));
        let at = r * columns + c;
        let around = [at, at + right, at + below, at + right + below];
        let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
        let cost = |label: u8| -> f32 {
            let costs = &self.costs[label as usize];
            (0..4).map(|k| weights[k] * costs[around[k]]).sum()
        };
        let mut best = (f32::INFINITY, UNLABELLED);
        let mut tried = [UNLABELLED; 4];
        for k in 0..4 {
            let label = self.labels[around[k]];
            if label == UNLABELLED || tried[..k].contains(&label) {
                continue;
            }
            tried[k] = label;
            let cost = cost(label);
            if cost < best.0 && raster.source(texel, self.offsets[label as usize]).is_some() {
                best = (cost, label);
            }
        }
        if best.1 != UNLABELLED {
            return best.1;
        }
        // None of them leads to known cloth from here.
        for label in 0..self.offsets.len() as u8 {
            let cost = cost(label);
            if cost < best.0 && raster.source(texel, self.offsets[label as usize]).is_some() {
                best = (cost, label);
            }
        }
        best.1
    }
}

/// One look at all places.
struct Round<'a> {
    raster: &'a Known<'a>,
    texels: &'a [usize],
    depths: &'a [f32],
    /// Places from the middle of a window to its sides.
    reach: usize,
}

impl Round<'_> {
    /// The mean squared difference of each offset's copy to what is there, in each place's window.
    fn costs(
        &self,
        labelling: &Labelling,
        candidates: &[Candidate],
        budget: &Budget,
    ) -> Result<Vec<Vec<f32>>, Exhausted> {
        let (look, weights) = self.appearance(labelling);
        candidates
            .par_iter()
            .map(|candidate| {
                budget.spend(PLACE_WORK * self.texels.len() as u64)?;
                Ok(self.cost(candidate, &look, &weights, labelling.places.columns))
            })
            .collect()
    }

    /// What every place looks like now, and how much that counts.
    fn appearance(&self, labelling: &Labelling) -> (Vec<Feature>, Vec<f32>) {
        let of = |place: usize| {
            let texel = self.texels[place];
            if self.raster.known[texel] {
                return (self.raster.features[texel], 1.0);
            }
            let offset = labelling.offsets.get(labelling.labels[place] as usize);
            match offset.and_then(|s| self.raster.source(texel, *s)) {
                Some(source) => {
                    let weight = CHOSEN_WEIGHT * (-self.depths[place] / FADE).exp();
                    (self.raster.features[source], weight)
                }
                None => ([0.0; 4], 0.0),
            }
        };
        (0..self.texels.len()).map(of).unzip()
    }

    fn cost(
        &self,
        candidate: &Candidate,
        look: &[Feature],
        weights: &[f32],
        columns: usize,
    ) -> Vec<f32> {
        let rows = self.texels.len() / columns;
        let across = columns + 1;
        // Sums of weighted squared differences and of weights over all places left of and above.
        let mut table = vec![[0.0f64; 2]; across * (rows + 1)];
        for r in 0..rows {
            let mut sum = [0.0f64; 2];
            for c in 0..columns {
                let place = r * columns + c;
                if weights[place] > 0.0
                    && let Some(source) = self.raster.source(self.texels[place], candidate.offset)
                {
                    let weight = f64::from(weights[place]);
                    sum[0] +=
                        weight * f64::from(distance(look[place], self.raster.features[source]));
                    sum[1] += weight;
                }
                let above = table[r * across + c + 1];
                table[(r + 1) * across + c + 1] = [above[0] + sum[0], above[1] + sum[1]];
            }
        }
        let prior = f64::from(PRIOR * candidate.difference);
        (0..self.texels.len())
            .map(|place| {
                // Labels between places look at those beside the hole too.
                if self.depths[place] == 0.0 && !self.beside_hole(place, columns) {
                    return candidate.difference;
                }
                let (c, r, reach) = (place % columns, place / columns, self.reach);
                let (left, right) = (c.saturating_sub(reach), (c + reach + 1).min(columns));
                let (top, bottom) = (r.saturating_sub(reach), (r + reach + 1).min(rows));
                let corner = |x: usize, y: usize| table[y * across + x];
                let (a, b, c, d) = (
                    corner(left, top),
                    corner(right, top),
                    corner(left, bottom),
                    corner(right, bottom),
                );
                let sum = [0, 1].map(|k: usize| (d[k] - c[k] - b[k] + a[k]).max(0.0));
                if sum[1] < 1e-9 {
                    return candidate.difference;
                }
                (sum[0] / sum[1] + prior) as f32
            })
            .collect()
    }

    fn beside_hole(&self, place: usize, columns: usize) -> bool {
        let hole = |other: Option<usize>| {
            other
                .and_then(|o| self.depths.get(o))
                .is_some_and(|d| *d > 0.0)
        };
        let rows = [
            place.checked_sub(columns),
            Some(place),
            Some(place + columns),
        ];
        rows.into_iter().flatten().any(|middle| {
            hole(middle.checked_sub(1)) || hole(Some(middle)) || hole(Some(middle + 1))
        })
    }
}
