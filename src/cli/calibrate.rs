//! `darn calibrate`: measures how far a network's answers are off on held-out sheets, and writes that into its weights file.

use super::evaluate::filled;
use super::failure::{Failure, OrFail};
use super::files;
use super::progress::WorkProgress;
use darn_geometry::grid::NormalGrid;
use darn_lab::evaluate::{self, CalibrationSets};
use darn_lab::scarffolds::samples::{SampleRotation, Sampler};
use darn_lab::scarffolds::sheets;
use darn_net::engine::EngineOptions;
use darn_net::{Averaging, Network, weights};
use std::path::PathBuf;

/// Noise on the known cells of the noisy sets, cells.
const NOISE: f64 = 0.2;

#[derive(Debug, clap::Args)]
pub struct CalibrateArgs {
    /// The weights file to measure
    #[arg(long)]
    weights: PathBuf,
    /// Folders of sheets that it has not learned from, as `darn scarffolds` makes them; each counts the same
    #[arg(long, required = true)]
    sheets: Vec<PathBuf>,
    /// How many samples of each folder
    #[arg(long, default_value_t = 400)]
    samples: usize,
    /// Seed of the samples
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Keep the sheets upright instead of turning each sample anyhow: for weights that know which way is up
    #[arg(long)]
    upright: bool,
    /// Where the weights go, with what was measured on their card
    #[arg(long)]
    out: PathBuf,
}

pub fn run(args: &CalibrateArgs) -> Result<(), Failure> {
    let name = args.weights.display();
    let bytes = files::read(&args.weights)?;
    let (mut card, tensors) = weights::read(&bytes).or_fail(format!("read {name}"))?;
    let options = EngineOptions {
        isa: None,
        threads: rayon::current_num_threads(),
    };
    let network = Network::load(&bytes, options).or_fail(format!("load {name}"))?;
    let fill = |grids: &[NormalGrid]| filled(&network, grids, Averaging::Flips);
    let rotation = match args.upright {
        true => SampleRotation::Upright,
        false => SampleRotation::Any,
    };
    let progress = WorkProgress::counted("sets", 2 * args.sheets.len() as u64);
    let mut sets = CalibrationSets::default();
    for folder in &args.sheets {
        let name = folder.display();
        let sheets = sheets::read(folder).or_fail(format!("read sheets in {name}"))?;
        if sheets.is_empty() || args.samples == 0 {
            return Err(Failure::Usage(format!(
                "there is nothing to measure in {name}"
            )));
        }
        let sampler = Sampler::new(&sheets, rotation);
        let cases = evaluate::draw(&sampler, args.samples, args.seed);
        for (noise, sets) in [(0.0, &mut sets.clean), (NOISE, &mut sets.noisy)] {
            let cells = evaluate::cell_errors(&cases, noise, args.seed, &fill);
            sets.push(cells.or_fail("calibrate")?);
            progress.advance(1);
        }
    }
    drop(progress);
    let errors = evaluate::calibrated(&sets).or_fail("calibrate")?;
    for (noise, sets) in [(0.0, &sets.clean), (NOISE, &sets.noisy)] {
        for (folder, cells) in args.sheets.iter().zip(sets) {
            println!("\n{}, noise {noise}\n", folder.display());
            print!("{}", evaluate::coverage_table(cells, &errors));
        }
    }
    card.errors = Some(errors);
    let bytes = weights::write(&tensors, &card).or_fail(format!("write {name}"))?;
    files::write(&args.out, &bytes)
}
