//! Vectors on the vertices of a sheet, stored by row and by axis, and constraints that are projected for whole rows at once.
//!
//! A row is three arrays of `WIDTH` numbers, so that the compiler turns a constraint between two rows into vector instructions. Constraints
//! along a row are constraints between rows of the transposed field. Columns from `SIDE` on are padding that nothing reads.

use super::lattice::{SIDE, Vec3f};

/// Columns of a row: `SIDE`, padded to a multiple of eight.
pub(super) const WIDTH: usize = 56;

/// One number for every column of a row.
pub(super) type AxisRow = [f32; WIDTH];
/// x, y and z of a row.
pub(super) type FieldRow = [AxisRow; 3];

/// A vector for every vertex of a sheet.
#[derive(Debug, Clone)]
pub(super) struct VertexField {
    /// `SIDE` rows.
    pub rows: Vec<FieldRow>,
}

/// The inverse mass of every vertex, 0 where it is pinned, by row.
pub(super) type InverseMasses = Vec<AxisRow>;

impl VertexField {
    /// All zero.
    pub(super) fn zeros() -> Self {
        Self {
            rows: vec![[[0.0; WIDTH]; 3]; SIDE],
        }
    }

    /// From one point for each vertex, row by row.
    pub(super) fn from_points(points: &[Vec3f]) -> Self {
        let mut field = Self::zeros();
        for (k, p) in points.iter().enumerate() {
            field.set(slot(k), p);
        }
        field
    }

    /// One point for each vertex, row by row.
    pub(super) fn points(&self) -> Vec<Vec3f> {
        (0..SIDE * SIDE).map(|k| self.at(slot(k))).collect()
    }

    /// The vector in a slot.
    #[inline(always)]
    pub(super) fn at(&self, slot: usize) -> Vec3f {
        let flat = self.rows.as_flattened().as_flattened();
        Vec3f::new(flat[slot], flat[slot + WIDTH], flat[slot + 2 * WIDTH])
    }

    /// Replaces the vector in a slot.
    #[inline(always)]
    pub(super) fn set(&mut self, slot: usize, p: &Vec3f) {
        let flat = self.rows.as_flattened_mut().as_flattened_mut();
        flat[slot] = p.x;
        flat[slot + WIDTH] = p.y;
        flat[slot + 2 * WIDTH] = p.z;
    }

    /// Writes the transposed field into `other`.
    pub(super) fn transpose_into(&self, other: &mut Self) {
        for (j, row) in self.rows.iter().enumerate() {
            for (axis, run) in row.iter().enumerate() {
                for (target, value) in other.rows.iter_mut().zip(run) {
                    target[axis][j] = *value;
                }
            }
        }
    }
}

/// Index of vertex `k`'s x in a flattened field; y and z follow at `WIDTH` and 2 `WIDTH`.
#[inline(always)]
pub(super) fn slot(k: usize) -> usize {
    k / SIDE * 3 * WIDTH + k % SIDE
}

/// The inverse mass of the vertex in a slot.
pub(super) fn inverse_mass(masses: &InverseMasses, slot: usize) -> f32 {
    masses[slot / (3 * WIDTH)][slot % WIDTH]
}

/// A distance between two vertices that a projection restores.
#[derive(Debug, Clone, Copy)]
pub(super) struct DistanceConstraint {
    /// The distance, metres.
    pub rest: f32,
    /// XPBD's compliance: 0 is hard, 1/(stiffness · step²) soft.
    pub compliance: f32,
}

/// One row that a constraint moves, and the inverse masses of its vertices.
pub(super) struct WeightedRow<'a> {
    /// Positions.
    pub row: &'a mut FieldRow,
    /// Inverse masses.
    pub masses: &'a AxisRow,
}

/// Projects the distances between column `i + A` of one row and column `i + B` of another, for `N` columns.
#[inline(always)]
pub(super) fn link_rows<const A: usize, const B: usize, const N: usize>(
    constraint: DistanceConstraint,
    a: WeightedRow,
    b: WeightedRow,
) {
    let (wa, wb) = (a.masses, b.masses);
    let [ax, ay, az] = a.row;
    let [bx, by, bz] = b.row;
    for i in 0..N {
        let (p, q) = (i + A, i + B);
        let d = [bx[q] - ax[p], by[q] - ay[p], bz[q] - az[p]];
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            .max(1.0e-14)
            .sqrt();
        let give = (wa[p] + wb[q] + constraint.compliance).max(1.0e-6);
        let push = (length - constraint.rest) / (length * give);
        let (pa, pb) = (push * wa[p], push * wb[q]);
        ax[p] += d[0] * pa;
        ay[p] += d[1] * pa;
        az[p] += d[2] * pa;
        bx[q] -= d[0] * pb;
        by[q] -= d[1] * pb;
        bz[q] -= d[2] * pb;
    }
}

/// Projects the second differences over three rows at column `i + A` of the first, `i + C` of the last and the column halfway between
/// them, for `N` columns.
#[inline(always)]
pub(super) fn straighten_rows<const A: usize, const C: usize, const N: usize>(
    compliance: f32,
    first: WeightedRow,
    middle: WeightedRow,
    last: WeightedRow,
) {
    let (wa, wb, wc) = (first.masses, middle.masses, last.masses);
    for axis in 0..3 {
        let (a, b, c) = (
            &mut first.row[axis],
            &mut middle.row[axis],
            &mut last.row[axis],
        );
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

/// Moves vertices of a row that are further from `pin` than the square root of their `reach2` back to that distance.
pub(super) fn tether_row(row: &mut FieldRow, masses: &AxisRow, pin: &Vec3f, reach2: &AxisRow) {
    let [x, y, z] = row;
    for i in 0..WIDTH {
        let d = [x[i] - pin.x, y[i] - pin.y, z[i] - pin.z];
        let far2 = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).max(1.0e-14);
        let back = masses[i] * (1.0 - (reach2[i] / far2).min(1.0).sqrt());
        x[i] -= back * d[0];
        y[i] -= back * d[1];
        z[i] -= back * d[2];
    }
}
