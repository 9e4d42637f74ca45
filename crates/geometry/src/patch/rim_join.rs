//! The patch joined with the scan triangles at its rim; strain limiting moves the patch and holds the scan.

use nalgebra::Matrix2;

use super::metric::PatchMetric;
use super::rest::RestMesh;
use super::triangulate::Triangulation;
use crate::flatten::Chart;
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};

/// A patch with the scan triangles that touch its rim. Order of the vertices: the patch's inner ones, its rim, the
/// scan's around it.
#[derive(Debug, Clone)]
pub(super) struct RimJoin {
    /// Rest positions in the plane of the chart, scene units.
    points: Vec<Vec2>,
    faces: Vec<[u32; 3]>,
    /// Inner vertices of the patch.
    free: usize,
    /// Positions of the rim and of the scan's vertices around it.
    held: Vec<Vec3>,
    /// Vertices of the rim.
    corners: usize,
    /// How far each triangle of the patch is stretched from the chart at rest; empty where none is.
    stretches: Vec<Matrix2<f64>>,
}

impl RimJoin {
    /// Joins a triangulated hole with its region; `rim` holds the region vertices of the hole's polygon.
    pub fn new(
        rim: &[u32],
        triangulation: &Triangulation,
        region: &Region,
        chart: &Chart,
    ) -> RimJoin {
        let corners = rim.len();
        let free = triangulation.points.len() - corners;
        let vertex = |v: u32| vertex(v, corners, free);
        let mut points = triangulation.points[corners..].to_vec();
        points.extend_from_slice(&triangulation.points[..corners]);
        let mut faces: Vec<[u32; 3]> = (triangulation.faces.iter())
            .map(|f| f.map(vertex))
            .collect();
        let position = |v: &u32| region.mesh.positions[*v as usize];
        let mut held: Vec<Vec3> = rim.iter().map(position).collect();

        let mut index = vec![u32::MAX; region.mesh.positions.len()];
        for (k, v) in rim.iter().enumerate() {
            index[*v as usize] = (free + k) as u32;
        }
        let touches = |f: &&[u32; 3]| f.iter().any(|v| index[*v as usize] != u32::MAX);
        let around: Vec<[u32; 3]> = region.mesh.faces.iter().filter(touches).copied().collect();
        for face in around {
            faces.push(face.map(|v| {
                let own = &mut index[v as usize];
                if *own == u32::MAX {
                    *own = points.len() as u32;
                    points.push(chart.flat[v as usize]);
                    held.push(position(&v));
                }
                *own
            }));
        }
        RimJoin {
            points,
            faces,
            free,
            held,
            corners,
            stretches: Vec::new(),
        }
    }

    /// The same with the lengths of a metric in the triangulated hole.
    pub fn with_metric(
        mut self,
        metric: &PatchMetric,
        triangulation: &Triangulation,
        chart: &Chart,
    ) -> RimJoin {
        let stretch = |f: &[u32; 3]| {
            let corners = f.iter().map(|v| triangulation.points[*v as usize]);
            metric.stretch(chart.frame.uv(corners.sum::<Vec2>() / 3.0))
        };
        self.stretches = triangulation.faces.iter().map(stretch).collect();
        self
    }

    /// All triangles at rest.
    pub fn rest(&self) -> RestMesh<'_> {
        RestMesh {
            points: &self.points,
            faces: &self.faces,
            free: self.free,
            stretches: &self.stretches,
        }
    }

    /// The index here of a vertex of the patch (whose rim comes first).
    pub fn vertex(&self, patch_vertex: u32) -> u32 {
        vertex(patch_vertex, self.corners, self.free)
    }

    /// Positions of all vertices, given those of the inner ones.
    pub fn with_inner(&self, mut inner: Vec<Vec3>) -> Vec<Vec3> {
        inner.extend_from_slice(&self.held);
        inner
    }

    /// Bytes of memory held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.points[..])
            + size_of_val(&self.faces[..])
            + size_of_val(&self.held[..])
            + size_of_val(&self.stretches[..])
    }
}

/// Moves the rim's vertices, first in a patch, behind its inner ones.
fn vertex(v: u32, corners: usize, free: usize) -> u32 {
    if (v as usize) < corners {
        v + free as u32
    } else {
        v - corners as u32
    }
}
