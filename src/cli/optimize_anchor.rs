//! `darn optimize-anchor`: searches where on a hole's grid a point in space belongs.

use super::failure::{Failure, OrFail};
use super::files;
use super::network::mender;
use super::progress::WorkProgress;
use crate::settings::{DeadlineArgs, NetworkArgs, SizeArgs};
use darn_contract::Search;
use darn_mend::Call;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct OptimizeAnchorArgs {
    /// The scan: GLB; glTF, with its files beside it; or a zip of those
    scan: PathBuf,
    /// The point that the cloth should reach, in scene space
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true)]
    target: [f64; 3],
    /// Id of the hole; may be left out when the scan has one
    #[arg(long)]
    hole: Option<u32>,
    /// Where on the chart the search starts; left out, where the cloth is nearest
    #[arg(long, value_name = "U,V", value_parser = uv)]
    start: Option<[f64; 2]>,
    /// Try every cell of the hole
    #[arg(long)]
    exhaustive: bool,
    /// Where a picture of the loss at every cell goes, as PNG; its numbers are then printed, too
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Where the scan goes, mended with an anchor at the place that was found
    #[arg(long, value_name = "FILE")]
    mend: Option<PathBuf>,
    #[command(flatten)]
    size: SizeArgs,
    #[command(flatten)]
    deadline: DeadlineArgs,
    #[command(flatten)]
    network: NetworkArgs,
}

/// Runs `darn optimize-anchor`.
pub fn run(args: &OptimizeAnchorArgs) -> Result<(), Failure> {
    let name = args.scan.display();
    let progress = WorkProgress::staged("darn");
    progress.stage("reading");
    let budget = args.deadline.budget();
    let scan = files::read_scan(&args.scan, &args.size, &budget)?;
    progress.stage("loading weights");
    let mender = mender(&args.network)?;
    progress.stage("searching");
    let search = Search {
        hole: args.hole,
        target: args.target,
        start: args.start,
        exhaustive: args.exhaustive,
        map: args.map.is_some(),
        map_gradient: false,
    };
    let call = || Call {
        mender: &mender,
        budget: &budget,
    };
    let mut found =
        darn_mend::optimize_anchor(&scan, &search, call()).or_fail(format!("search {name}"))?;
    if let Some(path) = &args.map {
        // The picture is in its file; the JSON would repeat it as base64.
        files::write(path, &std::mem::take(&mut found.map_png))?;
    }
    if let Some(path) = &args.mend {
        progress.stage("mending");
        let anchor = darn_mend::anchor_of(&found, &search);
        let mended = darn_mend::mend(&scan, &anchor, call()).or_fail(format!("mend {name}"))?;
        match files::packed_scan(path, &scan, &mended.bytes)? {
            Some(packed) => files::write(path, &packed)?,
            None => files::write_scan(path, &scan, &mended.bytes, mended.file.as_ref())?,
        }
    }
    drop(progress);
    let json = serde_json::to_string_pretty(&found).or_fail("write the answer")?;
    println!("{json}");
    Ok(())
}

/// `N` finite numbers, separated by commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let each: Result<Vec<f64>, _> = text.split(',').map(|x| x.trim().parse::<f64>()).collect();
    let each = each.map_err(|error| error.to_string())?;
    if let Some(wrong) = each.iter().find(|x| !x.is_finite()) {
        return Err(format!("{wrong} is not finite"));
    }
    <[f64; N]>::try_from(each).map_err(|each| format!("expected {N} numbers; got {}", each.len()))
}

/// A place on the chart: two numbers from 0 to 1.
fn uv(text: &str) -> Result<[f64; 2], String> {
    let uv = numbers::<2>(text)?;
    match uv.iter().find(|x| !(0.0..=1.0).contains(*x)) {
        Some(wrong) => Err(format!("expected numbers from 0 to 1; got {wrong}")),
        None => Ok(uv),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_places_are_read() {
        assert_eq!(numbers::<3>("1, -2.5,3e-2"), Ok([1.0, -2.5, 0.03]));
        assert!(numbers::<3>("1,2").is_err());
        assert!(numbers::<3>("1,2,NaN").is_err());
        assert_eq!(uv("0.25,1"), Ok([0.25, 1.0]));
        assert!(uv("0.25,1.5").is_err());
    }
}
