//! The network's weights with every batch norm fused into the convolution before it.

use super::error::EngineError;
use crate::config::DOWN;
use crate::tensors::NamedTensors;

/// Added to a variance before its root, so that a channel without variance stays finite; as in training.
pub const EPSILON: f64 = 1e-5;

/// Names of a convolution's module and of the batch norm after it.
#[derive(Debug)]
pub struct ConvNames {
    pub conv: String,
    pub norm: String,
}

impl ConvNames {
    /// Of the convolution 0 or 1 of a block.
    pub fn of_block(block: &str, index: usize) -> ConvNames {
        ConvNames {
            conv: format!("{block}.conv{index}"),
            norm: format!("{block}.norm{index}"),
        }
    }

    /// Of the convolution after the upsampling of an up step.
    pub fn of_up_step(step: &str) -> ConvNames {
        ConvNames {
            conv: format!("{step}.conv"),
            norm: format!("{step}.norm"),
        }
    }

    /// Of a gate's 1×1 convolution of the `skip` or of the `signal`.
    pub fn of_gate(gate: &str, part: &str) -> ConvNames {
        ConvNames {
            conv: format!("{gate}.{part}"),
            norm: format!("{gate}.{part}_norm"),
        }
    }
}

/// Size of a convolution with a square kernel.
#[derive(Debug, Clone, Copy)]
pub struct ConvShape {
    pub out_channels: usize,
    pub in_channels: usize,
    /// Taps along a side of the kernel.
    pub side: usize,
}

/// A convolution and the batch norm after it as one convolution: kernel `[out, in, taps]`, bias `[out]`.
#[derive(Debug, Clone)]
pub struct FusedConv {
    pub out_channels: usize,
    pub in_channels: usize,
    pub kernel: Vec<f32>,
    pub bias: Vec<f32>,
}

impl FusedConv {
    /// Reads and fuses the tensors of a convolution and of its batch norm.
    ///
    /// # Errors
    /// A tensor that is missing or has another shape.
    pub fn read(
        tensors: &NamedTensors,
        names: &ConvNames,
        shape: ConvShape,
    ) -> Result<FusedConv, EngineError> {
        let ConvShape {
            out_channels,
            in_channels,
            side,
        } = shape;
        let expected = [out_channels, in_channels, side, side];
        let kernel = tensor(tensors, &format!("{}.weight", names.conv), &expected)?;
        let vector = |part: &str| {
            let name = format!("{}.{part}", names.norm);
            tensor(tensors, &name, &[out_channels])
        };
        let (scale, shift) = (vector("scale")?, vector("shift")?);
        let (mean, variance) = (vector("mean")?, vector("variance")?);
        let factors: Vec<f64> = scale
            .iter()
            .zip(variance)
            .map(|(s, v)| f64::from(*s) / (f64::from(*v) + EPSILON).sqrt())
            .collect();
        let bias = (0..out_channels)
            .map(|c| (f64::from(shift[c]) - f64::from(mean[c]) * factors[c]) as f32)
            .collect();
        let row = in_channels * side * side;
        let kernel = kernel
            .iter()
            .enumerate()
            .map(|(i, w)| (f64::from(*w) * factors[i / row]) as f32)
            .collect();
        Ok(FusedConv {
            out_channels,
            in_channels,
            kernel,
            bias,
        })
    }

    /// Weights from one input channel to one output channel.
    pub fn taps(&self) -> usize {
        self.kernel.len() / (self.out_channels * self.in_channels).max(1)
    }

    /// The adjoint convolution: channels swapped, kernel turned by half a turn, no bias.
    pub fn adjoint(&self) -> FusedConv {
        let taps = self.taps();
        self.with_channels_swapped(|tap| taps - 1 - tap)
    }

    /// Channels swapped, kernel as it is, no bias.
    pub fn transposed(&self) -> FusedConv {
        self.with_channels_swapped(|tap| tap)
    }

    fn with_channels_swapped(&self, moved: impl Fn(usize) -> usize) -> FusedConv {
        let taps = self.taps();
        let mut kernel = vec![0.0; self.kernel.len()];
        for to in 0..self.out_channels {
            for from in 0..self.in_channels {
                for tap in 0..taps {
                    kernel[(from * self.out_channels + to) * taps + moved(tap)] =
                        self.kernel[(to * self.in_channels + from) * taps + tap];
                }
            }
        }
        FusedConv {
            out_channels: self.in_channels,
            in_channels: self.out_channels,
            kernel,
            bias: vec![0.0; self.in_channels],
        }
    }
}

/// An attention gate; the 1×1 convolutions of skip and signal are one over the channels of both.
#[derive(Debug)]
pub struct FusedGate {
    pub joint: FusedConv,
    /// By channel of the joint features.
    pub score: Vec<f32>,
    pub score_bias: f32,
}

impl FusedGate {
    fn read(tensors: &NamedTensors, name: &str, channels: usize) -> Result<FusedGate, EngineError> {
        let shape = ConvShape {
            out_channels: (channels / 2).max(1),
            in_channels: channels,
            side: 1,
        };
        let half = |part: &str| FusedConv::read(tensors, &ConvNames::of_gate(name, part), shape);
        let (skip, signal) = (half("skip")?, half("signal")?);
        let rows = skip
            .kernel
            .chunks(channels)
            .zip(signal.kernel.chunks(channels));
        let biases = skip.bias.iter().zip(&signal.bias);
        let joint = FusedConv {
            out_channels: shape.out_channels,
            in_channels: 2 * channels,
            kernel: rows.flat_map(|(a, b)| a.iter().chain(b).copied()).collect(),
            bias: biases.map(|(a, b)| a + b).collect(),
        };
        let score_shape = [1, shape.out_channels, 1, 1];
        let score = tensor(tensors, &format!("{name}.score.weight"), &score_shape)?;
        let score_bias = tensor(tensors, &format!("{name}.score.bias"), &[1])?;
        Ok(FusedGate {
            joint,
            score: score.to_vec(),
            score_bias: score_bias[0],
        })
    }
}

/// One step up: upsampling with its convolution, gate, block.
#[derive(Debug)]
pub struct FusedUpStep {
    pub conv: FusedConv,
    pub gate: FusedGate,
    pub block: [FusedConv; 2],
}

/// All weights of a network. A gradient with respect to them has the same shape.
#[derive(Debug)]
pub struct FusedWeights {
    pub width: usize,
    /// By level, two convolutions each.
    pub down: Vec<[FusedConv; 2]>,
    /// By level.
    pub up: Vec<FusedUpStep>,
    /// `[3, width]`.
    pub last: Vec<f32>,
    pub last_bias: [f32; 3],
}

impl FusedWeights {
    /// Reads and fuses all tensors of a network of a width that is given `in_channels` channels.
    ///
    /// # Errors
    /// The first tensor that is missing or has another shape.
    pub fn read(
        tensors: &NamedTensors,
        width: usize,
        in_channels: usize,
    ) -> Result<FusedWeights, EngineError> {
        let conv = |names: ConvNames, in_channels: usize, out_channels: usize| {
            let shape = ConvShape {
                out_channels,
                in_channels,
                side: 3,
            };
            FusedConv::read(tensors, &names, shape)
        };
        let block = |name: String, from: usize, to: usize| -> Result<_, EngineError> {
            let first = conv(ConvNames::of_block(&name, 0), from, to)?;
            Ok([first, conv(ConvNames::of_block(&name, 1), to, to)?])
        };
        let channels = |level: usize| width << level;
        let mut down = vec![block("down.0".into(), in_channels, width)?];
        for level in 1..=DOWN {
            let (from, to) = (channels(level - 1), channels(level));
            down.push(block(format!("down.{level}"), from, to)?);
        }
        let mut up = Vec::new();
        for level in 0..DOWN {
            let name = format!("up.{level}");
            let (from, to) = (channels(level + 1), channels(level));
            up.push(FusedUpStep {
                conv: conv(ConvNames::of_up_step(&name), from, to)?,
                gate: FusedGate::read(tensors, &format!("{name}.gate"), to)?,
                block: block(format!("{name}.block"), 2 * to, to)?,
            });
        }
        let bias = tensor(tensors, "last.bias", &[3])?;
        Ok(FusedWeights {
            width,
            down,
            up,
            last: tensor(tensors, "last.weight", &[3, width, 1, 1])?.to_vec(),
            last_bias: [bias[0], bias[1], bias[2]],
        })
    }
}

/// The values of a tensor by name.
///
/// # Errors
/// It is missing or has another shape.
pub fn tensor<'a>(
    tensors: &'a NamedTensors,
    name: &str,
    expected: &[usize],
) -> Result<&'a [f32], EngineError> {
    let (shape, values) = tensors
        .get(name)
        .ok_or_else(|| EngineError::MissingTensor {
            name: name.to_owned(),
        })?;
    if shape != expected || values.len() != expected.iter().product::<usize>() {
        return Err(EngineError::Shape {
            name: name.to_owned(),
            found: shape.clone(),
            expected: expected.to_vec(),
        });
    }
    Ok(values)
}
