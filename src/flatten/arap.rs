//! As-rigid-as-possible parametrization (Liu, Zhang, Xu, Gotsman, Gortler 2008; paper eq. 1), local and global steps by turns.

use nalgebra::Matrix2;

use super::cholesky::Symmetric;
use super::{FlattenError, RestTriangle};
use crate::mesh::{TriMesh, Vec2};

/// Most rounds of local and global steps; the stop test usually ends them long before.
const ROUNDS: usize = 150;
/// Rounds end when one lowers the energy by less than this share.
const GAIN: f64 = 1e-4;

/// Minimises ½ Σ_f Σ_{e∈f} cot θₑ ‖e_uv − R_f e‖² from a start without flips; may flip faces. Returns the rounds, too.
pub fn minimise(
    mesh: &TriMesh,
    rest: &[RestTriangle],
    start: &[Vec2],
) -> Result<(Vec<Vec2>, usize), FlattenError> {
    let singular = |_| FlattenError::Singular {
        stage: "ARAP",
        vertices: mesh.positions.len(),
    };
    let mut matrix = Symmetric::zero(start.len());
    for (face, triangle) in mesh.faces.iter().zip(rest) {
        for k in 0..3 {
            matrix.add_spring(
                face[k] as usize,
                face[(k + 1) % 3] as usize,
                triangle.cotangent[k],
            );
        }
    }
    // The energy does not see translations: hold the first vertex where it is.
    matrix.add(0, 0, 1.0);
    let factor = matrix.factor().map_err(singular)?;

    let mut flat = start.to_vec();
    let (mut before, mut rounds) = (f64::INFINITY, 0);
    while rounds < ROUNDS {
        rounds += 1;
        let mut energy = 0.0;
        let mut rhs = vec![[0.0; 2]; flat.len()];
        rhs[0] = flat[0].into();
        for (face, triangle) in mesh.faces.iter().zip(rest) {
            let rotation = best_rotation(face, triangle, &flat);
            for k in 0..3 {
                let (a, b) = (face[k] as usize, face[(k + 1) % 3] as usize);
                let target = rotation * (triangle.corners[(k + 1) % 3] - triangle.corners[k]);
                energy += 0.5 * triangle.cotangent[k] * (flat[b] - flat[a] - target).norm_squared();
                let force = target * triangle.cotangent[k];
                for d in 0..2 {
                    rhs[b][d] += force[d];
                    rhs[a][d] -= force[d];
                }
            }
        }
        factor.solve(&mut rhs).map_err(singular)?;
        flat = rhs.into_iter().map(Vec2::from).collect();
        if before - energy <= GAIN * before.min(f64::MAX) {
            break;
        }
        before = energy;
    }
    Ok((flat, rounds))
}

/// The rotation that brings the rest triangle nearest to its image: the angle of Σ cot θₑ e eᵤᵥᵀ in closed form.
fn best_rotation(face: &[u32; 3], triangle: &RestTriangle, flat: &[Vec2]) -> Matrix2<f64> {
    let (mut cosine, mut sine) = (0.0, 0.0);
    for k in 0..3 {
        let e = triangle.corners[(k + 1) % 3] - triangle.corners[k];
        let image = flat[face[(k + 1) % 3] as usize] - flat[face[k] as usize];
        cosine += triangle.cotangent[k] * e.dot(&image);
        sine += triangle.cotangent[k] * e.perp(&image);
    }
    let norm = cosine.hypot(sine);
    if norm == 0.0 {
        return Matrix2::identity();
    }
    let (c, s) = (cosine / norm, sine / norm);
    Matrix2::new(c, -s, s, c)
}
