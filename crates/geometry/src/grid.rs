//! The grid: 64×64 samples of a chart, which of them are known, and the network's units.
//!
//! Cell (i, j) has index j·64 + i and its centre at uv ((i + ½)/64, (j + ½)/64); u grows with i, v with j.

use crate::mesh::{Vec2, Vec3};

/// Number of cells along one side of a grid.
pub const SIDE: usize = 64;
/// Number of cells of a grid.
pub const CELLS: usize = SIDE * SIDE;

/// Positions sampled on the chart's unit square, in scene space.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// One position per cell; meaningless where `known` is false.
    pub positions: Vec<Vec3>,
    /// Whether the scan covers the cell's centre; false in holes and outside the region.
    pub known: Vec<bool>,
}

/// A grid in the network's units: mean of the known cells at the origin, mean spacing of neighbouring known cells 1/64.
#[derive(Debug, Clone, PartialEq)]
pub struct NormalGrid {
    /// One position per cell; zero where unknown.
    pub positions: Vec<[f32; 3]>,
    /// 1 where the position is given, 0 where it is to be filled; values between are soft.
    pub known: Vec<f32>,
    /// A smooth fill of the scan's known cells without anchors, one position per cell, if there is one; anchors are
    /// found by comparing with it.
    pub base: Option<Vec<[f32; 3]>>,
}

/// The similarity transform between scene space and the network's units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normalisation {
    /// Mean of the known positions, scene space.
    pub centre: Vec3,
    /// Scene units per network unit: 64 × the mean spacing of known neighbours.
    pub scale: f64,
}

/// Mean and variance of the distance between 4-neighbours, in the units of the positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spacing {
    /// Mean distance.
    pub mean: f64,
    /// Variance of the distance.
    pub variance: f64,
    /// How many pairs were measured.
    pub pairs: usize,
}

/// The index of cell (i, j).
#[inline]
pub fn cell_index(i: usize, j: usize) -> usize {
    j * SIDE + i
}

/// The uv of the centre of the cell with this index.
#[inline]
pub fn cell_centre(index: usize) -> Vec2 {
    let half = 0.5 / SIDE as f64;
    Vec2::new(
        (index % SIDE) as f64 / SIDE as f64 + half,
        (index / SIDE) as f64 / SIDE as f64 + half,
    )
}

/// The index of the cell that a uv lies in; the nearest cell for a uv outside the unit square.
#[inline]
pub fn cell_at(uv: Vec2) -> usize {
    let along = |x: f64| ((x * SIDE as f64).floor().max(0.0) as usize).min(SIDE - 1);
    cell_index(along(uv.x), along(uv.y))
}

/// The index pairs of all 4-neighbours: first the pairs along u, then those along v.
pub fn neighbour_pairs() -> impl Iterator<Item = (usize, usize)> {
    let right = (0..CELLS)
        .filter(|k| k % SIDE + 1 < SIDE)
        .map(|k| (k, k + 1));
    let upper = (0..CELLS - SIDE).map(|k| (k, k + SIDE));
    right.chain(upper)
}

/// Exact distance of every cell's centre from the nearest cell of the mask, in cells, computed by columns and then by rows; at least
/// the grid's side where the mask is empty.
pub fn distances_to(mask: &[bool]) -> Vec<f32> {
    const FAR: f32 = 4.0 * SIDE as f32;
    let mut column = vec![FAR; CELLS];
    for i in 0..SIDE {
        let mut away = FAR;
        for j in 0..SIDE {
            away = if mask[j * SIDE + i] { 0.0 } else { away + 1.0 };
            column[j * SIDE + i] = away.min(FAR);
        }
        away = FAR;
        for j in (0..SIDE).rev() {
            away = if mask[j * SIDE + i] { 0.0 } else { away + 1.0 };
            column[j * SIDE + i] = column[j * SIDE + i].min(away);
        }
    }
    let mut all = Vec::with_capacity(CELLS);
    for row in column.chunks_exact(SIDE) {
        for i in 0..SIDE {
            let near2 = row.iter().enumerate().fold(f32::MAX, |least, (n, &d)| {
                let across = n as f32 - i as f32;
                least.min(d * d + across * across)
            });
            all.push(near2.sqrt());
        }
    }
    all
}

/// Spacing of the pairs of 4-neighbours for which `counted` is true.
pub fn spacing(positions: &[Vec3], counted: impl Fn(usize, usize) -> bool) -> Spacing {
    let (mut sum, mut squares, mut pairs) = (0.0, 0.0, 0usize);
    for (a, b) in neighbour_pairs().filter(|&(a, b)| counted(a, b)) {
        let d = (positions[a] - positions[b]).norm();
        sum += d;
        squares += d * d;
        pairs += 1;
    }
    let n = pairs.max(1) as f64;
    let mean = sum / n;
    Spacing {
        mean,
        variance: (squares / n - mean * mean).max(0.0),
        pairs,
    }
}

impl Grid {
    /// A grid without known cells.
    pub fn unknown() -> Self {
        Grid {
            positions: vec![Vec3::zeros(); CELLS],
            known: vec![false; CELLS],
        }
    }

    /// Number of known cells.
    pub fn known_count(&self) -> usize {
        self.known.iter().filter(|k| **k).count()
    }

    /// The transform that brings this grid to the network's units; `None` when no two neighbouring cells are known or
    /// all known cells coincide.
    pub fn normalisation(&self) -> Option<Normalisation> {
        let spacing = spacing(&self.positions, |a, b| self.known[a] && self.known[b]);
        if spacing.pairs == 0 || spacing.mean <= 0.0 || !spacing.mean.is_finite() {
            return None;
        }
        let known = self.positions.iter().zip(&self.known).filter(|(_, k)| **k);
        let centre = known.fold(Vec3::zeros(), |sum, (p, _)| sum + p) / self.known_count() as f64;
        Some(Normalisation {
            centre,
            scale: spacing.mean * SIDE as f64,
        })
    }

    /// This grid in the network's units.
    pub fn normalised(&self, by: &Normalisation) -> NormalGrid {
        let positions = self
            .positions
            .iter()
            .zip(&self.known)
            .map(|(p, known)| if *known { by.to_network(p) } else { [0.0; 3] })
            .collect();
        NormalGrid {
            positions,
            known: self.known.iter().map(|k| f32::from(u8::from(*k))).collect(),
            base: None,
        }
    }

    /// Positions of all cells in scene space: the scan's where known, `predicted` (one position per cell, network's
    /// units) elsewhere.
    pub fn filled(&self, predicted: &[[f32; 3]], by: &Normalisation) -> Vec<Vec3> {
        self.positions
            .iter()
            .zip(&self.known)
            .zip(predicted)
            .map(|((p, known), q)| if *known { *p } else { by.to_scene(q) })
            .collect()
    }
}

impl NormalGrid {
    /// How rough the known cells are, in cells: the size of the noise that would give their third differences along u and v, which folds hardly
    /// show in. Root mean square over the smaller 95 % of them, so that a spike of the scan does not count; 0 where no four cells in a row are known.
    pub fn roughness(&self) -> f64 {
        let known = |k: usize| self.known[k] > 0.5;
        let at = |k: usize| Vec3::from(self.positions[k].map(f64::from));
        let along = |step: usize, room: fn(usize) -> usize| {
            let whole = move |k: &usize| room(*k) > 3 && (0..4).all(|n| known(k + n * step));
            let starts = (0..CELLS).filter(whole);
            starts.map(move |k| {
                let [a, b, c, d] = [0, 1, 2, 3].map(|n| at(k + n * step));
                (a - b * 3.0 + c * 3.0 - d).norm_squared()
            })
        };
        let rows = along(1, |k| SIDE - k % SIDE);
        let mut squares: Vec<f64> = rows.chain(along(SIDE, |k| SIDE - k / SIDE)).collect();
        squares.sort_unstable_by(f64::total_cmp);
        squares.truncate(squares.len().div_ceil(20) * 19);
        // A third difference of independent noise has 1 + 9 + 9 + 1 times its variance, on each of three axes.
        let variance = squares.iter().sum::<f64>() / (60 * squares.len().max(1)) as f64;
        variance.sqrt() * SIDE as f64
    }
}

impl Normalisation {
    /// A position in scene space, in the network's units.
    #[inline]
    pub fn to_network(&self, p: &Vec3) -> [f32; 3] {
        let q = (p - self.centre) / self.scale;
        [q.x as f32, q.y as f32, q.z as f32]
    }

    /// A position in the network's units, in scene space.
    #[inline]
    pub fn to_scene(&self, q: &[f32; 3]) -> Vec3 {
        Vec3::new(q[0].into(), q[1].into(), q[2].into()) * self.scale + self.centre
    }
}

/// Bicubic (Catmull–Rom) interpolation of positions, one per cell, at a uv; linear extrapolation beyond the outermost
/// cell centres.
pub fn evaluate(positions: &[Vec3], uv: Vec2) -> Vec3 {
    let place = |x: f64| catmull_rom(x * SIDE as f64 - 0.5, SIDE);
    let ((wu, iu), (wv, iv)) = (place(uv.x), place(uv.y));
    let mut sum = Vec3::zeros();
    for (b, j) in iv.iter().enumerate() {
        for (a, i) in iu.iter().enumerate() {
            sum += positions[cell_index(*i, *j)] * (wu[a] * wv[b]);
        }
    }
    sum
}

/// Bilinear interpolation of numbers, one per cell, at a uv; constant beyond the outermost cell centres.
pub fn interpolate(values: &[f64], uv: Vec2) -> f64 {
    let place = |x: f64| {
        let s = (x * SIDE as f64 - 0.5).clamp(0.0, (SIDE - 1) as f64);
        let base = (s.floor() as usize).min(SIDE - 2);
        (base, s - base as f64)
    };
    let ((i, s), (j, t)) = (place(uv.x), place(uv.y));
    let row = |j: usize| values[cell_index(i, j)] * (1.0 - s) + values[cell_index(i + 1, j)] * s;
    row(j) * (1.0 - t) + row(j + 1) * t
}

/// Weights and indices of the four samples around place `s` on a line of `side` ≥ 2 samples, which lie at 0, 1, 2 and so on.
/// Next to the ends, where a sample is missing, the two nearest ones interpolate linearly.
pub(crate) fn catmull_rom(s: f64, side: usize) -> ([f64; 4], [usize; 4]) {
    let base = (s.floor().max(0.0) as usize).min(side - 2);
    let t = s - base as f64;
    if base == 0 || base + 2 >= side {
        return ([0.0, 1.0 - t, t, 0.0], [base, base, base + 1, base + 1]);
    }
    let (t2, t3) = (t * t, t * t * t);
    let weights = [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ];
    (weights, [base - 1, base, base + 1, base + 2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(a: Vec3, b: Vec3, c: Vec3) -> Vec<Vec3> {
        (0..CELLS)
            .map(cell_centre)
            .map(|uv| a + b * uv.x + c * uv.y)
            .collect()
    }

    proptest! {
        #[test]
        fn distances_are_what_a_search_over_all_cells_finds(
            mask in prop::collection::btree_set(0..CELLS, 1..60), cell in 0..CELLS,
        ) {
            let apart = |k: &usize| {
                let along = |a: usize, b: usize| a as f32 - b as f32;
                along(k % SIDE, cell % SIDE).hypot(along(k / SIDE, cell / SIDE))
            };
            let nearest = mask.iter().map(apart).fold(f32::MAX, f32::min);
            let flags: Vec<bool> = (0..CELLS).map(|k| mask.contains(&k)).collect();
            prop_assert!((distances_to(&flags)[cell] - nearest).abs() < 1e-4);
        }

        #[test]
        fn evaluation_reproduces_an_affine_sheet(u in 0.0..1.0f64, v in 0.0..1.0f64) {
            let (a, b, c) = (Vec3::new(1.0, -2.0, 0.5), Vec3::new(3.0, 0.1, -1.0), Vec3::new(0.0, 2.0, 4.0));
            let at = evaluate(&plane(a, b, c), Vec2::new(u, v));
            prop_assert!((at - (a + b * u + c * v)).norm() < 1e-12);
        }

        #[test]
        fn interpolation_reproduces_a_ramp(u in 0.01..0.99f64, v in 0.01..0.99f64) {
            let ramp: Vec<f64> = (0..CELLS).map(cell_centre).map(|uv| 2.0 * uv.x - 3.0 * uv.y + 1.0).collect();
            let found = interpolate(&ramp, Vec2::new(u, v));
            let half = 0.5 / SIDE as f64;
            let clamped = [u, v].map(|x| x.clamp(half, 1.0 - half));
            prop_assert!((found - (2.0 * clamped[0] - 3.0 * clamped[1] + 1.0)).abs() < 1e-12);
        }

        #[test]
        fn normalisation_is_undone_within_single_precision(scale in 1e-3..1e3f64, shift in -1e4..1e4f64) {
            let mut grid = Grid::unknown();
            grid.positions = plane(Vec3::repeat(shift), Vec3::x() * scale, Vec3::z() * scale);
            grid.known = (0..CELLS).map(|k| k % 7 != 3).collect();
            let by = grid.normalisation().unwrap();
            let normal = grid.normalised(&by);
            for k in (0..CELLS).filter(|k| grid.known[*k]) {
                let back = by.to_scene(&normal.positions[k]);
                prop_assert!((back - grid.positions[k]).norm() <= 1e-6 * by.scale);
            }
            let q: Vec<Vec3> = normal.positions.iter().map(|p| Vec3::new(p[0].into(), p[1].into(), p[2].into())).collect();
            let mean = spacing(&q, |a, b| grid.known[a] && grid.known[b]).mean;
            prop_assert!((mean * 64.0 - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn roughness_is_the_size_of_noise_and_zero_on_a_bend() {
        let bend = |k: usize| {
            let uv = cell_centre(k);
            Vec3::new(0.5 * (2.0 * uv.x).sin(), uv.y, 0.5 * (2.0 * uv.x).cos())
        };
        // Sums of twelve uniform numbers, deviation 1.
        let mut state = 9u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        for sigma in [0.0, 0.05, 0.3] {
            let grid = NormalGrid {
                positions: (0..CELLS)
                    .map(|k| {
                        let noise = Vec3::from_fn(|_, _| normal()) * (sigma / SIDE as f64);
                        (bend(k) + noise).cast::<f32>().into()
                    })
                    .collect(),
                known: (0..CELLS)
                    .map(|k| f32::from(u8::from(k % 31 != 0)))
                    .collect(),
                base: None,
            };
            // The largest 5 % are left out.
            let found = grid.roughness();
            assert!(
                (found - 0.9 * sigma).abs() < 0.1 * sigma + 1e-3,
                "{found} of {sigma}"
            );
        }
        let mut nothing = Grid::unknown().normalised(&Normalisation {
            centre: Vec3::zeros(),
            scale: 1.0,
        });
        assert_eq!(nothing.roughness(), 0.0);
        nothing.known[0] = 1.0;
        assert_eq!(nothing.roughness(), 0.0);
    }

    #[test]
    fn cells_and_uvs_agree() {
        for k in [0, 63, 64, 2080, CELLS - 1] {
            assert_eq!(cell_at(cell_centre(k)), k);
        }
        assert_eq!(cell_at(Vec2::new(-1.0, 2.0)), cell_index(0, SIDE - 1));
    }

    #[test]
    fn an_empty_or_collapsed_grid_has_no_normalisation() {
        assert_eq!(Grid::unknown().normalisation(), None);
        let collapsed = Grid {
            positions: vec![Vec3::x(); CELLS],
            known: vec![true; CELLS],
        };
        assert_eq!(collapsed.normalisation(), None);
    }
}
