//! The adjoint of [`super::fuse`]: gradients with respect to fused weights become gradients with respect to the named tensors.

use super::error::EngineError;
use super::fuse::{ConvNames, EPSILON, FusedConv, FusedGate, FusedWeights, tensor};
use crate::tensors::NamedTensors;

/// The gradient with respect to the tensors of a network, by name; those of `mean` and `variance` are left out.
///
/// # Errors
/// `tensors` are not those that the fused weights were made from.
pub fn by_name(
    gradient: FusedWeights,
    tensors: &NamedTensors,
) -> Result<NamedTensors, EngineError> {
    let mut named = Unfused {
        tensors,
        gradients: NamedTensors::new(),
    };
    for (level, block) in gradient.down.into_iter().enumerate() {
        named.put_block(&format!("down.{level}"), block)?;
    }
    for (level, up) in gradient.up.into_iter().enumerate() {
        let name = format!("up.{level}");
        named.put_conv(&ConvNames::of_up_step(&name), up.conv)?;
        named.put_gate(&format!("{name}.gate"), up.gate)?;
        named.put_block(&format!("{name}.block"), up.block)?;
    }
    let mut gradients = named.gradients;
    let shape = vec![3, gradient.width, 1, 1];
    gradients.insert("last.weight".into(), (shape, gradient.last));
    let bias = (vec![3], gradient.last_bias.to_vec());
    gradients.insert("last.bias".into(), bias);
    Ok(gradients)
}

struct Unfused<'a> {
    tensors: &'a NamedTensors,
    gradients: NamedTensors,
}

impl Unfused<'_> {
    fn put_block(&mut self, name: &str, block: [FusedConv; 2]) -> Result<(), EngineError> {
        let mut convs = block.into_iter().enumerate();
        convs.try_for_each(|(i, conv)| self.put_conv(&ConvNames::of_block(name, i), conv))
    }

    fn put_gate(&mut self, name: &str, gate: FusedGate) -> Result<(), EngineError> {
        let FusedConv {
            out_channels,
            in_channels,
            kernel,
            bias,
        } = gate.joint;
        let channels = in_channels / 2;
        for (part, first) in [("skip", 0), ("signal", channels)] {
            let rows = kernel.chunks(in_channels);
            let conv = FusedConv {
                out_channels,
                in_channels: channels,
                kernel: rows
                    .flat_map(|row| &row[first..first + channels])
                    .copied()
                    .collect(),
                bias: bias.clone(),
            };
            self.put_conv(&ConvNames::of_gate(name, part), conv)?;
        }
        let score = (vec![1, out_channels, 1, 1], gate.score);
        self.gradients.insert(format!("{name}.score.weight"), score);
        let bias = (vec![1], vec![gate.score_bias]);
        self.gradients.insert(format!("{name}.score.bias"), bias);
        Ok(())
    }

    /// Kernel, scale and shift: the adjoint of [`FusedConv::read`].
    fn put_conv(&mut self, names: &ConvNames, gradient: FusedConv) -> Result<(), EngineError> {
        let ConvNames { conv, norm } = names;
        let (channels, size) = (gradient.out_channels, gradient.taps().isqrt());
        let shape = [channels, gradient.in_channels, size, size];
        let kernel = tensor(self.tensors, &format!("{conv}.weight"), &shape)?;
        let vector = |part: &str| tensor(self.tensors, &format!("{norm}.{part}"), &[channels]);
        let (scale, mean, variance) = (vector("scale")?, vector("mean")?, vector("variance")?);
        let row = gradient.kernel.len() / channels.max(1);
        let mut by_kernel = gradient.kernel;
        let mut by_scale = Vec::with_capacity(channels);
        let rows = by_kernel.chunks_mut(row).zip(kernel.chunks(row));
        for (c, (by, kernel)) in rows.enumerate() {
            let deviation = (f64::from(variance[c]) + EPSILON).sqrt();
            let products = by.iter().zip(kernel);
            let product: f64 = products.map(|(by, w)| f64::from(*by) * f64::from(*w)).sum();
            let shifted = f64::from(mean[c]) * f64::from(gradient.bias[c]);
            by_scale.push(((product - shifted) / deviation) as f32);
            let factor = (f64::from(scale[c]) / deviation) as f32;
            by.iter_mut().for_each(|by| *by *= factor);
        }
        let by_kernel = (shape.to_vec(), by_kernel);
        self.gradients.insert(format!("{conv}.weight"), by_kernel);
        let by_scale = (vec![channels], by_scale);
        self.gradients.insert(format!("{norm}.scale"), by_scale);
        let by_shift = (vec![channels], gradient.bias);
        self.gradients.insert(format!("{norm}.shift"), by_shift);
        Ok(())
    }
}
