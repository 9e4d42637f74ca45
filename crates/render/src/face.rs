//! The faces of a mesh that can be drawn.

use darn_geometry::mesh::TriMesh;

/// A face whose vertices exist and are finite.
#[derive(Debug, Clone, Copy)]
pub(super) struct DrawableFace {
    /// Its index in the mesh.
    pub face: usize,
    pub vertices: [usize; 3],
}

/// The faces of a mesh that can be drawn, in order.
pub(super) fn drawable_faces(mesh: &TriMesh) -> Vec<DrawableFace> {
    let is_finite = |&v: &u32| {
        mesh.positions
            .get(v as usize)
            .is_some_and(|p| p.iter().all(|c| c.is_finite()))
    };
    let all = mesh.faces.iter().enumerate();
    all.filter(|(_, f)| f.iter().all(is_finite))
        .map(|(face, f)| DrawableFace {
            face,
            vertices: f.map(|v| v as usize),
        })
        .collect()
}
