//! Where the inner vertices of a patch in space belong: on a surface whose mean curvature goes on from the cloth around.
//!
//! A surface of least bending that meets the cloth tangentially falls short of a sphere, and of a tube. So its
//! Laplacian is not made small, but close to that of a surface with a given mean curvature: the harmonic continuation
//! of the curvature around the hole (after Schneider and Kobbelt 2001, "Geometric fairing of irregular meshes for
//! free-form surface design"). Spheres, cylinders and planes come out as they are; a saddle nearly.

use darn_budget::Budget;

use super::Fairness;
use super::remesh::Sheet;
use crate::cholesky::Symmetric;
use crate::flatten::RestTriangle;
use crate::mesh::curvature::vertex_normals;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec3};
use crate::patch::PatchError;
use crate::patch::harmonic::HarmonicExtension;

/// Largest cotangent of an angle that counts; sharper angles count as this one (11°).
const SHARPEST: f64 = 5.0;
/// Rounds of smoothing of the cloth's mean curvature.
const SMOOTHINGS: usize = 3;
/// Nanoseconds of work a face in a step, without the factor.
const FACE_WORK: u64 = 1000;
/// The name of the stage in errors.
const STAGE: &str = "fairing";

/// The cloth around a hole, for fairing what lies in the hole.
pub(super) struct Fairing<'a> {
    region: &'a Region,
    /// Region vertices of the rim, in the sheet's order.
    rim: &'a [u32],
    /// Per region vertex its Laplacian along its normal (twice the mean curvature, 1 / scene unit), smoothed; `None` on
    /// borders.
    bends: Vec<Option<f64>>,
    /// What the surface is to be like.
    pub fairness: Fairness,
    budget: &'a Budget<'a>,
}

/// What the surface in the hole should be like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Bend {
    /// As little bent as possible.
    Least,
    /// Its mean curvature continues that of the cloth around.
    Continued,
}

/// The discrete Laplacian of a mesh: weights and lumped areas.
struct Laplacian {
    /// Per vertex its neighbours with their weights, then itself with minus their sum.
    rows: Vec<Vec<(u32, f64)>>,
    areas: Vec<f64>,
}

impl<'a> Fairing<'a> {
    /// Measures the cloth around a hole; `rim` holds the region vertices of the rim, in the order of the sheets to come.
    pub fn new(
        region: &'a Region,
        rim: &'a [u32],
        fairness: Fairness,
        budget: &'a Budget<'a>,
    ) -> Fairing<'a> {
        let mesh = &region.mesh;
        let (laplacian, closed) = (Laplacian::cotangent(mesh), closed_fans(mesh));
        let normals = vertex_normals(mesh);
        let bend = |v: usize| {
            let along = laplacian.at(v, &mesh.positions).dot(&normals[v]);
            (closed[v] && laplacian.areas[v] > 0.0).then(|| along / laplacian.areas[v])
        };
        let mut bends: Vec<Option<f64>> = (0..closed.len()).map(bend).collect();
        for _ in 0..SMOOTHINGS {
            let smooth = |v: usize| {
                let own = bends[v]?;
                let near = laplacian.rows[v].iter().filter(|(n, _)| *n as usize != v);
                let near: Vec<f64> = near.filter_map(|(n, _)| bends[*n as usize]).collect();
                let mean = near.iter().sum::<f64>() / near.len().max(1) as f64;
                Some(if near.is_empty() {
                    own
                } else {
                    0.5 * (own + mean)
                })
            };
            bends = (0..bends.len()).map(smooth).collect();
        }
        Fairing {
            region,
            rim,
            bends,
            fairness,
            budget,
        }
    }

    /// Moves the inner vertices of a sheet one step towards the surface; the largest distance that one moves along its
    /// normal, scene units.
    ///
    /// # Errors
    /// `Singular` when triangles are degenerate; `Exhausted`.
    pub fn step(&self, sheet: &mut Sheet, bend: Bend) -> Result<f64, PatchError> {
        let joined = self.joined(sheet);
        self.budget.spend(FACE_WORK * joined.faces.len() as u64)?;
        let laplacian = match self.fairness {
            Fairness::Curved => Laplacian::cotangent(&joined),
            Fairness::Plain => Laplacian::uniform(&joined),
        };
        let closed = closed_fans(&joined);
        let held = self.region.mesh.positions.len();
        let free = joined.positions.len() - held;
        if free == 0 {
            return Ok(0.0);
        }
        let normals = vertex_normals(&joined);
        let wanted = match bend {
            Bend::Least => vec![Vec3::zeros(); joined.positions.len()],
            Bend::Continued => self.wanted(&joined, &normals)?,
        };
        let mut matrix = Symmetric::zero(free);
        let mut rhs = vec![[0.0; 3]; free];
        let rim = self.rim.iter().map(|v| *v as usize);
        let mut row = Vec::with_capacity(16);
        for v in rim.chain(held..held + free).filter(|v| closed[*v]) {
            let area = laplacian.areas[v].max(f64::MIN_POSITIVE);
            row.clear();
            let mut constant = -wanted[v] * area;
            for (n, weight) in &laplacian.rows[v] {
                match (*n as usize).checked_sub(held) {
                    Some(place) => row.push((place, *weight)),
                    None => constant += joined.positions[*n as usize] * *weight,
                }
            }
            matrix.add_square(&row, 1.0 / area);
            for (place, weight) in &row {
                (0..3).for_each(|d| rhs[*place][d] -= weight * constant[d] / area);
            }
        }
        let factor = matrix
            .factor(self.budget)
            .map_err(PatchError::of_stage(STAGE))?;
        factor
            .solve(&mut rhs)
            .map_err(PatchError::of_stage(STAGE))?;
        let mut most = 0.0f64;
        let inner = sheet.mesh.positions[sheet.corners..].iter_mut();
        for ((p, solved), normal) in inner.zip(&rhs).zip(&normals[held..]) {
            let to = Vec3::from(*solved);
            most = most.max((to - *p).dot(normal).abs());
            *p = to;
        }
        Ok(most)
    }

    /// The region with a sheet in its hole: the region's vertices, then the sheet's inner ones.
    fn joined(&self, sheet: &Sheet) -> TriMesh {
        let mut joined = self.region.mesh.clone();
        let base = joined.positions.len() as u32;
        joined
            .positions
            .extend_from_slice(&sheet.mesh.positions[sheet.corners..]);
        let vertex = |v: u32| match self.rim.get(v as usize) {
            Some(own) => *own,
            None => base + v - sheet.corners as u32,
        };
        joined
            .faces
            .extend(sheet.mesh.faces.iter().map(|f| f.map(vertex)));
        joined
    }

    /// Per vertex the Laplacian that it should have: the continued curvature along its normal.
    fn wanted(&self, joined: &TriMesh, normals: &[Vec3]) -> Result<Vec<Vec3>, PatchError> {
        let held = self.region.mesh.positions.len();
        let mut asked: Vec<bool> = (0..joined.positions.len()).map(|v| v >= held).collect();
        self.rim.iter().for_each(|v| asked[*v as usize] = true);
        let faces: Vec<[u32; 3]> = (joined.faces.iter())
            .filter(|f| f.iter().any(|v| asked[*v as usize]))
            .copied()
            .collect();
        let mesh = joined.part(faces);
        // `part` numbers vertices by first use.
        let mut whole = Vec::with_capacity(mesh.positions.len());
        let mut seen = vec![false; joined.positions.len()];
        for v in joined
            .faces
            .iter()
            .filter(|f| f.iter().any(|v| asked[*v as usize]))
            .flatten()
        {
            if !std::mem::replace(&mut seen[*v as usize], true) {
                whole.push(*v as usize);
            }
        }
        let known = |v: usize| if asked[v] { None } else { self.bends[v] };
        let (mut vertices, mut values) = (Vec::new(), Vec::new());
        for (k, v) in (0u32..).zip(&whole) {
            if let Some(bend) = known(*v) {
                vertices.push(k);
                values.push([bend]);
            }
        }
        let mut wanted = vec![Vec3::zeros(); joined.positions.len()];
        if vertices.is_empty() {
            return Ok(wanted);
        }
        let continued = HarmonicExtension::on_surface(&mesh, &vertices, self.budget)
            .and_then(|extension| extension.extend(&values))
            .map_err(PatchError::of_stage(STAGE))?;
        for ([bend], v) in continued.iter().zip(&whole) {
            wanted[*v] = normals[*v] * *bend;
        }
        Ok(wanted)
    }
}

impl Laplacian {
    fn cotangent(mesh: &TriMesh) -> Laplacian {
        let mut areas = vec![0.0; mesh.positions.len()];
        let rest = RestTriangle::of(mesh);
        for (face, rest) in mesh.faces.iter().zip(&rest) {
            face.iter()
                .for_each(|v| areas[*v as usize] += rest.area / 3.0);
        }
        let weight = |f: usize, k: usize| 0.5 * rest[f].cotangent[k].clamp(-SHARPEST, SHARPEST);
        Self::weighted(mesh, weight, areas)
    }

    /// All neighbours weigh the same and all vertices have the same area, whatever the shapes of triangles.
    fn uniform(mesh: &TriMesh) -> Laplacian {
        Self::weighted(mesh, |_, _| 0.5, vec![1.0; mesh.positions.len()])
    }

    /// The Laplacian with these weights of the edges from corner k of a face to the next, which add up for both faces.
    fn weighted(
        mesh: &TriMesh,
        weight_of: impl Fn(usize, usize) -> f64,
        areas: Vec<f64>,
    ) -> Laplacian {
        let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); mesh.positions.len()];
        for (f, face) in mesh.faces.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                let weight = weight_of(f, k);
                for (from, to) in [(a, b), (b, a)] {
                    let row = &mut rows[from as usize];
                    match row.iter_mut().find(|(v, _)| *v == to) {
                        Some((_, sum)) => *sum += weight,
                        None => row.push((to, weight)),
                    }
                }
            }
        }
        for (v, row) in (0u32..).zip(&mut rows) {
            let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
            row.push((v, -sum));
        }
        Laplacian { rows, areas }
    }

    /// The Laplacian of the positions at a vertex, times its area.
    fn at(&self, vertex: usize, positions: &[Vec3]) -> Vec3 {
        let each = self.rows[vertex].iter();
        each.map(|(v, weight)| positions[*v as usize] * *weight)
            .sum()
    }
}

/// Per vertex whether triangles surround it.
fn closed_fans(mesh: &TriMesh) -> Vec<bool> {
    let mut sides: Vec<(u32, u32)> = (mesh.faces.iter())
        .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])])
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect();
    sides.sort_unstable();
    let mut closed = vec![false; mesh.positions.len()];
    mesh.faces
        .iter()
        .flatten()
        .for_each(|v| closed[*v as usize] = true);
    for side in sides.chunk_by(|a, b| a == b).filter(|side| side.len() == 1) {
        let (a, b) = side[0];
        (closed[a as usize], closed[b as usize]) = (false, false);
    }
    closed
}
