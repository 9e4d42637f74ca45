//! The dominant offsets of the cloth (He and Sun 2012): those at which it looks like itself.

use rayon::prelude::*;

use crate::correlation::SelfDifference;
use crate::features::{Feature, distance};
use crate::selection::select;

/// A movement in texels, columns and rows.
pub(crate) type Offset = [i32; 2];

/// An offset with the mean squared difference of the cloth around the hole with itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub offset: Offset,
    pub difference: f32,
}

/// Repeats of each reduced raster that are refined.
const REFINED: usize = 112;
/// Offsets of a regular grid among them, which reach every place of the hole in cloth without structure.
const GRID: i32 = 3;
/// Parts of the cloth around the hole, by direction, which may have patterns of their own.
const SECTORS: usize = 8;
/// Texels of each sector at which offsets are compared, and at which those around a seed are.
const SAMPLES: usize = 90;
const FEW_SAMPLES: usize = 30;
/// The raster that offsets are looked for in.
pub(crate) struct Known<'a> {
    pub width: usize,
    pub height: usize,
    /// Which texels the cloth covers.
    pub known: &'a [bool],
    pub features: &'a [Feature],
    /// Which texels are to be filled.
    pub hole: &'a [bool],
}

impl Known<'_> {
    /// The texel at an offset from another one, when the raster has it and it is known.
    #[inline]
    pub(crate) fn source(&self, at: usize, offset: Offset) -> Option<usize> {
        let at = self.moved(at, offset)?;
        self.known[at].then_some(at)
    }

    /// The texel at an offset from another one, known or not.
    #[inline]
    pub(crate) fn moved(&self, at: usize, [dx, dy]: Offset) -> Option<usize> {
        // Short numbers are divided faster.
        let (at, width) = (at as u32, self.width as u32);
        self.at((at % width) as i32 + dx, (at / width) as i32 + dy)
    }

    /// The texel at a column and row, when the raster has it.
    #[inline]
    pub(crate) fn at(&self, x: i32, y: i32) -> Option<usize> {
        let inside = x >= 0 && y >= 0 && x < self.width as i32 && y < self.height as i32;
        inside.then(|| y as usize * self.width + x as usize)
    }
}

/// Every n-th texel of a kind, about `count` of them, in the raster's order.
pub(crate) fn spread(of: &[bool], count: usize) -> Vec<usize> {
    let all = of.iter().filter(|x| **x).count();
    // Odd steps, so that the samples do not stand in columns of a weave.
    let step = (all / count.max(1)).max(1) | 1;
    let texels = of.iter().enumerate().filter(|(_, x)| **x).map(|(at, _)| at);
    texels.step_by(step).collect()
}

/// Looks for offsets in reduced rasters, refines them in the full one, and keeps those that together suit every place of the hole. `unserved`:
/// cost of a place without an offset. Second, all that were refined.
pub(crate) fn dominant_offsets(
    raster: &Known,
    reduced: &[SelfDifference; 2],
    near: &[bool],
    unserved: f32,
) -> [Vec<Candidate>; 2] {
    let hole = spread(raster.hole, 600);
    let sectors = sectors(raster, near);
    let serves = |by: &Offset| hole.iter().any(|at| raster.source(*at, *by).is_some());
    let (finest, coarser) = (&reduced[0], &reduced[1..]);
    let scale = finest.scale as i32;
    let exact = |level: &SelfDifference, by: Offset| {
        let ratio = level.scale as i32 / scale;
        finest.least_around(by.map(|d| d * ratio), ratio / 2)
    };
    let mut seeds: Vec<Offset> = minima(finest);
    seeds.extend(coarser.iter().flat_map(|level| {
        minima(level)
            .into_iter()
            .map(|by| exact(level, by))
            .collect::<Vec<_>>()
    }));
    let mut seeds: Vec<Offset> = (seeds.into_iter().map(|by| by.map(|d| d * scale)))
        .chain(grid(raster))
        .filter(serves)
        .collect();
    seeds.sort_unstable();
    seeds.dedup();
    let reach = scale / 2 + 1;
    let mut all: Vec<Candidate> = seeds
        .par_iter()
        .flat_map_iter(|seed| refine(raster, &sectors, *seed, reach))
        .collect();
    all.sort_by(|a, b| {
        a.offset
            .cmp(&b.offset)
            .then(a.difference.total_cmp(&b.difference))
    });
    all.dedup_by_key(|c| c.offset);
    [select(raster, &all, unserved), all]
}

/// A known texel to compare.
pub(crate) struct Sample {
    /// Column and row.
    pub place: Offset,
    pub look: Feature,
}

/// Samples of the cloth around the hole by their direction from its middle.
fn sectors(raster: &Known, near: &[bool]) -> [Vec<Sample>; SECTORS] {
    let place = |at: usize| [(at % raster.width) as f64, (at / raster.width) as f64];
    let hole = spread(raster.hole, 600);
    let count = hole.len().max(1) as f64;
    let middle = hole.iter().fold([0.0; 2], |sum, at| {
        let p = place(*at);
        [sum[0] + p[0] / count, sum[1] + p[1] / count]
    });
    let mut sectors: [Vec<usize>; SECTORS] = Default::default();
    for at in spread(near, 4 * SECTORS * SAMPLES) {
        let [x, y] = place(at);
        let turn =
            (y - middle[1]).atan2(x - middle[0]) / std::f64::consts::TAU + 0.5 / SECTORS as f64;
        let sector = (turn.rem_euclid(1.0) * SECTORS as f64) as usize;
        sectors[sector.min(SECTORS - 1)].push(at);
    }
    sectors.map(|all| {
        let step = all.len().div_ceil(SAMPLES).max(1);
        let sample = |at: usize| Sample {
            place: [(at % raster.width) as i32, (at / raster.width) as i32],
            look: raster.features[at],
        };
        all.into_iter().step_by(step).map(sample).collect()
    })
}

/// Offsets, in steps, at which the difference is smaller than at the eight around: those where it is least, and those that stand out most against the
/// offsets around them. Large plain parts of a cloth agree with themselves almost anywhere, and hide by their number a pattern that lies on them.
pub(crate) fn minima(level: &SelfDifference) -> Vec<Offset> {
    let [columns, rows] = level.reach;
    let mut found: Vec<(f32, f32, Offset)> = Vec::new();
    for dy in 0..=rows {
        for dx in -columns..=columns {
            if (dy == 0 && dx <= 0) || dx.abs().max(dy) < 3 {
                continue;
            }
            let Some(own) = level.at(dx, dy) else {
                continue;
            };
            let around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| (x, y)));
            let least = around
                .filter(|o| *o != (0, 0))
                .all(|(x, y)| level.at(dx + x, dy + y).is_none_or(|other| own <= other));
            if least {
                found.push((own, level.depth(dx, dy), [dx, dy]));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    let mut best: Vec<Offset> = found.iter().take(REFINED / 4).map(|f| f.2).collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.2.cmp(&b.2)));
    best.extend(found.iter().take(REFINED / 4).map(|f| f.2));
    best.into_iter()
        .flat_map(|[dx, dy]| [[dx, dy], [-dx, -dy]])
        .collect()
}

/// Offsets over the whole raster.
fn grid(raster: &Known) -> Vec<Offset> {
    let at = |k: i32, size: usize| k * size as i32 / (GRID + 1);
    (-GRID..=GRID)
        .flat_map(|j| (-GRID..=GRID).map(move |i| [i, j]))
        .filter(|o| *o != [0, 0])
        .map(|[i, j]| [at(i, raster.width), at(j, raster.height)])
        .collect()
}

/// Samples of all sectors, and the sum of squared differences and the count of those that an offset moves to known cloth, per sector and, last, for all.
fn differences(
    raster: &Known,
    sectors: &[Vec<Sample>; SECTORS],
    offset: Offset,
    most: usize,
) -> [Option<f32>; SECTORS + 1] {
    let mut sums = [None; SECTORS + 1];
    let mean = |sum: f32, count: usize, samples: usize| {
        (count * 8 >= samples && count > 3).then(|| sum / count as f32)
    };
    let (mut all, mut asked) = ((0.0f32, 0usize), 0);
    for (samples, result) in sectors.iter().zip(&mut sums) {
        let step = samples.len().div_ceil(most).max(1);
        let (mut sum, mut count) = (0.0f32, 0usize);
        for at in samples.iter().step_by(step) {
            let source = raster.at(at.place[0] + offset[0], at.place[1] + offset[1]);
            if let Some(source) = source.filter(|s| raster.known[*s]) {
                sum += distance(at.look, raster.features[source]);
                count += 1;
            }
        }
        let own = samples.len().div_ceil(step);
        *result = mean(sum, count, own);
        all = (all.0 + sum, all.1 + count);
        asked += own;
    }
    sums[SECTORS] = mean(all.0, all.1, asked);
    sums
}

/// The offsets within `reach` texels of a seed that suit the cloth as a whole or a sector of it best, with the difference that each has where it suits
/// least.
fn refine(
    raster: &Known,
    sectors: &[Vec<Sample>; SECTORS],
    seed: Offset,
    reach: i32,
) -> Vec<Candidate> {
    let mut best: [Option<(f32, Offset)>; SECTORS + 1] = [None; SECTORS + 1];
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let offset = [seed[0] + dx, seed[1] + dy];
            let found = differences(raster, sectors, offset, FEW_SAMPLES);
            for (best, found) in best.iter_mut().zip(found) {
                if let Some(found) = found
                    && best.is_none_or(|(least, _)| found < least)
                {
                    *best = Some((found, offset));
                }
            }
        }
    }
    let mut offsets: Vec<Offset> = best.iter().flatten().map(|(_, offset)| *offset).collect();
    offsets.sort_unstable();
    offsets.dedup();
    offsets
        .into_iter()
        .filter_map(|offset| {
            let found = differences(raster, sectors, offset, SAMPLES);
            let difference = found.into_iter().flatten().max_by(f32::total_cmp)?;
            Some(Candidate { offset, difference })
        })
        .collect()
}
