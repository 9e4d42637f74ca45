//! Vectors on the vertices of a sheet, row by row and axis by axis, and the projections of whole rows at once.
//!
//! A row is three runs of `WIDTH` numbers, so that a constraint between two rows is one loop the compiler turns into vector
//! instructions; constraints along a row are constraints between rows of the transposed field. The columns from `SIDE` on are padding
//! that nothing reads.

use super::cloth::{Point, SIDE};

/// Length of a run: `SIDE` and padding to a multiple of eight.
pub const WIDTH: usize = 56;

/// One axis of a row.
pub type Run = [f32; WIDTH];
/// x, y and z of a row.
pub type Row = [Run; 3];

/// A vector for every vertex of a sheet.
#[derive(Debug, Clone)]
pub struct Field {
    /// `SIDE` rows.
    pub rows: Vec<Row>,
}

/// A number for every vertex, with the same padding.
pub type Weights = Vec<Run>;

impl Field {
    /// All zero.
    pub fn zeros() -> Self {
        Self {
            rows: vec![[[0.0; WIDTH]; 3]; SIDE],
        }
    }

    /// From one point for each vertex, row by row.
    pub fn from_points(points: &[Point]) -> Self {
        let mut field = Self::zeros();
        for (k, p) in points.iter().enumerate() {
            field.set(slot(k), p);
        }
        field
    }

    /// One point for each vertex, row by row.
    pub fn points(&self) -> Vec<Point> {
        (0..SIDE * SIDE).map(|k| self.at(slot(k))).collect()
    }

    /// The vector in a slot.
    #[inline(always)]
    pub fn at(&self, slot: usize) -> Point {
        let flat = self.rows.as_flattened().as_flattened();
        Point::new(flat[slot], flat[slot + WIDTH], flat[slot + 2 * WIDTH])
    }

    /// Replaces the vector in a slot.
    #[inline(always)]
    pub fn set(&mut self, slot: usize, p: &Point) {
        let flat = self.rows.as_flattened_mut().as_flattened_mut();
        flat[slot] = p.x;
        flat[slot + WIDTH] = p.y;
        flat[slot + 2 * WIDTH] = p.z;
    }

    /// Writes the transposed field into `other`.
    pub fn transpose_into(&self, other: &mut Self) {
        for (j, row) in self.rows.iter().enumerate() {
            for (axis, run) in row.iter().enumerate() {
                for (target, value) in other.rows.iter_mut().zip(run) {
                    target[axis][j] = *value;
                }
            }
        }
    }
}

/// Where vertex `k`'s x stands in a field; y and z follow at `WIDTH` and 2 `WIDTH`.
#[inline(always)]
pub fn slot(k: usize) -> usize {
    k / SIDE * 3 * WIDTH + k % SIDE
}

/// A distance to keep, and how far it gives: 0 is hard, 1/(stiffness · step²) soft.
#[derive(Debug, Clone, Copy)]
pub struct Link {
    /// The distance.
    pub rest: f32,
    /// XPBD's compliance.
    pub compliance: f32,
}

/// Projects the distances between column `i + A` of one row and column `i + B` of another, for `N` columns.
#[inline(always)]
pub fn link_rows<const A: usize, const B: usize, const N: usize>(
    link: Link,
    [a, b]: [&mut Row; 2],
    [wa, wb]: [&Run; 2],
) {
    let [ax, ay, az] = a;
    let [bx, by, bz] = b;
    for i in 0..N {
        let (p, q) = (i + A, i + B);
        let d = [bx[q] - ax[p], by[q] - ay[p], bz[q] - az[p]];
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            .max(1.0e-14)
            .sqrt();
        let give = (wa[p] + wb[q] + link.compliance).max(1.0e-6);
        let push = (length - link.rest) / (length * give);
        let (pa, pb) = (push * wa[p], push * wb[q]);
        ax[p] += d[0] * pa;
        ay[p] += d[1] * pa;
        az[p] += d[2] * pa;
        bx[q] -= d[0] * pb;
        by[q] -= d[1] * pb;
        bz[q] -= d[2] * pb;
    }
}

/// Projects the second differences over three rows at columns `i + A`, the middle of both, and `i + C`, for `N` columns.
#[inline(always)]
pub fn straighten_rows<const A: usize, const C: usize, const N: usize>(
    compliance: f32,
    [a, b, c]: [&mut Row; 3],
    [wa, wb, wc]: [&Run; 3],
) {
    for axis in 0..3 {
        let (a, b, c) = (&mut a[axis], &mut b[axis], &mut c[axis]);
        for i in 0..N {
            let (p, q, r) = (i + A, i + (A + C) / 2, i + C);
            let error = a[p] - 2.0 * b[q] + c[r];
            let push = error / (wa[p] + 4.0 * wb[q] + wc[r] + compliance);
            a[p] -= push * wa[p];
            b[q] += 2.0 * push * wb[q];
            c[r] -= push * wc[r];
        }
    }
}

/// Brings a row's points that are further from `pin` than `reach2` (squared, for each column) back to that distance.
pub fn tether_row(row: &mut Row, weight: &Run, pin: &Point, reach2: &Run) {
    let [x, y, z] = row;
    for i in 0..WIDTH {
        let d = [x[i] - pin.x, y[i] - pin.y, z[i] - pin.z];
        let far2 = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).max(1.0e-14);
        let back = weight[i] * (1.0 - (reach2[i] / far2).min(1.0).sqrt());
        x[i] -= back * d[0];
        y[i] -= back * d[1];
        z[i] -= back * d[2];
    }
}
