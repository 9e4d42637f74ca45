//! How far from the cloth a point of a request may lie.

use std::cell::OnceCell;

use darn_geometry::mesh::{TriMesh, diagonal};

/// The largest distance of a request's point from what it names: the scan's diagonal. Nobody who points at a place on a scan is farther off.
pub struct PointLimit<'a> {
    mesh: &'a TriMesh,
    /// Scene units; a pass over the vertices, made for the first point.
    diagonal: OnceCell<f64>,
}

impl<'a> PointLimit<'a> {
    /// For points of requests about a mesh.
    pub fn of(mesh: &'a TriMesh) -> PointLimit<'a> {
        PointLimit {
            mesh,
            diagonal: OnceCell::new(),
        }
    }

    /// Why a point that lies so far from `what` it names is refused, if it is; `name` is the member that has it.
    pub fn check(&self, name: &str, distance: f64, what: &str) -> Result<(), String> {
        let limit = *self.diagonal.get_or_init(|| diagonal(&self.mesh.positions));
        // What is no number is far, too.
        match distance <= limit {
            true => Ok(()),
            false => Err(format!(
                "`{name}` lies {distance:.4} from the nearest {what}; the limit is the scan's diagonal, {limit:.4}"
            )),
        }
    }
}
