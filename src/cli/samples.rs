//! `darn samples`: training samples for a trainer outside this program, as records on standard output.

use super::failure::{Failure, OrFail};
use darn_lab::scarffolds::samples::SampleRotation;
use darn_lab::train::batch::{BatchGenerator, PreparedSample, prepare};
use darn_lab::train::{self, sample_records};
use darn_net::{FrameKind, UnetConfig};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::PathBuf;

/// Samples written at once.
const TOGETHER: usize = 64;

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
    let rotation = match args.upright {
        true => SampleRotation::Upright,
        false => SampleRotation::Any,
    };
    let sampler = train::sampler(&args.sheets, rotation).or_fail("read the sheets")?;
    let network = UnetConfig {
        frame: match args.upright {
            true => FrameKind::Hanging,
            false => FrameKind::Canonical,
        },
        ..UnetConfig::default()
    };
    let mut records = Vec::new();
    // Returns whether the reader still reads.
    let mut send = |samples: &[PreparedSample]| {
        records.clear();
        sample_records::write(samples, &mut records);
        match out.write_all(&records) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
            written => written.or_fail("write samples").map(|()| true),
        }
    };
    if args.held_out {
        let samples = train::held_out(&sampler);
        let samples = samples.iter().filter_map(|s| prepare(s, &network));
        return send(&samples.collect::<Vec<_>>()).map(|_| ());
    }
    let generator = BatchGenerator {
        source: train::source(sampler.roughest_of(args.roughest_of), args.alike),
        network,
        size: TOGETHER,
        seed: args.seed,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(args.seed);
    let mut left = args.count.unwrap_or(usize::MAX);
    while left > 0 {
        let mut samples = generator.samples(&mut rng);
        samples.truncate(left);
        left -= samples.len();
        if !send(&samples)? {
            break;
        }
    }
    Ok(())
}
