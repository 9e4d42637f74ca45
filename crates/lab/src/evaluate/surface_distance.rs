//! How far points are from a surface.

use darn_geometry::mesh::nearest::nearest_on_triangle;
use darn_geometry::mesh::{TriMesh, Vec3};
use rstar::{AABB, PointDistance, RTree, RTreeObject};

/// The triangles of a mesh, by place.
pub(super) struct Surface(RTree<Triangle>);

struct Triangle([Vec3; 3]);

impl RTreeObject for Triangle {
    type Envelope = AABB<[f64; 3]>;

    fn envelope(&self) -> Self::Envelope {
        let [a, b, c] = self.0;
        AABB::from_corners(a.inf(&b).inf(&c).into(), a.sup(&b).sup(&c).into())
    }
}

impl PointDistance for Triangle {
    fn distance_2(&self, point: &[f64; 3]) -> f64 {
        let point = Vec3::from(*point);
        (point - nearest_on_triangle(&point, &self.0)).norm_squared()
    }
}

impl Surface {
    /// The surface of a mesh.
    pub fn of(mesh: &TriMesh) -> Surface {
        let all = (0..mesh.faces.len()).map(|f| Triangle(mesh.triangle(f)));
        Surface(RTree::bulk_load(all.collect()))
    }

    /// The distance of a point, scene units; infinite where there are no triangles.
    pub fn distance(&self, point: &Vec3) -> f64 {
        let point = <[f64; 3]>::from(*point);
        let nearest = self.0.nearest_neighbor(&point);
        nearest.map_or(f64::INFINITY, |triangle| triangle.distance_2(&point).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::mesh::shapes::sheet;

    #[test]
    fn a_point_is_as_far_from_a_sheet_as_it_is_above_or_beside_it() {
        let flat = Surface::of(&sheet(8, |_, _| true, |u, v| Vec3::new(u, v, 0.0)));
        for (point, distance) in [
            (Vec3::new(0.31, 0.77, 0.4), 0.4),
            (Vec3::new(0.31, 0.77, 0.0), 0.0),
            (Vec3::new(1.3, 0.5, -0.4), 0.5),
            (Vec3::new(-3.0, -4.0, 0.0), 5.0),
        ] {
            assert!((flat.distance(&point) - distance).abs() < 1e-12, "{point}");
        }
        let nothing = Surface::of(&TriMesh::default());
        assert_eq!(nothing.distance(&Vec3::zeros()), f64::INFINITY);
    }
}
