//! Tutte's embedding: the outer loop on a circle, every other vertex at the mean of its neighbours. It flips no face
//! (Tutte 1963).

use std::f64::consts::TAU;

use darn_budget::Budget;

use super::error::FlattenError;
use crate::cholesky::Symmetric;
use crate::mesh::region::Region;
use crate::mesh::{TriMesh, Vec2};

/// Embeds a region whose rim, if it has one, and holes are each closed by one virtual vertex joined to all of the loop.
///
/// The circle's circumference is the length of the outer loop, so the layout has about the right size.
///
/// # Errors
/// `Singular` when the system has no solution; `Exhausted`.
pub(super) fn embed(region: &Region, budget: &Budget) -> Result<Vec<Vec2>, FlattenError> {
    let Region { mesh, outer, .. } = region;
    let loops = std::iter::once(&region.rim).chain(&region.holes);
    let loops: Vec<&Vec<u32>> = loops.filter(|rim| !rim.is_empty()).collect();
    let count = mesh.positions.len();
    let fixed = circle(mesh, outer);
    let mut unknown = vec![usize::MAX; count + loops.len()];
    let free = (0..count + loops.len()).filter(|v| *v >= count || fixed[*v].is_none());
    let mut size = 0;
    for v in free {
        unknown[v] = size;
        size += 1;
    }

    let mut matrix = Symmetric::zero(size);
    let mut rhs = vec![[0.0; 2]; size];
    let mut join = |a: usize, b: usize| match (unknown[a], unknown[b]) {
        (usize::MAX, usize::MAX) => {}
        (i, usize::MAX) => pull(&mut matrix, &mut rhs, i, fixed[b]),
        (usize::MAX, j) => pull(&mut matrix, &mut rhs, j, fixed[a]),
        (i, j) => matrix.add_spring(i, j, 1.0),
    };
    for face in &mesh.faces {
        // Inner edges are added from both sides and weigh 2, boundary edges 1: any positive symmetric weights work.
        for k in 0..3 {
            join(face[k] as usize, face[(k + 1) % 3] as usize);
        }
    }
    for (k, rim) in loops.iter().enumerate() {
        rim.iter().for_each(|v| join(count + k, *v as usize));
    }
    let solved = matrix
        .factor(budget)
        .and_then(|factor| factor.solve(&mut rhs));
    solved.map_err(|e| FlattenError::unsolved(e, "Tutte", count))?;
    Ok((0..count)
        .map(|v| fixed[v].unwrap_or_else(|| rhs[unknown[v]].into()))
        .collect())
}

/// A spring of weight 1 from a free vertex to a fixed point.
fn pull(matrix: &mut Symmetric, rhs: &mut [[f64; 2]], i: usize, to: Option<Vec2>) {
    let to = to.unwrap_or_default();
    matrix.add(i, i, 1.0);
    rhs[i][0] += to.x;
    rhs[i][1] += to.y;
}

/// The outer loop on a circle by arc length, counter-clockwise; `None` for all other vertices.
fn circle(mesh: &TriMesh, outer: &[u32]) -> Vec<Option<Vec2>> {
    let length = |k: usize| {
        let (a, b) = (outer[k] as usize, outer[(k + 1) % outer.len()] as usize);
        (mesh.positions[a] - mesh.positions[b]).norm()
    };
    let total: f64 = (0..outer.len()).map(length).sum();
    let mut placed = vec![None; mesh.positions.len()];
    let mut along = 0.0;
    for (k, v) in outer.iter().enumerate() {
        let angle = TAU * along / total;
        placed[*v as usize] = Some(Vec2::new(angle.cos(), angle.sin()) * (total / TAU));
        along += length(k);
    }
    placed
}
