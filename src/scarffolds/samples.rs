//! Training samples: a sheet, a square of it, a hole in the square, in the network's units.
//!
//! A sample looks like what `flatten` and `Grid` hand to the network: the hole takes a third to two thirds of the grid, cloth ends where
//! the sheet ends or at some distance from the hole, the mean of the known cells is 0 and the mean spacing of known neighbours is 1/64.

use super::cloth::{SIDE as SHEET, VERTICES};
use super::masks;
use super::sheets::Sheet;
use crate::grid::{CELLS, SIDE};
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

/// Draws samples from sheets.
#[derive(Debug, Clone)]
pub struct Sampler {
    splines: Vec<Spline>,
    turning: Turning,
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
            turning,
        }
    }

    /// How many sheets there are.
    pub fn sheets(&self) -> usize {
        self.splines.len()
    }

    /// Draws a sample from any sheet.
    pub fn sample(&self, rng: &mut impl Rng) -> Sample {
        let sheet = rng.random_range(0..self.splines.len());
        self.sample_of(sheet, rng)
    }

    /// Draws a sample from sheet number `sheet`: for held-out sets in which every sheet has its turn.
    pub fn sample_of(&self, sheet: usize, rng: &mut impl Rng) -> Sample {
        let spline = &self.splines[sheet];
        let banded = rng.random_bool(BANDED);
        let hole = if banded {
            centred(&masks::draw(rng), rng)
        } else {
            masks::draw(rng)
        };
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
        let positions: Vec<Vector3<f32>> = (0..CELLS)
            .map(|k| {
                if valid[k] {
                    spline.at(places[k])
                } else {
                    Vector3::zeros()
                }
            })
            .collect();
        let mut truth = normalised(&positions, &valid, &known, &turn(self.turning, rng));
        if rng.random_bool(NOISY.0) {
            add_noise(&mut truth, &known, rng);
        }
        Sample {
            truth,
            valid,
            known,
            hole,
        }
    }
}

/// Natural bicubic spline through a sheet's vertices, as B-spline coefficients with one more on every side.
#[derive(Debug, Clone)]
pub(super) struct Spline {
    coefficients: Vec<Vector3<f32>>,
}

const PADDED: usize = SHEET + 2;

impl Spline {
    pub(super) fn new(sheet: &Sheet) -> Self {
        assert_eq!(
            sheet.positions.len(),
            VERTICES,
            "a sheet has 51 × 51 vertices"
        );
        let mut rows: Vec<Vec<Vector3<f32>>> = sheet
            .positions
            .chunks_exact(SHEET)
            .map(|row| {
                line_coefficients(&row.iter().map(|p| Vector3::from(*p)).collect::<Vec<_>>())
            })
            .collect();
        let mut coefficients = vec![Vector3::zeros(); PADDED * PADDED];
        for i in 0..PADDED {
            let column: Vec<_> = rows.iter_mut().map(|row| row[i]).collect();
            for (j, c) in line_coefficients(&column).into_iter().enumerate() {
                coefficients[j * PADDED + i] = c;
            }
        }
        Self { coefficients }
    }

    /// The sheet's position at a place in [0, 1]².
    pub(super) fn at(&self, [u, v]: [f32; 2]) -> Vector3<f32> {
        let (i, wu) = basis(u);
        let (j, wv) = basis(v);
        let mut sum = Vector3::zeros();
        for (row, wv) in wv.iter().enumerate() {
            let start = (j + row) * PADDED + i;
            for (c, wu) in self.coefficients[start..start + 4].iter().zip(&wu) {
                sum += c * (wu * wv);
            }
        }
        sum
    }
}

/// First coefficient and the four cubic B-spline weights at a coordinate in [0, 1].
fn basis(x: f32) -> (usize, [f32; 4]) {
    let x = x.clamp(0.0, 1.0) * (SHEET - 1) as f32;
    let cell = (x as usize).min(SHEET - 2);
    let t = x - cell as f32;
    let s = 1.0 - t;
    let (t2, t3) = (t * t, t * t * t);
    let sixth = 1.0 / 6.0;
    (
        cell,
        [
            s * s * s * sixth,
            (3.0 * t3 - 6.0 * t2 + 4.0) * sixth,
            (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) * sixth,
            t3 * sixth,
        ],
    )
}

/// B-spline coefficients of the natural cubic spline through `values`: (c₋ + 4c + c₊)/6 = value, straight at the ends.
fn line_coefficients(values: &[Vector3<f32>]) -> Vec<Vector3<f32>> {
    let n = values.len();
    let mut c = vec![Vector3::zeros(); n + 2];
    let mut ratio = vec![0.0f32; n];
    c[1] = values[0];
    for k in 1..n - 1 {
        let pivot = 4.0 - ratio[k - 1];
        ratio[k] = 1.0 / pivot;
        c[k + 1] = (values[k] * 6.0 - c[k]) * ratio[k];
    }
    c[n] = values[n - 1];
    for k in (1..n - 1).rev() {
        c[k + 1] = c[k + 1] - c[k + 2] * ratio[k];
    }
    c[0] = c[1] * 2.0 - c[2];
    c[n + 1] = c[n] * 2.0 - c[n - 1];
    c
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

/// First and last column and row of the mask.
fn bounds(mask: &[bool]) -> [[usize; 2]; 2] {
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
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// A sheet rolled on a cylinder of the given radius: isometric to the flat one.
    fn rolled(radius: f32) -> Sheet {
        let step = 1.0 / (SHEET - 1) as f32;
        let positions = (0..VERTICES)
            .map(|k| {
                let (u, v) = ((k % SHEET) as f32 * step, (k / SHEET) as f32 * step);
                [radius * (u / radius).sin(), v, radius * (u / radius).cos()]
            })
            .collect();
        Sheet { positions }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn a_sample_is_in_the_networks_units(seed: u64, radius in 0.15f32..2.0) {
            let sampler = Sampler::new(&[rolled(radius)], Turning::Any);
            let sample = sampler.sample(&mut ChaCha8Rng::seed_from_u64(seed));
            let known: Vec<usize> = (0..CELLS).filter(|&k| sample.known[k]).collect();
            prop_assert!(known.len() > 150, "{} known cells", known.len());
            for axis in 0..3 {
                let mean: f32 = known.iter().map(|&k| sample.truth[k][axis]).sum::<f32>() / known.len() as f32;
                prop_assert!(mean.abs() < 1e-3);
            }
            for k in 0..CELLS {
                prop_assert!(!sample.hole[k] || (sample.valid[k] && !sample.known[k]));
                prop_assert!(!sample.known[k] || sample.valid[k]);
                if k % SIDE + 1 < SIDE && sample.hole[k] && sample.hole[k + 1] {
                    let [a, b] = [k, k + 1].map(|k| Vector3::from(sample.truth[k]));
                    // holes carry no noise; a chord is shorter than its arc by less than 1 % here
                    prop_assert!(((a - b).norm() * 64.0 - 1.0).abs() < 0.03, "{}", (a - b).norm() * 64.0);
                }
            }
        }

        #[test]
        fn every_rim_lies_on_the_sheet(seed: u64) {
            let sampler = Sampler::new(&[rolled(1.0)], Turning::Any);
            let sample = sampler.sample(&mut ChaCha8Rng::seed_from_u64(seed));
            let away = masks::distance(&sample.hole);
            for k in (0..CELLS).filter(|&k| away[k] > 0.0 && away[k] < 1.5) {
                prop_assert!(sample.known[k]);
            }
        }
    }

    #[test]
    fn the_spline_goes_through_the_vertices() {
        let sheet = rolled(0.3);
        let spline = Spline::new(&sheet);
        for (k, p) in sheet.positions.iter().enumerate() {
            let place = [k % SHEET, k / SHEET].map(|i| i as f32 / (SHEET - 1) as f32);
            assert!((spline.at(place) - Vector3::from(*p)).norm() < 2e-5);
        }
    }

    #[test]
    fn upright_samples_keep_their_height_order() {
        let sheet = rolled(0.4);
        let sampler = Sampler::new(&[sheet], Turning::Upright);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let q = turn(sampler.turning, &mut rng);
        assert!((q * Vector3::z() - Vector3::z()).norm() < 1e-6);
    }

    #[test]
    fn the_same_seed_draws_the_same_sample() {
        let sampler = Sampler::new(&[rolled(0.5), rolled(0.2)], Turning::Any);
        let draw = || sampler.sample(&mut ChaCha8Rng::seed_from_u64(11));
        assert_eq!(draw(), draw());
    }
}
