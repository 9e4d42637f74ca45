//! The network's weights, ready for the kernels: read and folded once, forward layers at load, adjoint ones when first wanted.

use super::EngineError;
use super::gate::{Gate, GateAdjoint};
use super::pack::{Folded, Layer, Parts, Plan, Turn, tensor};
use crate::weights::NamedTensors;
use darn_geometry::grid::SIDE;

/// Scales below the first.
pub const DOWN: usize = 4;

/// Cells along a side at a level.
pub fn side(level: usize) -> usize {
    SIDE >> level
}

/// All convolutions with their batch norm folded in.
#[derive(Debug)]
pub struct Folds {
    pub width: usize,
    /// By level, two convolutions each.
    pub down: Vec<[Folded; 2]>,
    /// By level.
    pub up: Vec<UpFolds>,
    /// `[3, width]`.
    pub last: Vec<f32>,
    pub last_bias: [f32; 3],
}

/// One step up.
#[derive(Debug)]
pub struct UpFolds {
    pub conv: Folded,
    pub gate: GateFolds,
    pub block: [Folded; 2],
}

/// A gate; its two 1×1 convolutions as one over the channels of skip and signal.
#[derive(Debug)]
pub struct GateFolds {
    pub joint: Folded,
    pub score: Vec<f32>,
    pub score_bias: f32,
}

impl Folds {
    /// Reads and folds all tensors of a network.
    ///
    /// # Errors
    /// The first tensor that is missing or has another shape.
    pub fn read(
        tensors: &NamedTensors,
        width: usize,
        channels_seen: usize,
    ) -> Result<Folds, EngineError> {
        let block = |name: String, from: usize, to: usize| -> Result<[Folded; 2], EngineError> {
            let half = |i: usize, from: usize| {
                let (conv, norm) = (format!("{name}.conv{i}"), format!("{name}.norm{i}"));
                Folded::read(tensors, [&conv, &norm], [to, from, 3])
            };
            Ok([half(0, from)?, half(1, to)?])
        };
        let channels = |level: usize| width << level;
        let mut down = vec![block("down.0".into(), channels_seen, width)?];
        for level in 1..=DOWN {
            let (from, to) = (channels(level - 1), channels(level));
            down.push(block(format!("down.{level}"), from, to)?);
        }
        let mut up = Vec::new();
        for level in 0..DOWN {
            let name = format!("up.{level}");
            let (from, to) = (channels(level + 1), channels(level));
            let (conv, norm) = (format!("{name}.conv"), format!("{name}.norm"));
            up.push(UpFolds {
                conv: Folded::read(tensors, [&conv, &norm], [to, from, 3])?,
                gate: GateFolds::read(tensors, &format!("{name}.gate"), to)?,
                block: block(format!("{name}.block"), 2 * to, to)?,
            });
        }
        let bias = tensor(tensors, "last.bias", &[3])?;
        Ok(Folds {
            width,
            down,
            up,
            last: tensor(tensors, "last.weight", &[3, width, 1, 1])?.to_vec(),
            last_bias: [bias[0], bias[1], bias[2]],
        })
    }
}

impl GateFolds {
    fn read(tensors: &NamedTensors, name: &str, channels: usize) -> Result<GateFolds, EngineError> {
        let inner = (channels / 2).max(1);
        let half = |part: &str| {
            let (conv, norm) = (format!("{name}.{part}"), format!("{name}.{part}_norm"));
            Folded::read(tensors, [&conv, &norm], [inner, channels, 1])
        };
        let (skip, signal) = (half("skip")?, half("signal")?);
        let rows = skip
            .kernel
            .chunks(channels)
            .zip(signal.kernel.chunks(channels));
        let joint = Folded {
            to: inner,
            from: 2 * channels,
            kernel: rows.flat_map(|(a, b)| a.iter().chain(b).copied()).collect(),
            bias: skip
                .bias
                .iter()
                .zip(&signal.bias)
                .map(|(a, b)| a + b)
                .collect(),
        };
        let score = tensor(tensors, &format!("{name}.score.weight"), &[1, inner, 1, 1])?;
        let score_bias = tensor(tensors, &format!("{name}.score.bias"), &[1])?;
        Ok(GateFolds {
            joint,
            score: score.to_vec(),
            score_bias: score_bias[0],
        })
    }
}

/// The forward pass's layers. Packed on one thread: the first to ask may be a thread of a pool, and one that waits for others there may be
/// given work that asks again.
#[derive(Debug)]
pub struct Forward {
    pub down: Vec<[Layer; 2]>,
    pub up: Vec<UpLayers>,
}

/// One step up.
#[derive(Debug)]
pub struct UpLayers {
    pub conv: Layer,
    pub gate: Gate,
    pub block: [Layer; 2],
}

impl Forward {
    pub fn pack(folds: &Folds) -> Forward {
        let block = |level: usize, [first, second]: &[Folded; 2], parts: usize| {
            let (plan, to) = (Plan::of_side(side(level)), Parts(first.to));
            [
                Layer::pack(plan, first, [Parts(parts), to]),
                Layer::pack(plan, second, [to, to]),
            ]
        };
        Forward {
            down: (folds.down.iter().enumerate())
                .map(|(level, convs)| block(level, convs, convs[0].from))
                .collect(),
            up: (folds.up.iter().enumerate())
                .map(|(level, up)| UpLayers {
                    conv: Layer::pack(Plan::Up, &up.conv, [Parts(up.conv.from), Parts(up.conv.to)]),
                    gate: Gate::pack(&up.gate),
                    block: block(level, &up.block, up.conv.to),
                })
                .collect(),
        }
    }
}

/// The adjoint pass's layers; those of a block in the forward order.
#[derive(Debug)]
pub struct Reverse {
    pub down: Vec<[Layer; 2]>,
    pub up: Vec<UpReverse>,
}

/// One step up, backwards.
#[derive(Debug)]
pub struct UpReverse {
    pub conv: Layer,
    pub gate: GateAdjoint,
    pub block: [Layer; 2],
}

impl Reverse {
    pub fn pack(folds: &Folds) -> Reverse {
        let block = |level: usize, [first, second]: &[Folded; 2], parts: usize| {
            let (plan, from) = (Plan::of_side(side(level)), Parts(first.to));
            [
                Layer::pack(plan, &first.adjoint(Turn::Half), [from, Parts(parts)]),
                Layer::pack(plan, &second.adjoint(Turn::Half), [from, from]),
            ]
        };
        Reverse {
            down: (folds.down.iter().enumerate())
                .map(|(level, convs)| block(level, convs, convs[0].from))
                .collect(),
            up: (folds.up.iter().enumerate())
                .map(|(level, up)| UpReverse {
                    conv: Layer::pack(
                        Plan::Down,
                        &up.conv.adjoint(Turn::Not),
                        [Parts(up.conv.to), Parts(up.conv.from)],
                    ),
                    gate: GateAdjoint::pack(&up.gate),
                    block: block(level, &up.block, up.conv.to),
                })
                .collect(),
        }
    }
}
