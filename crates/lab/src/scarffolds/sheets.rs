//! Sheets at rest: making many of them from a seed, and their files.
//!
//! A folder of sheets holds `sheets.safetensors`, one tensor `positions` of f32 `[n, 51, 51, 3]` in metres, +z up (sheet, row along v,
//! column along u, xyz), and `manifest.json` with the seed and every sheet's parameters. While they are being made, finished chunks
//! are `part-*.safetensors` with their records in the header; a broken-off run goes on from them, and `read` reads them early.

use super::cloth::{Point, SIDE, SPACING};
use super::files::{
    MANIFEST, PartHeader, WHOLE, format_error, part_name, read_part, write_file, write_whole,
};
pub use super::files::{read, read_manifest};
use super::scene::Scene;
use darn_geometry::mesh::intersect::self_intersections;
use darn_geometry::mesh::{TriMesh, Vec3};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Version of the generator: raised whenever the same seed gives other sheets.
pub const VERSION: u32 = 2;
/// Sheets in a part file.
const CHUNK: usize = 10;
/// Scenes tried for one sheet before giving up.
const ATTEMPTS: u32 = 40;
/// Greatest root mean square of edge strain of a sheet that is kept.
pub const MAX_STRAIN: f64 = 0.02;

/// One sheet at rest: `VERTICES` positions, metres, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Vertex `(i, j)` at index `j * SIDE + i`.
    pub positions: Vec<[f32; 3]>,
}

impl Sheet {
    /// Root mean square of the angle between an edge and the next one along its row or column, radians.
    pub fn roughness(&self) -> f32 {
        let at = |i: usize, j: usize| Vector3::from(self.positions[j * SIDE + i]);
        let bend = |a: Vector3<f32>, b: Vector3<f32>, c: Vector3<f32>| (b - a).angle(&(c - b));
        let mut squares = 0.0;
        for j in 0..SIDE {
            for i in 0..SIDE - 2 {
                squares += bend(at(i, j), at(i + 1, j), at(i + 2, j)).powi(2);
                squares += bend(at(j, i), at(j, i + 1), at(j, i + 2)).powi(2);
            }
        }
        (squares / (2 * SIDE * (SIDE - 2)) as f32).sqrt()
    }

    /// The sheet as 5,000 triangles; every cell is split along the diagonal from `(i, j)` to `(i + 1, j + 1)`.
    pub fn mesh(&self) -> TriMesh {
        let side = SIDE as u32;
        let mut faces = Vec::with_capacity(2 * (SIDE - 1) * (SIDE - 1));
        for j in 0..side - 1 {
            for i in 0..side - 1 {
                let k = j * side + i;
                faces.push([k, k + 1, k + side + 1]);
                faces.push([k, k + side + 1, k + side]);
            }
        }
        TriMesh {
            positions: self
                .positions
                .iter()
                .map(|p| Vec3::from(p.map(f64::from)))
                .collect(),
            faces,
        }
    }

    /// True when two triangles without a common vertex cut each other.
    pub fn crosses_itself(&self) -> bool {
        let mesh = self.mesh();
        let apart = |&(f, g): &(u32, u32)| {
            let (f, g) = (mesh.faces[f as usize], mesh.faces[g as usize]);
            !f.iter().any(|v| g.contains(v))
        };
        self_intersections(&mesh).iter().any(apart)
    }
}

/// How a sheet came to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Its place in the tensor.
    pub index: usize,
    /// The scene it came from.
    pub scene: Scene,
    /// Scenes before it that were dropped for self-intersection.
    pub dropped_crossing: u32,
    /// Scenes before it that were dropped for stretch.
    pub dropped_strain: u32,
    /// Root mean square of (length / rest length − 1) over the edges along u and v.
    pub strain: f64,
}

/// What `manifest.json` says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// `VERSION` of the generator.
    pub version: u32,
    /// The seed of the whole set.
    pub seed: u64,
    /// The set in numbers.
    pub summary: Summary,
    /// One record for each sheet, in the tensor's order.
    pub sheets: Vec<Record>,
}

/// A set of sheets in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Sheets kept.
    pub sheets: usize,
    /// Scenes dropped for self-intersection.
    pub dropped_crossing: usize,
    /// Scenes dropped for stretch.
    pub dropped_strain: usize,
    /// Share of all simulated scenes dropped for self-intersection.
    pub crossing_share: f64,
    /// Root mean square of the sheets' strains.
    pub strain: f64,
}

/// Sheet number `index` of the set of `seed`; depends on nothing else.
///
/// # Errors
/// `NoSheet` when no scene passes the checks.
pub fn make(seed: u64, index: usize) -> Result<(Sheet, Record), ScarfError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index as u64);
    let (mut dropped_crossing, mut dropped_strain) = (0, 0);
    for _ in 0..ATTEMPTS {
        let scene = Scene::draw(&mut rng);
        let positions = scene.simulate(&mut rng);
        let strain = strain(&positions);
        let sheet = Sheet {
            positions: positions.into_iter().map(Into::into).collect(),
        };
        if strain.is_nan() || strain > MAX_STRAIN {
            dropped_strain += 1;
        } else if sheet.crosses_itself() {
            dropped_crossing += 1;
        } else {
            return Ok((
                sheet,
                Record {
                    index,
                    scene,
                    dropped_crossing,
                    dropped_strain,
                    strain,
                },
            ));
        }
    }
    Err(ScarfError::NoSheet { index })
}

/// Root mean square of (length / rest length − 1) over the edges along u and v.
pub fn strain(positions: &[Point]) -> f64 {
    let edge = |a: usize, b: usize| {
        let strain = f64::from((positions[a] - positions[b]).norm() / SPACING) - 1.0;
        strain * strain
    };
    let mut sum = 0.0;
    for line in 0..SIDE {
        for k in 0..SIDE - 1 {
            sum += edge(line * SIDE + k, line * SIDE + k + 1)
                + edge(k * SIDE + line, (k + 1) * SIDE + line);
        }
    }
    (sum / (2 * SIDE * (SIDE - 1)) as f64).sqrt()
}

/// Why sheets could not be made or read.
#[derive(Debug, thiserror::Error)]
pub enum ScarfError {
    #[error("{path}: {source}")]
    Io {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path} is no file of sheets: {reason}")]
    Format { path: PathBuf, reason: String },
    #[error(
        "{path} was made with seed {found} by generator version {version}, not with seed {seed} by version {VERSION}"
    )]
    Foreign {
        path: PathBuf,
        found: u64,
        version: u32,
        seed: u64,
    },
    #[error(
        "no scene of sheet {index} came to rest without self-intersection in {ATTEMPTS} attempts"
    )]
    NoSheet { index: usize },
    #[error("no sheets in {path}")]
    Empty { path: PathBuf },
}

/// Makes `count` sheets into the folder `out`, which is created. The same seed gives the same bytes; a run that was broken off goes on
/// where it stopped, and a finished set grows. `progress` is told how many sheets were just finished, from whatever thread finished them.
///
/// # Errors
/// Files that cannot be written, sheets of another seed in `out`, a sheet that cannot be made.
pub fn generate(
    count: usize,
    seed: u64,
    out: &Path,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Summary, ScarfError> {
    let maker = |index| {
        let made = make(seed, index)?;
        progress(1);
        Ok(made)
    };
    collect(count, seed, out, progress, &maker)
}

/// Makes the sheet of an index.
type Maker<'a> = &'a (dyn Fn(usize) -> Result<(Sheet, Record), ScarfError> + Sync);

/// [`generate`] with any maker; it tells the progress of what it makes itself.
fn collect(
    count: usize,
    seed: u64,
    out: &Path,
    progress: &(dyn Fn(usize) + Sync),
    maker: Maker,
) -> Result<Summary, ScarfError> {
    std::fs::create_dir_all(out).map_err(|source| ScarfError::Io {
        path: out.into(),
        source,
    })?;
    let finished = finished(out, seed)?;
    let starts: Vec<usize> = (0..count).step_by(CHUNK).collect();
    let parts: Vec<Part> = starts
        .par_iter()
        .map(|&start| {
            let range = start..(start + CHUNK).min(count);
            if let (Some(sheets), Some(records)) =
                (finished.0.get(range.clone()), finished.1.get(range.clone()))
            {
                progress(range.len());
                return Ok((sheets.to_vec(), records.to_vec()));
            }
            let path = out.join(part_name(start));
            if let Some(part) = read_own_part(&path, seed, range.len())? {
                progress(range.len());
                return Ok(part);
            }
            make_part(range, seed, &path, maker)
        })
        .collect::<Result<_, _>>()?;
    let (sheets, records): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    let (sheets, records) = (sheets.concat(), records.concat());
    let summary = summarise(&records);
    let manifest = Manifest {
        version: VERSION,
        seed,
        summary,
        sheets: records,
    };
    let path = out.join(MANIFEST);
    let text =
        serde_json::to_vec_pretty(&manifest).map_err(|e| format_error(&path, &e.to_string()))?;
    write_file(&out.join(WHOLE), &sheets, None)?;
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

/// Sheets and their records.
type Part = (Vec<Sheet>, Vec<Record>);

/// A finished set in the folder, or nothing.
fn finished(out: &Path, seed: u64) -> Result<Part, ScarfError> {
    if !out.join(MANIFEST).exists() {
        return Ok((Vec::new(), Vec::new()));
    }
    let manifest = read_manifest(out)?;
    own(&out.join(MANIFEST), [manifest.seed, seed], manifest.version)?;
    Ok((read(out)?, manifest.sheets))
}

/// A part from its file, if the file is there and whole.
fn read_own_part(path: &Path, seed: u64, sheets: usize) -> Result<Option<Part>, ScarfError> {
    if !path.exists() {
        return Ok(None);
    }
    let (read, header) = read_part(path)?;
    own(path, [header.seed, seed], header.version)?;
    let whole = read.len() == sheets && header.sheets.len() == sheets;
    Ok(whole.then_some((read, header.sheets)))
}

/// Makes a part and writes it.
fn make_part(
    range: Range<usize>,
    seed: u64,
    path: &Path,
    maker: Maker,
) -> Result<Part, ScarfError> {
    let made: Vec<(Sheet, Record)> = range.map(maker).collect::<Result<_, _>>()?;
    let (sheets, records): (Vec<_>, Vec<_>) = made.into_iter().unzip();
    let header = PartHeader {
        version: VERSION,
        seed,
        sheets: records,
    };
    write_file(path, &sheets, Some(&header))?;
    Ok((sheets, header.sheets))
}

/// Refuses files of another seed or generator.
fn own(path: &Path, [found, seed]: [u64; 2], version: u32) -> Result<(), ScarfError> {
    if found == seed && version == VERSION {
        return Ok(());
    }
    Err(ScarfError::Foreign {
        path: path.into(),
        found,
        version,
        seed,
    })
}

fn summarise(records: &[Record]) -> Summary {
    let crossing: usize = records.iter().map(|r| r.dropped_crossing as usize).sum();
    let strained: usize = records.iter().map(|r| r.dropped_strain as usize).sum();
    let simulated = (records.len() + crossing + strained).max(1);
    let strain2: f64 = records.iter().map(|r| r.strain * r.strain).sum();
    Summary {
        sheets: records.len(),
        dropped_crossing: crossing,
        dropped_strain: strained,
        crossing_share: crossing as f64 / simulated as f64,
        strain: (strain2 / records.len().max(1) as f64).sqrt(),
    }
}

#[cfg(test)]
#[path = "sheets_tests.rs"]
mod tests;
