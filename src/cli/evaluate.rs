//! `darn evaluate`: measures a network's fills on held-out sheets, beside smooth fills and the truth.

use super::failure::{Failure, OrFail};
use super::files;
use super::garments::made;
use super::mended::{listed, mended, mended_at};
use super::network::mender;
use super::progress::WorkProgress;
use super::texture_table;
use crate::settings::NetworkArgs;
use darn_geometry::grid::NormalGrid;
use darn_geometry::mesh::TriMesh;
use darn_geometry::patch::PatchOptions;
use darn_lab::evaluate::{
    self, AskedHole, EvaluateError, EvaluationPlan, GarmentMender, GridShares, HoleKind, ScanRow,
    SyntheticScanOptions,
};
use darn_lab::garments;
use darn_lab::scarffolds::samples::{SampleRotation, Sampler};
use darn_lab::scarffolds::sheets::{self, SimulatedSheet};
use darn_net::{Averaging, FillRequest, FilledGrid, Network};
use darn_texture::testset::Family;
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct EvaluateArgs {
    /// Folder of sheets to be measured on, as `darn scarffolds` makes it; none of them may have been trained on
    #[arg(long, required_unless_present_any = ["garments", "texture"])]
    sheets: Option<PathBuf>,
    /// Mend a set of garments end to end instead, as `darn garments` makes it; without a folder, two of each kind are made from the seed
    #[arg(long, value_name = "DIR", num_args = 0..=1, conflicts_with_all = ["sheets", "noise", "picture", "upright", "scans", "masks", "once"])]
    garments: Option<Option<PathBuf>>,
    /// Complete the texture of ten fabrics in three layouts and three sizes of holes instead; with a folder, pictures go there
    #[arg(long, value_name = "DIR", num_args = 0..=1, conflicts_with_all = ["sheets", "garments", "noise", "picture", "upright", "scans", "masks", "once"])]
    texture: Option<Option<PathBuf>>,
    /// Complete siblings of these fabrics, drawn by a seed: other numbers in their patterns, other colours, rims, islands and folds
    #[arg(long, value_name = "SEED", requires = "texture")]
    siblings: Option<u32>,
    /// Measure the mended garments of another filler instead: a folder with a GLB of the hole's name for each
    #[arg(long, value_name = "FOLDER", requires = "garments")]
    mended: Option<PathBuf>,
    /// Count which loops would be closed by default after trimming, noise, torn and bitten edges, too
    #[arg(long, requires = "garments", conflicts_with = "mended")]
    worn: bool,
    /// How many samples, the sheets in turn
    #[arg(long, value_name = "N", default_value_t = 100)]
    samples: usize,
    /// Seed of the samples
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Keep the sheets upright instead of turning each sample anyhow: for weights that know which way is up
    #[arg(long)]
    upright: bool,
    /// Standard deviations of noise on the known cells, in cells; 0 is always measured
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = noise, default_value = "0")]
    noise: Vec<f64>,
    /// Where every measurement goes, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Where the curves go, as SVG
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Mend this many sheets end to end, too, each scanned with a round, a ragged and a long hole
    #[arg(long, value_name = "N", default_value_t = 0)]
    scans: usize,
    /// Noise of the scans' vertices: standard deviation of every coordinate, in edges
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, value_parser = noise, requires = "scans")]
    scan_noise: f64,
    /// Compare the holes of training samples with those of flattened scans instead
    #[arg(long, conflicts_with_all = ["noise", "picture", "upright", "scans"])]
    masks: bool,
    /// Measure the plausible fills beside the likeliest one, too
    #[arg(long)]
    alternatives: bool,
    /// Ask the network once a grid, not for its four flips
    #[arg(long)]
    once: bool,
    #[command(flatten)]
    network: NetworkArgs,
}

pub fn run(args: &EvaluateArgs) -> Result<(), Failure> {
    if let Some(set) = &args.garments {
        return garments(args, set.as_deref());
    }
    if let Some(pictures) = &args.texture {
        let family = args.siblings.map_or(Family::Tuned, Family::Sibling);
        return texture_table::run(family, pictures.as_deref(), args.json.as_deref());
    }
    let folder = args.sheets.clone().unwrap_or_default();
    let name = folder.display();
    let sheets = sheets::read(&folder).or_fail(format!("read sheets in {name}"))?;
    if sheets.is_empty() || args.samples == 0 {
        return Err(Failure::Usage("there is nothing to measure".into()));
    }
    let rotation = match args.upright {
        true => SampleRotation::Upright,
        false => SampleRotation::Any,
    };
    let cases = evaluate::draw(&Sampler::new(&sheets, rotation), args.samples, args.seed);
    if args.masks {
        return masks(args, &sheets, &evaluate::of_samples(&cases));
    }
    let mender = mender(&args.network)?;
    let network = mender.networks.default();
    let averaging = match args.once {
        true => Averaging::Once,
        false => Averaging::Flips,
    };
    let fill = |grids: &[NormalGrid]| filled(network, grids, averaging);
    let plan = EvaluationPlan {
        noises: args.noises(),
        seed: args.seed,
        options: PatchOptions::default(),
    };
    let work = cases.len() * plan.noises.len();
    let progress = WorkProgress::counted("samples", work as u64);
    let report = evaluate::run(&cases, &plan, &fill, &|done| progress.advance(done as u64));
    drop(progress);
    let report = report.or_fail("evaluate")?;
    print!("{}", report.markdown());
    if let (Some(errors), false) = (&network.card().errors, args.once) {
        for noise in args.noises() {
            let cells = evaluate::cell_errors(&cases, noise, args.seed, &fill);
            let cells = cells.or_fail("evaluate")?;
            println!("\nConfidence after patch, noise {noise}\n");
            print!("{}", evaluate::coverage_table(&cells, errors));
        }
    }
    if args.alternatives {
        let fills = |grid: &NormalGrid| {
            let fills = network.alternatives(grid, None);
            fills.map_err(|error| EvaluateError::Filler(Box::new(error)))
        };
        let found = evaluate::alternative_fills(&cases, &fills).or_fail("evaluate")?;
        println!("\nAlternatives\n");
        print!("{}", evaluate::alternatives_table(&found));
    }
    let scanner = SyntheticScanOptions {
        seed: args.seed,
        noise: args.scan_noise,
    };
    let scans: Vec<Option<ScanRow>> = (HoleKind::ALL.into_iter())
        .flat_map(|kind| {
            let sheets = &sheets[..args.scans.min(sheets.len())];
            evaluate::over_scans(sheets, kind, &scanner, &|scan| mended(scan, &mender))
        })
        .collect();
    if !scans.is_empty() {
        print!(
            "\nScans mended end to end\n\n{}",
            evaluate::scan_table(&scans)
        );
    }
    if let Some(path) = &args.json {
        let text = json!({
            "weights": network.card(), "seed": args.seed, "report": report, "scans": scans,
        });
        files::write(path, &files::json(&text, "write the report")?)?;
    }
    match &args.picture {
        Some(path) => files::write(path, evaluate::picture(&report).as_bytes()),
        None => Ok(()),
    }
}

/// A network's answers.
pub fn filled(
    network: &Network,
    grids: &[NormalGrid],
    averaging: Averaging,
) -> Result<Vec<FilledGrid>, EvaluateError> {
    let request = FillRequest {
        grids,
        up: None,
        averaging,
    };
    let answers = network.fill(&request);
    answers.map_err(|error| EvaluateError::Filler(Box::new(error)))
}

impl EvaluateArgs {
    /// Noise levels, ascending, with 0 among them.
    fn noises(&self) -> Vec<f64> {
        let mut all = self.noise.clone();
        all.push(0.0);
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }
}

/// Measures mends of garments, ours or another filler's.
fn garments(args: &EvaluateArgs, set: Option<&Path>) -> Result<(), Failure> {
    let cases = match set {
        Some(dir) => {
            garments::set::read(dir).or_fail(format!("read garments in {}", dir.display()))?
        }
        None => made(args.seed, 2)?,
    };
    let mender = mender(&args.network)?;
    let list = |mesh: &TriMesh| listed(mesh);
    let mend = |asked: &AskedHole| match &args.mended {
        Some(folder) => {
            let path = folder.join(&asked.record.file);
            garments::set::read_mesh(&path).map_err(|e| EvaluateError::Mender(Box::new(e)))
        }
        None => mended_at(asked.mesh, asked.at, &mender),
    };
    let progress = WorkProgress::counted("garments", cases.len() as u64);
    let ours = GarmentMender {
        list: args.mended.is_none().then_some(&list),
        mend: &mend,
    };
    let report = evaluate::over_garments(&cases, &ours, &|| progress.advance(1));
    drop(progress);
    let report = report.or_fail("evaluate")?;
    print!("{}", report.markdown());
    if args.worn {
        let progress = WorkProgress::counted("worn garments", cases.len() as u64);
        let rows = evaluate::over_worn_garments(&cases, &list, args.seed, &|| progress.advance(1));
        drop(progress);
        let rows = rows.or_fail("evaluate")?;
        print!("\n{}", evaluate::worn_table(&rows));
    }
    match &args.json {
        Some(path) => files::write(path, &files::json(&json!(report), "write the report")?),
        None => Ok(()),
    }
}

/// A line of the table of shares.
struct MaskRow {
    name: String,
    /// Grids that could not be made.
    refused: usize,
    shares: Vec<GridShares>,
}

/// Prints and writes the shares of the grid that holes take, in training samples and in flattened scans.
fn masks(
    args: &EvaluateArgs,
    sheets: &[SimulatedSheet],
    trained: &[GridShares],
) -> Result<(), Failure> {
    let mut rows = vec![MaskRow {
        name: "training samples".into(),
        refused: 0,
        shares: trained.to_vec(),
    }];
    for kind in HoleKind::ALL {
        let found = evaluate::of_flattened(sheets, kind, args.seed);
        let flat: Vec<GridShares> = found.iter().flatten().copied().collect();
        let name = format!("flattened, {}", format!("{kind:?}").to_lowercase());
        rows.push(MaskRow {
            name,
            refused: found.len() - flat.len(),
            shares: flat,
        });
    }
    println!(
        "Quantiles 5 / 25 / 50 / 75 / 95 %, in per cent of the grid (extent: of its side)\n\n\
         | | grids | refused | unknown | hole | extent of the hole | unknown outside |\n|---|---|---|---|---|---|---|"
    );
    for MaskRow {
        name,
        refused,
        shares,
    } in &rows
    {
        let parts: [fn(&GridShares) -> f64; 4] =
            [|s| s.unknown, |s| s.hole, |s| s.extent, |s| s.outside];
        let cells = parts.map(|part| quantiles(shares.iter().map(part).collect()));
        println!(
            "| {name} | {} | {refused} | {} |",
            shares.len(),
            cells.join(" | ")
        );
    }
    if let Some(path) = &args.json {
        let all: Vec<_> = (rows.iter())
            .map(|row| json!({"name": row.name, "refused": row.refused, "shares": row.shares}))
            .collect();
        files::write(path, &files::json(&json!(all), "write the report")?)?;
    }
    Ok(())
}

fn quantiles(mut numbers: Vec<f64>) -> String {
    numbers.sort_by(f64::total_cmp);
    let last = numbers.len().saturating_sub(1) as f64;
    let at = |q: f64| {
        numbers
            .get((q * last).round() as usize)
            .copied()
            .unwrap_or(0.0)
    };
    [0.05, 0.25, 0.5, 0.75, 0.95]
        .map(|q| format!("{:.0}", 100.0 * at(q)))
        .join(" / ")
}

fn noise(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(sigma) if (0.0..=2.0).contains(&sigma) => Ok(sigma),
        _ => Err(format!("{text:?} is not a number from 0 to 2")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_of_the_sorted_numbers() {
        let numbers = (0..=100).rev().map(|k| f64::from(k) / 100.0).collect();
        assert_eq!(quantiles(numbers), "5 / 25 / 50 / 75 / 95");
        assert_eq!(quantiles(Vec::new()), "0 / 0 / 0 / 0 / 0");
    }

    #[test]
    fn noise_is_a_length() {
        assert_eq!(noise(" 0.25"), Ok(0.25));
        for wrong in ["-1", "nan", "3", ""] {
            assert!(noise(wrong).is_err(), "{wrong}");
        }
    }
}
