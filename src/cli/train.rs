//! `darn train`: train a network on simulated sheets.

use super::failure::{Failure, OrFail};
use darn_lab::train::{
    LossTerms, LossWeights, OptimiserKind, RunStart, Score, TrainOptions, TrainProgress,
    TrainerKind,
};
use darn_net::{FrameKind, InputKind, UnetConfig};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::path::PathBuf;

/// Steps of the progress bar.
const BAR: u64 = 1000;
/// Log lines of a whole run, in addition to those with scores.
const LINES: f64 = 50.0;

#[derive(Debug, clap::Args)]
pub struct TrainArgs {
    /// Folder of sheets to learn from, as `darn scarffolds` makes it
    #[arg(long)]
    sheets: PathBuf,
    /// Folder of sheets to be measured on; made with another seed
    #[arg(long)]
    held_out: PathBuf,
    /// Folder for checkpoints, curves and weights
    #[arg(long)]
    out: PathBuf,
    /// How long, in minutes; the learning rate falls to zero at the end
    #[arg(long)]
    minutes: f64,
    /// Name on the model card
    #[arg(long, default_value = "standard")]
    name: String,
    /// Channels at the first scale
    #[arg(long, default_value_t = UnetConfig::default().width)]
    width: usize,
    /// Samples a step
    #[arg(long, default_value_t = TrainOptions::default().batch)]
    batch: usize,
    /// Sheets drawn for a sample to learn from, of which the roughest is taken: most sheets are gentle
    #[arg(long, value_name = "N", default_value_t = TrainOptions::default().roughest_of)]
    roughest_of: usize,
    /// Samples to learn from that share a hole: the plate under it, most of the work of making them, is factored once
    #[arg(long, value_name = "N", default_value_t = TrainOptions::default().alike)]
    alike: usize,
    /// Highest learning rate
    #[arg(long, default_value_t = TrainOptions::default().rate)]
    rate: f64,
    /// Minutes between checkpoints, scores and exported weights
    #[arg(long, default_value_t = TrainOptions::default().every)]
    every: f64,
    /// What the network sees in unknown cells
    #[arg(long, value_enum, default_value = "plate")]
    input: Input,
    /// Keep up up instead of turning every sample anyhow: for scans that say where up is
    #[arg(long)]
    upright: bool,
    /// The frame the network sees the cloth in; left out, canonical, or hanging with --upright
    #[arg(long, value_enum)]
    frame: Option<Frame>,
    /// Leave the attention gates open for good: what they are worth
    #[arg(long)]
    open_gates: bool,
    /// What counts as an error
    #[arg(long, value_enum, default_value = "standard")]
    loss: Loss,
    /// Weight of the differences between neighbours, instead of the loss's own
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    alpha: Option<f64>,
    /// Weight of the repulsion of cloth from cloth, instead of the loss's own
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    beta: Option<f64>,
    /// Weight of the lengths between neighbours, instead of the loss's own
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    gamma: Option<f64>,
    /// What computes the steps: burn, or the engine, which is several times as fast but needs weights to start from
    #[arg(long, value_enum, default_value = "burn")]
    trainer: Steps,
    /// What turns gradients into steps; muon needs the engine
    #[arg(long, value_enum, default_value = "adamw")]
    optimiser: Optimiser,
    /// Learn the mean of the answers of these weights to a grid's eight symmetries instead of the truth; needs the engine
    #[arg(long, value_name = "WEIGHTS")]
    teacher: Option<PathBuf>,
    /// Seed of weights and samples
    #[arg(long, default_value_t = TrainOptions::default().seed)]
    seed: u64,
    /// Threads that make samples
    #[arg(long, default_value_t = TrainOptions::default().sample_threads)]
    sample_threads: usize,
    /// Go on from the checkpoint in the output folder
    #[arg(long)]
    resume: bool,
    /// Start from the weights in this file instead of random ones
    #[arg(long, conflicts_with = "resume")]
    from: Option<PathBuf>,
}

/// The input of unknown cells.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Input {
    /// Nothing: zeros (the paper)
    Zeros,
    /// A membrane over the known cells
    Membrane,
    /// A thin plate over the known cells
    Plate,
}

impl Input {
    fn kind(self) -> InputKind {
        match self {
            Self::Zeros => InputKind::Zeros,
            Self::Membrane => InputKind::Membrane,
            Self::Plate => InputKind::Plate,
        }
    }
}

/// The frames that a network can see cloth in.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Frame {
    /// As the cloth lies (the paper)
    Given,
    /// Turned onto its chart
    Canonical,
}

impl Frame {
    fn kind(self) -> FrameKind {
        match self {
            Self::Given => FrameKind::Given,
            Self::Canonical => FrameKind::Canonical,
        }
    }
}

/// What can compute the steps.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Steps {
    /// burn, from random weights or given ones
    Burn,
    /// darn's own kernels
    Engine,
    /// burn on an NVIDIA GPU, from random weights or given ones
    #[cfg(feature = "cuda")]
    Cuda,
}

impl Steps {
    fn kind(self) -> TrainerKind {
        match self {
            Self::Burn => TrainerKind::Burn,
            Self::Engine => TrainerKind::Engine,
            #[cfg(feature = "cuda")]
            Self::Cuda => TrainerKind::Cuda,
        }
    }
}

/// What can turn gradients into steps.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Optimiser {
    /// AdamW on all tensors
    Adamw,
    /// Muon on kernels between the first and the last layer, AdamW on the rest
    Muon,
}

impl Optimiser {
    fn kind(self) -> OptimiserKind {
        match self {
            Self::Adamw => OptimiserKind::Adamw,
            Self::Muon => OptimiserKind::Muon,
        }
    }
}

/// The losses there are weights for.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Loss {
    /// Softened positions and differences, lengths
    Standard,
    /// The same, and cloth repels cloth
    Interpen,
    /// As in the paper: squared positions and differences, a small repulsion
    Paper,
}

impl Loss {
    fn weights(self) -> LossWeights {
        match self {
            Self::Standard => LossWeights::default(),
            Self::Interpen => LossWeights::interpen(),
            Self::Paper => LossWeights::paper(),
        }
    }
}

pub fn run(args: &TrainArgs) -> Result<(), Failure> {
    let mut output = ProgressOutput::new();
    let summary = darn_lab::train::run(&args.options(), &mut |progress| output.step(progress))
        .or_fail("train")?;
    drop(output);
    println!(
        "{} steps in {:.1} minutes; weights in {}",
        summary.steps,
        summary.minutes,
        summary.weights.display()
    );
    println!("network     {}", line(&summary.score));
    println!("input fill  {}", line(&summary.fill));
    Ok(())
}

impl TrainArgs {
    fn weights(&self) -> LossWeights {
        let named = self.loss.weights();
        LossWeights {
            gradient: self.alpha.unwrap_or(named.gradient),
            self_penetration: self.beta.unwrap_or(named.self_penetration),
            stretch: self.gamma.unwrap_or(named.stretch),
            ..named
        }
    }

    fn options(&self) -> TrainOptions {
        TrainOptions {
            name: self.name.clone(),
            sheets: self.sheets.clone(),
            held_out: self.held_out.clone(),
            out: self.out.clone(),
            resume: if self.resume {
                RunStart::Resume
            } else {
                RunStart::Fresh
            },
            from: self.from.clone(),
            trainer: self.trainer.kind(),
            optimiser: self.optimiser.kind(),
            teacher: self.teacher.clone(),
            network: UnetConfig {
                width: self.width,
                input: self.input.kind(),
                frame: match (self.frame, self.upright) {
                    (Some(frame), _) => frame.kind(),
                    (None, true) => FrameKind::Hanging,
                    (None, false) => FrameKind::Canonical,
                },
            },
            upright: self.upright,
            open_gates: self.open_gates,
            loss: self.weights(),
            batch: self.batch,
            roughest_of: self.roughest_of,
            alike: self.alike,
            rate: self.rate,
            minutes: self.minutes,
            every: self.every,
            seed: self.seed,
            sample_threads: self.sample_threads,
        }
    }
}

/// A bar on a terminal, log lines elsewhere; scores always get a line.
struct ProgressOutput {
    bar: Option<ProgressBar>,
    /// Log lines so far.
    lines: f64,
}

impl ProgressOutput {
    fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(BAR).with_prefix("train");
            if let Ok(style) =
                ProgressStyle::with_template("{prefix} [{bar:40}] {percent} % {msg} {eta}")
            {
                bar.set_style(style.progress_chars("=> "));
            }
            bar
        });
        Self { bar, lines: 0.0 }
    }

    fn step(&mut self, now: &TrainProgress) {
        let LossTerms {
            total,
            data,
            gradient,
            stretch,
            self_penetration,
        } = now.loss;
        if let Some(bar) = &self.bar {
            bar.set_position((now.share * BAR as f64) as u64);
            bar.set_message(format!("step {} loss {total:.4}", now.step));
        } else if now.share * LINES >= self.lines {
            self.lines = (now.share * LINES).floor() + 1.0;
            tracing::info!(
                step = now.step,
                minutes = now.minutes,
                total,
                data,
                gradient,
                stretch,
                self_penetration,
                norm = now.norm,
                "training"
            );
        }
        if let Some(scores) = &now.scores {
            let text = format!(
                "step {}: network {}; input fill {}",
                now.step,
                line(&scores.network),
                line(&scores.fill)
            );
            match &self.bar {
                Some(bar) => bar.println(text),
                None => tracing::info!("{text}"),
            }
        }
    }
}

impl Drop for ProgressOutput {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn weight(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(weight) if (0.0..=1e6).contains(&weight) => Ok(weight),
        _ => Err(format!("{text:?} is not a weight from 0 to 1000000")),
    }
}

fn line(score: &Score) -> String {
    format!(
        "rmse {:.2} cells (median {:.2}), normals {:.1} degrees, spacing {:.3}, area {:.3}",
        score.rmse, score.rmse_median, score.normal, score.spacing, score.area
    )
}
