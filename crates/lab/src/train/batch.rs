//! From samples to batches: symmetries, noise on known cells, revealed anchors, normalisation, the network's frame. Batch `k` depends on the
//! seed and `k` only, so a resumed run gets the same batches as an uninterrupted one.

use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};

use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scarffolds::samples::TrainingSample;
use darn_geometry::grid::{CELLS, NormalGrid, SIDE, neighbour_pairs};
use darn_net::symmetry::origins;
use darn_net::{InputKind, NetworkFrame, UnetConfig, plates};

/// Share of samples with noise on the known cells.
const NOISY: f64 = 0.2;
/// Largest standard deviation of that noise, in cells.
const NOISE_CELLS: f32 = 0.25;
/// Share of samples in which a few hole cells are known, like a user's anchors.
const ANCHORED: f64 = 0.15;
/// Most such cells of a sample.
const ANCHORS: usize = 6;
/// Weight of known cells in the data loss: keeps predictions plausible there.
const KNOWN_WEIGHT: f32 = 0.1;
/// The base of a sample without one.
static NO_BASE: [[f32; 3]; CELLS] = [[0.0; 3]; CELLS];
/// Batches that each thread makes in advance.
const PREFETCHED: usize = 2;

/// A sample in the network's units and frame.
#[derive(Debug, Clone)]
pub struct PreparedSample {
    /// The network's input, with its base.
    pub input: NormalGrid,
    /// Direction of the sample's +z in the network's frame.
    pub up: [f32; 3],
    /// The truth in the same units and frame; zero where not `valid`.
    pub truth: Vec<[f32; 3]>,
    /// Cells with a truth.
    pub valid: Vec<bool>,
    /// Known cells.
    pub known: Vec<bool>,
    /// Hole cells.
    pub hole: Vec<bool>,
}

/// Some samples as planes of numbers, ready to become tensors.
#[derive(Debug, Clone, Default)]
pub struct TrainingBatch {
    /// Number of samples.
    pub count: usize,
    /// `[count, 3, 64, 64]`.
    pub positions: Vec<f32>,
    /// `[count, 1, 64, 64]`.
    pub known: Vec<f32>,
    /// The base that the membrane is added to, zero where there is none; `[count, 3, 64, 64]`.
    pub base: Vec<f32>,
    /// Direction of each sample's +z, `[count, 3]`.
    pub up: Vec<f32>,
    /// `[count, 3, 64, 64]`.
    pub truth: Vec<f32>,
    /// Weight of each cell in the data loss, `[count, 1, 64, 64]`.
    pub weight: Vec<f32>,
    /// Hole cells with a truth, `[count, 1, 64, 64]`.
    pub hole: Vec<f32>,
    /// Pairs along u with a truth that touch the hole, `[count, 1, 64, 63]`.
    pub pairs_u: Vec<f32>,
    /// Pairs along v with a truth that touch the hole, `[count, 1, 63, 64]`.
    pub pairs_v: Vec<f32>,
}

/// Brings a sample to the network's units and frame; `None` when too few cells are known.
pub fn prepare(sample: &TrainingSample, network: &UnetConfig) -> Option<PreparedSample> {
    let still = vec![[0.0; 3]; CELLS];
    let prepared = prepare_noisy(sample, &still, network)?;
    with_bases(vec![prepared], &sample.known, network).pop()
}

/// Random variants of samples with the same known cells: one of the grid's 8 symmetries for all; each sample may be mirrored, get noise or
/// get anchors. Samples with too few known cells are left out.
pub(super) fn augment(
    samples: &[TrainingSample],
    network: &UnetConfig,
    rng: &mut ChaCha8Rng,
) -> Vec<PreparedSample> {
    let symmetry = rng.random_range(0..8);
    let samples: Vec<TrainingSample> = samples.iter().map(|s| symmetric(s, symmetry)).collect();
    let scanned = samples.first().map(|s| s.known.clone());
    let prepared = samples.into_iter().filter_map(|s| vary(s, network, rng));
    with_bases(prepared.collect(), &scanned.unwrap_or_default(), network)
}

/// A random variant of one sample.
fn vary(
    mut sample: TrainingSample,
    network: &UnetConfig,
    rng: &mut ChaCha8Rng,
) -> Option<PreparedSample> {
    if network.frame.turns() && rng.random() {
        sample.truth.iter_mut().for_each(|p| p[0] = -p[0]);
    }
    if rng.random_bool(ANCHORED) {
        let holes: Vec<usize> = (0..CELLS).filter(|k| sample.hole[*k]).collect();
        for _ in 0..rng.random_range(1..=ANCHORS) {
            if !holes.is_empty() {
                let cell = holes[rng.random_range(0..holes.len())];
                (sample.known[cell], sample.hole[cell]) = (true, false);
            }
        }
    }
    let sigma = if rng.random_bool(NOISY) {
        rng.random_range(0.0..NOISE_CELLS)
    } else {
        0.0
    };
    let noise: Vec<[f32; 3]> = (0..CELLS)
        .map(|_| [(); 3].map(|()| gaussian(rng) * sigma))
        .collect();
    prepare_noisy(&sample, &noise, network)
}

/// Gives samples the base that the network needs; the `scanned` cells are known in all of them, anchors not included.
fn with_bases(
    mut samples: Vec<PreparedSample>,
    scanned: &[bool],
    network: &UnetConfig,
) -> Vec<PreparedSample> {
    if network.input != InputKind::Plate {
        return samples;
    }
    let grids: Vec<&[[f32; 3]]> = (samples.iter())
        .map(|s| s.input.positions.as_slice())
        .collect();
    let Some(bases) = plates(&grids, scanned, 1) else {
        return Vec::new();
    };
    for (sample, base) in samples.iter_mut().zip(bases) {
        sample.input.base = Some(base);
    }
    samples
}

/// A prepared sample without its base; `noise` of each cell is in cells.
fn prepare_noisy(
    sample: &TrainingSample,
    noise: &[[f32; 3]],
    network: &UnetConfig,
) -> Option<PreparedSample> {
    let point = |k: usize| Vector3::from(sample.truth[k]);
    let known = |k: &usize| sample.known[*k];
    let count = (0..CELLS).filter(known).count();
    if count < 16 || count == CELLS {
        return None;
    }
    let lengths: Vec<f32> = neighbour_pairs()
        .filter(|(a, b)| sample.known[*a] && sample.known[*b])
        .map(|(a, b)| (point(a) - point(b)).norm())
        .collect();
    let spacing = lengths.iter().sum::<f32>() / lengths.len().max(1) as f32;
    if !spacing.is_finite() || spacing <= 0.0 {
        return None;
    }
    let scale = 1.0 / (spacing * SIDE as f32);
    let centre = (0..CELLS).filter(known).map(point).sum::<Vector3<f32>>() / count as f32;
    let normal = |k: usize| -> Vector3<f32> { (point(k) - centre) * scale };
    let positions = (0..CELLS)
        .map(|k| {
            if sample.known[k] {
                (normal(k) + Vector3::from(noise[k]) / SIDE as f32).into()
            } else {
                [0.0; 3]
            }
        })
        .collect();
    let mut input = NormalGrid {
        positions,
        known: sample
            .known
            .iter()
            .map(|k| f32::from(u8::from(*k)))
            .collect(),
        base: None,
    };
    let frame = NetworkFrame::of(network.frame, &input);
    input
        .positions
        .iter_mut()
        .for_each(|p| *p = frame.enter(*p));
    let truth = (0..CELLS)
        .map(|k| {
            if sample.valid[k] {
                frame.enter(normal(k).into())
            } else {
                [0.0; 3]
            }
        })
        .collect();
    Some(PreparedSample {
        input,
        up: frame.up(),
        truth,
        valid: sample.valid.clone(),
        known: sample.known.clone(),
        hole: sample.hole.clone(),
    })
}

/// The sample under one of the grid's symmetries.
fn symmetric(sample: &TrainingSample, symmetry: usize) -> TrainingSample {
    let from = origins(symmetry);
    TrainingSample {
        truth: from.iter().map(|k| sample.truth[*k]).collect(),
        valid: from.iter().map(|k| sample.valid[*k]).collect(),
        known: from.iter().map(|k| sample.known[*k]).collect(),
        hole: from.iter().map(|k| sample.hole[*k]).collect(),
    }
}

/// A standard normal number (Box–Muller).
fn gaussian(rng: &mut ChaCha8Rng) -> f32 {
    let radius = (-2.0 * (1.0 - rng.random::<f32>()).ln()).sqrt();
    radius * (std::f32::consts::TAU * rng.random::<f32>()).cos()
}

impl TrainingBatch {
    /// The batch of some samples.
    pub fn of(samples: &[PreparedSample]) -> TrainingBatch {
        let mut batch = TrainingBatch {
            count: samples.len(),
            ..TrainingBatch::default()
        };
        let flag = |b: bool| f32::from(u8::from(b));
        for sample in samples {
            let hole = |k: usize| sample.hole[k];
            let pair = |a: usize, b: usize| {
                flag(sample.valid[a] && sample.valid[b] && (hole(a) || hole(b)))
            };
            for axis in 0..3 {
                batch
                    .positions
                    .extend(sample.input.positions.iter().map(|p| p[axis]));
                batch.truth.extend(sample.truth.iter().map(|p| p[axis]));
            }
            batch.known.extend(&sample.input.known);
            batch.up.extend(sample.up);
            for axis in 0..3 {
                let base = sample.input.base.as_deref().unwrap_or(&NO_BASE);
                batch.base.extend(base.iter().map(|p| p[axis]));
            }
            batch.hole.extend((0..CELLS).map(|k| flag(hole(k))));
            batch.weight.extend((0..CELLS).map(|k| {
                if hole(k) {
                    1.0
                } else {
                    KNOWN_WEIGHT * flag(sample.known[k])
                }
            }));
            batch.pairs_u.extend(
                (0..CELLS)
                    .filter(|k| k % SIDE + 1 < SIDE)
                    .map(|k| pair(k, k + 1)),
            );
            batch
                .pairs_v
                .extend((0..CELLS - SIDE).map(|k| pair(k, k + SIDE)));
        }
        batch
    }
}

impl TrainingBatch {
    /// A range of the samples.
    pub fn part(&self, samples: Range<usize>) -> TrainingBatch {
        let part = |values: &[f32]| {
            let one = values.len() / self.count.max(1);
            values[samples.start * one..samples.end * one].to_vec()
        };
        TrainingBatch {
            count: samples.len(),
            positions: part(&self.positions),
            known: part(&self.known),
            base: part(&self.base),
            up: part(&self.up),
            truth: part(&self.truth),
            weight: part(&self.weight),
            hole: part(&self.hole),
            pairs_u: part(&self.pairs_u),
            pairs_v: part(&self.pairs_v),
        }
    }
}

/// Draws samples with the same known cells, at least one.
pub type SampleSource = Arc<dyn Fn(&mut ChaCha8Rng) -> Vec<TrainingSample> + Send + Sync>;

/// Makes batches from samples.
#[derive(Clone)]
pub struct BatchGenerator {
    /// Draws the samples.
    pub source: SampleSource,
    /// The network to train.
    pub network: UnetConfig,
    /// Samples in a batch.
    pub size: usize,
    /// Seed of all batches.
    pub seed: u64,
}

impl BatchGenerator {
    /// Batch `index`; depends on the seed and `index` only.
    pub fn batch(&self, index: u64) -> TrainingBatch {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(index + 1);
        TrainingBatch::of(&self.samples(&mut rng))
    }

    /// The samples of one batch.
    pub fn samples(&self, rng: &mut ChaCha8Rng) -> Vec<PreparedSample> {
        let mut samples = Vec::with_capacity(self.size);
        while samples.len() < self.size {
            samples.extend(augment(&(self.source)(rng), &self.network, rng));
        }
        samples.truncate(self.size);
        samples
    }
}

/// Batches in order, made in advance by threads.
pub(super) struct BatchPrefetcher {
    threads: Vec<Receiver<TrainingBatch>>,
    next: u64,
}

impl BatchPrefetcher {
    /// Starts `threads` threads that make the batches from number `first` on; they end when this is dropped.
    pub fn start(generator: &BatchGenerator, first: u64, threads: usize) -> BatchPrefetcher {
        let threads = threads.max(1) as u64;
        let receivers = (0..threads).map(|thread| {
            let (sender, receiver) = sync_channel(PREFETCHED);
            let generator = generator.clone();
            // Thread t makes the batches with index ≡ t: the order does not depend on the speed of the threads.
            let start = first + (thread + threads - first % threads) % threads;
            std::thread::spawn(move || {
                let mut index = start;
                while sender.send(generator.batch(index)).is_ok() {
                    index += threads;
                }
            });
            receiver
        });
        BatchPrefetcher {
            threads: receivers.collect(),
            next: first,
        }
    }

    /// The next batch; `None` when its thread has ended.
    pub fn next_batch(&mut self) -> Option<TrainingBatch> {
        let thread = (self.next % self.threads.len() as u64) as usize;
        self.next += 1;
        self.threads.get(thread)?.recv().ok()
    }
}
