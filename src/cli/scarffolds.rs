//! `darn scarffolds`: simulate sheets of cloth to train on, and show them.

use super::failure::{Failure, OrFail};
use super::files;
use super::progress::WorkProgress;
use darn_lab::scarffolds::export::{as_glb, contact_sheet};
use darn_lab::scarffolds::sheets::{self, SimulatedSheet};
use image::ImageFormat;
use rand::SeedableRng;
use rand::seq::index::sample;
use rand_chacha::ChaCha8Rng;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Most sheets in a picture.
const PICTURED: usize = 12;

#[derive(Debug, clap::Args)]
pub struct ScarffoldsArgs {
    /// How many sheets
    #[arg(long)]
    count: usize,
    /// The same seed gives the same sheets
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for the sheets; a run that was broken off goes on there
    #[arg(long)]
    out: PathBuf,
    /// Write sheets as files of their own into the folder, too
    #[arg(long, value_name = "FORMAT")]
    export: Option<Format>,
    /// How many sheets to write so, from the first; left out, all
    #[arg(long, value_name = "N", requires = "export")]
    export_count: Option<usize>,
    /// Draw twelve random sheets into this PNG
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
}

/// What a sheet can be written as.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Format {
    /// One GLB a sheet, +y up
    Glb,
}

pub fn run(args: &ScarffoldsArgs) -> Result<(), Failure> {
    let progress = WorkProgress::counted("sheets", args.count as u64);
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
    if args.export.is_none() && args.picture.is_none() {
        return Ok(());
    }
    let all = sheets::read(&args.out).or_fail("read the sheets")?;
    if let Some(Format::Glb) = args.export {
        let count = args.export_count.unwrap_or(all.len()).min(all.len());
        export(&all[..count], &args.out)?;
    }
    if let Some(path) = &args.picture {
        draw(&all, args.seed, path)?;
    }
    Ok(())
}

fn export(sheets: &[SimulatedSheet], out: &Path) -> Result<(), Failure> {
    for (number, sheet) in sheets.iter().enumerate() {
        let name = format!("sheet-{number:06}");
        let bytes = as_glb(sheet, &name).or_fail(format!("write {name}"))?;
        files::write(&out.join(format!("{name}.glb")), &bytes)?;
    }
    println!("{} of them as GLB", sheets.len());
    Ok(())
}

/// Draws sheets that the seed chooses.
fn draw(sheets: &[SimulatedSheet], seed: u64, path: &Path) -> Result<(), Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut chosen = sample(&mut rng, sheets.len(), PICTURED.min(sheets.len())).into_vec();
    chosen.sort_unstable();
    let shown: Vec<&SimulatedSheet> = chosen.iter().map(|&k| &sheets[k]).collect();
    let mut png = Cursor::new(Vec::new());
    contact_sheet(&shown)
        .write_to(&mut png, ImageFormat::Png)
        .or_fail("encode the picture")?;
    files::write(path, &png.into_inner())?;
    println!("sheets {chosen:?} in {}", path.display());
    Ok(())
}
