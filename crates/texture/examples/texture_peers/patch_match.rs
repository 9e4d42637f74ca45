//! Completion by patches from coarse to fine: Wexler, Shechtman and Irani 2007 with the search of Barnes et al. 2009, as Newson et al. 2014 put them together.

use super::picture::{Colour, Picture, Random, distance};

/// Texels from a patch's middle to its sides.
const REACH: usize = 3;
/// The hole's texels along a side at the coarsest level, about, against a patch's.
const COARSEST: f32 = 2.0;
/// Rounds of search and vote at the coarsest level and at the finest.
const ROUNDS: [usize; 2] = [14, 5];
/// Sweeps of a search.
const SWEEPS: usize = 4;
/// No source.
const NONE: u32 = u32::MAX;

/// The source of each texel's patch, and the mean squared distance.
struct Matches {
    source: Vec<u32>,
    cost: Vec<f32>,
}

pub fn fill(picture: &Picture) -> Picture {
    let mut levels = vec![picture.clone()];
    let side = |p: &Picture| (p.hole.iter().filter(|h| **h).count() as f32).sqrt();
    while let Some(last) = levels.last() {
        let is_small = side(last) <= COARSEST * (2 * REACH + 1) as f32;
        let next = last.halved();
        if is_small || !next.squares(REACH, |at| next.known[at]).contains(&true) {
            break;
        }
        levels.push(next);
    }
    let count = levels.len();
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut before: Option<(Picture, Matches)> = None;
    for (level, mut own) in levels.into_iter().enumerate().rev() {
        let sources = own.squares(REACH, |at| own.known[at]);
        let mut matches = match &before {
            None => {
                from_rim(&mut own);
                Matches::random(&own, &sources, &mut random)
            }
            Some((coarse, matches)) => matches.finer(coarse, &own, &sources, &mut random),
        };
        if before.is_some() {
            matches.measure(&own);
            vote(&mut own, &matches);
        }
        let rounds = if level + 1 == count {
            ROUNDS[0]
        } else {
            ROUNDS[1]
        };
        for _ in 0..rounds {
            matches.measure(&own);
            for sweep in 0..SWEEPS {
                matches.sweep(&own, &sources, sweep % 2 == 1, &mut random);
            }
            vote(&mut own, &matches);
        }
        if level == 0 {
            copy_nearest(&mut own, &matches);
        }
        before = Some((own, matches));
    }
    before.map_or_else(|| picture.clone(), |(own, _)| own)
}

/// Fills the hole from its rim inwards by means of neighbours.
fn from_rim(picture: &mut Picture) {
    let mut shown = picture.known.clone();
    loop {
        let before = shown.clone();
        let mut changed = false;
        for at in (0..before.len()).filter(|at| picture.hole[*at] && !before[*at]) {
            let (mut sum, mut count) = ([0.0f32; 3], 0.0f32);
            for other in patch(picture, at, 1).flatten().filter(|o| before[*o]) {
                count += 1.0;
                (0..3).for_each(|k| sum[k] += picture.colours[other][k]);
            }
            if count > 0.0 {
                picture.colours[at] = sum.map(|x| x / count);
                shown[at] = true;
                changed = true;
            }
        }
        if !changed {
            return;
        }
    }
}

/// The texels of a square around a texel; `None` outside of the picture.
fn patch(picture: &Picture, at: usize, reach: usize) -> impl Iterator<Item = Option<usize>> {
    let (width, height) = (picture.width as i64, picture.height() as i64);
    let (x, y, reach) = (at as i64 % width, at as i64 / width, reach as i64);
    (-reach..=reach).flat_map(move |dy| {
        (-reach..=reach).map(move |dx| {
            let (u, v) = (x + dx, y + dy);
            let inside = u >= 0 && v >= 0 && u < width && v < height;
            inside.then(|| (v * width + u) as usize)
        })
    })
}

impl Matches {
    fn random(picture: &Picture, sources: &[bool], random: &mut Random) -> Matches {
        let all: Vec<u32> = (0..sources.len() as u32)
            .filter(|at| sources[*at as usize])
            .collect();
        let mut source = vec![NONE; sources.len()];
        for at in targets(picture) {
            source[at] = all[random.below(all.len())];
        }
        Matches {
            cost: vec![f32::INFINITY; source.len()],
            source,
        }
    }

    /// The matches of the next finer level.
    fn finer(
        &self,
        coarse: &Picture,
        fine: &Picture,
        sources: &[bool],
        random: &mut Random,
    ) -> Matches {
        let mut matches = Matches::random(fine, sources, random);
        for at in targets(fine) {
            let (x, y) = (at % fine.width, at / fine.width);
            let source = self.source[y / 2 * coarse.width + x / 2];
            if source == NONE {
                continue;
            }
            let (u, v) = (
                source as usize % coarse.width,
                source as usize / coarse.width,
            );
            let found = (2 * v + y % 2) * fine.width + 2 * u + x % 2;
            if sources.get(found).is_some_and(|s| *s) {
                matches.source[at] = found as u32;
            }
        }
        matches
    }

    /// Measures all matches again after a vote.
    fn measure(&mut self, picture: &Picture) {
        for at in 0..self.source.len() {
            if self.source[at] != NONE {
                self.cost[at] = cost(picture, at, self.source[at] as usize, f32::INFINITY);
            }
        }
    }

    fn sweep(&mut self, picture: &Picture, sources: &[bool], back: bool, random: &mut Random) {
        let mut all = targets(picture);
        if back {
            all.reverse();
        }
        let width = picture.width as i64;
        let height = picture.height() as i64;
        let side = if back { 1 } else { -1 };
        for at in all {
            let try_source = |matches: &mut Matches, found: i64| {
                if found < 0 || !sources.get(found as usize).is_some_and(|s| *s) {
                    return;
                }
                let own = cost(picture, at, found as usize, matches.cost[at]);
                if own < matches.cost[at] {
                    matches.cost[at] = own;
                    matches.source[at] = found as u32;
                }
            };
            for step in [side, side * width] {
                let other = at as i64 + step;
                if let Some(source) = self.source.get(other as usize).filter(|s| **s != NONE) {
                    let found = i64::from(*source) - step;
                    try_source(self, found);
                }
            }
            let mut radius = width.max(height);
            while radius >= 1 {
                let source = i64::from(self.source[at]);
                let mut shift = || random.below(2 * radius as usize + 1) as i64 - radius;
                let (u, v) = (source % width + shift(), source / width + shift());
                if u >= 0 && v >= 0 && u < width && v < height {
                    try_source(self, v * width + u);
                }
                radius /= 2;
            }
        }
    }
}

/// Texels whose patches hold a texel of the hole.
fn targets(picture: &Picture) -> Vec<usize> {
    let clear = picture.squares(REACH, |at| !picture.hole[at]);
    let touches = |at: &usize| {
        !clear[*at]
            && patch(picture, *at, REACH)
                .flatten()
                .any(|k| picture.hole[k])
    };
    (0..picture.hole.len()).filter(touches).collect()
}

/// Mean squared distance of two patches; more than `most` once it is certain to be.
fn cost(picture: &Picture, at: usize, source: usize, most: f32) -> f32 {
    let width = picture.width;
    let rows = picture.height();
    let (x, y) = (at % width, at / width);
    let first = source - REACH * width - REACH;
    let (mut sum, mut count) = (0.0f32, 0.0f32);
    // So many of the patch's texels count at most.
    let bound = most * ((2 * REACH + 1) * (2 * REACH + 1)) as f32;
    for r in 0..=2 * REACH {
        let Some(v) = (y + r).checked_sub(REACH).filter(|v| *v < rows) else {
            continue;
        };
        for c in 0..=2 * REACH {
            let Some(u) = (x + c).checked_sub(REACH).filter(|u| *u < width) else {
                continue;
            };
            let own = v * width + u;
            if picture.known[own] || picture.hole[own] {
                sum += distance(picture.colours[own], picture.colours[first + r * width + c]);
                count += 1.0;
            }
        }
        if sum > bound {
            return f32::INFINITY;
        }
    }
    sum / count.max(1.0)
}

/// Every texel of the hole becomes the mean of what the patches over it show, near ones counting more.
fn vote(picture: &mut Picture, matches: &Matches) {
    let mut next: Vec<(usize, Colour)> = Vec::new();
    for at in (0..picture.hole.len()).filter(|at| picture.hole[*at]) {
        let votes = votes(picture, matches, at);
        let mut costs: Vec<f32> = votes.iter().map(|v| v.0).collect();
        costs.sort_by(f32::total_cmp);
        let spread = costs[costs.len() * 3 / 4].max(1e-6);
        let (mut sum, mut total) = ([0.0f32; 3], 0.0f32);
        for (cost, colour) in votes {
            let weight = (-cost / (2.0 * spread)).exp();
            total += weight;
            (0..3).for_each(|k| sum[k] += weight * colour[k]);
        }
        next.push((at, sum.map(|x| x / total)));
    }
    next.into_iter()
        .for_each(|(at, colour)| picture.colours[at] = colour);
}

/// The colours and costs that the patches over a texel give it.
fn votes(picture: &Picture, matches: &Matches, at: usize) -> Vec<(f32, Colour)> {
    let others = patch(picture, at, REACH).flatten();
    others
        .filter(|other| matches.source[*other] != NONE)
        .map(|other| {
            let found = i64::from(matches.source[other]) + at as i64 - other as i64;
            (matches.cost[other], picture.colours[found as usize])
        })
        .collect()
}

/// Every texel of the hole takes the colour of the patch over it that fits best: votes blur.
fn copy_nearest(picture: &mut Picture, matches: &Matches) {
    let hole = (0..picture.hole.len()).filter(|at| picture.hole[*at]);
    let best = hole.filter_map(|at| {
        let votes = votes(picture, matches, at).into_iter();
        Some((at, votes.min_by(|a, b| a.0.total_cmp(&b.0))?.1))
    });
    let best: Vec<(usize, Colour)> = best.collect();
    best.into_iter()
        .for_each(|(at, colour)| picture.colours[at] = colour);
}
