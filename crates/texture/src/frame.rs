//! The raster that a completion works on: its place in the chart, and which triangle covers each texel.

use darn_budget::{Budget, Exhausted};
use rayon::prelude::*;

/// No face.
pub(crate) const NONE: u32 = u32::MAX;
/// Rows that one task covers.
const BAND: usize = 64;
/// Nanoseconds of work for a face in a band, and for a texel tested.
const FACE_WORK: u64 = 40;
const TEXEL_WORK: u64 = 3;

/// A raster over a part of the chart. Columns go along +x, rows along −y, so that the picture looks as the chart does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    /// The chart's point at the upper left corner of the first texel.
    pub origin: [f64; 2],
    /// Length of a texel in the chart.
    pub step: f64,
    pub width: usize,
    pub height: usize,
}

impl Frame {
    /// Number of texels.
    pub(crate) fn len(&self) -> usize {
        self.width * self.height
    }

    /// The frame and some texels more on each side: left, above, right, below.
    pub(crate) fn widened(&self, [left, above, right, below]: [usize; 4]) -> Frame {
        Frame {
            origin: [
                self.origin[0] - left as f64 * self.step,
                self.origin[1] + above as f64 * self.step,
            ],
            step: self.step,
            width: left + self.width + right,
            height: above + self.height + below,
        }
    }

    /// The chart's point at the middle of a texel.
    pub(crate) fn centre(&self, column: usize, row: usize) -> [f64; 2] {
        [
            self.origin[0] + (column as f64 + 0.5) * self.step,
            self.origin[1] - (row as f64 + 0.5) * self.step,
        ]
    }

    /// A point of the chart in texels from the upper left corner.
    pub(crate) fn texels(&self, p: [f64; 2]) -> [f64; 2] {
        [
            (p[0] - self.origin[0]) / self.step,
            (self.origin[1] - p[1]) / self.step,
        ]
    }

    /// The texel that holds a point of the chart.
    pub(crate) fn texel(&self, p: [f64; 2]) -> Option<usize> {
        let [x, y] = self.texels(p).map(f64::floor);
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        inside.then(|| y as usize * self.width + x as usize)
    }
}

/// Smallest and largest coordinates of the vertices that faces use.
pub(crate) fn bounds(flat: &[[f64; 2]], faces: &[[u32; 3]]) -> [[f64; 2]; 2] {
    let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for p in faces.iter().flatten().map(|v| flat[*v as usize]) {
        for k in 0..2 {
            bounds[0][k] = bounds[0][k].min(p[k]);
            bounds[1][k] = bounds[1][k].max(p[k]);
        }
    }
    bounds
}

/// Twice the signed area of a triangle.
pub(crate) fn doubled_area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Per texel: the first face whose triangle holds its middle, or [`NONE`].
pub(crate) fn owners(
    frame: &Frame,
    flat: &[[f64; 2]],
    faces: &[[u32; 3]],
    budget: &Budget,
) -> Result<Vec<u32>, Exhausted> {
    let mut owners = vec![NONE; frame.len()];
    owners
        .par_chunks_mut(frame.width * BAND)
        .enumerate()
        .try_for_each(|(band, owners)| {
            budget.spend(FACE_WORK * faces.len() as u64)?;
            let rows = band * BAND..band * BAND + owners.len() / frame.width;
            let mut tested = 0;
            for (index, face) in faces.iter().enumerate() {
                let corners = face.map(|v| frame.texels(flat[v as usize]));
                tested += cover(&corners, &rows, frame.width, |at| {
                    if owners[at] == NONE {
                        owners[at] = index as u32;
                    }
                });
            }
            budget.spend(TEXEL_WORK * tested)
        })?;
    Ok(owners)
}

/// Calls `found` with the index, from the first row of `rows`, of every texel whose middle lies in a triangle; returns how many were tested.
fn cover(
    corners: &[[f64; 2]; 3],
    rows: &std::ops::Range<usize>,
    width: usize,
    mut found: impl FnMut(usize),
) -> u64 {
    let range = |k: usize, end: usize| {
        let low = corners[0][k].min(corners[1][k]).min(corners[2][k]) - 0.5;
        let high = corners[0][k].max(corners[1][k]).max(corners[2][k]) - 0.5;
        (
            low.ceil().max(0.0) as usize,
            ((high.floor() + 1.0).max(0.0) as usize).min(end),
        )
    };
    let (top, bottom) = range(1, rows.end);
    let top = top.max(rows.start);
    let (left, right) = range(0, width);
    let area = doubled_area(*corners);
    if top >= bottom || left >= right || area.abs() < 1e-12 || !area.is_finite() {
        return 0;
    }
    let sign = area.signum();
    for row in top..bottom {
        let y = row as f64 + 0.5;
        for column in left..right {
            let p = [column as f64 + 0.5, y];
            let inside =
                (0..3).all(|k| sign * doubled_area([corners[k], corners[(k + 1) % 3], p]) >= -1e-9);
            if inside {
                found((row - rows.start) * width + column);
            }
        }
    }
    ((bottom - top) * (right - left)) as u64
}
