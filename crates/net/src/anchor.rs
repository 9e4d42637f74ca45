//! The loss of the anchor search (paper §3.5): how far the network leaves the cloth from a target that it is given at a place.
//!
//! L(u, v) = ‖f(Y(u, v))(u, v) − P‖², where Y has a thin Gaussian of the target P and of its mask at (u, v) in place of a hard cell
//! ("soft-equal"), and f is read off with the same Gaussian; so L is smooth in (u, v).
//!
//! Here the engine computes it, with the chain rule through the Gaussian written out: with the bell b(u, v), the soft mask
//! Y = known + b (1 − known), the answer f(Y) and r = Σ b f / Σ b, the loss is ‖r − P‖² and
//! ∂L/∂u = Σ (∂L/∂Y (1 − known) + ∂L/∂r · (f − r) / Σ b) ∂b/∂u. `darn-lab` has the same by burn's autodiff.

use darn_geometry::grid::{CELLS, NormalGrid, SIDE};

use crate::network::{base_of, up_of};
use crate::planes::planes;
use crate::{EngineRuntime, GridPlanes, NetError, NetworkFrame, UnetConfig};

/// Standard deviation of the Gaussian, in cells: at half its height it is 1.3 cells wide.
pub const SIGMA: f32 = 0.55;

/// The loss of an anchor at a place, and its gradient there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnchorLoss {
    /// L, in squared cells (spacings of the grid).
    pub loss: f32,
    /// ∂L/∂u and ∂L/∂v, per cell width.
    pub gradient: [f32; 2],
}

/// A grid and a target as the network sees them, in its frame.
#[derive(Debug, Clone)]
pub struct AnchorProblem {
    /// The scan's positions where known, the target elsewhere: `[3, 64, 64]`.
    pub positions: Vec<f32>,
    /// `[1, 64, 64]`.
    pub known: Vec<f32>,
    /// The target P.
    pub target: [f32; 3],
    /// The plate, `[3, 64, 64]`, for networks that see one.
    pub base: Option<Vec<f32>>,
    /// The up direction, for networks that are told it.
    pub up: Option<[f32; 3]>,
}

impl AnchorProblem {
    pub(crate) fn new(config: &UnetConfig, grid: &NormalGrid, target: [f32; 3]) -> AnchorProblem {
        // The anchor itself does not turn the frame: it would make the loss depend on the place in one more way.
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

/// The Gaussian at a place of the grid.
struct Bell {
    /// Along u and along v, by cell.
    along: [[f32; SIDE]; 2],
    /// Σ b.
    total: f32,
    /// The place, in cells.
    at: [f32; 2],
}

impl Bell {
    fn new(uv: &[f32; 2]) -> Bell {
        let at = uv.map(|x| x * SIDE as f32 - 0.5);
        let along = at.map(|x| {
            std::array::from_fn(|k| {
                let off = k as f32 - x;
                (off * off * (-0.5 / (SIGMA * SIGMA))).exp()
            })
        });
        let sum = |line: &[f32; SIDE]| line.iter().sum::<f32>();
        Bell {
            total: sum(&along[0]) * sum(&along[1]),
            along,
            at,
        }
    }

    /// b of a cell.
    fn of(&self, cell: usize) -> f32 {
        self.along[0][cell % SIDE] * self.along[1][cell / SIDE]
    }

    /// ∂b/∂u and ∂b/∂v of a cell, per cell width.
    fn slope(&self, cell: usize) -> [f32; 2] {
        let by = self.of(cell) / (SIGMA * SIGMA);
        [
            by * ((cell % SIDE) as f32 - self.at[0]),
            by * ((cell / SIDE) as f32 - self.at[1]),
        ]
    }

    /// r of a prediction's planes.
    fn read(&self, prediction: &[f32]) -> [f32; 3] {
        std::array::from_fn(|axis| {
            let plane = prediction[axis * CELLS..][..CELLS].iter().enumerate();
            plane.map(|(cell, x)| self.of(cell) * x).sum::<f32>() / self.total
        })
    }
}

/// A problem's planes repeated for each place, with the places' bells.
struct Places<'a> {
    problem: &'a AnchorProblem,
    /// With the soft mask.
    shown: GridPlanes,
    bells: Vec<Bell>,
}

/// What the engine answered for one place.
struct PlaceAnswer<'a> {
    /// `[3, 64, 64]`.
    prediction: &'a [f32],
    /// ∂L/∂Y, `[1, 64, 64]`.
    by_mask: &'a [f32],
}

impl<'a> Places<'a> {
    fn new(problem: &'a AnchorProblem, uvs: &[[f32; 2]]) -> Places<'a> {
        let bells: Vec<Bell> = uvs.iter().map(Bell::new).collect();
        let soft = bells.iter().flat_map(|bell| {
            let each = problem.known.iter().enumerate();
            each.map(|(cell, known)| known + bell.of(cell) * (1.0 - known))
        });
        Places {
            problem,
            shown: GridPlanes {
                positions: problem.positions.repeat(uvs.len()),
                known: soft.collect(),
                base: (problem.base.as_ref()).map(|base| base.repeat(uvs.len())),
                up: problem.up.map(|up| up.repeat(uvs.len())),
            },
            bells,
        }
    }

    /// r − P in cells.
    fn off(&self, place: usize, prediction: &[f32]) -> [f32; 3] {
        let read = self.bells[place].read(prediction);
        std::array::from_fn(|axis| (read[axis] - self.problem.target[axis]) * SIDE as f32)
    }

    fn loss(&self, place: usize, prediction: &[f32]) -> Result<f32, NetError> {
        let loss = self
            .off(place, prediction)
            .iter()
            .map(|x| x * x)
            .sum::<f32>();
        finite(loss)
    }

    /// ∂L/∂f of a place's prediction.
    fn by_prediction(&self, place: usize, prediction: &[f32], by: &mut [f32]) {
        let (bell, off) = (&self.bells[place], self.off(place, prediction));
        for (axis, plane) in by.chunks_exact_mut(CELLS).enumerate() {
            let by_read = 2.0 * SIDE as f32 * off[axis] / bell.total;
            for (cell, by) in plane.iter_mut().enumerate() {
                *by = by_read * bell.of(cell);
            }
        }
    }

    fn slope(&self, place: usize, answer: &PlaceAnswer) -> Result<AnchorLoss, NetError> {
        let PlaceAnswer {
            prediction,
            by_mask,
        } = answer;
        let bell = &self.bells[place];
        let (read, off) = (bell.read(prediction), self.off(place, prediction));
        let mut gradient = [0.0f32; 2];
        for cell in 0..CELLS {
            let through_mask = by_mask[cell] * (1.0 - self.problem.known[cell]);
            let directly = (0..3).map(|axis| {
                let away = prediction[axis * CELLS + cell] - read[axis];
                2.0 * SIDE as f32 * off[axis] * away / bell.total
            });
            let by_bell = through_mask + directly.sum::<f32>();
            let slope = bell.slope(cell);
            gradient[0] += by_bell * slope[0];
            gradient[1] += by_bell * slope[1];
        }
        Ok(AnchorLoss {
            loss: self.loss(place, prediction)?,
            gradient: [finite(gradient[0])?, finite(gradient[1])?],
        })
    }
}

fn finite(x: f32) -> Result<f32, NetError> {
    let ok = x.is_finite().then_some(x);
    ok.ok_or(NetError::Answer { index: 0 })
}

/// L at uvs.
pub(crate) fn losses(
    engine: &EngineRuntime,
    problem: &AnchorProblem,
    uvs: &[[f32; 2]],
) -> Result<Vec<f32>, NetError> {
    let places = Places::new(problem, uvs);
    let answer = engine.predict_planes(&places.shown)?;
    let each = answer.chunks_exact(3 * CELLS).enumerate();
    each.map(|(place, prediction)| places.loss(place, prediction))
        .collect()
}

/// L at uvs and its gradient.
pub(crate) fn gradients(
    engine: &EngineRuntime,
    problem: &AnchorProblem,
    uvs: &[[f32; 2]],
) -> Result<Vec<AnchorLoss>, NetError> {
    let places = Places::new(problem, uvs);
    let cotangent = |place: usize, prediction: &[f32], by: &mut [f32]| {
        places.by_prediction(place, prediction, by)
    };
    let answers = engine.gradient_by_mask(&places.shown, &cotangent)?;
    let each =
        (answers.predictions.chunks_exact(3 * CELLS)).zip(answers.by_mask.chunks_exact(CELLS));
    each.enumerate()
        .map(|(place, (prediction, by_mask))| {
            let answer = PlaceAnswer {
                prediction,
                by_mask,
            };
            places.slope(place, &answer)
        })
        .collect()
}
