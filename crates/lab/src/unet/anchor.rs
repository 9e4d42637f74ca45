//! The loss of the anchor search and its gradient by burn's autodiff, through the Gaussian, the mask, the membrane and the network; see
//! [`darn_net::AnchorProblem`] for the formula.

use burn::backend::Autodiff;
use burn::module::{HasAutodiffModule, Module};
use burn::tensor::{Tensor, TensorData, backend::Backend};

use darn_geometry::grid::{CELLS, SIDE};
use darn_net::{AnchorLoss, AnchorProblem, NetError, SIGMA, UnetConfig};

use super::{Convolve, InputTensors, Unet};

/// A grid with its target, in the network's frame.
struct ProblemTensors<B: Backend> {
    /// The scan's positions where known, the target elsewhere: `[1, 3, 64, 64]`.
    positions: Tensor<B, 4>,
    /// `[1, 1, 64, 64]`.
    known: Tensor<B, 4>,
    /// `[1, 3, 64, 64]`.
    base: Option<Tensor<B, 4>>,
    /// `[1, 3]`.
    up: Option<Tensor<B, 2>>,
    /// `[1, 3]`.
    target: Tensor<B, 2>,
}

impl<B: Backend> ProblemTensors<B> {
    fn of(problem: &AnchorProblem) -> Self {
        let device = B::Device::default();
        let three = |x: [f32; 3]| Tensor::from_data(TensorData::new(x.to_vec(), [1, 3]), &device);
        let planes = |values: &[f32], channels: usize| {
            let data = TensorData::new(values.to_vec(), [1, channels, SIDE, SIDE]);
            Tensor::from_data(data, &device)
        };
        ProblemTensors {
            positions: planes(&problem.positions, 3),
            known: planes(&problem.known, 1),
            base: (problem.base.as_deref()).map(|base| planes(base, 3)),
            up: problem.up.map(three),
            target: three(problem.target),
        }
    }

    /// L at positions `at [n, 2]`, in cells: `[n]`.
    fn losses(&self, unet: &Unet<B>, config: &UnetConfig, at: Tensor<B, 2>) -> Tensor<B, 1>
    where
        B: Convolve,
    {
        let [n, _] = at.dims();
        let along_u = bell(at.clone().narrow(1, 0, 1)).reshape([n, 1, SIDE]);
        let along_v = bell(at.narrow(1, 1, 1)).reshape([n, SIDE, 1]);
        let bell = along_v.matmul(along_u).reshape([n, 1, SIDE, SIDE]);
        let known = self.known.clone().repeat_dim(0, n);
        let soft = known.clone() + bell.clone() * (known.neg() + 1.0);
        let input = InputTensors {
            positions: self.positions.clone().repeat_dim(0, n),
            known: soft,
            base: self.base.clone().map(|base| base.repeat_dim(0, n)),
            up: self.up.clone().map(|up| up.repeat_dim(0, n)),
        };
        let answer = unet.predict(config.input, input);
        let weight = bell.reshape([n, 1, CELLS]);
        let total = weight.clone().sum_dim(2);
        let read = (answer.reshape([n, 3, CELLS]) * weight.repeat_dim(1, 3)).sum_dim(2);
        let read = (read / total.repeat_dim(1, 3)).reshape([n, 3]);
        let off = (read - self.target.clone().repeat_dim(0, n)) * SIDE as f32;
        off.clone().mul(off).sum_dim(1).reshape([n])
    }
}

/// exp(−(k − x)² / 2σ²) at the cells k of a line: `[n, 1] -> [n, 64]`.
fn bell<B: Backend>(at: Tensor<B, 2>) -> Tensor<B, 2> {
    let [n, _] = at.dims();
    let cells: Vec<f32> = (0..SIDE).map(|k| k as f32).collect();
    let cells = Tensor::<B, 2>::from_data(TensorData::new(cells, [1, SIDE]), &at.device());
    let off = cells.repeat_dim(0, n) - at.repeat_dim(1, SIDE);
    (off.clone().mul(off) * (-0.5 / (SIGMA * SIGMA))).exp()
}

/// Positions `[n, 2]` in cells, with the centre of cell (i, j) at (i, j), from uvs.
fn positions_in_cells<B: Backend>(uvs: &[[f32; 2]]) -> Tensor<B, 2> {
    let cells = uvs.iter().flatten().map(|x| x * SIDE as f32 - 0.5);
    Tensor::from_data(
        TensorData::new(cells.collect::<Vec<f32>>(), [uvs.len(), 2]),
        &B::Device::default(),
    )
}

fn numbers<B: Backend, const D: usize>(x: Tensor<B, D>) -> Result<Vec<f32>, NetError> {
    let numbers = x.into_data().convert::<f32>().into_vec::<f32>();
    let numbers = numbers.unwrap_or_default();
    if numbers.iter().all(|x| x.is_finite()) {
        Ok(numbers)
    } else {
        Err(NetError::Answer { index: 0 })
    }
}

/// L at uvs.
pub fn losses<B: Convolve>(
    unet: &Unet<B>,
    config: &UnetConfig,
    problem: &AnchorProblem,
    uvs: &[[f32; 2]],
) -> Result<Vec<f32>, NetError> {
    let tensors = ProblemTensors::<B>::of(problem);
    numbers(tensors.losses(unet, config, positions_in_cells(uvs)))
}

/// L at uvs and its gradient. The parameters of the network are frozen, so that their gradients are not computed.
pub fn gradients<B>(
    unet: &Unet<B>,
    config: &UnetConfig,
    problem: &AnchorProblem,
    uvs: &[[f32; 2]],
) -> Result<Vec<AnchorLoss>, NetError>
where
    B: Convolve,
    Unet<B>: HasAutodiffModule<Autodiff<B>, TrainModule = Unet<Autodiff<B>>>,
{
    let unet: Unet<Autodiff<B>> = unet.clone().train().no_grad();
    let tensors = ProblemTensors::<Autodiff<B>>::of(problem);
    let at = positions_in_cells::<Autodiff<B>>(uvs).require_grad();
    let losses = tensors.losses(&unet, config, at.clone());
    let gradients = losses.clone().sum().backward();
    let slopes = match at.grad(&gradients) {
        Some(slopes) => numbers(slopes)?,
        None => vec![0.0; 2 * uvs.len()],
    };
    let losses = numbers(losses.inner())?;
    let pairs = slopes.chunks_exact(2).map(|g| [g[0], g[1]]);
    Ok((losses.into_iter().zip(pairs))
        .map(|(loss, gradient)| AnchorLoss { loss, gradient })
        .collect())
}
