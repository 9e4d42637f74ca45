//! Training samples: a sheet, a square of it, a hole in the square, in the network's units.
//!
//! A sample looks like what `flatten` and `Grid` hand to the network: the hole takes a third to two thirds of the grid, cloth ends where
//! the sheet ends or at some distance from the hole, the mean of the known cells is 0 and the mean spacing of known neighbours is 1/64.

use super::masks::{self, Shape};
use super::sheets::Sheet;
use super::spline::Spline;
use darn_geometry::grid::{CELLS, SIDE};
use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};
use rand::Rng;

/// One training sample; every list is `CELLS` long, in the grid's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Where the cloth is; zero where it is not `valid`. Vertex noise, if any, is in the known cells only.
    pub truth: Vec<[f32; 3]>,
    /// The cell's centre lies on the sheet.
    pub valid: Vec<bool>,
    /// The network is given the position: valid, within the region and not in a hole.
    pub known: Vec<bool>,
    /// The cell lies in a hole: what the network is to fill in. Always valid.
    pub hole: Vec<bool>,
}

/// How samples are turned in space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Turning {
    /// Any rotation: the network knows no direction.
    Any,
    /// About +z only: up stays up.
    Upright,
}

impl Turning {
    /// How samples are turned when up is to stay up, or not.
    pub fn keeping_up(upright: bool) -> Self {
        match upright {
            true => Self::Upright,
            false => Self::Any,
        }
    }
}

/// Draws samples from sheets.
#[derive(Debug, Clone)]
pub struct Sampler {
    splines: Vec<Spline>,
    /// By sheet: see [`Sheet::roughness`].
    roughness: Vec<f32>,
    turning: Turning,
    /// Sheets drawn for a sample, of which the roughest is taken.
    candidates: usize,
}

/// Share of samples whose region ends at a distance from the hole; the others fill the grid or end at the sheet's border only.
const BANDED: f64 = 0.75;
/// Share of samples with vertex noise, and its greatest standard deviation in cells.
const NOISY: (f64, f32) = (0.15, 0.15);
/// Cells of cloth around a hole that must lie on the sheet: a hole never runs into the sheet's border.
const RIM: f32 = 2.5;

impl Sampler {
    /// A sampler over `sheets`.
    ///
    /// # Panics
    /// When there are no sheets, or one of them has not `VERTICES` positions.
    pub fn new(sheets: &[Sheet], turning: Turning) -> Self {
        assert!(!sheets.is_empty(), "a sampler needs sheets");
        Self {
            splines: sheets.iter().map(Spline::new).collect(),
            roughness: sheets.iter().map(Sheet::roughness).collect(),
            turning,
            candidates: 1,
        }
    }

    /// The same, with every sample from the roughest of so many sheets: most sheets of a folder are gentle, and little is learned there.
    pub fn roughest_of(self, candidates: usize) -> Self {
        Self {
            candidates: candidates.max(1),
            ..self
        }
    }

    /// How many sheets there are.
    pub fn sheets(&self) -> usize {
        self.splines.len()
    }

    /// Draws `count` samples from any sheets, all with the same cells valid, known and missing: what depends on those alone, as the plate's
    /// factor, needs to be made once.
    pub fn alike(&self, count: usize, rng: &mut impl Rng) -> Vec<Sample> {
        let sheets: Vec<usize> = (0..count).map(|_| self.roughest(rng)).collect();
        let cut = Cut::draw(rng);
        let samples = sheets.into_iter().map(|sheet| {
            let mut sample = self.taken(sheet, &cut, rng);
            if rng.random_bool(NOISY.0) {
                add_noise(&mut sample.truth, &sample.known, rng);
            }
            sample
        });
        samples.collect()
    }

    /// The roughest of some sheets.
    fn roughest(&self, rng: &mut impl Rng) -> usize {
        let drawn = (0..self.candidates).map(|_| rng.random_range(0..self.splines.len()));
        drawn
            .max_by(|a, b| self.roughness[*a].total_cmp(&self.roughness[*b]))
            .unwrap_or(0)
    }

    /// Draws a sample from sheet number `sheet` without noise, and the shape of its hole: for measuring sets in which every sheet has its turn.
    pub fn clean_sample_of(&self, sheet: usize, rng: &mut impl Rng) -> (Shape, Sample) {
        let cut = Cut::draw(rng);
        let sample = self.taken(sheet, &cut, rng);
        (cut.shape, sample)
    }

    /// What a cut takes from a sheet.
    fn taken(&self, sheet: usize, cut: &Cut, rng: &mut impl Rng) -> Sample {
        let spline = &self.splines[sheet];
        let cells = cut.places.iter().zip(&cut.valid);
        let positions: Vec<Vector3<f32>> = cells
            .map(|(place, valid)| match valid {
                true => spline.at(*place),
                false => Vector3::zeros(),
            })
            .collect();
        let turn = turn(self.turning, rng);
        Sample {
            truth: normalised(&positions, &cut.valid, &cut.known, &turn),
            valid: cut.valid.clone(),
            known: cut.known.clone(),
            hole: cut.hole.clone(),
        }
    }
}

/// A square of a sheet with a hole in it, whatever the sheet; lists are `CELLS` long.
struct Cut {
    shape: Shape,
    /// Where cells lie on the sheet.
    places: Vec<[f32; 2]>,
    valid: Vec<bool>,
    known: Vec<bool>,
    hole: Vec<bool>,
}

impl Cut {
    fn draw(rng: &mut impl Rng) -> Self {
        let banded = rng.random_bool(BANDED);
        let (shape, hole) = masks::draw_kind(rng);
        let hole = if banded { centred(&hole, rng) } else { hole };
        let away = masks::distance(&hole);
        let square = Square::around(&away, rng);
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

/// The grid's square on the sheet: place = middle + across · (i, j), a similarity, sometimes mirrored.
struct Square {
    middle: [f32; 2],
    along_u: [f32; 2],
    along_v: [f32; 2],
}

impl Square {
    /// A random square such that the hole, and `RIM` cells around it, lie on the sheet.
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

/// First and last column, and first and last row, of the mask; `[64, 0]` twice when it is empty.
pub fn bounds(mask: &[bool]) -> [[usize; 2]; 2] {
    let mut found = [[SIDE, 0]; 2];
    for k in (0..CELLS).filter(|&k| mask[k]) {
        for (range, at) in found.iter_mut().zip([k % SIDE, k / SIDE]) {
            *range = [range[0].min(at), range[1].max(at)];
        }
    }
    found
}

/// The mask moved so that its holes stand in the middle, give or take two cells: a region grows alike on all sides.
fn centred(mask: &[bool], rng: &mut impl Rng) -> Vec<bool> {
    let shift = bounds(mask).map(|[first, last]| {
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

/// How far from the hole the region reaches in each cell's direction: so far that the grid is its tightest square, with an uneven edge.
fn region_edge(hole: &[bool], rng: &mut impl Rng) -> Vec<f32> {
    let extent = bounds(hole)
        .map(|[first, last]| last + 1 - first)
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

/// A rotation drawn evenly from all, or about +z.
fn turn(turning: Turning, rng: &mut impl Rng) -> Rotation3<f32> {
    match turning {
        Turning::Any => loop {
            let q = Quaternion::from(nalgebra::Vector4::from_fn(|_, _| {
                rng.random_range(-1.0..1.0f32)
            }));
            if (0.01..1.0).contains(&q.norm_squared()) {
                return UnitQuaternion::from_quaternion(q).to_rotation_matrix();
            }
        },
        Turning::Upright => Rotation3::from_axis_angle(
            &Vector3::z_axis(),
            rng.random_range(0.0..std::f32::consts::TAU),
        ),
    }
}

/// Known cells to mean 0 and mean spacing 1/64, as the service's grids are; then turned. Zero where not valid.
fn normalised(
    positions: &[Vector3<f32>],
    valid: &[bool],
    known: &[bool],
    turn: &Rotation3<f32>,
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
            (turn * (positions[k] - mean) * scale).into()
        } else {
            [0.0; 3]
        }
    };
    (0..CELLS).map(place).collect()
}

/// Noise of one random strength on the known cells: three uniform numbers added are near enough to a Gaussian.
fn add_noise(truth: &mut [[f32; 3]], known: &[bool], rng: &mut impl Rng) {
    let strength = rng.random_range(0.0..NOISY.1) / SIDE as f32;
    for (p, _) in truth.iter_mut().zip(known).filter(|(_, known)| **known) {
        for x in p {
            let bell: f32 = (0..3).map(|_| rng.random_range(-1.0..1.0f32)).sum();
            *x += strength * bell; // the variance of the sum is 3 · 1/3 = 1
        }
    }
}

#[cfg(test)]
#[path = "samples_tests.rs"]
mod tests;
