//! Strain limiting: the patch is brought back to the chart's lengths, as cloth would be, with its rim and the scan around it held.
//!
//! Projective dynamics (Bouaziz et al. 2014) on one sparse factor: every triangle asks for its rest shape within the strain limit,
//! every vertex for its bending, and a weak tether for what the network drew.

use nalgebra::{Matrix2, Matrix3x2};

use crate::flatten::RestTriangle;
use crate::flatten::cholesky::{NotPositive, Symmetric};
use crate::mesh::{Vec2, Vec3};

/// What the energy weighs; lengths are relative to the mean edge of the patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elastics {
    /// Singular values of a triangle's deformation are free within 1 ± this.
    pub strain: f64,
    /// Bending length: bends of a radius well above it cost less than strain.
    pub bending: f64,
    /// Share of the network's own curvature that counts as unbent.
    pub rest_curvature: f64,
    /// Tether to the network's positions: the distance at which it pulls as much as a strain of 1, in mean edges.
    pub tether: f64,
    /// Rounds of local and global steps.
    pub rounds: usize,
}

impl Default for Elastics {
    fn default() -> Self {
        Elastics {
            strain: 0.002,
            bending: 0.25,
            rest_curvature: 0.25,
            tether: 100.0,
            rounds: 60,
        }
    }
}

/// A piece of cloth: rest shape in the plane, the first `free` vertices may move.
pub struct Sheet<'a> {
    /// Rest positions, scene units.
    pub rest: &'a [Vec2],
    /// Triangles, counter-clockwise at rest.
    pub faces: &'a [[u32; 3]],
    /// How many vertices, the first ones, may move.
    pub free: usize,
}

/// Moves the free vertices of `positions` towards rest lengths and returns the number of rounds done.
///
/// # Errors
/// `NotPositive` when the triangles at rest are degenerate.
pub fn relax(
    sheet: &Sheet,
    positions: &mut [Vec3],
    elastics: &Elastics,
) -> Result<usize, NotPositive> {
    if sheet.free == 0 {
        return Ok(0);
    }
    let triangles: Vec<Triangle> = (sheet.faces.iter())
        .map(|f| Triangle::at_rest(f, sheet.rest))
        .collect();
    let edge = mean_edge(&triangles);
    let mut bends = bending_rows(sheet, &triangles, positions, elastics);
    (bends.iter_mut()).for_each(|row| row.weight *= (elastics.bending * edge).powi(2));
    let tethers = tether_rows(
        sheet,
        &triangles,
        positions,
        (elastics.tether * edge).powi(-2),
    );

    let mut matrix = Symmetric::zero(sheet.free);
    let mut constant = vec![[0.0; 3]; sheet.free];
    for row in bends.iter().chain(&tethers) {
        row.add_to(&mut matrix, &mut constant, sheet.free, positions);
    }
    for (face, triangle) in sheet.faces.iter().zip(&triangles) {
        for c in 0..2 {
            let terms = (0..3)
                .map(|k| (face[k] as usize, triangle.gradient[k][c]))
                .collect();
            let row = Row {
                terms,
                weight: triangle.area,
                target: Vec3::zeros(),
            };
            row.add_to(&mut matrix, &mut constant, sheet.free, positions);
        }
    }
    let factor = matrix.factor()?;
    for _ in 0..elastics.rounds {
        let mut rhs = constant.clone();
        for (face, triangle) in sheet.faces.iter().zip(&triangles) {
            let pull = triangle.within(face, positions, elastics.strain) * triangle.area;
            for (v, gradient) in face.iter().zip(&triangle.gradient) {
                if let Some(force) = rhs.get_mut(*v as usize) {
                    let along = pull * gradient;
                    (0..3).for_each(|d| force[d] += along[d]);
                }
            }
        }
        factor.solve(&mut rhs)?;
        for (p, x) in positions.iter_mut().zip(&rhs) {
            *p = Vec3::from(*x);
        }
    }
    Ok(elastics.rounds)
}

/// One linear term of the energy: weight · ‖Σ cᵥ xᵥ − target‖².
struct Row {
    terms: Vec<(usize, f64)>,
    weight: f64,
    target: Vec3,
}

impl Row {
    /// Adds the term to the normal equations of the free vertices; the others stay where `positions` has them.
    fn add_to(
        &self,
        matrix: &mut Symmetric,
        rhs: &mut [[f64; 3]],
        free: usize,
        positions: &[Vec3],
    ) {
        let (moving, held): (Vec<_>, Vec<_>) = self.terms.iter().partition(|(v, _)| *v < free);
        let goal = held
            .iter()
            .fold(self.target, |goal, (v, c)| goal - positions[*v] * *c);
        matrix.add_square(&moving, self.weight);
        for (v, c) in moving {
            (0..3).for_each(|d| rhs[v][d] += self.weight * c * goal[d]);
        }
    }
}

/// A triangle at rest.
struct Triangle {
    rest: RestTriangle,
    /// Gradients of the three hat functions.
    gradient: [Vec2; 3],
    area: f64,
}

impl Triangle {
    fn at_rest(face: &[u32; 3], rest: &[Vec2]) -> Triangle {
        let rest = RestTriangle::from_corners(face.map(|v| rest[v as usize]));
        Triangle {
            gradient: rest.gradients(),
            area: rest.area,
            rest,
        }
    }

    /// The deformation gradient: columns are the images of the chart's axes.
    fn deformation(&self, face: &[u32; 3], positions: &[Vec3]) -> Matrix3x2<f64> {
        (0..3)
            .map(|k| positions[face[k] as usize] * self.gradient[k].transpose())
            .sum()
    }

    /// The deformation gradient with its singular values brought within 1 ± `strain`.
    fn within(&self, face: &[u32; 3], positions: &[Vec3], strain: f64) -> Matrix3x2<f64> {
        let f = self.deformation(face, positions);
        let limited = |square: f64| {
            let s = square.max(1e-12).sqrt();
            s.clamp(1.0 - strain, 1.0 + strain) / s
        };
        f * spectral(f.transpose() * f, limited)
    }
}

/// g(C) of a symmetric 2×2 matrix by its eigenvalues.
fn spectral(c: Matrix2<f64>, g: impl Fn(f64) -> f64) -> Matrix2<f64> {
    let (mean, half) = (0.5 * (c[(0, 0)] + c[(1, 1)]), 0.5 * (c[(0, 0)] - c[(1, 1)]));
    let radius = half.hypot(c[(0, 1)]);
    let (high, low) = (g(mean + radius), g(mean - radius));
    if radius <= 1e-12 * mean {
        return Matrix2::identity() * high;
    }
    // g(C) = ½(g₊ + g₋) I + ½(g₊ − g₋) (C − mean I) / radius
    (c - Matrix2::identity() * mean) * (0.5 * (high - low) / radius)
        + Matrix2::identity() * (0.5 * (high + low))
}

/// Triangles at rest flatter than this (doubled area ÷ longest edge squared) spoil the Laplacians of their corners.
const FLATTEST: f64 = 1e-3;

/// Discrete Laplacians (cotangent weights at rest, area-normalised) of the vertices whose fan is closed, as rows of weight area.
///
/// The cloth's own bends around the hole go on through its rim, because the rim's rows reach over it. Inner rows ask for a share of the
/// curvature that `positions` has now.
fn bending_rows(
    sheet: &Sheet,
    triangles: &[Triangle],
    positions: &[Vec3],
    elastics: &Elastics,
) -> Vec<Row> {
    let count = sheet.rest.len();
    let (mut area, mut angle, mut terms) =
        (vec![0.0; count], vec![0.0; count], vec![Vec::new(); count]);
    for (face, triangle) in sheet.faces.iter().zip(triangles) {
        for k in 0..3 {
            let (a, b, c) = (
                face[k] as usize,
                face[(k + 1) % 3] as usize,
                face[(k + 2) % 3] as usize,
            );
            let half = 0.5 * triangle.rest.cotangent[k];
            terms[a].extend([(b, half), (a, -half)]);
            terms[b].extend([(a, half), (b, -half)]);
            area[a] += triangle.area / 3.0;
            let (to_b, to_c) = (sheet.rest[b] - sheet.rest[a], sheet.rest[c] - sheet.rest[a]);
            let longest = to_b.norm_squared().max(to_c.norm_squared());
            // Where untangling the rim has turned a triangle of the scan over, there is no telling what unbent means.
            let sound = to_b.perp(&to_c) > FLATTEST * longest;
            angle[a] += if sound {
                to_b.perp(&to_c).atan2(to_b.dot(&to_c))
            } else {
                f64::NAN
            };
        }
    }
    let closed = |v: &usize| (angle[*v] - std::f64::consts::TAU).abs() < 1e-6;
    (0..count)
        .filter(closed)
        .map(|v| {
            let terms: Vec<(usize, f64)> = merged(std::mem::take(&mut terms[v]))
                .map(|(w, c)| (w, c / area[v]))
                .collect();
            let drawn: Vec3 = terms.iter().map(|(w, c)| positions[*w] * *c).sum();
            let share = if v < sheet.free {
                elastics.rest_curvature
            } else {
                0.0
            };
            Row {
                terms,
                weight: area[v],
                target: drawn * share,
            }
        })
        .collect()
}

/// Weak springs to where the free vertices are now.
fn tether_rows(sheet: &Sheet, triangles: &[Triangle], positions: &[Vec3], weight: f64) -> Vec<Row> {
    let mut area = vec![0.0; sheet.free];
    for (face, triangle) in sheet.faces.iter().zip(triangles) {
        for v in face {
            if let Some(a) = area.get_mut(*v as usize) {
                *a += triangle.area / 3.0;
            }
        }
    }
    (0..sheet.free)
        .map(|v| Row {
            terms: vec![(v, 1.0)],
            weight: weight * area[v],
            target: positions[v],
        })
        .collect()
}

/// Terms with their coefficients summed per vertex, in order of vertex.
fn merged(mut terms: Vec<(usize, f64)>) -> impl Iterator<Item = (usize, f64)> {
    terms.sort_by_key(|(v, _)| *v);
    terms.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    terms.into_iter()
}

/// Mean edge length at rest.
fn mean_edge(triangles: &[Triangle]) -> f64 {
    let edges = triangles
        .iter()
        .flat_map(|t| (0..3).map(|k| (t.rest.corners[(k + 1) % 3] - t.rest.corners[k]).norm()));
    edges.sum::<f64>() / (3 * triangles.len()).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat lattice of 2·n² triangles, unit edges, its border last so that it is held.
    fn lattice(n: usize) -> (Vec<Vec2>, Vec<[u32; 3]>, usize) {
        let inner = |i: usize, j: usize| i > 0 && j > 0 && i < n && j < n;
        let cells = || (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
        let order: Vec<(usize, usize)> = cells()
            .filter(|(i, j)| inner(*i, *j))
            .chain(cells().filter(|(i, j)| !inner(*i, *j)))
            .collect();
        let at = |i, j| order.iter().position(|c| *c == (i, j)).unwrap() as u32;
        let faces = (0..n)
            .flat_map(|j| (0..n).map(move |i| (i, j)))
            .flat_map(|(i, j)| {
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let rest = order
            .iter()
            .map(|(i, j)| Vec2::new(*i as f64, *j as f64))
            .collect();
        (rest, faces, (n - 1) * (n - 1))
    }

    #[test]
    fn a_sagging_lid_returns_to_its_lengths() {
        let (rest, faces, free) = lattice(8);
        let mut positions: Vec<Vec3> = rest.iter().map(|p| Vec3::new(p.x, p.y, 0.0)).collect();
        for p in &mut positions[..free] {
            p.z = -2.0;
            p.x += 0.4;
        }
        let elastics = Elastics {
            tether: 1e4,
            rest_curvature: 0.0,
            ..Elastics::default()
        };
        relax(
            &Sheet {
                rest: &rest,
                faces: &faces,
                free,
            },
            &mut positions,
            &elastics,
        )
        .unwrap();
        for face in &faces {
            for k in 0..3 {
                let (a, b) = (face[k] as usize, face[(k + 1) % 3] as usize);
                let r = (positions[a] - positions[b]).norm() / (rest[a] - rest[b]).norm();
                assert!((r - 1.0).abs() < 0.05, "{r}");
            }
        }
    }

    #[test]
    fn cloth_at_rest_stays() {
        let (rest, faces, free) = lattice(6);
        let mut positions: Vec<Vec3> = rest.iter().map(|p| Vec3::new(p.x, 2.0, p.y)).collect();
        let before = positions.clone();
        relax(
            &Sheet {
                rest: &rest,
                faces: &faces,
                free,
            },
            &mut positions,
            &Elastics::default(),
        )
        .unwrap();
        for (p, q) in positions.iter().zip(&before) {
            assert!((p - q).norm() < 1e-9);
        }
    }
}
