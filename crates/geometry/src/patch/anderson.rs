//! Anderson acceleration (mixing) of a fixed-point iteration x ← g(x) on vertex positions, after Peng et al. 2018,
//! "Anderson acceleration for geometry optimization and physics simulation": the next point is the combination of the
//! last few images g(x) whose residuals g(x) − x cancel best (least squares).

use nalgebra::{SMatrix, SVector};

use crate::mesh::Vec3;

/// Most differences of rounds that are kept.
const WINDOW: usize = 6;
/// A residual that grows by more than this factor discards all that is kept.
const GROWN: f64 = 1.5;

/// What an accelerated iteration x ← g(x) keeps of its last rounds.
pub(super) struct AndersonMixing {
    /// Differences of consecutive residuals g(x) − x; the oldest is overwritten.
    residuals: Vec<Vec<f64>>,
    /// Differences of consecutive images g(x), in the same order.
    images: Vec<Vec<f64>>,
    /// Scalar products of the residual differences.
    gram: SMatrix<f64, WINDOW, WINDOW>,
    /// Residual and image of the round before.
    last: Option<(Vec<f64>, Vec<f64>)>,
    /// Squared norm of the last residual.
    length: f64,
    /// How many differences count.
    used: usize,
    /// Where the next difference goes.
    next: usize,
    /// Numbers in a vector.
    size: usize,
}

impl AndersonMixing {
    /// The start of an iteration on vectors of `size` numbers.
    pub fn new(size: usize) -> AndersonMixing {
        AndersonMixing {
            residuals: Vec::new(),
            images: Vec::new(),
            gram: SMatrix::zeros(),
            last: None,
            length: f64::INFINITY,
            used: 0,
            next: 0,
            size,
        }
    }

    /// Replaces x, the first vertices of `positions`, by the next point, given `image` = g(x); returns the largest
    /// |g(x) − x| of a vertex.
    pub fn advance(&mut self, positions: &mut [Vec3], image: &[[f64; 3]]) -> f64 {
        let flat_image = &image.as_flattened()[..self.size];
        let mut residual = Vec::with_capacity(self.size);
        let mut farthest = 0.0f64;
        for (p, q) in positions.iter().zip(image) {
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
            self.remember(
                difference(&residual, old),
                difference(flat_image, old_image),
            );
        }
        for (p, x) in positions.iter_mut().zip(image) {
            *p = Vec3::from(*x);
        }
        let shares = self.shares(&residual);
        for (share, d) in shares.iter().zip(&self.images).take(self.used) {
            for (p, d) in positions.iter_mut().zip(d.as_chunks::<3>().0) {
                *p -= Vec3::from(*d) * *share;
            }
        }
        self.last = Some((residual, flat_image.to_vec()));
        farthest.sqrt()
    }

    /// Keeps the differences of a round, in the place of the oldest where there are enough.
    fn remember(&mut self, residual: Vec<f64>, image: Vec<f64>) {
        let place = self.next;
        if place < self.residuals.len() {
            self.residuals[place] = residual;
            self.images[place] = image;
        } else {
            self.residuals.push(residual);
            self.images.push(image);
        }
        self.next = (place + 1) % WINDOW;
        self.used = (self.used + 1).min(WINDOW);
        for k in 0..self.used {
            let product = dot(&self.residuals[k], &self.residuals[place]);
            self.gram[(k, place)] = product;
            self.gram[(place, k)] = product;
        }
    }

    /// Shares of the differences that cancel the residual best (least squares); zeros when the system cannot be solved.
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

/// Scalar product in four running sums, which the compiler can vectorise.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let ((a4, a_rest), (b4, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    for (x, y) in a4.iter().zip(b4) {
        (0..4).for_each(|k| sums[k] += x[k] * y[k]);
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// `new` − `old`, written into `old`.
fn difference(new: &[f64], mut old: Vec<f64>) -> Vec<f64> {
    old.iter_mut().zip(new).for_each(|(o, n)| *o = n - *o);
    old
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_linear_iteration_is_accelerated() {
        // g(x) = D x + b with contraction rates up to 0.99; the fixed point is b / (1 − D).
        let rate = |k: usize| 0.99 * (k + 1) as f64 / 4.0;
        let mut x = vec![Vec3::zeros(); 4];
        let mut mixing = AndersonMixing::new(12);
        for _ in 0..20 {
            let image: Vec<[f64; 3]> = (0..4)
                .map(|k| (x[k] * rate(k) + Vec3::repeat(1.0)).into())
                .collect();
            mixing.advance(&mut x, &image);
        }
        for (k, p) in x.iter().enumerate() {
            assert!((p - Vec3::repeat(1.0 / (1.0 - rate(k)))).norm() < 1e-6);
        }
    }
}
