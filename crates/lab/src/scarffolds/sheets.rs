//! Sets of sheets: making them from a seed, and continuing interrupted runs.
//!
//! A folder of sheets holds `sheets.safetensors`, one tensor `positions` of f32 `[n, 51, 51, 3]` in metres, +z up (sheet, row along v,
//! column along u, xyz), and `manifest.json` with the seed and the parameters of every sheet. While a set is being made, finished parts are
//! files `part-*.safetensors` with their records in the header. An interrupted run continues from them, and [`read`] reads them.

use super::error::ScarfError;
use super::files::{
    MANIFEST, PartHeader, WHOLE, format_error, part_name, read_part, write_file, write_whole,
};
pub use super::files::{read, read_manifest};
use super::manifest::{Manifest, SheetRecord, SheetSetSummary, VERSION};
use super::scene::Scene;
pub use super::sheet::SimulatedSheet;
use super::sheet::strain;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;

/// Sheets in a part file.
const PART_SHEETS: usize = 10;
/// Scenes simulated for one sheet before the run fails.
const ATTEMPTS: u32 = 40;
/// Largest strain (see [`SheetRecord::strain`]) of a sheet that is kept.
const MAX_STRAIN: f64 = 0.02;

/// Makes sheet number `index` of the set of `seed`. The result depends on these two numbers only.
///
/// # Errors
/// [`ScarfError::NoSheet`] when no scene passes the checks.
pub fn make(seed: u64, index: usize) -> Result<(SimulatedSheet, SheetRecord), ScarfError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index as u64);
    let (mut dropped_crossing, mut dropped_strain) = (0, 0);
    for _ in 0..ATTEMPTS {
        let scene = Scene::draw(&mut rng);
        let positions = scene.simulate(&mut rng);
        let strain = strain(&positions);
        let sheet = SimulatedSheet {
            positions: positions.into_iter().map(Into::into).collect(),
        };
        if strain.is_nan() || strain > MAX_STRAIN {
            dropped_strain += 1;
        } else if sheet.crosses_itself() {
            dropped_crossing += 1;
        } else {
            let record = SheetRecord {
                index,
                scene,
                dropped_crossing,
                dropped_strain,
                strain,
            };
            return Ok((sheet, record));
        }
    }
    Err(ScarfError::NoSheet {
        index,
        attempts: ATTEMPTS,
    })
}

/// Makes `count` sheets into the folder `out`, which is created if needed. The same seed gives the same bytes. An interrupted run
/// continues where it stopped, and a finished set can grow. `progress` gets the number of sheets just finished; any thread may call it.
///
/// # Errors
/// Files that cannot be written, sheets of another seed in `out`, a sheet that cannot be made.
pub fn generate(
    count: usize,
    seed: u64,
    out: &Path,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<SheetSetSummary, ScarfError> {
    let maker = |index| {
        let made = make(seed, index)?;
        progress(1);
        Ok(made)
    };
    collect(count, seed, out, progress, &maker)
}

/// Makes the sheet of an index.
type Maker<'a> = &'a (dyn Fn(usize) -> Result<(SimulatedSheet, SheetRecord), ScarfError> + Sync);

/// [`generate`] with any maker. `progress` counts the sheets that were found finished; the maker reports its own.
fn collect(
    count: usize,
    seed: u64,
    out: &Path,
    progress: &(dyn Fn(usize) + Sync),
    maker: Maker,
) -> Result<SheetSetSummary, ScarfError> {
    std::fs::create_dir_all(out).map_err(|source| ScarfError::Io {
        path: out.into(),
        source,
    })?;
    let finished = finished(out, seed)?;
    let starts: Vec<usize> = (0..count).step_by(PART_SHEETS).collect();
    let parts: Vec<SheetPart> = starts
        .par_iter()
        .map(|&start| {
            let range = start..(start + PART_SHEETS).min(count);
            if let Some(part) = finished.slice(range.clone()) {
                progress(range.len());
                return Ok(part);
            }
            let path = out.join(part_name(start));
            if let Some(part) = read_own_part(&path, seed, range.len())? {
                progress(range.len());
                return Ok(part);
            }
            make_part(range, seed, &path, maker)
        })
        .collect::<Result<_, _>>()?;
    let whole = SheetPart::concat(parts);
    let summary = SheetSetSummary::of(&whole.records);
    let manifest = Manifest {
        version: VERSION,
        seed,
        summary,
        sheets: whole.records,
    };
    let path = out.join(MANIFEST);
    let text =
        serde_json::to_vec_pretty(&manifest).map_err(|e| format_error(&path, &e.to_string()))?;
    write_file(&out.join(WHOLE), &whole.sheets, None)?;
    write_whole(&path, &text)?;
    for path in starts
        .iter()
        .map(|&start| out.join(part_name(start)))
        .filter(|p| p.exists())
    {
        std::fs::remove_file(&path).map_err(|source| ScarfError::Io { path, source })?;
    }
    Ok(summary)
}

/// Some sheets of a set and their records, equally many.
#[derive(Default)]
struct SheetPart {
    sheets: Vec<SimulatedSheet>,
    records: Vec<SheetRecord>,
}

impl SheetPart {
    /// A range of the sheets; `None` where there are fewer.
    fn slice(&self, range: Range<usize>) -> Option<SheetPart> {
        Some(SheetPart {
            sheets: self.sheets.get(range.clone())?.to_vec(),
            records: self.records.get(range)?.to_vec(),
        })
    }

    fn concat(parts: Vec<SheetPart>) -> SheetPart {
        let mut whole = SheetPart::default();
        for part in parts {
            whole.sheets.extend(part.sheets);
            whole.records.extend(part.records);
        }
        whole
    }
}

/// The finished set in the folder; empty where there is none.
fn finished(out: &Path, seed: u64) -> Result<SheetPart, ScarfError> {
    if !out.join(MANIFEST).exists() {
        return Ok(SheetPart::default());
    }
    let manifest = read_manifest(out)?;
    let found = Origin {
        version: manifest.version,
        seed: manifest.seed,
    };
    found.check(&out.join(MANIFEST), seed)?;
    Ok(SheetPart {
        sheets: read(out)?,
        records: manifest.sheets,
    })
}

/// A part from its file; `None` when the file is missing or holds another number of sheets.
fn read_own_part(path: &Path, seed: u64, count: usize) -> Result<Option<SheetPart>, ScarfError> {
    if !path.exists() {
        return Ok(None);
    }
    let (sheets, header) = read_part(path)?;
    let found = Origin {
        version: header.version,
        seed: header.seed,
    };
    found.check(path, seed)?;
    let whole = sheets.len() == count && header.sheets.len() == count;
    Ok(whole.then_some(SheetPart {
        sheets,
        records: header.sheets,
    }))
}

/// Makes a part and writes it.
fn make_part(
    range: Range<usize>,
    seed: u64,
    path: &Path,
    maker: Maker,
) -> Result<SheetPart, ScarfError> {
    let made: Vec<(SimulatedSheet, SheetRecord)> = range.map(maker).collect::<Result<_, _>>()?;
    let (sheets, records): (Vec<_>, Vec<_>) = made.into_iter().unzip();
    let header = PartHeader {
        version: VERSION,
        seed,
        sheets: records,
    };
    write_file(path, &sheets, Some(&header))?;
    Ok(SheetPart {
        sheets,
        records: header.sheets,
    })
}

/// What a file of sheets was made with.
struct Origin {
    version: u32,
    seed: u64,
}

impl Origin {
    /// Refuses files of another seed or generator.
    fn check(&self, path: &Path, seed: u64) -> Result<(), ScarfError> {
        if self.seed == seed && self.version == VERSION {
            return Ok(());
        }
        Err(ScarfError::Foreign {
            path: path.into(),
            found: self.seed,
            version: self.version,
            seed,
        })
    }
}

#[cfg(test)]
#[path = "sheets_tests.rs"]
mod tests;
