//! `darn garments`: a set of draped garments with holes whose truth is known.

use super::failure::{Failure, OrFail};
use super::progress::WorkProgress;
use darn_lab::garments::set::{self, GarmentCase};
use darn_lab::garments::{GarmentError, GarmentKind};
use rayon::prelude::*;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct GarmentsArgs {
    /// The same seed gives the same garments
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How many garments of each of the seven kinds
    #[arg(long, value_name = "N", default_value_t = 2)]
    each: u64,
    /// Folder for the files and their manifest
    #[arg(long)]
    out: PathBuf,
}

pub fn run(args: &GarmentsArgs) -> Result<(), Failure> {
    let cases = made(args.seed, args.each)?;
    set::write(&args.out, args.seed, &cases).or_fail("write the garments")?;
    let holes: usize = cases.iter().map(|c| c.holes.len()).sum();
    let name = args.out.display();
    println!("{} garments and {holes} holes in {name}", cases.len());
    Ok(())
}

/// Makes a set, on all processors.
pub fn made(seed: u64, each: u64) -> Result<Vec<GarmentCase>, Failure> {
    let all: Vec<(GarmentKind, u64)> = (GarmentKind::ALL.into_iter())
        .flat_map(|kind| (0..each).map(move |number| (kind, number)))
        .collect();
    let progress = WorkProgress::counted("garments", all.len() as u64);
    let one = |&(kind, number): &(GarmentKind, u64)| {
        let case = set::case(seed, kind, number)?;
        progress.advance(1);
        Ok(case)
    };
    let cases: Result<Vec<_>, GarmentError> = all.par_iter().map(one).collect();
    cases.or_fail("make garments")
}
