//! Image quilting (Efros and Freeman 2001) in holes: blocks are laid row by row over the hole; each is the one of the known cloth that fits what is there
//! already, the cloth at the rim included, and meets earlier blocks along the cheapest cut.

use super::picture::{Picture, Random, distance};

/// Overlap of blocks, as a share of their side.
const OVERLAP: usize = 4;
/// A block is drawn from those that differ at most so many times as much as the best.
const TOLERANCE: f32 = 1.1;
/// Blocks are compared at every second source along each axis first, and then beside the best ones.
const STEP: usize = 2;

pub fn fill(picture: &Picture, side: usize) -> Picture {
    let (width, height) = (picture.width, picture.height());
    let mut made = picture.clone();
    let mut shown = picture.known.clone();
    let hole: Vec<usize> = (0..picture.hole.len())
        .filter(|at| picture.hole[*at])
        .collect();
    let range = |of: &dyn Fn(usize) -> usize| {
        let all = hole.iter().map(|at| of(*at));
        (all.clone().min().unwrap_or(0), all.max().unwrap_or(0) + 1)
    };
    let ((left, right), (top, bottom)) = (range(&|at| at % width), range(&|at| at / width));
    // Little cloth has no large blocks.
    let sides = (1..=side / 8).rev().map(|eighth| 8 * eighth);
    let mut blocks = sides.map(|side| (side, corners(picture, side)));
    let Some((side, corners)) = blocks.find(|(_, corners)| !corners.is_empty()) else {
        return made;
    };
    let overlap = side / OVERLAP;
    let mut random = Random(0x2545_F491_4F6C_DD1D);
    let start = |x: usize| x.saturating_sub(overlap);
    for y in (start(top)..bottom).step_by(side - overlap) {
        for x in (start(left)..right).step_by(side - overlap) {
            let (x, y) = (x.min(width - side), y.min(height - side));
            let texels: Vec<usize> = (0..side * side)
                .map(|k| (y + k / side) * width + x + k % side)
                .collect();
            if !texels.iter().any(|at| picture.hole[*at]) {
                continue;
            }
            let found = best(&made, &shown, &texels, &corners, &mut random);
            let old = cut(&made, &shown, &texels, found, side);
            for (k, at) in texels.iter().enumerate() {
                let source = found + k / side * width + k % side;
                if picture.hole[*at] && !(shown[*at] && old[k]) {
                    made.colours[*at] = picture.colours[source];
                    shown[*at] = true;
                }
            }
        }
    }
    made
}

/// Upper left corners of blocks that are known everywhere.
fn corners(picture: &Picture, side: usize) -> Vec<usize> {
    let reach = side / 2;
    let middles = picture.squares(reach, |at| picture.known[at]);
    (0..middles.len())
        .filter(|at| middles[*at])
        .map(|at| at - reach * picture.width - reach)
        .collect()
}

fn best(
    made: &Picture,
    shown: &[bool],
    texels: &[usize],
    corners: &[usize],
    random: &mut Random,
) -> usize {
    let width = made.width;
    let side = texels.len().isqrt();
    // Every third texel of what is there tells enough.
    let there: Vec<usize> = (0..texels.len())
        .filter(|k| shown[texels[*k]] && (k % side + k / side).is_multiple_of(3))
        .collect();
    let cost = |corner: usize, most: f32| {
        let mut sum = 0.0;
        for k in &there {
            let source = corner + k / side * width + k % side;
            sum += distance(made.colours[texels[*k]], made.colours[source]);
            if sum > most {
                break;
            }
        }
        sum
    };
    let mut least = f32::INFINITY;
    let mut costs: Vec<(f32, usize)> = Vec::new();
    for corner in corners {
        let [x, y] = [corner % width, corner / width];
        if !(x.is_multiple_of(STEP) && y.is_multiple_of(STEP)) {
            continue;
        }
        let own = cost(*corner, 2.0 * least);
        least = least.min(own);
        costs.push((own, *corner));
    }
    costs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut near: Vec<(f32, usize)> = Vec::new();
    for (_, corner) in costs.iter().take(12) {
        for by in [0, 1, width, width + 1] {
            if corners.binary_search(&(corner + by)).is_ok() {
                near.push((cost(corner + by, f32::INFINITY), corner + by));
            }
        }
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.dedup_by_key(|c| c.1);
    let most = near.first().map_or(0.0, |c| TOLERANCE * c.0 + 1e-6);
    let count = near.iter().take_while(|c| c.0 <= most).count();
    near.get(random.below(count)).map_or(corners[0], |c| c.1)
}

/// Which texels of a block keep what is there: those left of and above the cheapest cuts through the overlaps with earlier blocks.
fn cut(made: &Picture, shown: &[bool], texels: &[usize], corner: usize, side: usize) -> Vec<bool> {
    let overlap = side / OVERLAP;
    let width = made.width;
    let error = |k: usize| {
        let source = corner + k / side * width + k % side;
        match shown[texels[k]] {
            true => distance(made.colours[texels[k]], made.colours[source]),
            false => 0.0,
        }
    };
    let mut old = vec![false; side * side];
    for down in [true, false] {
        // Along the overlap, and across it.
        let index = |along: usize, across: usize| match down {
            true => along * side + across,
            false => across * side + along,
        };
        let mut sums = vec![vec![0.0f32; overlap]; side];
        for along in 0..side {
            for across in 0..overlap {
                let low = across.saturating_sub(1);
                let before = match along {
                    0 => 0.0,
                    _ => (low..(across + 2).min(overlap))
                        .map(|c| sums[along - 1][c])
                        .fold(f32::INFINITY, f32::min),
                };
                sums[along][across] = before + error(index(along, across));
            }
        }
        let least = |row: &[f32], from: usize, to: usize| {
            (from..to)
                .min_by(|a, b| row[*a].total_cmp(&row[*b]))
                .unwrap_or(from)
        };
        let mut at = least(&sums[side - 1], 0, overlap);
        for along in (0..side).rev() {
            if along + 1 < side {
                at = least(&sums[along], at.saturating_sub(1), (at + 2).min(overlap));
            }
            (0..at).for_each(|across| old[index(along, across)] = true);
        }
    }
    old
}
