//! Anderson acceleration of a fixed-point iteration on vertex positions (Peng et al. 2018, "Anderson acceleration for geometry
//! optimization and physics simulation"): the next point is the combination of the last few steps whose residuals cancel best.

use nalgebra::{SMatrix, SVector};

use crate::mesh::Vec3;

/// Steps remembered.
const WINDOW: usize = 6;
/// A residual that grows by more than this factor empties the memory.
const GROWN: f64 = 1.5;

/// The memory of an accelerated iteration x ← g(x).
pub(super) struct Anderson {
    /// Differences of consecutive residuals g(x) − x, and of consecutive g(x); the oldest is overwritten.
    residuals: Vec<Vec<f64>>,
    steps: Vec<Vec<f64>>,
    /// Scalar products of the residual differences.
    gram: SMatrix<f64, WINDOW, WINDOW>,
    /// Residual and g(x) of the round before.
    last: Option<(Vec<f64>, Vec<f64>)>,
    length: f64,
    used: usize,
    next: usize,
    size: usize,
}

impl Anderson {
    /// Nothing remembered, for vectors of `size` numbers.
    pub fn new(size: usize) -> Anderson {
        Anderson {
            residuals: Vec::new(),
            steps: Vec::new(),
            gram: SMatrix::zeros(),
            last: None,
            length: f64::INFINITY,
            used: 0,
            next: 0,
            size,
        }
    }

    /// Replaces x, the first vertices of `positions`, by the next point, given g(x); the largest |g(x) − x| of a vertex.
    pub fn advance(&mut self, positions: &mut [Vec3], step: &[[f64; 3]]) -> f64 {
        let image = &step.as_flattened()[..self.size];
        let mut residual = Vec::with_capacity(self.size);
        let mut farthest = 0.0f64;
        for (p, q) in positions.iter().zip(step) {
            let d = Vec3::from(*q) - p;
            farthest = farthest.max(d.norm_squared());
            residual.extend_from_slice(d.as_slice());
        }
        let length = dot(&residual, &residual);
        if length > GROWN * GROWN * self.length {
            (self.used, self.next, self.last) = (0, 0, None);
        }
        self.length = length;
        if let Some((old, old_image)) = self.last.take() {
            self.remember(difference(&residual, old), difference(image, old_image));
        }
        for (p, x) in positions.iter_mut().zip(step) {
            *p = Vec3::from(*x);
        }
        let shares = self.shares(&residual);
        for (share, d) in shares.iter().zip(&self.steps).take(self.used) {
            for (p, d) in positions.iter_mut().zip(d.as_chunks::<3>().0) {
                *p -= Vec3::from(*d) * *share;
            }
        }
        self.last = Some((residual, image.to_vec()));
        farthest.sqrt()
    }

    fn remember(&mut self, residual: Vec<f64>, step: Vec<f64>) {
        let place = self.next;
        if place < self.residuals.len() {
            self.residuals[place] = residual;
            self.steps[place] = step;
        } else {
            self.residuals.push(residual);
            self.steps.push(step);
        }
        self.next = (place + 1) % WINDOW;
        self.used = (self.used + 1).min(WINDOW);
        for k in 0..self.used {
            let product = dot(&self.residuals[k], &self.residuals[place]);
            self.gram[(k, place)] = product;
            self.gram[(place, k)] = product;
        }
    }

    /// Shares of the remembered differences that cancel the residual best (least squares); zeros when they say nothing.
    fn shares(&self, residual: &[f64]) -> SVector<f64, WINDOW> {
        let mut gram = self.gram;
        let mut wanted = SVector::<f64, WINDOW>::zeros();
        let trace: f64 = (0..self.used).map(|k| gram[(k, k)]).sum();
        for k in 0..WINDOW {
            if k < self.used {
                gram[(k, k)] += 1e-10 * trace + f64::MIN_POSITIVE;
                wanted[k] = dot(&self.residuals[k], residual);
            } else {
                gram.fill_row(k, 0.0);
                gram.fill_column(k, 0.0);
                gram[(k, k)] = 1.0;
            }
        }
        let solved = gram.cholesky().map(|c| c.solve(&wanted));
        solved
            .filter(|s| s.iter().all(|x| x.is_finite()))
            .unwrap_or_else(SVector::zeros)
    }
}

/// Scalar product, in four running sums so that it vectorises.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let ((a4, a_rest), (b4, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    for (x, y) in a4.iter().zip(b4) {
        (0..4).for_each(|k| sums[k] += x[k] * y[k]);
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// New minus old, in the old one's memory.
fn difference(new: &[f64], mut old: Vec<f64>) -> Vec<f64> {
    old.iter_mut().zip(new).for_each(|(o, n)| *o = n - *o);
    old
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_linear_iteration_is_sped_up() {
        // g(x) = D x + b with contraction rates up to 0.99; the fixed point is b / (1 − D).
        let rate = |k: usize| 0.99 * (k + 1) as f64 / 4.0;
        let mut x = vec![Vec3::zeros(); 4];
        let mut ahead = Anderson::new(12);
        for _ in 0..20 {
            let step: Vec<[f64; 3]> = (0..4)
                .map(|k| (x[k] * rate(k) + Vec3::repeat(1.0)).into())
                .collect();
            ahead.advance(&mut x, &step);
        }
        for (k, p) in x.iter().enumerate() {
            assert!((p - Vec3::repeat(1.0 / (1.0 - rate(k)))).norm() < 1e-6);
        }
    }
}
