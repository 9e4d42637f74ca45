//! `darn scarffolds`: simulate sheets of cloth to train on.

use super::failure::{Failure, OrFail};
use super::progress::Progress;
use darn::scarffolds::sheets;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// How many sheets
    #[arg(long)]
    count: usize,
    /// The same seed gives the same sheets
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for the sheets; a run that was broken off goes on there
    #[arg(long)]
    out: PathBuf,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let progress = Progress::counted("sheets", args.count as u64);
    let made = sheets::generate(args.count, args.seed, &args.out, &|finished| {
        progress.advance(finished as u64)
    });
    drop(progress);
    let summary = made.or_fail("make sheets")?;
    println!(
        "{} sheets in {}; {} scenes dropped for self-intersection ({:.1} %), {} for stretch; strain {:.4}",
        summary.sheets,
        args.out.display(),
        summary.dropped_crossing,
        100.0 * summary.crossing_share,
        summary.dropped_strain,
        summary.strain
    );
    Ok(())
}
