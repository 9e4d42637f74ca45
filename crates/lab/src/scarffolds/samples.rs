//! Training samples: a square of a sheet with a hole, in the network's units.
//!
//! A sample has the properties of the grids that the service gives to the network: the hole takes a third to two thirds of the grid's side,
//! the cloth ends at the border of the sheet or at some distance from the hole, the mean of the known cells is 0 and the mean spacing of
//! known neighbours is 1/64.

use super::masks::{self, MaskShape};
use super::sheet::SimulatedSheet;
use super::spline::SheetSpline;
use darn_geometry::grid::{CELLS, SIDE, distances_to};
use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};
use rand::Rng;

/// One training sample; every list is `CELLS` long, in the grid's order.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingSample {
    /// Where the cloth is; zero where it is not `valid`. Vertex noise, if any, is in the known cells only.
    pub truth: Vec<[f32; 3]>,
    /// The cell's centre lies on the sheet.
    pub valid: Vec<bool>,
    /// The network is given the position: valid, within the region and not in a hole.
    pub known: Vec<bool>,
    /// The cell lies in a hole: what the network is to fill in. Always valid.
    pub hole: Vec<bool>,
}

/// How samples are rotated in space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleRotation {
    /// By any rotation: the network knows no direction.
    Any,
    /// About +z only: +z stays up.
    Upright,
}

/// Draws samples from sheets.
#[derive(Debug, Clone)]
pub struct Sampler {
    splines: Vec<SheetSpline>,
    /// By sheet: see [`SimulatedSheet::roughness`].
    roughness: Vec<f32>,
    rotation: SampleRotation,
    /// Sheets drawn for a sample, of which the roughest is taken.
    candidates: usize,
}

/// Share of samples whose region ends at a distance from the hole. The others fill the grid, or end at the border of the sheet only.
const BANDED: f64 = 0.75;
/// Share of samples with vertex noise.
const NOISY: f64 = 0.15;
/// Largest standard deviation of that noise, in cells.
const NOISE_CELLS: f32 = 0.15;
/// Cells of cloth around a hole that must lie on the sheet: a hole never touches the border of the sheet.
const RIM: f32 = 2.5;

impl Sampler {
    /// A sampler over `sheets`.
    ///
    /// # Panics
    /// When there are no sheets, or a sheet does not have [`VERTICES`](super::lattice::VERTICES) positions.
    pub fn new(sheets: &[SimulatedSheet], rotation: SampleRotation) -> Self {
        assert!(!sheets.is_empty(), "a sampler needs sheets");
        Self {
            splines: sheets.iter().map(SheetSpline::new).collect(),
            roughness: sheets.iter().map(SimulatedSheet::roughness).collect(),
            rotation,
            candidates: 1,
        }
    }

    /// A sampler that takes every sample from the roughest of `candidates` random sheets: most sheets of a folder are smooth, and little is
    /// learned from them.
    pub fn roughest_of(self, candidates: usize) -> Self {
        Self {
            candidates: candidates.max(1),
            ..self
        }
    }

    /// Number of sheets.
    pub fn sheets(&self) -> usize {
        self.splines.len()
    }

    /// Draws `count` samples from random sheets, all with the same valid, known and hole cells: what depends on these cells only, such as
    /// the factor of the plate, is computed once for all.
    pub fn alike(&self, count: usize, rng: &mut impl Rng) -> Vec<TrainingSample> {
        let sheets: Vec<usize> = (0..count).map(|_| self.roughest(rng)).collect();
        let square = HoledSquare::draw(rng);
        let samples = sheets.into_iter().map(|sheet| {
            let mut sample = self.cut_from(sheet, &square, rng);
            if rng.random_bool(NOISY) {
                add_noise(&mut sample.truth, &sample.known, rng);
            }
            sample
        });
        samples.collect()
    }

    /// The roughest of [`Self::roughest_of`] random sheets.
    fn roughest(&self, rng: &mut impl Rng) -> usize {
        let drawn = (0..self.candidates).map(|_| rng.random_range(0..self.splines.len()));
        drawn
            .max_by(|a, b| self.roughness[*a].total_cmp(&self.roughness[*b]))
            .unwrap_or(0)
    }

    /// Draws a sample without noise from sheet number `sheet`, and the shape of its hole.
    pub fn clean_sample_of(&self, sheet: usize, rng: &mut impl Rng) -> (MaskShape, TrainingSample) {
        let square = HoledSquare::draw(rng);
        let sample = self.cut_from(sheet, &square, rng);
        (square.shape, sample)
    }

    /// The sample that a square cuts from a sheet.
    fn cut_from(&self, sheet: usize, square: &HoledSquare, rng: &mut impl Rng) -> TrainingSample {
        let spline = &self.splines[sheet];
        let cells = square.places.iter().zip(&square.valid);
        let positions: Vec<Vector3<f32>> = cells
            .map(|(place, valid)| match valid {
                true => spline.at(*place),
                false => Vector3::zeros(),
            })
            .collect();
        let rotation = draw_rotation(self.rotation, rng);
        TrainingSample {
            truth: normalised(&positions, &square.valid, &square.known, &rotation),
            valid: square.valid.clone(),
            known: square.known.clone(),
            hole: square.hole.clone(),
        }
    }
}

/// A square with a hole, for any sheet; lists are `CELLS` long.
struct HoledSquare {
    shape: MaskShape,
    /// Position of each cell on the sheet, in the unit square.
    places: Vec<[f32; 2]>,
    valid: Vec<bool>,
    known: Vec<bool>,
    hole: Vec<bool>,
}

impl HoledSquare {
    fn draw(rng: &mut impl Rng) -> Self {
        let banded = rng.random_bool(BANDED);
        let (shape, hole) = masks::draw(rng);
        let hole = if banded { centred(&hole, rng) } else { hole };
        let away = distances_to(&hole);
        let square = SheetSquare::around(&away, rng);
        let reach = if banded {
            region_edge(&hole, rng)
        } else {
            vec![f32::MAX; CELLS]
        };
        let places: Vec<[f32; 2]> = (0..CELLS).map(|k| square.place(k)).collect();
        let valid: Vec<bool> = places.iter().map(|p| on_sheet(*p)).collect();
        let known: Vec<bool> = (0..CELLS)
            .map(|k| valid[k] && !hole[k] && away[k] <= reach[k])
            .collect();
        Self {
            shape,
            places,
            valid,
            known,
            hole,
        }
    }
}

/// The grid's square on the sheet: cell (i, j) is at middle + i · along_u + j · along_v, a similarity, sometimes mirrored.
struct SheetSquare {
    middle: [f32; 2],
    along_u: [f32; 2],
    along_v: [f32; 2],
}

impl SheetSquare {
    /// A random square with the hole and `RIM` cells around it on the sheet; `away` holds the distance of each cell from the hole.
    fn around(away: &[f32], rng: &mut impl Rng) -> Self {
        let guarded: Vec<usize> = (0..CELLS).filter(|&k| away[k] <= RIM).collect();
        let mut side = rng.random_range(0.35..1.3f32);
        loop {
            for _ in 0..8 {
                let square = Self::draw(side, rng);
                if guarded.iter().all(|&k| on_sheet(square.place(k))) {
                    return square;
                }
            }
            side *= 0.93;
        }
    }

    fn draw(side: f32, rng: &mut impl Rng) -> Self {
        let turn = rng.random_range(0.0..std::f32::consts::TAU);
        let cell = side / SIDE as f32;
        let hand = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let (c, s) = (cell * turn.cos(), cell * turn.sin());
        Self {
            middle: [rng.random_range(0.0..1.0), rng.random_range(0.0..1.0)],
            along_u: [c, s],
            along_v: [-s * hand, c * hand],
        }
    }

    fn place(&self, cell: usize) -> [f32; 2] {
        let half = SIDE as f32 / 2.0 - 0.5;
        let (i, j) = ((cell % SIDE) as f32 - half, (cell / SIDE) as f32 - half);
        [0, 1].map(|a| self.middle[a] + i * self.along_u[a] + j * self.along_v[a])
    }
}

fn on_sheet([u, v]: [f32; 2]) -> bool {
    (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v)
}

/// The first and the last column or row of a mask.
#[derive(Debug, Clone, Copy)]
pub struct CellSpan {
    /// The first.
    pub first: usize,
    /// The last.
    pub last: usize,
}

impl CellSpan {
    /// Number of cells from the first to the last.
    pub fn length(self) -> usize {
        (self.last + 1).saturating_sub(self.first)
    }
}

/// Columns and rows of a mask, in this order; a mask without cells gives spans from 64 to 0.
pub fn spans(mask: &[bool]) -> [CellSpan; 2] {
    let nothing = CellSpan {
        first: SIDE,
        last: 0,
    };
    let mut spans = [nothing; 2];
    for k in (0..CELLS).filter(|&k| mask[k]) {
        for (span, at) in spans.iter_mut().zip([k % SIDE, k / SIDE]) {
            span.first = span.first.min(at);
            span.last = span.last.max(at);
        }
    }
    spans
}

/// The mask moved so that its holes are in the middle, up to two cells off: a region grows equally far on all sides.
fn centred(mask: &[bool], rng: &mut impl Rng) -> Vec<bool> {
    let shift = spans(mask).map(|CellSpan { first, last }| {
        let ideal = (SIDE as i32 - 1 - first as i32 - last as i32) / 2 + rng.random_range(-2..=2);
        let room = [
            masks::MARGIN as i32 - first as i32,
            (SIDE - 1 - masks::MARGIN) as i32 - last as i32,
        ];
        ideal.clamp(room[0], room[1])
    });
    let mut moved = vec![false; CELLS];
    for k in (0..CELLS).filter(|&k| mask[k]) {
        let (i, j) = ((k % SIDE) as i32 + shift[0], (k / SIDE) as i32 + shift[1]);
        moved[j as usize * SIDE + i as usize] = true;
    }
    moved
}

/// Distance from the hole, in cells, up to which the region reaches at each cell: such that the grid is the smallest square around the
/// region, with an uneven edge.
fn region_edge(hole: &[bool], rng: &mut impl Rng) -> Vec<f32> {
    let extent = spans(hole)
        .map(CellSpan::length)
        .into_iter()
        .max()
        .unwrap_or(SIDE);
    let reach = 0.5 * (SIDE - extent.min(SIDE)) as f32 + rng.random_range(-1.0..1.5);
    let ragged = rng.random_range(0.0..1.0f32);
    let waves: Vec<[f32; 4]> = (0..3)
        .map(|_| {
            let (turn, pace) = (
                rng.random_range(0.0..std::f32::consts::TAU),
                rng.random_range(0.1..1.0),
            );
            [
                pace * turn.cos(),
                pace * turn.sin(),
                rng.random_range(0.0..std::f32::consts::TAU),
                rng.random_range(0.0..1.0),
            ]
        })
        .collect();
    (0..CELLS)
        .map(|k| {
            let (i, j) = ((k % SIDE) as f32, (k / SIDE) as f32);
            let wave: f32 = waves
                .iter()
                .map(|w| w[3] * (w[0] * i + w[1] * j + w[2]).sin())
                .sum();
            (reach + ragged * (wave - 0.5 + rng.random_range(-0.5..0.5))).max(RIM)
        })
        .collect()
}

/// A random rotation, uniform over all rotations or over those about +z.
fn draw_rotation(rotation: SampleRotation, rng: &mut impl Rng) -> Rotation3<f32> {
    match rotation {
        SampleRotation::Any => loop {
            let q = Quaternion::from(nalgebra::Vector4::from_fn(|_, _| {
                rng.random_range(-1.0..1.0f32)
            }));
            if (0.01..1.0).contains(&q.norm_squared()) {
                return UnitQuaternion::from_quaternion(q).to_rotation_matrix();
            }
        },
        SampleRotation::Upright => Rotation3::from_axis_angle(
            &Vector3::z_axis(),
            rng.random_range(0.0..std::f32::consts::TAU),
        ),
    }
}

/// Positions moved and scaled so that known cells have mean 0 and mean spacing 1/64, as the service's grids have, then rotated; zero where
/// not valid.
fn normalised(
    positions: &[Vector3<f32>],
    valid: &[bool],
    known: &[bool],
    rotation: &Rotation3<f32>,
) -> Vec<[f32; 3]> {
    let mut mean = Vector3::<f64>::zeros();
    let (mut spacing, mut pairs, mut count) = (0.0f64, 0usize, 0usize);
    for k in (0..CELLS).filter(|&k| known[k]) {
        mean += positions[k].cast::<f64>();
        count += 1;
        let right = (k % SIDE + 1 < SIDE).then_some(k + 1);
        let upper = (k + SIDE < CELLS).then_some(k + SIDE);
        for n in [right, upper].into_iter().flatten().filter(|&n| known[n]) {
            spacing += f64::from((positions[n] - positions[k]).norm());
            pairs += 1;
        }
    }
    let mean = (mean / count.max(1) as f64).cast::<f32>();
    let scale = if spacing > 0.0 {
        (pairs as f64 / (spacing * SIDE as f64)) as f32
    } else {
        1.0
    };
    let place = |k: usize| {
        if valid[k] {
            (rotation * (positions[k] - mean) * scale).into()
        } else {
            [0.0; 3]
        }
    };
    (0..CELLS).map(place).collect()
}

/// Adds noise of one random strength to the known cells. The sum of three uniform numbers stands for a Gaussian.
fn add_noise(truth: &mut [[f32; 3]], known: &[bool], rng: &mut impl Rng) {
    let strength = rng.random_range(0.0..NOISE_CELLS) / SIDE as f32;
    for (p, _) in truth.iter_mut().zip(known).filter(|(_, known)| **known) {
        for x in p {
            let bell: f32 = (0..3).map(|_| rng.random_range(-1.0..1.0f32)).sum();
            *x += strength * bell; // The variance of the sum is 3 · 1/3 = 1.
        }
    }
}

#[cfg(test)]
#[path = "samples_tests.rs"]
mod tests;
