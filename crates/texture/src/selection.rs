//! Few offsets of many, so that every place of the hole has some that suit the cloth next to it, in each direction: on either side of a band other
//! offsets suit than along it.

use rayon::prelude::*;

use crate::features::distance;
use crate::offsets::{Candidate, Known, Offset, Sample, spread};

/// Offsets that are kept.
const KEPT: usize = 48;
/// Places of the hole, and of the cloth beside it.
const PLACES: usize = 110;
const BESIDE: usize = 220;
/// Directions in which a place looks for the cloth next to it.
const DIRECTIONS: usize = 8;
/// Cloth counts as beside the hole up to this share of the hole's side from it.
const BESIDE_SHARE: f32 = 0.12;
/// Places of the cloth in each direction that tell what suits a place of the hole.
const NEIGHBOURS: usize = 2;
/// How much the best, second and third offset of a place count.
const RANKS: [f32; 3] = [1.0, 0.35, 0.15];
/// Texels from the middle of a compared window to its samples.
const WINDOW: [i32; 3] = [-3, 0, 3];
/// Distance of two kept offsets at least, in texels.
const APART: i32 = 2;

/// Chooses greedily the offsets that lower the sum over places and directions of the costs of their best three most; `unserved` is the cost of a place
/// without an offset.
pub(crate) fn select(raster: &Known, all: &[Candidate], unserved: f32) -> Vec<Candidate> {
    let hole = spread(raster.hole, PLACES);
    let beside = beside(raster);
    let nearest: Vec<(usize, Vec<usize>)> = hole
        .iter()
        .flat_map(|at| nearest(raster, *at, &beside))
        .collect();
    let windows: Vec<Vec<Sample>> = beside.iter().map(|at| window(raster, *at)).collect();
    let costs: Vec<Vec<f32>> = all
        .par_iter()
        .map(|candidate| {
            let at_rim: Vec<Option<f32>> = (windows.iter())
                .map(|window| window_cost(raster, window, candidate.offset))
                .collect();
            let cost = |(at, nearest): &(usize, Vec<usize>)| {
                if raster.source(*at, candidate.offset).is_none() {
                    return unserved;
                }
                let known = nearest.iter().filter_map(|k| at_rim[*k]);
                let (sum, count) = known.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
                // Where little can be compared, what holds for all of the cloth counts.
                let share = if count > 0.0 { 0.2 } else { 1.0 };
                (sum + share * candidate.difference) / (count + share)
            };
            nearest.iter().map(cost).collect()
        })
        .collect();
    let mut best = vec![[unserved; 3]; nearest.len()];
    // Gains only become smaller, so one that was counted anew and is still the largest is the largest of all.
    let mut bounds: Vec<f32> = costs.par_iter().map(|costs| gain(&best, costs)).collect();
    let mut kept: Vec<Candidate> = Vec::new();
    while kept.len() < KEPT {
        let Some(found) = largest_of(&bounds) else {
            break;
        };
        bounds[found] = gain(&best, &costs[found]);
        if largest_of(&bounds) != Some(found) {
            continue;
        }
        for (best, cost) in best.iter_mut().zip(&costs[found]) {
            *best = inserted(*best, *cost);
        }
        let own = all[found].offset;
        for (bound, other) in bounds.iter_mut().zip(all) {
            if (0..2).all(|d| (own[d] - other.offset[d]).abs() < APART) {
                *bound = 0.0;
            }
        }
        kept.push(all[found]);
    }
    kept
}

/// The first of the largest that is above zero.
fn largest_of(bounds: &[f32]) -> Option<usize> {
    let largest = (0..bounds.len())
        .rev()
        .max_by(|a, b| bounds[*a].total_cmp(&bounds[*b]));
    largest.filter(|k| bounds[*k] > 0.0)
}

fn inserted([a, b, c]: [f32; 3], x: f32) -> [f32; 3] {
    match x {
        x if x < a => [x, a, b],
        x if x < b => [a, x, b],
        x if x < c => [a, b, x],
        _ => [a, b, c],
    }
}

fn gain(best: &[[f32; 3]], costs: &[f32]) -> f32 {
    let sum = |ranked: [f32; 3]| (0..3).map(|k| RANKS[k] * ranked[k]).sum::<f32>();
    (best.iter().zip(costs))
        .filter(|(best, cost)| **cost < best[2])
        .map(|(best, cost)| sum(*best) - sum(inserted(*best, *cost)))
        .sum()
}

/// Samples of the known cloth next to the hole.
fn beside(raster: &Known) -> Vec<usize> {
    let page = raster.hole.len();
    let holes = raster.hole.iter().filter(|h| **h).count() as f32;
    let reach = (BESIDE_SHARE * holes.sqrt()).max(4.0) as usize;
    let width = raster.width;
    let height = page / width;
    let mut rows = vec![false; page];
    for (row, out) in raster.hole.chunks(width).zip(rows.chunks_mut(width)) {
        widen(row.iter().copied(), reach)
            .into_iter()
            .zip(out)
            .for_each(|(near, out)| *out = near);
    }
    let mut known = vec![false; page];
    for column in 0..width {
        let near = widen((0..height).map(|r| rows[r * width + column]), reach);
        for (row, near) in near.into_iter().enumerate() {
            known[row * width + column] = near && raster.known[row * width + column];
        }
    }
    spread(&known, BESIDE)
}

/// Which of a row are within so many of one that is set.
fn widen(row: impl Iterator<Item = bool>, reach: usize) -> Vec<bool> {
    let set: Vec<bool> = row.collect();
    let mut near = vec![0i32; set.len() + 1];
    for (at, _) in set.iter().enumerate().filter(|(_, set)| **set) {
        near[at.saturating_sub(reach)] += 1;
        near[(at + reach + 1).min(set.len())] -= 1;
    }
    let mut open = 0;
    near[..set.len()]
        .iter()
        .map(|change| {
            open += change;
            open > 0
        })
        .collect()
}

/// For each direction in which there are any: a texel with the samples that lie nearest to it there.
fn nearest(raster: &Known, at: usize, samples: &[usize]) -> Vec<(usize, Vec<usize>)> {
    let place = |at: usize| [(at % raster.width) as i64, (at / raster.width) as i64];
    let [x, y] = place(at);
    let mut all: Vec<(usize, i64, usize)> = (samples.iter().enumerate())
        .map(|(k, s)| {
            let [u, v] = place(*s);
            let (dx, dy) = (u - x, v - y);
            let turn =
                (dy as f64).atan2(dx as f64) / std::f64::consts::TAU + 0.5 / DIRECTIONS as f64;
            let direction = (turn.rem_euclid(1.0) * DIRECTIONS as f64) as usize;
            (direction.min(DIRECTIONS - 1), dx * dx + dy * dy, k)
        })
        .collect();
    all.sort_unstable();
    all.chunk_by(|a, b| a.0 == b.0)
        .map(|own| (at, own.iter().take(NEIGHBOURS).map(|o| o.2).collect()))
        .collect()
}

/// The known texels of a window.
fn window(raster: &Known, at: usize) -> Vec<Sample> {
    let (x, y) = ((at % raster.width) as i32, (at / raster.width) as i32);
    WINDOW
        .into_iter()
        .flat_map(|v| WINDOW.into_iter().map(move |u| [x + u, y + v]))
        .filter_map(|place| {
            let known = raster.at(place[0], place[1]).filter(|at| raster.known[*at]);
            let look = raster.features[known?];
            Some(Sample { place, look })
        })
        .collect()
}

/// Mean squared difference over a window of the known cloth; `None` when the offset leads most of it to nothing known.
fn window_cost(raster: &Known, window: &[Sample], [dx, dy]: Offset) -> Option<f32> {
    let (mut sum, mut count) = (0.0f32, 0);
    for Sample {
        place: [x, y],
        look,
    } in window
    {
        let other = raster.at(x + dx, y + dy).filter(|at| raster.known[*at]);
        if let Some(other) = other {
            sum += distance(*look, raster.features[other]);
            count += 1;
        }
    }
    (count > 4).then(|| sum / count as f32)
}
