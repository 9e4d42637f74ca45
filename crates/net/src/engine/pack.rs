//! Weights, prepared once: batch norm folded into the kernels, kernels transformed to the frequencies of their scheme and laid out in
//! the order in which the products read them.

use super::map::panels;
use super::scheme::{Down, Four, Scheme, Two, Up};
use super::simd::{Block, LANES};
use super::{EngineError, Tensor};
use crate::weights::NamedTensors;

/// Keeps the division finite for a channel of no variance; as in training.
pub const EPSILON: f64 = 1e-5;

/// Which scheme a layer is computed by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plan {
    Four,
    Two,
    Up,
    Down,
}

impl Plan {
    /// The faster one for a 3×3 convolution of square images.
    pub fn of_side(side: usize) -> Plan {
        if side >= 16 { Plan::Four } else { Plan::Two }
    }

    /// Cells of input from a tile to the next.
    pub fn step(self) -> usize {
        match self {
            Plan::Four => Four::STEP,
            Plan::Two => Two::STEP,
            Plan::Up => Up::STEP,
            Plan::Down => Down::STEP,
        }
    }

    /// Cells of output along a tile's side; that many rows of it are a row of tiles.
    pub fn cells(self) -> usize {
        match self {
            Plan::Four => 4,
            Plan::Two | Plan::Up => 2,
            Plan::Down => 1,
        }
    }

    /// Products for one tile.
    pub fn frequencies(self) -> usize {
        match self {
            Plan::Four => 36,
            Plan::Two => 16,
            Plan::Up | Plan::Down => 9,
        }
    }
}

/// A convolution without bias and the batch norm after it, as one: kernel `[to, from, taps]` and bias `[to]`.
#[derive(Debug, Clone)]
pub struct Folded {
    pub to: usize,
    pub from: usize,
    pub kernel: Vec<f32>,
    pub bias: Vec<f32>,
}

impl Folded {
    /// `conv` and `norm` by the names of their modules; `shape` is `[to, from, side]`.
    ///
    /// # Errors
    /// A tensor that is missing or has another shape.
    pub fn read(
        tensors: &NamedTensors,
        [conv, norm]: [&str; 2],
        [to, from, side]: [usize; 3],
    ) -> Result<Folded, EngineError> {
        let kernel = tensor(tensors, &format!("{conv}.weight"), &[to, from, side, side])?;
        let vector = |name: &str| tensor(tensors, &format!("{norm}.{name}"), &[to]);
        let (scale, shift) = (vector("scale")?, vector("shift")?);
        let (mean, variance) = (vector("mean")?, vector("variance")?);
        let factors: Vec<f64> = scale
            .iter()
            .zip(variance)
            .map(|(s, v)| f64::from(*s) / (f64::from(*v) + EPSILON).sqrt())
            .collect();
        let bias = (0..to)
            .map(|c| (f64::from(shift[c]) - f64::from(mean[c]) * factors[c]) as f32)
            .collect();
        let row = from * side * side;
        let kernel = kernel
            .iter()
            .enumerate()
            .map(|(i, w)| (f64::from(*w) * factors[i / row]) as f32)
            .collect();
        Ok(Folded {
            to,
            from,
            kernel,
            bias,
        })
    }

    /// Number of weights from one input channel to one output channel.
    pub fn taps(&self) -> usize {
        self.kernel.len() / (self.to * self.from).max(1)
    }

    /// The adjoint: channels swapped, no bias; its kernel turned by half a turn or not.
    pub fn adjoint(&self, turn: Turn) -> Folded {
        let taps = self.taps();
        let mut kernel = vec![0.0; self.kernel.len()];
        for to in 0..self.to {
            for from in 0..self.from {
                for tap in 0..taps {
                    let turned = match turn {
                        Turn::Half => taps - 1 - tap,
                        Turn::Not => tap,
                    };
                    kernel[(from * self.to + to) * taps + turned] =
                        self.kernel[(to * self.from + from) * taps + tap];
                }
            }
        }
        Folded {
            to: self.from,
            from: self.to,
            kernel,
            bias: vec![0.0; self.from],
        }
    }
}

/// Whether an adjoint's kernel is turned by half a turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// For convolutions.
    Half,
    /// For [`Up`], whose adjoint [`Down`] turns by itself.
    Not,
}

/// Where channels lie in panels: in parts of so many channels, each of which begins a panel.
#[derive(Debug, Clone, Copy)]
pub struct Parts(pub usize);

impl Parts {
    /// Where a channel lies, in lanes.
    pub fn slot(self, channel: usize) -> usize {
        channel / self.0 * panels(self.0) * LANES + channel % self.0
    }

    /// How many panels so many channels take.
    pub fn panels(self, channels: usize) -> usize {
        channels.div_ceil(self.0) * panels(self.0)
    }
}

/// A 3×3 convolution, ready.
#[derive(Debug, Clone)]
pub struct Layer {
    pub plan: Plan,
    /// Panels of input.
    pub from: usize,
    /// Panels of output.
    pub to: usize,
    /// By panel of output.
    pub bias: Vec<Block>,
    /// `[panel of output][frequency][channel of input]`, each block 16 channels of output.
    weights: Vec<Block>,
}

impl Layer {
    /// Transforms and lays out a folded 3×3 convolution; `parts` of the input and of the output.
    pub fn pack(plan: Plan, conv: &Folded, [from, to]: [Parts; 2]) -> Layer {
        let (from_panels, to_panels) = (from.panels(conv.from), to.panels(conv.to));
        let frequencies = plan.frequencies();
        let channels = from_panels * LANES;
        let mut weights = vec![Block::ZERO; to_panels * frequencies * channels];
        for n in 0..conv.to {
            let (panel, lane) = (to.slot(n) / LANES, to.slot(n) % LANES);
            for k in 0..conv.from {
                let slot = from.slot(k);
                let kernel = &conv.kernel[(n * conv.from + k) * 9..][..9];
                let mut put = |f: usize, w: f64| {
                    weights[(panel * frequencies + f) * channels + slot].0[lane] = w as f32;
                };
                match plan {
                    Plan::Four => transform::<Four, 6, 6, 4>(kernel, &mut put),
                    Plan::Two => transform::<Two, 4, 4, 2>(kernel, &mut put),
                    Plan::Up => transform::<Up, 3, 3, 2>(kernel, &mut put),
                    Plan::Down => transform::<Down, 4, 3, 1>(kernel, &mut put),
                }
            }
        }
        Layer {
            plan,
            from: from_panels,
            to: to_panels,
            bias: vector(&conv.bias, to),
            weights,
        }
    }

    /// The weights of some panels of output.
    pub fn panels(&self, panels: std::ops::Range<usize>) -> &[Block] {
        let one = self.plan.frequencies() * self.from * LANES;
        &self.weights[panels.start * one..panels.end * one]
    }
}

/// A kernel's frequencies along both axes.
fn transform<T, const I: usize, const F: usize, const O: usize>(
    kernel: &[f32],
    put: &mut impl FnMut(usize, f64),
) where
    T: Scheme<I, F, O>,
{
    let row = |r: usize| T::kernel([0, 1, 2].map(|c| f64::from(kernel[3 * r + c])));
    let rows = [row(0), row(1), row(2)];
    for g in 0..F {
        let column = T::kernel(rows.map(|row| row[g]));
        for (f, w) in column.into_iter().enumerate() {
            put(f * F + g, w);
        }
    }
}

/// A 1×1 convolution for the products: `[panel of output][channel of input]`.
pub fn matrix(conv: &Folded, [from, to]: [Parts; 2]) -> Vec<Block> {
    let channels = from.panels(conv.from) * LANES;
    let mut weights = vec![Block::ZERO; to.panels(conv.to) * channels];
    for n in 0..conv.to {
        for k in 0..conv.from {
            let (panel, lane) = (to.slot(n) / LANES, to.slot(n) % LANES);
            weights[panel * channels + from.slot(k)].0[lane] = conv.kernel[n * conv.from + k];
        }
    }
    weights
}

/// Values of channels by panel; the lanes without a channel are zero.
pub fn vector(values: &[f32], parts: Parts) -> Vec<Block> {
    let mut blocks = vec![Block::ZERO; parts.panels(values.len())];
    for (channel, x) in values.iter().enumerate() {
        let slot = parts.slot(channel);
        blocks[slot / LANES].0[slot % LANES] = *x;
    }
    blocks
}

/// A tensor by name, checked.
///
/// # Errors
/// It is missing or has another shape.
pub fn tensor<'a>(
    tensors: &'a NamedTensors,
    name: &str,
    expected: &[usize],
) -> Result<&'a [f32], EngineError> {
    let (shape, values): &Tensor = tensors
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
