//! AdamW (Loshchilov & Hutter 2019) over a module's parameters in their own order, with one clip of the whole gradient's norm, and
//! an exponential average of the weights. burn's own clips each tensor by itself and keys its state by ids that a checkpoint would
//! have to carry.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use burn::tensor::backend::{AutodiffBackend, Backend};

pub const BETA1: f64 = 0.9;
pub const BETA2: f64 = 0.99;
pub const EPSILON: f64 = 1e-8;
/// Decay of kernels; vectors do not decay.
pub const DECAY: f64 = 1e-2;
/// Largest norm of the whole gradient.
pub const CLIP: f64 = 1.0;
/// The average's memory never exceeds this many steps' share.
const AVERAGE: f64 = 0.998;

/// The optimiser's state: first and second moments of every trained parameter, flat, in the module's order.
#[derive(Debug, Clone)]
pub struct AdamW<B: Backend> {
    /// Steps taken.
    pub step: u64,
    /// First and second moment of each parameter.
    pub moments: Vec<[Tensor<B, 1>; 2]>,
}

impl<B: Backend> Default for AdamW<B> {
    fn default() -> Self {
        AdamW {
            step: 0,
            moments: Vec::new(),
        }
    }
}

impl<I: Backend> AdamW<I> {
    /// One step down the gradients; returns the module and the gradient's norm before clipping.
    pub fn step<B, M>(&mut self, module: M, gradients: GradientsParams, rate: f64) -> (M, f64)
    where
        B: AutodiffBackend<InnerBackend = I>,
        M: Module<B>,
    {
        self.step += 1;
        let mut norm = Norm {
            gradients: &gradients,
            squares: 0.0,
            marker: std::marker::PhantomData::<I>,
        };
        module.visit(&mut norm);
        let norm = norm.squares.sqrt();
        let clip = if norm > CLIP { CLIP / norm } else { 1.0 };
        let mut update = Update {
            gradients,
            moments: &mut self.moments,
            index: 0,
            step: self.step,
            rate,
            clip,
        };
        (module.map(&mut update), norm)
    }
}

struct Norm<'a, I> {
    gradients: &'a GradientsParams,
    squares: f64,
    marker: std::marker::PhantomData<I>,
}

impl<B: AutodiffBackend> ModuleVisitor<B> for Norm<'_, B::InnerBackend> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        if let Some(gradient) = self.gradients.get::<B::InnerBackend, D>(param.id) {
            let squares = gradient
                .clone()
                .mul(gradient)
                .sum()
                .into_data()
                .convert::<f64>();
            self.squares += squares.iter::<f64>().sum::<f64>();
        }
    }
}

struct Update<'a, I: Backend> {
    gradients: GradientsParams,
    moments: &'a mut Vec<[Tensor<I, 1>; 2]>,
    index: usize,
    step: u64,
    rate: f64,
    clip: f64,
}

impl<B: AutodiffBackend> ModuleMapper<B> for Update<'_, B::InnerBackend> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let (id, tensor, mapper) = param.consume();
        let Some(gradient) = self.gradients.remove::<B::InnerBackend, D>(id) else {
            return Param::from_mapped_value(id, tensor, mapper);
        };
        let shape = tensor.shape();
        let n = shape.num_elements();
        let gradient = gradient.reshape([n]) * self.clip;
        let value = tensor.inner().reshape([n]);
        let zeros = || [value.zeros_like(), value.zeros_like()];
        let [first, second] = self.moments.get(self.index).cloned().unwrap_or_else(zeros);
        let first = first * BETA1 + gradient.clone() * (1.0 - BETA1);
        let second = second * BETA2 + gradient.clone().mul(gradient) * (1.0 - BETA2);
        let time = self.step as i32;
        let (scale1, scale2) = (
            1.0 / (1.0 - BETA1.powi(time)),
            1.0 / (1.0 - BETA2.powi(time)),
        );
        let change =
            (first.clone() * (scale1 * self.rate)).div((second.clone() * scale2).sqrt() + EPSILON);
        let decay = if D > 1 { 1.0 - self.rate * DECAY } else { 1.0 };
        let value = value * decay - change;
        if let Some(slot) = self.moments.get_mut(self.index) {
            *slot = [first, second];
        } else {
            self.moments.push([first, second]);
        }
        self.index += 1;
        let value = Tensor::<B, D>::from_inner(value.reshape(shape)).require_grad();
        Param::from_mapped_value(id, value, mapper)
    }
}

/// What the average keeps of itself at a step, which counts from 1.
pub fn share_kept(step: u64) -> f64 {
    AVERAGE.min((1.0 + step as f64) / (10.0 + step as f64))
}

/// Moves the averaged module towards the current one, running statistics included; `step` counts from 1.
pub fn average<B: Backend, M: Module<B>>(averaged: M, current: &M, step: u64) -> M {
    let keep = share_kept(step);
    let mut collect = Collect { values: Vec::new() };
    current.visit(&mut collect);
    averaged.map(&mut Average {
        values: collect.values.into_iter(),
        keep,
    })
}

struct Collect<B: Backend> {
    values: Vec<Tensor<B, 1>>,
}

impl<B: Backend> ModuleVisitor<B> for Collect<B> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let value = param.val();
        let n = value.shape().num_elements();
        self.values.push(value.reshape([n]));
    }
}

struct Average<B: Backend> {
    values: std::vec::IntoIter<Tensor<B, 1>>,
    keep: f64,
}

impl<B: Backend> ModuleMapper<B> for Average<B> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let (id, tensor, mapper) = param.consume();
        let tensor = match self.values.next() {
            Some(value) => {
                let shape = tensor.shape();
                tensor * self.keep + value.reshape(shape) * (1.0 - self.keep)
            }
            None => tensor,
        };
        Param::from_mapped_value(id, tensor, mapper)
    }
}
