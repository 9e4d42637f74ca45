//! Holes on the 64×64 grid: circle, ring and percolation as in the paper, and the tears and ragged blobs that worn cloth has.
//!
//! A hole takes about 0.3 to 0.65 of the grid's side, as in the regions that `flatten` cuts out, sometimes up to 0.88. It never touches the
//! grid's border. A mask is `CELLS` flags in the grid's order, true in the hole.

use darn_geometry::grid::{CELLS, SIDE, distances_to};
use rand::Rng;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f32::consts::{PI, TAU};

/// Fewest cells between a hole and the grid's border.
pub(super) const MARGIN: usize = 3;
/// Smallest share of the grid's cells in the holes of a mask.
const LEAST_SHARE: f32 = 0.04;
/// Largest share of the grid's cells in the holes of a mask.
const GREATEST_SHARE: f32 = 0.5;
/// Share of large holes, which leave little cloth around them, as where a region cannot grow further.
const LARGE: f64 = 0.15;

/// The shapes of holes on the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaskShape {
    /// A disk.
    Circle,
    /// A ring around an island of cloth.
    Ring,
    /// Ragged: grown by invasion of a random field.
    Percolation,
    /// Long and thin, along a bent line, with a ragged edge.
    Tear,
    /// Star-shaped with a wavy edge.
    Blob,
}

/// All shapes, each with its share of all holes.
pub const SHAPES: [(MaskShape, f32); 5] = [
    (MaskShape::Circle, 0.18),
    (MaskShape::Ring, 0.07),
    (MaskShape::Percolation, 0.27),
    (MaskShape::Tear, 0.20),
    (MaskShape::Blob, 0.28),
];

/// Draws a mask of one hole, sometimes two, and the shape of the first hole.
pub fn draw(rng: &mut impl Rng) -> (MaskShape, Vec<bool>) {
    let mut at = rng.random_range(0.0..1.0f32);
    let mut shape = MaskShape::Blob;
    for (candidate, share) in SHAPES {
        if at < share {
            shape = candidate;
            break;
        }
        at -= share;
    }
    let first = draw_shape(shape, rng);
    if rng.random_bool(0.88) {
        return (shape, first);
    }
    (shape, beside(first, rng))
}

/// Draws a mask of one hole of the given shape, somewhere near the middle.
pub fn draw_shape(shape: MaskShape, rng: &mut impl Rng) -> Vec<bool> {
    loop {
        let extent = SIDE as f32
            * if rng.random_bool(LARGE) {
                rng.random_range(0.65..0.88)
            } else {
                rng.random_range(0.30..0.65)
            };
        let middle = [place(rng), place(rng)];
        let mask = match shape {
            MaskShape::Circle => disk(middle, 0.0, 0.5 * extent),
            MaskShape::Ring => disk(
                middle,
                0.5 * extent * rng.random_range(0.25..0.6),
                0.5 * extent,
            ),
            MaskShape::Percolation => percolation(middle, 0.5 * extent, rng),
            MaskShape::Tear => tear(middle, extent * 1.2, rng),
            MaskShape::Blob => blob(middle, 0.45 * extent, rng),
        };
        let mask = clear_border(mask);
        let mask = if shape == MaskShape::Ring {
            mask
        } else {
            fill_islands(largest_piece(mask))
        };
        let share = mask.iter().filter(|&&m| m).count() as f32 / CELLS as f32;
        if (LEAST_SHARE..=GREATEST_SHARE).contains(&share) {
            return mask;
        }
    }
}

fn place(rng: &mut impl Rng) -> f32 {
    SIDE as f32 * rng.random_range(0.38..0.62)
}

/// Adds a second, smaller hole where there is room for it.
fn beside(first: Vec<bool>, rng: &mut impl Rng) -> Vec<bool> {
    let away = distances_to(&first);
    for _ in 0..20 {
        let middle = [0, 1].map(|_| rng.random_range(0.15..0.85) * SIDE as f32);
        let radius = rng.random_range(3.0..8.0);
        let second = clear_border(blob(middle, radius, rng));
        let clear = second.iter().zip(&away).all(|(&m, &d)| !m || d > 4.0);
        let both: Vec<bool> = first.iter().zip(&second).map(|(a, b)| a | b).collect();
        let share = both.iter().filter(|&&m| m).count() as f32 / CELLS as f32;
        if clear && second.contains(&true) && share <= GREATEST_SHARE {
            return both;
        }
    }
    first
}

/// The centres of all cells, in cells.
fn cells() -> impl Iterator<Item = [f32; 2]> {
    (0..CELLS).map(|k| [(k % SIDE) as f32 + 0.5, (k / SIDE) as f32 + 0.5])
}

fn disk(middle: [f32; 2], inner: f32, outer: f32) -> Vec<bool> {
    cells()
        .map(|[x, y]| {
            let r = (x - middle[0]).hypot(y - middle[1]);
            r >= inner && r < outer
        })
        .collect()
}

/// Star-shaped: the radius is a random Fourier series of the angle, rough or smooth.
fn blob(middle: [f32; 2], radius: f32, rng: &mut impl Rng) -> Vec<bool> {
    let rough = rng.random_range(0.1..0.5);
    let fall = rng.random_range(0.8..1.5f32);
    let waves: Vec<[f32; 2]> = (1..10)
        .map(|k| {
            [
                rough * rng.random_range(-1.0..1.0) / (k as f32).powf(fall),
                rng.random_range(0.0..TAU),
            ]
        })
        .collect();
    cells()
        .map(|[x, y]| {
            let (dx, dy) = (x - middle[0], y - middle[1]);
            let angle = dy.atan2(dx);
            let wave: f32 = waves
                .iter()
                .enumerate()
                .map(|(k, w)| w[0] * ((k + 1) as f32 * angle + w[1]).cos())
                .sum();
            dx.hypot(dy) < radius * (1.0 + wave).max(0.3)
        })
        .collect()
}

/// A bent line of varying width, `length` cells long before clipping.
fn tear(middle: [f32; 2], length: f32, rng: &mut impl Rng) -> Vec<bool> {
    let width = rng.random_range(2.5..7.0);
    let ragged = rng.random_range(0.0..0.35);
    let mut heading = rng.random_range(0.0..TAU);
    let bend = rng.random_range(-1.2..1.2) / length;
    let (steps, phase) = (length.ceil() as usize * 2, rng.random_range(0.0..TAU));
    let mut course: Vec<([f32; 2], f32)> = Vec::with_capacity(steps);
    let mut at = [0.0f32, 0.0];
    for n in 0..steps {
        let t = (n as f32 + 0.5) / steps as f32;
        heading += 0.5 * bend + rng.random_range(-1.0..1.0) * ragged * 0.3;
        at = [at[0] + 0.5 * heading.cos(), at[1] + 0.5 * heading.sin()];
        let taper = (PI * t).sin().sqrt() * (1.0 + 0.3 * (9.0 * t + phase).sin());
        course.push((
            at,
            (width * taper * (1.0 + rng.random_range(-1.0..1.0) * ragged)).max(0.8),
        ));
    }
    let half = course[steps / 2].0;
    cells()
        .map(|[x, y]| {
            let (x, y) = (x - middle[0] + half[0], y - middle[1] + half[1]);
            course
                .iter()
                .any(|(p, w)| (x - p[0]).powi(2) + (y - p[1]).powi(2) < w * w)
        })
        .collect()
}

/// Invasion percolation: from the middle outwards, always the neighbour with the least of a random field that rises with the radius.
fn percolation(middle: [f32; 2], radius: f32, rng: &mut impl Rng) -> Vec<bool> {
    let mut field: Vec<f32> = (0..CELLS).map(|_| rng.random_range(0.0..1.0)).collect();
    let rounds = rng.random_range(0..4);
    for _ in 0..rounds {
        field = blurred(&field);
    }
    // Blurring narrows the range of the field. It is widened again, so that its roughness keeps its weight against the radius.
    let weight = rng.random_range(0.5..1.6) * [1.0, 3.0, 4.5, 6.0][rounds];
    let target = (rng.random_range(0.45..0.9) * PI * radius * radius) as usize;
    let value = |k: usize| {
        let [dx, dy] = [
            (k % SIDE) as f32 + 0.5 - middle[0],
            (k / SIDE) as f32 + 0.5 - middle[1],
        ];
        weight * field[k] + (dx * dx + dy * dy) / (radius * radius)
    };
    let start = middle[1] as usize * SIDE + middle[0] as usize;
    let mut mask = vec![false; CELLS];
    let mut seen = vec![false; CELLS];
    let mut front = BinaryHeap::from([FrontierCell {
        value: value(start),
        cell: start,
    }]);
    seen[start] = true;
    let mut taken = 0;
    while let Some(FrontierCell { cell: k, .. }) = front.pop() {
        mask[k] = true;
        taken += 1;
        if taken >= target {
            break;
        }
        for n in around(k) {
            if !seen[n] {
                seen[n] = true;
                front.push(FrontierCell {
                    value: value(n),
                    cell: n,
                });
            }
        }
    }
    mask
}

/// A cell that may be invaded next; the cell of the smallest value comes first.
#[derive(PartialEq)]
struct FrontierCell {
    value: f32,
    cell: usize,
}

impl Eq for FrontierCell {}
impl Ord for FrontierCell {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .value
            .total_cmp(&self.value)
            .then(other.cell.cmp(&self.cell))
    }
}
impl PartialOrd for FrontierCell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

fn blurred(field: &[f32]) -> Vec<f32> {
    (0..CELLS)
        .map(|k| {
            let (sum, count) = around(k).fold((field[k], 1.0), |(s, c), n| (s + field[n], c + 1.0));
            sum / count
        })
        .collect()
}

/// The up to four neighbours of a cell.
fn around(k: usize) -> impl Iterator<Item = usize> {
    let (i, j) = (k % SIDE, k / SIDE);
    let left = (i > 0).then(|| k - 1);
    let right = (i + 1 < SIDE).then_some(k + 1);
    let below = (j > 0).then(|| k - SIDE);
    let above = (j + 1 < SIDE).then_some(k + SIDE);
    [left, right, below, above].into_iter().flatten()
}

fn clear_border(mut mask: Vec<bool>) -> Vec<bool> {
    let inside = MARGIN..SIDE - MARGIN;
    for (k, m) in mask.iter_mut().enumerate() {
        *m &= inside.contains(&(k % SIDE)) && inside.contains(&(k / SIDE));
    }
    mask
}

/// The cells that are not in a mask.
fn inverted(mask: &[bool]) -> Vec<bool> {
    mask.iter().map(|m| !m).collect()
}

/// All 4-connected pieces of a mask, each as a list of cells.
fn pieces(mask: &[bool]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; CELLS];
    let mut found = Vec::new();
    for start in 0..CELLS {
        if !mask[start] || seen[start] {
            continue;
        }
        seen[start] = true;
        let mut piece = vec![start];
        let mut next = 0;
        while next < piece.len() {
            for n in around(piece[next]) {
                if mask[n] && !seen[n] {
                    seen[n] = true;
                    piece.push(n);
                }
            }
            next += 1;
        }
        found.push(piece);
    }
    found
}

fn largest_piece(mask: Vec<bool>) -> Vec<bool> {
    let mut kept = vec![false; CELLS];
    let largest = pieces(&mask)
        .into_iter()
        .max_by_key(Vec::len)
        .unwrap_or_default();
    for k in largest {
        kept[k] = true;
    }
    kept
}

/// The mask with the islands of cloth inside a hole added to the hole.
fn fill_islands(mut mask: Vec<bool>) -> Vec<bool> {
    for piece in pieces(&inverted(&mask)) {
        if !piece.contains(&0) {
            for k in piece {
                mask[k] = true;
            }
        }
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    proptest! {
        #[test]
        fn a_hole_is_one_piece_of_fair_size_clear_of_the_border(seed: u64, kind in 0usize..5) {
            let shape = SHAPES[kind].0;
            let mask = draw_shape(shape, &mut ChaCha8Rng::seed_from_u64(seed));
            let share = mask.iter().filter(|&&m| m).count() as f32 / CELLS as f32;
            prop_assert!((LEAST_SHARE..=GREATEST_SHARE).contains(&share), "{share}");
            let inside = MARGIN..SIDE - MARGIN;
            for (k, _) in mask.iter().enumerate().filter(|(_, m)| **m) {
                prop_assert!(inside.contains(&(k % SIDE)) && inside.contains(&(k / SIDE)));
            }
            prop_assert_eq!(pieces(&mask).len(), 1);
            prop_assert_eq!(pieces(&inverted(&mask)).len(), if shape == MaskShape::Ring { 2 } else { 1 });
        }
    }

    #[test]
    fn the_same_seed_draws_the_same_mask() {
        let draw_once = || draw(&mut ChaCha8Rng::seed_from_u64(5));
        assert_eq!(draw_once(), draw_once());
    }

    #[test]
    fn shares_of_shapes_add_to_one() {
        assert!((SHAPES.iter().map(|s| s.1).sum::<f32>() - 1.0).abs() < 1e-6);
    }
}
