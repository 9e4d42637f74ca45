//! A sheet as a smooth surface: the natural bicubic spline through its vertices.

use super::lattice::{SIDE as SHEET, VERTICES};
use super::sheet::SimulatedSheet;
use nalgebra::Vector3;

/// Natural bicubic spline through a sheet's vertices, as B-spline coefficients: one row or column more than vertices on every side.
#[derive(Debug, Clone)]
pub(super) struct SheetSpline {
    coefficients: Vec<Vector3<f32>>,
}

const PADDED: usize = SHEET + 2;

impl SheetSpline {
    pub(super) fn new(sheet: &SimulatedSheet) -> Self {
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
