//! A loaded network: grids in, positions out. Prepares what the network sees and asks its runtime.

use darn_geometry::grid::{CELLS, NormalGrid};
use darn_geometry::mesh::Vec3;
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::engine;
use crate::fill::plate;
use crate::planes::{cells, planes};
use crate::symmetry::{Averaging, origins};
use crate::weights::{self, WeightsCard};
use crate::{
    AnchorLoss, AnchorProblem, EngineRuntime, GridPlanes, InputKind, NetError, NetworkFrame,
    Runtime, UnetConfig,
};

/// Grids, or places of an anchor, that go through the network together; bounds the memory of a call.
const BATCH: usize = 16;

/// A loaded network, ready for inference. Threads share one behind an `Arc`.
#[derive(Debug)]
pub struct Network {
    forward: Box<dyn Runtime>,
    /// What computes gradients, where it is not what predicts.
    reverse: Option<Box<dyn Runtime>>,
    card: WeightsCard,
}

/// What a network is asked to fill.
#[derive(Debug, Clone, Copy)]
pub struct FillRequest<'a> {
    /// The grids, in the network's units.
    pub grids: &'a [NormalGrid],
    /// The direction against gravity in the grids' space, of any length but zero; without it, +z. Networks that were trained in any direction
    /// ignore it.
    pub up: Option<[f64; 3]>,
    /// The symmetries of the grid that the answer is averaged over.
    pub averaging: Averaging,
}

impl Network {
    /// Reads a weights file, to be computed by darn's own engine.
    ///
    /// # Errors
    /// Whatever is wrong with the file, by the tensor's name; see [`weights::read`]. An instruction set that this CPU lacks.
    pub fn load(bytes: &[u8], options: engine::EngineOptions) -> Result<Network, NetError> {
        let (card, tensors) = weights::read(bytes)?;
        weights::check(&card, &tensors)?;
        let runtime = EngineRuntime::new(&tensors, &card.architecture, options)?;
        Ok(Network::of(card, Box::new(runtime), None))
    }

    /// A network on given runtimes: one for predictions, and one for gradients where that is another.
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

    /// Packs the weights now instead of at the first prediction; a network that is never asked saves that memory.
    pub fn prepare(&self) {
        self.forward.prepare();
    }

    /// What the weights are.
    pub fn card(&self) -> &WeightsCard {
        &self.card
    }

    /// Predicts every cell of every grid, in the network's units and the grid's own space.
    ///
    /// The prediction covers known cells, too; callers keep the scan's positions there.
    ///
    /// # Errors
    /// A grid of another size, or one whose values make the answer overflow.
    pub fn fill(&self, request: &FillRequest) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
        check_sizes(request.grids)?;
        let upright = self.upright(request.up);
        let symmetries: Vec<Vec<usize>> = (request.averaging.symmetries().iter())
            .map(|s| origins(*s))
            .collect();
        let mut copies = Vec::with_capacity(request.grids.len() * symmetries.len());
        for grid in request.grids {
            let grid = turned(grid, upright.as_ref());
            // The plate is the same for all symmetries, mirrored: it is computed once.
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
        let mut answers = Vec::with_capacity(request.grids.len());
        for alike in self.predict(&copies)?.chunks(symmetries.len()) {
            let mut mean = vec![[0.0; 3]; CELLS];
            for (answer, from) in alike.iter().zip(&symmetries) {
                for (p, k) in answer.iter().zip(from) {
                    (0..3).for_each(|axis| mean[*k][axis] += p[axis] / symmetries.len() as f32);
                }
            }
            answers.push(mean);
        }
        if let Some(upright) = upright {
            let back = upright.transpose();
            for p in answers.iter_mut().flatten() {
                *p = times(&back, *p);
            }
        }
        Ok(answers)
    }

    /// The anchor search's problem (paper §3.5): a grid and a target in the network's units, as the network sees them.
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

    /// The loss of a problem at each of the uvs; squared cells.
    ///
    /// # Errors
    /// Values that make the answer overflow.
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

    /// The same loss with its gradient.
    ///
    /// # Errors
    /// As of [`Network::anchor_losses`].
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

    /// Predictions of grids of checked size: shown to the network in its frame, the answers turned back.
    fn predict(&self, grids: &[NormalGrid]) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
        let config = &self.card.architecture;
        let mut answers = Vec::with_capacity(grids.len());
        for chunk in grids.chunks(BATCH) {
            let frames: Vec<NetworkFrame> = (chunk.iter())
                .map(|grid| NetworkFrame::of(config.frame, grid))
                .collect();
            let answer = self.forward.predict(&shown(config, chunk, &frames))?;
            let each = answer.chunks_exact(3 * CELLS).zip(&frames);
            answers.extend(each.map(|(planes, frame)| {
                let inside = cells(planes).into_iter();
                inside.map(|p| frame.leave(p)).collect::<Vec<_>>()
            }));
        }
        let finite = |answer: &Vec<[f32; 3]>| answer.iter().flatten().all(|x| x.is_finite());
        match answers.iter().position(|answer| !finite(answer)) {
            Some(index) => Err(NetError::Answer { index }),
            None => Ok(answers),
        }
    }

    /// The rotation that brings `up` to +z; none when this network does not know up, or up is not given.
    fn upright(&self, up: Option<[f64; 3]>) -> Option<Matrix3<f32>> {
        let known = self.card.architecture.frame.knows_up();
        up.filter(|_| known).map(upright)
    }
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

/// Grids as planes, each in its frame.
fn shown(config: &UnetConfig, grids: &[NormalGrid], frames: &[NetworkFrame]) -> GridPlanes {
    let entered = |cells: &[[f32; 3]], frame: &NetworkFrame| -> Vec<[f32; 3]> {
        cells.iter().map(|p| frame.enter(*p)).collect()
    };
    let each = || grids.iter().zip(frames);
    let positions: Vec<_> = each().map(|(g, f)| entered(&g.positions, f)).collect();
    let base: Option<Vec<_>> = each()
        .map(|(g, f)| Some(entered(&base_of(config, g)?, f)))
        .collect();
    let known = grids.iter().flat_map(|grid| grid.known.iter().copied());
    let up = frames.iter().map(|frame| up_of(config, frame));
    let up: Option<Vec<[f32; 3]>> = up.collect();
    GridPlanes {
        positions: planes(&positions),
        known: known.collect(),
        base: base.map(|base| planes(&base)),
        up: up.map(|up| up.as_flattened().to_vec()),
    }
}

/// The plate that a network sees under a grid's anchors, in the grid's frame: the grid's own, else made of its known cells. None for
/// networks that see no plate.
pub(crate) fn base_of(config: &UnetConfig, grid: &NormalGrid) -> Option<Vec<[f32; 3]>> {
    let seen = config.input == InputKind::Plate;
    let made = || {
        let known: Vec<bool> = grid.known.iter().map(|k| *k > 0.5).collect();
        // A grid of which next to nothing is known has no plate: then a membrane alone is seen.
        let plate = plate(&grid.positions, &known);
        plate.unwrap_or_else(|| vec![[0.0; 3]; CELLS])
    };
    seen.then(|| grid.base.clone().unwrap_or_else(made))
}

/// The up direction in a frame, for a network that is told it.
pub(crate) fn up_of(config: &UnetConfig, frame: &NetworkFrame) -> Option<[f32; 3]> {
    config.frame.told_up().then(|| frame.up())
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
    // None for the opposite direction: any half turn about a horizontal axis will do.
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
        fn up_becomes_z(up in prop::array::uniform3(-1.0..1.0f64)) {
            prop_assume!(Vec3::from(up).norm() > 1e-3);
            let unit = Vec3::from(up).normalize().cast::<f32>();
            prop_assert!((upright(up) * unit - Vector3::z()).norm() < 1e-5);
        }
    }

    #[test]
    fn straight_down_turns_over() {
        let rotation = upright([0.0, 0.0, -2.0]);
        assert!((rotation * -Vector3::z() - Vector3::z()).norm() < 1e-6);
        assert!((rotation.determinant() - 1.0).abs() < 1e-6);
    }
}
