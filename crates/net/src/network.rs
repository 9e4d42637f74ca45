//! A loaded network: prepares the input of grids, asks the runtime, and brings the predictions back to the grids' space.

use darn_geometry::grid::{CELLS, NormalGrid};
use darn_geometry::mesh::Vec3;
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::alternatives::{SYMMETRIES, around};
use crate::anchor::{AnchorLoss, AnchorProblem};
use crate::engine::EngineOptions;
use crate::error::NetError;
use crate::frame::NetworkFrame;
use crate::planes::{GridPlanes, base_of, cells};
use crate::runtime::{EngineRuntime, Runtime};
use crate::symmetry::{Averaging, origins};
use crate::weights::{self, WeightsCard};
use std::time::Duration;

/// The most grids, or places of an anchor, that a runtime is given at once; bounds the memory of a call.
const BATCH: usize = 16;

/// A loaded network. Threads share one behind an `Arc`.
#[derive(Debug)]
pub struct Network {
    forward: Box<dyn Runtime>,
    /// The runtime of gradients, if it is another than `forward`.
    reverse: Option<Box<dyn Runtime>>,
    card: WeightsCard,
}

/// Grids for a network to fill.
#[derive(Debug, Clone, Copy)]
pub struct FillRequest<'a> {
    /// The grids, in the network's units.
    pub grids: &'a [NormalGrid],
    /// The direction against gravity in the grids' space, of any length but zero; +z if `None`. Networks of
    /// [`FrameKind::Canonical`](crate::FrameKind::Canonical) ignore it.
    pub up: Option<[f64; 3]>,
    /// The symmetries of the grid that the prediction is averaged over.
    pub averaging: Averaging,
}

/// A network's answer for one grid, in the network's units and the grid's own space.
#[derive(Debug, Clone, PartialEq)]
pub struct FilledGrid {
    /// One position per cell: the mean of the answers to the grid and its symmetries.
    pub positions: Vec<[f32; 3]>,
    /// How far these answers lie apart, one number per cell: their root mean square distance from the mean; zeros when only one was asked for.
    pub spread: Vec<f32>,
}

impl Network {
    /// Reads a weights file, for darn's own engine.
    ///
    /// # Errors
    /// Those of [`weights::read`], tensors that are missing or have another shape, and an instruction set that this CPU lacks.
    pub fn load(bytes: &[u8], options: EngineOptions) -> Result<Network, NetError> {
        let (card, tensors) = weights::read(bytes)?;
        weights::check(&card, &tensors)?;
        let runtime = EngineRuntime::new(&tensors, &card.architecture, options)?;
        Ok(Network::of(card, Box::new(runtime), None))
    }

    /// A network on given runtimes: `forward` predicts, `reverse` computes gradients; without it `forward` does both.
    pub fn of(
        card: WeightsCard,
        forward: Box<dyn Runtime>,
        reverse: Option<Box<dyn Runtime>>,
    ) -> Network {
        Network {
            forward,
            reverse,
            card,
        }
    }

    /// Packs the weights now instead of at the first prediction; until then a network needs less memory.
    pub fn prepare(&self) {
        self.forward.prepare();
    }

    /// Frees buffers that no call has used for so long; a search for the place of an anchor leaves some 40 MiB for each thread. The next
    /// call makes them anew.
    pub fn release_idle(&self, unused: Duration) {
        let runtimes = [Some(&self.forward), self.reverse.as_ref()];
        let runtimes = runtimes.into_iter().flatten();
        runtimes.for_each(|runtime| runtime.release_idle(unused));
    }

    /// The model card of the weights.
    pub fn card(&self) -> &WeightsCard {
        &self.card
    }

    /// Predicts every cell of every grid, in the network's units and the grid's own space.
    ///
    /// It predicts known cells, too; callers keep the scan's positions there.
    ///
    /// # Errors
    /// A grid of another size, or a prediction that is not finite.
    pub fn fill(&self, request: &FillRequest) -> Result<Vec<FilledGrid>, NetError> {
        let FillRequest {
            grids,
            up,
            averaging,
        } = *request;
        let answers = self.answers(grids, up, averaging.symmetries())?;
        Ok(answers.iter().map(|alike| averaged(alike)).collect())
    }

    /// For each grid the answers to some of its symmetries, each in the grid's own cells and space.
    fn answers(
        &self,
        grids: &[NormalGrid],
        up: Option<[f64; 3]>,
        symmetries: &[usize],
    ) -> Result<Vec<Vec<Vec<[f32; 3]>>>, NetError> {
        check_sizes(grids)?;
        let upright = self.upright(up);
        let back = upright.map(|upright| upright.transpose());
        let symmetries: Vec<Vec<usize>> = symmetries.iter().map(|s| origins(*s)).collect();
        let mut copies = Vec::with_capacity(grids.len() * symmetries.len());
        for grid in grids {
            let grid = turned(grid, upright.as_ref());
            // The plate of a mirrored grid is the mirrored plate, so one is enough for all symmetries.
            let base = base_of(&self.card.architecture, &grid);
            copies.extend(symmetries.iter().map(|from| {
                let mirrored = |cells: &[[f32; 3]]| from.iter().map(|k| cells[*k]).collect();
                NormalGrid {
                    positions: mirrored(&grid.positions),
                    known: from.iter().map(|k| grid.known[*k]).collect(),
                    base: base.as_deref().map(mirrored),
                }
            }));
        }
        let answers = self.predict(&copies)?;
        let own_cells = |(answer, from): (&Vec<[f32; 3]>, &Vec<usize>)| {
            let mut cells = vec![[0.0; 3]; CELLS];
            for (p, k) in answer.iter().zip(from) {
                cells[*k] = back.as_ref().map_or(*p, |back| times(back, *p));
            }
            cells
        };
        let alike = answers.chunks(symmetries.len());
        Ok(alike
            .map(|alike| alike.iter().zip(&symmetries).map(own_cells).collect())
            .collect())
    }

    /// The plausible fills of a grid, the likeliest first: what [`Network::fill`] gives with [`Averaging::Flips`], then pairs on either side of it.
    ///
    /// The answers to the eight symmetries of the grid lie around their mean where the network is unsure; their principal directions are folds that
    /// could be deeper or shallower. The fills of a pair lie two standard deviations along one direction, the one farther from the smooth base first;
    /// the pairs follow the variance of their directions. `up` as in [`FillRequest`].
    ///
    /// # Errors
    /// As [`Network::fill`].
    pub fn alternatives(
        &self,
        grid: &NormalGrid,
        up: Option<[f64; 3]>,
    ) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
        let all: Vec<usize> = (0..SYMMETRIES).collect();
        let answers = self.answers(std::slice::from_ref(grid), up, &all)?;
        let answers = answers.into_iter().next().unwrap_or_default();
        let flips = Averaging::Flips.symmetries().len();
        let first = averaged(&answers[..flips]).positions;
        Ok(around(first, &answers, grid))
    }

    /// The problem of the anchor search (paper §3.5) for a grid and a target, both in the network's units and the grid's space; `up` as in
    /// [`FillRequest`].
    ///
    /// # Errors
    /// A grid of another size.
    pub fn anchor_problem(
        &self,
        grid: &NormalGrid,
        target: [f32; 3],
        up: Option<[f64; 3]>,
    ) -> Result<AnchorProblem, NetError> {
        check_sizes(std::slice::from_ref(grid))?;
        let upright = self.upright(up);
        let grid = turned(grid, upright.as_ref());
        let target = upright.map_or(target, |upright| times(&upright, target));
        Ok(AnchorProblem::new(&self.card.architecture, &grid, target))
    }

    /// The loss of a problem at each of the uvs, in squared cells.
    ///
    /// # Errors
    /// A loss that is not finite.
    pub fn anchor_losses(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<f32>, NetError> {
        let mut losses = Vec::with_capacity(uvs.len());
        for uvs in uvs.chunks(BATCH) {
            losses.extend(self.forward.anchor_losses(problem, uvs)?);
        }
        Ok(losses)
    }

    /// As [`Network::anchor_losses`], with the gradients.
    ///
    /// # Errors
    /// A loss or gradient that is not finite.
    pub fn anchor_gradients(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        let runtime = self.reverse.as_ref().unwrap_or(&self.forward);
        let mut losses = Vec::with_capacity(uvs.len());
        for uvs in uvs.chunks(BATCH) {
            losses.extend(runtime.anchor_gradients(problem, uvs)?);
        }
        Ok(losses)
    }

    /// Predicts grids of checked size; turns them to the network's frame, and the predictions back.
    fn predict(&self, grids: &[NormalGrid]) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
        let config = &self.card.architecture;
        let mut predictions = Vec::with_capacity(grids.len());
        for chunk in grids.chunks(BATCH) {
            let frames: Vec<NetworkFrame> = (chunk.iter())
                .map(|grid| NetworkFrame::of(config.frame, grid))
                .collect();
            let prediction = self
                .forward
                .predict(&GridPlanes::new(config, chunk, &frames))?;
            let each = prediction.chunks_exact(3 * CELLS).zip(&frames);
            predictions.extend(each.map(|(planes, frame)| {
                let inside = cells(planes).into_iter();
                inside.map(|p| frame.leave(p)).collect::<Vec<_>>()
            }));
        }
        let finite = |answer: &Vec<[f32; 3]>| answer.iter().flatten().all(|x| x.is_finite());
        match predictions.iter().position(|answer| !finite(answer)) {
            Some(index) => Err(NetError::Answer { index }),
            None => Ok(predictions),
        }
    }

    /// The rotation that brings `up` to +z; `None` if this network ignores it, or it is not given.
    fn upright(&self, up: Option<[f64; 3]>) -> Option<Matrix3<f32>> {
        let known = self.card.architecture.frame.knows_up();
        up.filter(|_| known).map(upright)
    }
}

/// The mean of the answers to a grid's symmetries, and their spread.
fn averaged(answers: &[Vec<[f32; 3]>]) -> FilledGrid {
    let count = answers.len() as f32;
    let mut positions = vec![[0.0; 3]; CELLS];
    for answer in answers {
        for (mean, p) in positions.iter_mut().zip(answer) {
            (0..3).for_each(|axis| mean[axis] += p[axis] / count);
        }
    }
    let mut spread = vec![0.0; CELLS];
    for answer in answers {
        for ((square, p), mean) in spread.iter_mut().zip(answer).zip(&positions) {
            let off = Vector3::from(*p) - Vector3::from(*mean);
            *square += off.norm_squared() / count;
        }
    }
    spread.iter_mut().for_each(|square| *square = square.sqrt());
    FilledGrid { positions, spread }
}

fn check_sizes(grids: &[NormalGrid]) -> Result<(), NetError> {
    match grids.iter().position(|grid| {
        let base = grid.base.as_ref().map_or(CELLS, Vec::len);
        [grid.positions.len(), grid.known.len(), base] != [CELLS; 3]
    }) {
        Some(index) => Err(NetError::GridSize {
            index,
            positions: grids[index].positions.len(),
            known: grids[index].known.len(),
        }),
        None => Ok(()),
    }
}

/// A grid whose space is rotated.
fn turned(grid: &NormalGrid, rotation: Option<&Matrix3<f32>>) -> NormalGrid {
    let Some(rotation) = rotation else {
        return grid.clone();
    };
    let turned = |cells: &[[f32; 3]]| cells.iter().map(|p| times(rotation, *p)).collect();
    NormalGrid {
        positions: turned(&grid.positions),
        known: grid.known.clone(),
        base: grid.base.as_deref().map(turned),
    }
}

/// The smallest rotation that brings `up` to +z.
fn upright(up: [f64; 3]) -> Matrix3<f32> {
    let up = Vec3::from(up);
    let rotation = Rotation3::rotation_between(&up, &Vec3::z());
    // There is none for the opposite direction; any half turn about a horizontal axis brings it to +z.
    let rotation = rotation
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vec3::x_axis(), std::f64::consts::PI));
    rotation.matrix().cast()
}

fn times(matrix: &Matrix3<f32>, p: [f32; 3]) -> [f32; 3] {
    (matrix * Vector3::from(p)).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn upright_brings_up_to_z(up in prop::array::uniform3(-1.0..1.0f64)) {
            prop_assume!(Vec3::from(up).norm() > 1e-3);
            let unit = Vec3::from(up).normalize().cast::<f32>();
            prop_assert!((upright(up) * unit - Vector3::z()).norm() < 1e-5);
        }
    }

    #[test]
    fn upright_turns_straight_down_over() {
        let rotation = upright([0.0, 0.0, -2.0]);
        assert!((rotation * -Vector3::z() - Vector3::z()).norm() < 1e-6);
        assert!((rotation.determinant() - 1.0).abs() < 1e-6);
    }
}
