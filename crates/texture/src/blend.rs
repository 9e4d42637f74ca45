//! Seams in the gradient domain: the copies keep their differences between neighbouring texels, and meet the cloth at the rim.
//!
//! What is solved for is a correction that is smooth but for the places where copies meet: a Poisson equation with multigrid (Pérez 2003; cells of
//! 2 × 2 texels become one in the next level).

use darn_budget::{Budget, Exhausted};
use rayon::prelude::*;

/// Four channels.
pub(crate) type Value = [f32; 4];

/// Nanoseconds of work for a texel in all cycles.
const TEXEL_WORK: u64 = 150;
/// Cycles at each level.
const CYCLES: usize = 1;
/// Sweeps before and after each coarser level.
const SWEEPS: usize = 2;
/// Sweeps at the coarsest level.
const LAST_SWEEPS: usize = 40;
/// Weight of a sweep's change (damped Jacobi).
const DAMPING: f32 = 0.8;
/// Rows that one task sweeps.
const BAND: usize = 16;

/// Σ over neighbours of weight × (own − neighbour's) + fixed × own = right, at the texels that are free.
pub(crate) struct Equation {
    pub width: usize,
    pub free: Vec<bool>,
    /// Weight to the next texel to the right, and below.
    pub right: Vec<f32>,
    pub below: Vec<f32>,
    /// Weight of neighbours whose correction is zero.
    pub fixed: Vec<f32>,
    pub wanted: Vec<Value>,
}

impl Equation {
    pub(crate) fn new(width: usize, height: usize) -> Equation {
        let count = width * height;
        Equation {
            width,
            free: vec![false; count],
            right: vec![0.0; count],
            below: vec![0.0; count],
            fixed: vec![0.0; count],
            wanted: vec![[0.0; 4]; count],
        }
    }

    fn height(&self) -> usize {
        self.free.len() / self.width
    }

    /// The sum of the weights at a texel, and the sum of weight × neighbour.
    ///
    /// No weight leads out of a row, so the neighbours of a row's ends that lie in other rows count nothing.
    #[inline]
    fn around(&self, at: usize, x: &[Value]) -> (f32, Value) {
        let width = self.width;
        let mut sum = [0.0f32; 4];
        let mut total = self.fixed[at];
        let mut add = |weight: f32, other: Option<&Value>| {
            if let Some(other) = other {
                total += weight;
                (0..4).for_each(|k| sum[k] += weight * other[k]);
            }
        };
        add(self.right[at], x.get(at + 1));
        if at > 0 {
            add(self.right[at - 1], x.get(at - 1));
        }
        add(self.below[at], x.get(at + width));
        if at >= width {
            add(self.below[at - width], x.get(at - width));
        }
        (total, sum)
    }

    fn sweep(&self, x: &mut Vec<Value>, count: usize) {
        let mut next = x.clone();
        for _ in 0..count {
            let old: &[Value] = x;
            let bands = next.par_chunks_mut(self.width * BAND).enumerate();
            bands.for_each(|(band, rows)| {
                let first = band * BAND * self.width;
                for (k, new) in rows.iter_mut().enumerate() {
                    let at = first + k;
                    if !self.free[at] {
                        continue;
                    }
                    let (total, sum) = self.around(at, old);
                    if total > 0.0 {
                        let full = |k: usize| (self.wanted[at][k] + sum[k]) / total;
                        *new =
                            std::array::from_fn(|k| old[at][k] + DAMPING * (full(k) - old[at][k]));
                    }
                }
            });
            std::mem::swap(x, &mut next);
        }
    }

    fn residual(&self, x: &[Value]) -> Vec<Value> {
        let of = |at: usize| {
            if !self.free[at] {
                return [0.0; 4];
            }
            let (total, sum) = self.around(at, x);
            std::array::from_fn(|k| self.wanted[at][k] + sum[k] - total * x[at][k])
        };
        (0..x.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(of)
            .collect()
    }

    /// The same equation for cells of 2 × 2 texels.
    fn coarser(&self) -> Equation {
        let (width, height) = (self.width.div_ceil(2), self.height().div_ceil(2));
        let mut coarse = Equation::new(width, height);
        for row in 0..self.height() {
            for column in 0..self.width {
                let at = row * self.width + column;
                let cell = row / 2 * width + column / 2;
                coarse.free[cell] |= self.free[at];
                // Half of the sum: the middles of cells are twice as far apart as those of texels. Neighbours that are held do not move away.
                if column % 2 == 1 {
                    coarse.right[cell] += 0.5 * self.right[at];
                }
                if row % 2 == 1 {
                    coarse.below[cell] += 0.5 * self.below[at];
                }
                coarse.fixed[cell] += self.fixed[at];
            }
        }
        coarse
    }

    fn restrict(&self, fine: &[Value], coarse: &Equation) -> Vec<Value> {
        let mut sums = vec![[0.0; 4]; coarse.free.len()];
        for (row, values) in fine.chunks(self.width).enumerate() {
            let cells = &mut sums[row / 2 * coarse.width..];
            for (column, value) in values.iter().enumerate() {
                (0..4).for_each(|k| cells[column / 2][k] += value[k]);
            }
        }
        sums
    }

    /// Adds a coarser level's correction, linear between the middles of free cells.
    fn prolong(&self, x: &mut [Value], coarse: &Equation, correction: &[Value]) {
        let width = self.width;
        let (last_column, last_row) = (coarse.width as isize - 1, coarse.height() as isize - 1);
        x.par_chunks_mut(width * BAND)
            .enumerate()
            .for_each(|(band, rows)| {
                for (k, x) in rows.iter_mut().enumerate() {
                    let at = band * BAND * width + k;
                    if !self.free[at] {
                        continue;
                    }
                    let (column, row) = (at % width, at / width);
                    let other = |x: usize| (x / 2) as isize + if x % 2 == 1 { 1 } else { -1 };
                    let columns = [(column / 2) as isize, other(column).clamp(0, last_column)];
                    let rows = [(row / 2) as isize, other(row).clamp(0, last_row)];
                    let (mut sum, mut total) = ([0.0f32; 4], 0.0);
                    for (r, u) in rows.into_iter().zip([0.75, 0.25]) {
                        for (c, v) in columns.into_iter().zip([0.75, 0.25]) {
                            let cell = r as usize * coarse.width + c as usize;
                            if coarse.free[cell] {
                                total += u * v;
                                (0..4).for_each(|k| sum[k] += u * v * correction[cell][k]);
                            }
                        }
                    }
                    (0..4).for_each(|k| x[k] += sum[k] / total);
                }
            });
    }
}

/// Solves an equation; zero where no texel is free or none is held.
pub(crate) fn solve(mut equation: Equation, budget: &Budget) -> Result<Vec<Value>, Exhausted> {
    budget.spend(TEXEL_WORK * equation.free.len() as u64)?;
    let mut wanted = std::mem::take(&mut equation.wanted);
    let mut levels = vec![equation];
    while let Some(last) = levels.last().filter(|l| l.width.min(l.height()) > 4) {
        let coarse = last.coarser();
        let next = last.restrict(&wanted, &coarse);
        let count = levels.len();
        levels[count - 1].wanted = std::mem::replace(&mut wanted, next);
        levels.push(coarse);
    }
    let count = levels.len();
    levels[count - 1].wanted = wanted;
    let mut x = vec![[0.0; 4]; levels[count - 1].free.len()];
    levels[count - 1].sweep(&mut x, LAST_SWEEPS);
    for level in (0..count - 1).rev() {
        budget.check()?;
        let mut finer = vec![[0.0; 4]; levels[level].free.len()];
        levels[level].prolong(&mut finer, &levels[level + 1], &x);
        x = finer;
        for _ in 0..CYCLES {
            cycle(&mut levels[level..], &mut x);
        }
    }
    Ok(x)
}

fn cycle(levels: &mut [Equation], x: &mut Vec<Value>) {
    let Some((own, coarser)) = levels
        .split_first_mut()
        .filter(|(_, rest)| !rest.is_empty())
    else {
        levels[0].sweep(x, LAST_SWEEPS);
        return;
    };
    own.sweep(x, SWEEPS);
    let right = own.restrict(&own.residual(x), &coarser[0]);
    let kept = std::mem::replace(&mut coarser[0].wanted, right);
    let mut correction = vec![[0.0; 4]; coarser[0].free.len()];
    cycle(coarser, &mut correction);
    coarser[0].wanted = kept;
    own.prolong(x, &coarser[0], &correction);
    own.sweep(x, SWEEPS);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk in a square, held at its border, with a right side that a linear function gives.
    #[test]
    fn a_slope_at_the_rim_goes_on_inside() {
        let side = 90;
        let mut equation = Equation::new(side, side);
        let inside = |c: usize, r: usize| (c as f32 - 44.5).hypot(r as f32 - 44.5) < 41.0;
        let truth = |c: usize| 0.01 * c as f32 - 0.3;
        for at in 0..side * side {
            let (c, r) = (at % side, at / side);
            if c == side - 1 || r == side - 1 || c == 0 || r == 0 || !inside(c, r) {
                continue;
            }
            equation.free[at] = true;
            equation.right[at] = f32::from(u8::from(inside(c + 1, r)));
            equation.below[at] = f32::from(u8::from(inside(c, r + 1)));
            for (x, y) in [(c + 1, r), (c - 1, r), (c, r + 1), (c, r - 1)] {
                if !inside(x, y) {
                    equation.fixed[at] += 1.0;
                    equation.wanted[at][1] += truth(x);
                }
            }
        }
        let free = equation.free.clone();
        let x = solve(equation, Budget::unlimited()).unwrap();
        let off = |at: usize| (x[at][1] - truth(at % side)).abs();
        let inside = (0..side * side).filter(|at| free[*at]);
        let most = inside.clone().map(off).fold(0.0, f32::max);
        // Half a byte.
        assert!(most < 2e-3, "{most}");
        assert!(inside.into_iter().all(|at| x[at][0] == 0.0));
    }
}
