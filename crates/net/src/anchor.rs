//! The loss of the anchor search (paper §3.5): how far the network's surface at a place of the grid is from a target position.
//!
//! L(u, v) = ‖f(Y(u, v))(u, v) − P‖². The input Y has the target P and its mask as a narrow Gaussian at (u, v) instead of one hard cell
//! ("soft-equal"), and f is read with the same Gaussian, so that L is smooth in (u, v).
//!
//! Here the engine computes it, and the chain rule through the Gaussian is written out. With the Gaussian b(u, v), the soft mask
//! Y = known + b (1 − known), the prediction f(Y) and r = Σ b f / Σ b, the loss is ‖r − P‖² and
//! ∂L/∂u = Σ (∂L/∂Y (1 − known) + ∂L/∂r · (f − r) / Σ b) ∂b/∂u. `darn-lab` computes the same with burn's autodiff.

use darn_geometry::grid::{CELLS, NormalGrid, SIDE};

use crate::config::UnetConfig;
use crate::error::NetError;
use crate::frame::NetworkFrame;
use crate::planes::{GridPlanes, base_of, planes, up_of};

/// Standard deviation of the Gaussian, in cells; its width at half its height is 1.3 cells.
pub const SIGMA: f32 = 0.55;

/// The loss of an anchor at a place, and the gradient there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnchorLoss {
    /// L, in squared cells.
    pub loss: f32,
    /// ∂L/∂u and ∂L/∂v, per cell width.
    pub gradient: [f32; 2],
}

/// A grid and a target in the network's units and frame.
#[derive(Debug, Clone)]
pub struct AnchorProblem {
    /// The scan's positions in known cells, the target in the others: `[3, 64, 64]`.
    pub positions: Vec<f32>,
    /// `[1, 64, 64]` in 0..=1.
    pub known: Vec<f32>,
    /// The target P.
    pub target: [f32; 3],
    /// The plate, `[3, 64, 64]`; for networks that see one.
    pub base: Option<Vec<f32>>,
    /// The up direction; for networks that are given it.
    pub up: Option<[f32; 3]>,
}

impl AnchorProblem {
    /// A problem for a network of this architecture; grid and target in its units, in the grid's space.
    pub(crate) fn new(config: &UnetConfig, grid: &NormalGrid, target: [f32; 3]) -> AnchorProblem {
        // The frame is that of the grid without the anchor: with it, the frame would depend on the anchor's place.
        let frame = NetworkFrame::of(config.frame, grid);
        let target = frame.enter(target);
        let cells: Vec<[f32; 3]> = (grid.positions.iter().zip(&grid.known))
            .map(|(p, known)| {
                let p = frame.enter(*p);
                std::array::from_fn(|d| known * p[d] + (1.0 - known) * target[d])
            })
            .collect();
        let base = base_of(config, grid).map(|base| {
            let turned: Vec<[f32; 3]> = base.iter().map(|p| frame.enter(*p)).collect();
            planes(&[turned])
        });
        AnchorProblem {
            positions: planes(&[cells]),
            known: grid.known.clone(),
            target,
            base,
            up: up_of(config, &frame),
        }
    }
}

/// A problem at several places, as one input of the network.
pub(crate) struct AnchorBatch<'a> {
    problem: &'a AnchorProblem,
    gaussians: Vec<Gaussian>,
}

impl<'a> AnchorBatch<'a> {
    /// A batch of a problem at these uvs.
    pub fn new(problem: &'a AnchorProblem, uvs: &[[f32; 2]]) -> AnchorBatch<'a> {
        AnchorBatch {
            problem,
            gaussians: uvs.iter().map(Gaussian::new).collect(),
        }
    }

    /// The network's input: the problem's planes once per place, each with the soft mask of its place.
    pub fn input(&self) -> GridPlanes {
        let (problem, places) = (self.problem, self.gaussians.len());
        let soft = self.gaussians.iter().flat_map(|gaussian| {
            let each = problem.known.iter().enumerate();
            each.map(|(cell, known)| known + gaussian.at(cell) * (1.0 - known))
        });
        GridPlanes {
            positions: problem.positions.repeat(places),
            known: soft.collect(),
            base: (problem.base.as_ref()).map(|base| base.repeat(places)),
            up: problem.up.map(|up| up.repeat(places)),
        }
    }

    /// The loss at each place, given the predictions `[n, 3, 64, 64]`.
    pub fn losses(&self, predictions: &[f32]) -> Result<Vec<f32>, NetError> {
        let each = predictions.chunks_exact(3 * CELLS).enumerate();
        each.map(|(place, prediction)| self.loss(place, prediction))
            .collect()
    }

    /// Writes ∂L/∂f of a place.
    pub fn cotangent(&self, place: usize, prediction: &[f32], by: &mut [f32]) {
        let gaussian = &self.gaussians[place];
        let residual = self.residual(place, prediction);
        for (axis, plane) in by.chunks_exact_mut(CELLS).enumerate() {
            let by_read = 2.0 * SIDE as f32 * residual[axis] / gaussian.total;
            for (cell, by) in plane.iter_mut().enumerate() {
                *by = by_read * gaussian.at(cell);
            }
        }
    }

    /// The loss at each place and its gradient, given the predictions `[n, 3, 64, 64]` and ∂L/∂Y, `[n, 1, 64, 64]`.
    pub fn gradients(
        &self,
        predictions: &[f32],
        by_mask: &[f32],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        let each = predictions
            .chunks_exact(3 * CELLS)
            .zip(by_mask.chunks_exact(CELLS));
        each.enumerate()
            .map(|(place, (prediction, by_mask))| self.gradient(place, prediction, by_mask))
            .collect()
    }

    fn gradient(
        &self,
        place: usize,
        prediction: &[f32],
        by_mask: &[f32],
    ) -> Result<AnchorLoss, NetError> {
        let gaussian = &self.gaussians[place];
        let read = gaussian.read(prediction);
        let residual = self.residual(place, prediction);
        let mut gradient = [0.0f32; 2];
        for cell in 0..CELLS {
            let through_mask = by_mask[cell] * (1.0 - self.problem.known[cell]);
            let directly = (0..3).map(|axis| {
                let away = prediction[axis * CELLS + cell] - read[axis];
                2.0 * SIDE as f32 * residual[axis] * away / gaussian.total
            });
            let by_gaussian = through_mask + directly.sum::<f32>();
            let slope = gaussian.slope(cell);
            gradient[0] += by_gaussian * slope[0];
            gradient[1] += by_gaussian * slope[1];
        }
        Ok(AnchorLoss {
            loss: self.loss(place, prediction)?,
            gradient: [finite(gradient[0])?, finite(gradient[1])?],
        })
    }

    fn loss(&self, place: usize, prediction: &[f32]) -> Result<f32, NetError> {
        let residual = self.residual(place, prediction);
        finite(residual.iter().map(|x| x * x).sum::<f32>())
    }

    /// r − P in cells.
    fn residual(&self, place: usize, prediction: &[f32]) -> [f32; 3] {
        let read = self.gaussians[place].read(prediction);
        std::array::from_fn(|axis| (read[axis] - self.problem.target[axis]) * SIDE as f32)
    }
}

fn finite(x: f32) -> Result<f32, NetError> {
    let ok = x.is_finite().then_some(x);
    ok.ok_or(NetError::Answer { index: 0 })
}

/// The Gaussian b at a place of the grid.
struct Gaussian {
    /// Its factors along u and along v, by cell.
    along: [[f32; SIDE]; 2],
    /// Σ b.
    total: f32,
    /// The place, in cells.
    centre: [f32; 2],
}

impl Gaussian {
    fn new(uv: &[f32; 2]) -> Gaussian {
        let centre = uv.map(|x| x * SIDE as f32 - 0.5);
        let along = centre.map(|x| {
            std::array::from_fn(|k| {
                let off = k as f32 - x;
                (off * off * (-0.5 / (SIGMA * SIGMA))).exp()
            })
        });
        let sum = |line: &[f32; SIDE]| line.iter().sum::<f32>();
        Gaussian {
            total: sum(&along[0]) * sum(&along[1]),
            along,
            centre,
        }
    }

    /// b of a cell.
    fn at(&self, cell: usize) -> f32 {
        self.along[0][cell % SIDE] * self.along[1][cell / SIDE]
    }

    /// ∂b/∂u and ∂b/∂v of a cell, per cell width.
    fn slope(&self, cell: usize) -> [f32; 2] {
        let by = self.at(cell) / (SIGMA * SIGMA);
        [
            by * ((cell % SIDE) as f32 - self.centre[0]),
            by * ((cell / SIDE) as f32 - self.centre[1]),
        ]
    }

    /// r of a prediction `[3, 64, 64]`.
    fn read(&self, prediction: &[f32]) -> [f32; 3] {
        std::array::from_fn(|axis| {
            let plane = prediction[axis * CELLS..][..CELLS].iter().enumerate();
            plane.map(|(cell, x)| self.at(cell) * x).sum::<f32>() / self.total
        })
    }
}
