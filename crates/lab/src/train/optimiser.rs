//! AdamW (Loshchilov & Hutter 2019) over the parameters of a module in their order, with the norm of the whole gradient clipped, and an
//! exponential average of the weights. burn's AdamW is not used: it clips each tensor separately, and it stores its state by parameter ids,
//! which a checkpoint would have to contain.

use std::collections::VecDeque;
use std::ops::Range;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param, ParamId};
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use burn::tensor::backend::{AutodiffBackend, Backend};

/// Decay of the first moment.
pub const BETA1: f64 = 0.9;
/// Decay of the second moment.
pub const BETA2: f64 = 0.99;
/// Keeps the division by the second moment finite.
pub const EPSILON: f64 = 1e-8;
/// Weight decay of kernels; vectors do not decay.
pub const DECAY: f64 = 1e-2;
/// Largest norm of the whole gradient.
pub const CLIP: f64 = 1.0;
/// Largest share that the average keeps of itself at a step.
const AVERAGE: f64 = 0.998;

/// The state of the optimiser. All trained parameters are concatenated to one tensor in the module's order, so that a step on a GPU is a few
/// large kernels instead of a thousand small ones.
#[derive(Debug, Clone)]
pub struct AdamW<B: Backend> {
    /// Steps taken.
    pub step: u64,
    /// First and second moments; `None` before the first step.
    pub moments: Option<[Tensor<B, 1>; 2]>,
}

impl<B: Backend> Default for AdamW<B> {
    fn default() -> Self {
        AdamW {
            step: 0,
            moments: None,
        }
    }
}

impl<I: Backend> AdamW<I> {
    /// One step down the gradients; returns the module, and the norm of the gradient before clipping as a tensor `[1]`, so that the step does
    /// not wait for the device.
    pub fn step<B, M>(
        &mut self,
        module: M,
        gradients: &GradientsParams,
        rate: f64,
    ) -> (M, Tensor<I, 1>)
    where
        B: AutodiffBackend<InnerBackend = I>,
        M: Module<B>,
    {
        self.step += 1;
        let mut trained = TrainedParameters::<I> {
            gradients,
            decay: 1.0 - rate * DECAY,
            places: VecDeque::new(),
            values: Vec::new(),
            slopes: Vec::new(),
        };
        module.visit(&mut trained);
        let values = Tensor::cat(trained.values, 0);
        let gradient = Tensor::cat(trained.slopes, 0);
        let norm = gradient.clone().mul(gradient.clone()).sum().sqrt();
        let clip = (norm.clone().recip() * CLIP).clamp_max(1.0);
        let gradient = gradient.clone().mul(clip.expand(gradient.shape()));
        let zeros = || [gradient.zeros_like(), gradient.zeros_like()];
        let [first, second] = self.moments.take().unwrap_or_else(zeros);
        let first = first * BETA1 + gradient.clone() * (1.0 - BETA1);
        let second = second * BETA2 + gradient.clone().mul(gradient) * (1.0 - BETA2);
        let unbias = |beta: f64| 1.0 / (1.0 - beta.powi(self.step as i32));
        let (scale1, scale2) = (unbias(BETA1) * rate, unbias(BETA2));
        let change = (first.clone() * scale1).div((second.clone() * scale2).sqrt() + EPSILON);
        self.moments = Some([first, second]);
        let mut update = ParameterUpdate {
            values: values - change,
            places: trained.places,
        };
        (module.map(&mut update), norm)
    }
}

/// Collects the decayed parameters that have a gradient, and their gradients.
struct TrainedParameters<'a, I: Backend> {
    gradients: &'a GradientsParams,
    /// Factor that kernels shrink by; vectors keep their values.
    decay: f64,
    places: VecDeque<(ParamId, Range<usize>)>,
    values: Vec<Tensor<I, 1>>,
    slopes: Vec<Tensor<I, 1>>,
}

impl<B: AutodiffBackend> ModuleVisitor<B> for TrainedParameters<'_, B::InnerBackend> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let Some(slope) = self.gradients.get::<B::InnerBackend, D>(param.id) else {
            return;
        };
        let n = slope.shape().num_elements();
        let start = self.places.back().map_or(0, |(_, range)| range.end);
        self.places.push_back((param.id, start..start + n));
        let value = param.val().inner().reshape([n]);
        let kernel = D > 1;
        let value = if kernel { value * self.decay } else { value };
        self.values.push(value);
        self.slopes.push(slope.reshape([n]));
    }
}

/// Writes concatenated values back into their parameters.
struct ParameterUpdate<I: Backend> {
    values: Tensor<I, 1>,
    places: VecDeque<(ParamId, Range<usize>)>,
}

impl<B: AutodiffBackend> ModuleMapper<B> for ParameterUpdate<B::InnerBackend> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let (id, tensor, mapper) = param.consume();
        match self.places.pop_front_if(|(first, _)| *first == id) {
            None => Param::from_mapped_value(id, tensor, mapper),
            Some((_, range)) => {
                let value = self.values.clone().slice(range).reshape(tensor.shape());
                let value = Tensor::<B, D>::from_inner(value).require_grad();
                Param::from_mapped_value(id, value, mapper)
            }
        }
    }
}

/// The share that the average keeps of itself at a step; steps count from 1.
pub fn share_kept(step: u64) -> f64 {
    AVERAGE.min((1.0 + step as f64) / (10.0 + step as f64))
}

/// All values of a module concatenated, with the running statistics.
pub fn flat<B: Backend, M: Module<B>>(module: &M) -> Tensor<B, 1> {
    let mut collect = ValueCollector { values: Vec::new() };
    module.visit(&mut collect);
    Tensor::cat(collect.values, 0)
}

/// The module with the values of [`flat`].
pub fn with_values<B: Backend, M: Module<B>>(module: M, values: Tensor<B, 1>) -> M {
    module.map(&mut ValuePlacer { values, next: 0 })
}

/// The average of [`flat`] values, moved towards the current ones; `step` counts from 1.
pub fn average<B: Backend>(
    averaged: Tensor<B, 1>,
    current: Tensor<B, 1>,
    step: u64,
) -> Tensor<B, 1> {
    let keep = share_kept(step);
    averaged * keep + current * (1.0 - keep)
}

/// Collects all values of a module.
struct ValueCollector<B: Backend> {
    values: Vec<Tensor<B, 1>>,
}

impl<B: Backend> ModuleVisitor<B> for ValueCollector<B> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let value = param.val();
        let n = value.shape().num_elements();
        self.values.push(value.reshape([n]));
    }
}

/// Replaces all values of a module.
struct ValuePlacer<B: Backend> {
    values: Tensor<B, 1>,
    next: usize,
}

impl<B: Backend> ModuleMapper<B> for ValuePlacer<B> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let (id, tensor, mapper) = param.consume();
        let shape = tensor.shape();
        let end = self.next + shape.num_elements();
        let value = self.values.clone().slice(self.next..end);
        self.next = end;
        Param::from_mapped_value(id, value.reshape(shape), mapper)
    }
}
