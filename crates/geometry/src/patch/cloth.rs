//! Strain limiting: the patch is brought back to the chart's lengths, as cloth would be, with its rim and the scan around it held.
//!
//! Projective dynamics (Bouaziz et al. 2014) on one sparse factor: every triangle asks for its rest shape within the strain limit,
//! every vertex for its bending, and a weak tether for what the network drew.

use nalgebra::{Matrix2, Matrix3x2};

use crate::cholesky::{Factor, NotPositive, Symmetric};
use crate::flatten::RestTriangle;
use crate::mesh::{Vec2, Vec3};

use super::anderson::Anderson;
use super::bending::{Bend, bends};
use super::pull::Pulls;

/// What the energy weighs; lengths are relative to the mean edge of the patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elastics {
    /// Singular values of a triangle's deformation are free within 1 ± this.
    pub strain: f64,
    /// Bending length: bends of a radius well above it cost less than strain.
    pub bending: f64,
    /// Share of the network's own curvature that counts as unbent; at the rim none does, so that the scan's own folds go on.
    pub rest_curvature: f64,
    /// Tether to the network's positions: the distance at which it pulls as much as a strain of 1, in mean edges.
    pub tether: f64,
    /// Most rounds of local and global steps.
    pub rounds: usize,
    /// Rounds end when no vertex moves farther than this in one, in mean edges.
    pub still: f64,
}

impl Default for Elastics {
    fn default() -> Self {
        Elastics {
            strain: 0.002,
            bending: 0.2,
            rest_curvature: 0.7,
            tether: 10.0,
            rounds: 300,
            still: 1e-3,
        }
    }
}

/// A piece of cloth: rest shape in the plane, the first `free` vertices may move.
#[derive(Debug, Clone, Copy)]
pub struct Sheet<'a> {
    /// Rest positions, scene units.
    pub rest: &'a [Vec2],
    /// Triangles, counter-clockwise at rest.
    pub faces: &'a [[u32; 3]],
    /// How many vertices, the first ones, may move.
    pub free: usize,
}

/// A sheet's energy, its matrix factored: what does not depend on where the sheet lies.
pub struct Fabric {
    triangles: Vec<Triangle>,
    bends: Vec<Bend>,
    /// A third of the area of the triangles around each free vertex.
    lumped: Vec<f64>,
    /// Mean edge length at rest.
    edge: f64,
    bending: f64,
    tether: f64,
    factor: Option<Factor>,
}

/// The constant part of the right-hand side: bends and tethers of one drawing, and what the held vertices contribute.
type Goal = Vec<[f64; 3]>;

/// Where strain limiting stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// Rounds of local and global steps.
    pub rounds: usize,
    /// Largest move of a vertex in the last round, in mean edges.
    pub moved: f64,
}

impl Fabric {
    /// Assembles and factors the energy of a sheet.
    ///
    /// # Errors
    /// `NotPositive` when the triangles at rest are degenerate.
    pub fn new(sheet: &Sheet, elastics: &Elastics) -> Result<Fabric, NotPositive> {
        let triangles: Vec<Triangle> = (sheet.faces.iter())
            .map(|f| Triangle::at_rest(f, sheet.rest))
            .collect();
        let edge = mean_edge(sheet);
        let areas: Vec<f64> = triangles.iter().map(|t| t.area).collect();
        let mut bends = bends(sheet, &areas);
        (bends.iter_mut()).for_each(|row| row.weight *= (elastics.bending * edge).powi(2));
        let mut lumped = vec![0.0; sheet.free];
        for triangle in &triangles {
            for v in triangle.face {
                if let Some(a) = lumped.get_mut(v as usize) {
                    *a += triangle.area / 3.0;
                }
            }
        }
        let mut fabric = Fabric {
            triangles,
            bends,
            lumped,
            edge,
            bending: elastics.bending,
            tether: elastics.tether,
            factor: None,
        };
        if sheet.free > 0 {
            fabric.factor = Some(fabric.matrix().factor()?);
        }
        Ok(fabric)
    }

    /// Whether the factor is that of these weights; the others do not enter it.
    pub fn fits(&self, elastics: &Elastics) -> bool {
        self.bending == elastics.bending && self.tether == elastics.tether
    }

    /// How many vertices, the first ones, may move.
    pub fn free(&self) -> usize {
        self.lumped.len()
    }

    /// Bytes held, about.
    pub fn bytes(&self) -> usize {
        let terms: usize = self.bends.iter().map(|row| row.terms.len()).sum();
        // The factor of such a matrix has some 60 entries a row, with their row numbers.
        size_of_val(&self.triangles[..])
            + size_of_val(&self.bends[..])
            + terms * size_of::<(u32, f64)>()
            + self.free() * (60 * 12 + 8)
    }

    /// The normal equations of all terms.
    fn matrix(&self) -> Symmetric {
        let free = self.free();
        let mut matrix = Symmetric::zero(free);
        let mut row = Vec::with_capacity(32);
        for bend in &self.bends {
            row.clear();
            row.extend(
                (bend.terms.iter())
                    .filter_map(|(v, c)| ((*v as usize) < free).then_some((*v as usize, *c))),
            );
            matrix.add_square(&row, bend.weight);
        }
        for triangle in &self.triangles {
            for a in 0..3 {
                for b in 0..=a {
                    let (i, j) = (triangle.face[a] as usize, triangle.face[b] as usize);
                    if i < free && j < free {
                        matrix.add(
                            i,
                            j,
                            triangle.area * triangle.gradient[a].dot(&triangle.gradient[b]),
                        );
                    }
                }
            }
        }
        let tether = self.tether_weight();
        (0..free).for_each(|v| matrix.add(v, v, tether * self.lumped[v]));
        matrix
    }

    fn tether_weight(&self) -> f64 {
        (self.tether * self.edge).powi(-2)
    }

    /// What the drawing `positions` asks for: its own place by the tether, a share of its bends, at free and at held vertices; and the held
    /// vertices' part of all terms.
    fn goal(&self, positions: &[Vec3], [at_free, at_held]: [f64; 2]) -> Goal {
        let free = self.free();
        let tether = self.tether_weight();
        let mut goal: Goal = (self.lumped.iter().zip(positions))
            .map(|(area, p)| (p * (tether * area)).into())
            .collect();
        let mut add = |v: u32, force: Vec3| {
            if let Some(g) = goal.get_mut(v as usize) {
                (0..3).for_each(|d| g[d] += force[d]);
            }
        };
        for bend in &self.bends {
            let sum = |own: fn(usize, usize) -> bool| -> Vec3 {
                (bend.terms.iter())
                    .filter(|(v, _)| own(*v as usize, free))
                    .map(|(v, c)| positions[*v as usize] * *c)
                    .sum()
            };
            let held = sum(|v, free| v >= free);
            let share = if (bend.vertex as usize) < free {
                at_free
            } else {
                at_held
            };
            let target = (held + sum(|v, free| v < free)) * share;
            for (v, c) in &bend.terms {
                add(*v, (target - held) * (bend.weight * c));
            }
        }
        for triangle in &self.triangles {
            for a in 0..3 {
                for b in (0..3).filter(|b| triangle.face[*b] as usize >= free) {
                    let weight = triangle.area * triangle.gradient[a].dot(&triangle.gradient[b]);
                    add(
                        triangle.face[a],
                        positions[triangle.face[b] as usize] * -weight,
                    );
                }
            }
        }
        goal
    }

    /// Moves the free vertices of `positions`, which hold a drawing, towards rest lengths.
    ///
    /// # Errors
    /// `NotPositive` when a step is not finite.
    pub fn relax(&self, positions: &mut [Vec3], elastics: &Elastics) -> Result<Rest, NotPositive> {
        let drawn = Drawn {
            goal: self.goal(positions, [elastics.rest_curvature, 0.0]),
            stretches: None,
        };
        self.settle(&drawn, positions, elastics, &Pulls::none())
    }

    /// Cloth that is at rest where it lies now: bends and strains as they are cost nothing, so that pulls to where it lies move nothing.
    pub fn at_rest(&self, positions: &[Vec3]) -> Drawn {
        let stretches = self.triangles.iter().map(|t| t.stretch(positions));
        Drawn {
            goal: self.goal(positions, [1.0, 1.0]),
            stretches: Some(stretches.collect()),
        }
    }

    /// Moves the free vertices of `positions` to where pulls and a drawing agree.
    ///
    /// # Errors
    /// `NotPositive` when a step is not finite.
    pub fn settle(
        &self,
        drawn: &Drawn,
        positions: &mut [Vec3],
        elastics: &Elastics,
        pulls: &Pulls,
    ) -> Result<Rest, NotPositive> {
        let mut rest = Rest {
            rounds: 0,
            moved: 0.0,
        };
        let Some(factor) = &self.factor else {
            return Ok(rest);
        };
        let mut ahead = Anderson::new(3 * self.free());
        let mut step = drawn.goal.clone();
        while rest.rounds < elastics.rounds {
            step.copy_from_slice(&drawn.goal);
            self.add_strain(&mut step, positions, (drawn, elastics.strain));
            factor.solve(&mut step)?;
            pulls.correct(&mut step);
            rest.rounds += 1;
            rest.moved = ahead.advance(positions, &step) / self.edge;
            if rest.moved < elastics.still {
                break;
            }
        }
        Ok(rest)
    }

    /// Adds what every triangle asks for: its deformation within the strain limit, or as it was drawn but for a turn.
    fn add_strain(&self, rhs: &mut [[f64; 3]], positions: &[Vec3], (drawn, strain): (&Drawn, f64)) {
        for (k, triangle) in self.triangles.iter().enumerate() {
            let [a, b, c] = triangle.face.map(|v| v as usize);
            if a.min(b).min(c) >= rhs.len() {
                continue;
            }
            let own = drawn.stretches.as_ref().map(|all| &all[k]);
            let wanted = match own {
                Some(stretch) => triangle.turned(positions, stretch),
                None => triangle.within(positions, strain),
            };
            let pull = wanted * triangle.area;
            for (v, gradient) in triangle.face.iter().zip(&triangle.gradient) {
                if let Some(force) = rhs.get_mut(*v as usize) {
                    let along = pull * gradient;
                    (0..3).for_each(|d| force[d] += along[d]);
                }
            }
        }
    }

    /// Solves with the energy's matrix, in place.
    ///
    /// # Errors
    /// `NotPositive` when the solution is not finite.
    pub fn solve<const K: usize>(&self, rhs: &mut [[f64; K]]) -> Result<(), NotPositive> {
        self.factor
            .as_ref()
            .map_or(Ok(()), |factor| factor.solve(rhs))
    }
}

/// What a drawing asks of its fabric.
pub struct Drawn {
    goal: Goal,
    /// Per triangle the stretch it wants to keep; none where the strain limit decides.
    stretches: Option<Vec<Matrix2<f64>>>,
}

/// A triangle at rest.
struct Triangle {
    face: [u32; 3],
    /// Gradients of the three hat functions.
    gradient: [Vec2; 3],
    area: f64,
}

impl Triangle {
    fn at_rest(face: &[u32; 3], rest: &[Vec2]) -> Triangle {
        let rest = RestTriangle::from_corners(face.map(|v| rest[v as usize]));
        Triangle {
            face: *face,
            gradient: rest.gradients(),
            area: rest.area,
        }
    }

    /// The deformation gradient: its columns are the images of the chart's axes.
    fn deformation(&self, positions: &[Vec3]) -> Matrix3x2<f64> {
        let [a, b, c] = self.face.map(|v| positions[v as usize]);
        let (ab, ac) = (b - a, c - a);
        // The gradients of the hat functions add up to zero.
        Matrix3x2::from_columns(&[
            ab * self.gradient[1].x + ac * self.gradient[2].x,
            ab * self.gradient[1].y + ac * self.gradient[2].y,
        ])
    }

    /// The deformation gradient with its singular values brought within 1 ± `strain`.
    fn within(&self, positions: &[Vec3], strain: f64) -> Matrix3x2<f64> {
        let f = self.deformation(positions);
        let limited = |square: f64| {
            let s = square.max(1e-12).sqrt();
            s.clamp(1.0 - strain, 1.0 + strain) / s
        };
        f * spectral(f.transpose() * f, limited)
    }

    /// S of the deformation gradient's polar decomposition F = R S.
    fn stretch(&self, positions: &[Vec3]) -> Matrix2<f64> {
        let f = self.deformation(positions);
        spectral(f.transpose() * f, |square| square.max(0.0).sqrt())
    }

    /// The deformation R S nearest to the present one, for a given S and any turn R.
    fn turned(&self, positions: &[Vec3], stretch: &Matrix2<f64>) -> Matrix3x2<f64> {
        let along = self.deformation(positions) * stretch;
        let inverse_root = |square: f64| square.max(1e-24).sqrt().recip();
        along * spectral(along.transpose() * along, inverse_root) * stretch
    }
}

/// g(C) of a symmetric 2×2 matrix by its eigenvalues.
fn spectral(c: Matrix2<f64>, g: impl Fn(f64) -> f64) -> Matrix2<f64> {
    let (mean, half) = (0.5 * (c[(0, 0)] + c[(1, 1)]), 0.5 * (c[(0, 0)] - c[(1, 1)]));
    // Not `hypot`: nothing here is near overflow, and this is asked for every triangle in every round.
    let radius = (half * half + c[(0, 1)] * c[(0, 1)]).sqrt();
    let (high, low) = (g(mean + radius), g(mean - radius));
    if radius <= 1e-12 * mean {
        return Matrix2::identity() * high;
    }
    // g(C) = ½(g₊ + g₋) I + ½(g₊ − g₋) (C − mean I) / radius
    (c - Matrix2::identity() * mean) * (0.5 * (high - low) / radius)
        + Matrix2::identity() * (0.5 * (high + low))
}

/// Mean edge length at rest.
fn mean_edge(sheet: &Sheet) -> f64 {
    let edges = (sheet.faces.iter()).flat_map(|f| {
        (0..3).map(|k| (sheet.rest[f[(k + 1) % 3] as usize] - sheet.rest[f[k] as usize]).norm())
    });
    edges.sum::<f64>() / (3 * sheet.faces.len()).max(1) as f64
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
        let sheet = Sheet {
            rest: &rest,
            faces: &faces,
            free,
        };
        let fabric = Fabric::new(&sheet, &elastics).unwrap();
        fabric.relax(&mut positions, &elastics).unwrap();
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
        let sheet = Sheet {
            rest: &rest,
            faces: &faces,
            free,
        };
        let fabric = Fabric::new(&sheet, &Elastics::default()).unwrap();
        fabric.relax(&mut positions, &Elastics::default()).unwrap();
        for (p, q) in positions.iter().zip(&before) {
            assert!((p - q).norm() < 1e-9);
        }
    }
}
