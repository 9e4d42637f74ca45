//! The anchor search's loss and its gradient by darn's own engine: what [`super::anchor`] does by burn's autodiff, with the chain rule
//! through the Gaussian written out.
//!
//! With the bell b(u, v), the soft mask Y = known + b (1 − known), the answer f(Y) and r = Σ b f / Σ b, the loss is ‖r − P‖² and
//! ∂L/∂u = Σ (∂L/∂Y (1 − known) + ∂L/∂r · (f − r) / Σ b) ∂b/∂u.

use super::anchor::{AnchorLoss, SIGMA, Scene, show};
use super::shared::Shared;
use super::{NetError, Shown, UnetConfig};
use crate::grid::{CELLS, NormalGrid, SIDE};

/// A bell at a place of the grid.
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

/// A search's grid as planes, repeated for each place, and the places' bells.
struct Stage {
    /// With the soft mask.
    shown: Shown,
    known: Vec<f32>,
    target: [f32; 3],
    bells: Vec<Bell>,
}

impl Stage {
    fn new(
        config: &UnetConfig,
        (grid, target): (&NormalGrid, [f32; 3]),
        uvs: &[[f32; 2]],
    ) -> Stage {
        let Scene {
            planes,
            target,
            base,
            up,
        } = show(config, grid, target);
        let bells: Vec<Bell> = uvs.iter().map(Bell::new).collect();
        let soft = bells.iter().flat_map(|bell| {
            let each = grid.known.iter().enumerate();
            each.map(|(cell, known)| known + bell.of(cell) * (1.0 - known))
        });
        Stage {
            shown: Shown {
                positions: planes.repeat(uvs.len()),
                known: soft.collect(),
                base: base.map(|base| base.repeat(uvs.len())),
                up: up.map(|up| up.repeat(uvs.len())),
            },
            known: grid.known.clone(),
            target,
            bells,
        }
    }

    /// r − P in cells.
    fn off(&self, place: usize, prediction: &[f32]) -> [f32; 3] {
        let read = self.bells[place].read(prediction);
        std::array::from_fn(|axis| (read[axis] - self.target[axis]) * SIDE as f32)
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

    fn slope(
        &self,
        place: usize,
        (prediction, by_soft): (&[f32], &[f32]),
    ) -> Result<AnchorLoss, NetError> {
        let bell = &self.bells[place];
        let (read, off) = (bell.read(prediction), self.off(place, prediction));
        let mut gradient = [0.0f32; 2];
        for cell in 0..CELLS {
            let through_mask = by_soft[cell] * (1.0 - self.known[cell]);
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
pub fn losses(
    engine: &Shared,
    config: &UnetConfig,
    search: (&NormalGrid, [f32; 3]),
    uvs: &[[f32; 2]],
) -> Result<Vec<f32>, NetError> {
    let stage = Stage::new(config, search, uvs);
    let answer = engine.predict(&stage.shown)?;
    let each = answer.chunks_exact(3 * CELLS).enumerate();
    each.map(|(place, prediction)| stage.loss(place, prediction))
        .collect()
}

/// L at uvs and its gradient.
pub fn gradients(
    engine: &Shared,
    config: &UnetConfig,
    search: (&NormalGrid, [f32; 3]),
    uvs: &[[f32; 2]],
) -> Result<Vec<AnchorLoss>, NetError> {
    let stage = Stage::new(config, search, uvs);
    let cotangent = |place: usize, prediction: &[f32], by: &mut [f32]| {
        stage.by_prediction(place, prediction, by)
    };
    let (predictions, by_soft) = engine.by_known(&stage.shown, &cotangent)?;
    let each = (predictions.chunks_exact(3 * CELLS)).zip(by_soft.chunks_exact(CELLS));
    each.enumerate()
        .map(|(place, answer)| stage.slope(place, answer))
        .collect()
}
