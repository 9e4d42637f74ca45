//! `darn samples`: training samples for a trainer outside this program, as records on standard output.

use super::failure::{Failure, OrFail};
use darn_lab::scarffolds::samples::SampleRotation;
use darn_lab::train::{SampleStream, StreamedSamples};
use std::io::IsTerminal;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct SamplesArgs {
    /// Folder of sheets to learn from, as `darn scarffolds` makes it
    #[arg(long)]
    sheets: PathBuf,
    /// How many samples; left out, as many as are read
    #[arg(long)]
    count: Option<usize>,
    /// The same seed gives the same samples
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Sheets drawn for a sample, of which the roughest is taken: most sheets are gentle
    #[arg(long, value_name = "N", default_value_t = 1)]
    roughest_of: usize,
    /// Samples that share a hole: the plate under it, most of the work of making them, is factored once
    #[arg(long, value_name = "N", default_value_t = 1)]
    alike: usize,
    /// Keep up up instead of turning every sample anyhow
    #[arg(long)]
    upright: bool,
    /// Write the samples that `darn train` measures its scores on, and no others
    #[arg(long, conflicts_with_all = ["count", "seed", "roughest_of", "alike"])]
    held_out: bool,
}

pub fn run(args: &SamplesArgs) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    if out.is_terminal() {
        return Err(Failure::Usage(
            "records are bytes: send standard output to a file or a program".into(),
        ));
    }
    let stream = SampleStream {
        sheets: args.sheets.clone(),
        rotation: match args.upright {
            true => SampleRotation::Upright,
            false => SampleRotation::Any,
        },
        samples: match args.held_out {
            true => StreamedSamples::HeldOut,
            false => StreamedSamples::Random {
                count: args.count.unwrap_or(usize::MAX),
                seed: args.seed,
                roughest_of: args.roughest_of,
                alike: args.alike,
            },
        },
    };
    stream.write(&mut out).or_fail("make samples")
}
