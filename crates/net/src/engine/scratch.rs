//! Reusable buffers for predictions and gradients, and the way of a call through them: grids are shared among threads.

use rayon::prelude::*;

use super::backward::{ActivationGradients, AdjointPass};
use super::forward::{Activations, GRIDS_TOGETHER, PassSize, SavedActivations};
use super::input_fill::{FillBuffers, read_channels};
use super::io::{Cotangent, EngineInput, InputGradient, image3, image3_mut};
use super::last_layer::{LastLayerAdjoint, last_layer};
use super::membrane::MembraneGradient;
use super::model::EngineModel;
use darn_geometry::grid::CELLS;

/// Reusable buffers for the calls of one thread to one engine. They grow with the number of grids and never shrink.
#[derive(Debug, Default)]
pub struct Scratch {
    /// One per thread that shares a call.
    threads: Vec<PassBuffers>,
}

/// Buffers for the forward and adjoint passes of one thread.
#[derive(Debug, Default)]
struct PassBuffers {
    forward: Option<Activations>,
    adjoint: Option<AdjointBuffers>,
    fill: FillBuffers,
    /// The gradient with respect to one grid's filled positions.
    by_filled: Vec<f32>,
    /// The gradients with respect to the predictions.
    cotangents: Vec<f32>,
}

/// Buffers that only an adjoint pass needs.
#[derive(Debug)]
struct AdjointBuffers {
    saved: SavedActivations,
    gradients: ActivationGradients,
}

/// How the grids of a call are shared among threads.
#[derive(Clone, Copy)]
struct Sharing {
    /// Grids of one thread's buffers.
    grids: usize,
    /// Threads that a single grid is split among.
    threads: usize,
}

impl Scratch {
    /// [`super::Engine::predict`] with checked lengths on so many threads.
    pub(super) fn predict(
        &mut self,
        model: &EngineModel,
        threads: usize,
        input: EngineInput,
        out: &mut [f32],
    ) {
        let images = input.images();
        let sharing = self.share(threads, images);
        let work = |buffers: &mut PassBuffers, first: usize, out: &mut [f32]| {
            let numbered = (first..).step_by(GRIDS_TOGETHER);
            for (first, out) in numbered.zip(out.chunks_mut(GRIDS_TOGETHER * 3 * CELLS)) {
                let images = first..first + out.len() / (3 * CELLS);
                buffers.predict(model, sharing.threads, input.part(images), out);
            }
        };
        if sharing.grids >= images {
            if let Some(buffers) = self.threads.first_mut() {
                on_pool(sharing.threads, || work(buffers, 0, out));
            }
            return;
        }
        let buffers = self.threads.par_iter_mut().enumerate();
        buffers
            .zip(out.par_chunks_mut(sharing.grids * 3 * CELLS))
            .for_each(|((place, buffers), out)| work(buffers, place * sharing.grids, out));
    }

    /// [`super::Engine::gradient`] with checked lengths on so many threads.
    pub(super) fn gradient(
        &mut self,
        model: &EngineModel,
        threads: usize,
        call: GradientCall,
        out: InputGradient,
    ) {
        let images = call.input.images();
        let sharing = self.share(threads, images);
        let work = |buffers: &mut PassBuffers, first: usize, out: InputGradient| {
            let numbered = (first..).step_by(GRIDS_TOGETHER);
            for (first, out) in numbered.zip(out.chunks(GRIDS_TOGETHER)) {
                let call = call.part(first, out.images());
                buffers.gradient(model, sharing.threads, call, out);
            }
        };
        if sharing.grids >= images {
            if let Some(buffers) = self.threads.first_mut() {
                on_pool(sharing.threads, || work(buffers, 0, out));
            }
            return;
        }
        let buffers = self.threads.par_iter_mut().enumerate();
        buffers
            .zip(out.par_chunks(sharing.grids))
            .for_each(|((place, buffers), out)| work(buffers, place * sharing.grids, out));
    }

    /// Shares grids among threads, and makes buffers for all of them.
    fn share(&mut self, threads: usize, images: usize) -> Sharing {
        let grids = images.div_ceil(threads).max(1);
        let used = images.div_ceil(grids).max(1);
        if self.threads.len() < used {
            self.threads.resize_with(used, PassBuffers::default);
        }
        Sharing {
            grids,
            threads: (threads / used).max(1),
        }
    }
}

/// What a gradient is computed of.
#[derive(Clone, Copy)]
pub(super) struct GradientCall<'a> {
    pub input: EngineInput<'a>,
    pub cotangent: &'a Cotangent<'a>,
    /// The place of the first grid among all that the caller gave.
    pub first: usize,
}

impl<'a> GradientCall<'a> {
    /// So many grids from `first` on.
    fn part(&self, first: usize, images: usize) -> GradientCall<'a> {
        GradientCall {
            input: self.input.part(first..first + images),
            first: self.first + first,
            ..*self
        }
    }
}

/// Runs on a thread of the pool if the work will be split there: from outside the pool every split would wake a thread.
fn on_pool(threads: usize, work: impl FnOnce() + Send) {
    match threads {
        0 | 1 => work(),
        _ => rayon::scope(|_| work()),
    }
}

impl PassBuffers {
    /// Predicts at most [`GRIDS_TOGETHER`] grids.
    fn predict(
        &mut self,
        model: &EngineModel,
        threads: usize,
        input: EngineInput,
        out: &mut [f32],
    ) {
        let images = input.images();
        let size = PassSize { images, threads };
        let forward = activations(&mut self.forward, model, size);
        self.fill.fill_map(model, input, out, &mut forward.input);
        let features = forward.run(model.target, images, model.forward(), None);
        last_layer(model, threads, features, out);
    }

    /// Predicts and differentiates at most [`GRIDS_TOGETHER`] grids.
    fn gradient(
        &mut self,
        model: &EngineModel,
        threads: usize,
        call: GradientCall,
        out: InputGradient,
    ) {
        let GradientCall {
            input,
            cotangent,
            first,
        } = call;
        let images = input.images();
        let size = PassSize { images, threads };
        let forward = activations(&mut self.forward, model, size);
        let AdjointBuffers { saved, gradients } = adjoint_buffers(&mut self.adjoint, model, size);
        self.by_filled.resize(3 * CELLS, 0.0);
        self.cotangents.resize(images * 3 * CELLS, 0.0);
        let fill = &mut self.fill;
        fill.fill_map(model, input, out.prediction, &mut forward.input);
        let features = forward.run(model.target, images, model.forward(), Some(saved));
        last_layer(model, threads, features, out.prediction);
        for image in 0..images {
            let by_prediction = image3_mut(&mut self.cotangents, image);
            cotangent(first + image, image3(out.prediction, image), by_prediction);
            model.target.run(LastLayerAdjoint {
                model,
                features,
                image,
                cotangent: by_prediction,
                result: &mut gradients.result[0],
            });
        }
        let pass = AdjointPass {
            model,
            images,
            activations: forward,
            saved,
        };
        gradients.run(&pass, None);
        for image in 0..images {
            let by = MembraneGradient {
                by_positions: image3_mut(out.by_positions, image),
                by_known: &mut out.by_known[image * CELLS..][..CELLS],
            };
            by.by_positions.fill(0.0);
            read_channels(&gradients.input, image, &mut self.by_filled, by.by_known);
            if model.input.answers_offsets() {
                let direct = image3(&self.cotangents, image);
                let both = self.by_filled.iter_mut().zip(direct);
                both.for_each(|(by, direct)| *by += direct);
            }
            let grid = input.part(image..image + 1);
            fill.fill_adjoint(model, grid, &self.by_filled, by);
        }
    }
}

/// Buffers for a forward pass of a size.
fn activations<'a>(
    place: &'a mut Option<Activations>,
    model: &EngineModel,
    size: PassSize,
) -> &'a mut Activations {
    let old = place.as_ref().map(Activations::size);
    let forward = grown(place, old, size, |size| Activations::new(size, model));
    forward.threads = size.threads;
    forward
}

/// Buffers for an adjoint pass of a size.
fn adjoint_buffers<'a>(
    place: &'a mut Option<AdjointBuffers>,
    model: &EngineModel,
    size: PassSize,
) -> &'a mut AdjointBuffers {
    let old = place.as_ref().map(|buffers| buffers.gradients.size());
    let buffers = grown(place, old, size, |size| AdjointBuffers {
        saved: SavedActivations::new(size.images, model),
        gradients: ActivationGradients::new(size, model),
    });
    buffers.gradients.threads = size.threads;
    buffers
}

/// The buffers in `place`, whose size is `old`; made anew if they are too small for `size`.
fn grown<T>(
    place: &mut Option<T>,
    old: Option<PassSize>,
    size: PassSize,
    make: impl FnOnce(PassSize) -> T,
) -> &mut T {
    let old = old.unwrap_or_default();
    if old.images < size.images || old.threads < size.threads {
        *place = None;
    }
    place.get_or_insert_with(|| {
        make(PassSize {
            images: old.images.max(size.images),
            threads: old.threads.max(size.threads),
        })
    })
}
