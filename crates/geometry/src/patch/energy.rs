//! The strain energy of the patch and the scan triangles at its rim, with its matrix factored.
//!
//! Terms (projective dynamics, Bouaziz et al. 2014): every triangle wants a deformation within the strain limit, every
//! vertex its target curvature, and weak tethers lead to the positions that the grid gave.

use darn_budget::Budget;
use nalgebra::Matrix2;

use super::bending::{BendingTerm, bending_terms};
use super::deformation::StrainTriangle;
use super::rest::RestMesh;
use crate::cholesky::{Factor, SolveError, Symmetric};
use crate::mesh::Vec3;

/// Weights of the strain energy and when its minimisation ends. Lengths are in mean edges of the patch and the
/// triangles at its rim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrainOptions {
    /// The singular values of a triangle's deformation cost nothing within 1 ± this; where the patch's metric is stretched from the chart, within as
    /// much more.
    pub max_strain: f64,
    /// Bends of a radius well above this cost less than strain.
    pub bending_length: f64,
    /// Share of the grid's own curvature that costs nothing inside the patch. At the rim all curvature costs, so that
    /// the folds of the scan continue.
    pub rest_curvature: f64,
    /// The distance at which the tether to the grid's positions pulls as much as a strain of 1.
    pub tether_length: f64,
    /// Most rounds of local and global steps.
    pub max_rounds: usize,
    /// Rounds end when no vertex moves farther than this in one.
    pub tolerance: f64,
}

impl Default for StrainOptions {
    fn default() -> Self {
        StrainOptions {
            max_strain: 0.002,
            bending_length: 0.2,
            rest_curvature: 0.7,
            tether_length: 10.0,
            max_rounds: 300,
            tolerance: 1e-3,
        }
    }
}

/// Nanoseconds of work a triangle in a round, without the solution.
const FACE_WORK: u64 = 100;

/// The energy of a rest mesh, its matrix factored; independent of where the mesh lies.
pub(super) struct StrainEnergy {
    triangles: Vec<StrainTriangle>,
    bends: Vec<BendingTerm>,
    /// A third of the area of the triangles around each free vertex, scene units squared.
    lumped: Vec<f64>,
    /// Mean edge length at rest, scene units.
    mean_edge: f64,
    bending_length: f64,
    tether_length: f64,
    /// None when no vertex is free.
    factor: Option<Factor>,
}

/// What the terms of an energy aim at.
pub(super) struct StrainTarget {
    /// Constant part of the right-hand side, per free vertex: bends, tethers and the held vertices' part of all terms.
    constant: Vec<[f64; 3]>,
    /// The stretch that each triangle is to keep; without it the strain limit decides.
    stretches: Option<Vec<Matrix2<f64>>>,
}

impl StrainTarget {
    /// Constant part of the right-hand side, per free vertex.
    pub fn constant(&self) -> &[[f64; 3]] {
        &self.constant
    }
}

impl StrainEnergy {
    /// Assembles and factors the energy of a rest mesh.
    ///
    /// # Errors
    /// `NotPositive` when the triangles at rest are degenerate; `Exhausted`.
    pub fn new(
        rest: &RestMesh,
        options: &StrainOptions,
        budget: &Budget,
    ) -> Result<StrainEnergy, SolveError> {
        let triangle = |(k, face)| match rest.stretches.get(k) {
            Some(by) => StrainTriangle::stretched(face, rest.points, by),
            None => StrainTriangle::new(face, rest.points),
        };
        let triangles: Vec<StrainTriangle> =
            (rest.faces.iter().enumerate()).map(triangle).collect();
        let mean_edge = rest.mean_edge();
        let areas: Vec<f64> = triangles.iter().map(|t| t.area).collect();
        let mut bends = bending_terms(rest, &areas);
        (bends.iter_mut())
            .for_each(|bend| bend.weight *= (options.bending_length * mean_edge).powi(2));
        let mut lumped = vec![0.0; rest.free];
        for triangle in &triangles {
            for v in triangle.face {
                if let Some(a) = lumped.get_mut(v as usize) {
                    *a += triangle.area / 3.0;
                }
            }
        }
        let mut energy = StrainEnergy {
            triangles,
            bends,
            lumped,
            mean_edge,
            bending_length: options.bending_length,
            tether_length: options.tether_length,
            factor: None,
        };
        if rest.free > 0 {
            energy.factor = Some(energy.matrix().factor(budget)?);
        }
        Ok(energy)
    }

    /// About the nanoseconds that a round of limiting strain takes.
    pub fn round_work(&self) -> u64 {
        let solve = self.factor.as_ref().map_or(0, |f| f.solve_work(3));
        FACE_WORK * self.triangles.len() as u64 + solve
    }

    /// About the nanoseconds that one solution with a single right-hand side takes.
    pub fn solve_work(&self) -> u64 {
        self.factor.as_ref().map_or(0, |f| f.solve_work(1))
    }

    /// Whether the factor holds for these options; only two of them enter it.
    pub fn fits(&self, options: &StrainOptions) -> bool {
        self.bending_length == options.bending_length && self.tether_length == options.tether_length
    }

    /// How many vertices, the first ones, may move.
    pub fn free(&self) -> usize {
        self.lumped.len()
    }

    /// Mean edge length at rest, scene units.
    pub fn mean_edge(&self) -> f64 {
        self.mean_edge
    }

    /// Bytes of memory held, about.
    pub fn bytes(&self) -> usize {
        let terms: usize = self.bends.iter().map(|bend| bend.terms.len()).sum();
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
        (self.tether_length * self.mean_edge).powi(-2)
    }

    /// The constant part of the right-hand side for tethers to `positions`; of the curvature there, a share costs
    /// nothing: `at_free` at free vertices, `at_held` at held ones.
    fn constant(&self, positions: &[Vec3], at_free: f64, at_held: f64) -> Vec<[f64; 3]> {
        let free = self.free();
        let tether = self.tether_weight();
        let mut constant: Vec<[f64; 3]> = (self.lumped.iter().zip(positions))
            .map(|(area, p)| (p * (tether * area)).into())
            .collect();
        let mut add = |v: u32, force: Vec3| {
            if let Some(g) = constant.get_mut(v as usize) {
                (0..3).for_each(|d| g[d] += force[d]);
            }
        };
        for bend in &self.bends {
            let sum_of = |vertices: std::ops::Range<usize>| -> Vec3 {
                (bend.terms.iter())
                    .filter(|(v, _)| vertices.contains(&(*v as usize)))
                    .map(|(v, c)| positions[*v as usize] * *c)
                    .sum()
            };
            let held = sum_of(free..usize::MAX);
            let share = if (bend.vertex as usize) < free {
                at_free
            } else {
                at_held
            };
            let target = (held + sum_of(0..free)) * share;
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
        constant
    }

    /// The target of a patch read off the grid: near `positions`, with a share of their curvature and lengths within
    /// the strain limit.
    pub fn target_near(&self, positions: &[Vec3], options: &StrainOptions) -> StrainTarget {
        StrainTarget {
            constant: self.constant(positions, options.rest_curvature, 0.0),
            stretches: None,
        }
    }

    /// The target of a patch that is at rest at `positions`: its bends and strains there cost nothing, so that a pull
    /// to where its point already lies moves nothing.
    pub fn target_at(&self, positions: &[Vec3]) -> StrainTarget {
        let stretches = self.triangles.iter().map(|t| t.stretch(positions));
        StrainTarget {
            constant: self.constant(positions, 1.0, 1.0),
            stretches: Some(stretches.collect()),
        }
    }

    /// Adds the deformation that every triangle wants to the right-hand side: the nearest within the strain limit or,
    /// where the target has stretches, the nearest rotation of its stretch.
    pub fn add_strain(
        &self,
        rhs: &mut [[f64; 3]],
        positions: &[Vec3],
        target: &StrainTarget,
        max_strain: f64,
    ) {
        for (k, triangle) in self.triangles.iter().enumerate() {
            let [a, b, c] = triangle.face.map(|v| v as usize);
            if a.min(b).min(c) >= rhs.len() {
                continue;
            }
            let wanted = match &target.stretches {
                Some(stretches) => triangle.rotated(positions, &stretches[k]),
                None => triangle.limited(positions, max_strain),
            };
            let weighted = wanted * triangle.area;
            for (v, gradient) in triangle.face.iter().zip(&triangle.gradient) {
                if let Some(force) = rhs.get_mut(*v as usize) {
                    let along = weighted * gradient;
                    (0..3).for_each(|d| force[d] += along[d]);
                }
            }
        }
    }

    /// Solves with the energy's matrix, in place: one row of right-hand sides per free vertex.
    ///
    /// # Errors
    /// `NotPositive` when the solution is not finite.
    pub fn solve<const K: usize>(&self, rhs: &mut [[f64; K]]) -> Result<(), SolveError> {
        self.factor
            .as_ref()
            .map_or(Ok(()), |factor| factor.solve(rhs))
    }
}
