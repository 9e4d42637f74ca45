//! A patch together with the triangles of the scan that touch its rim, which are held: what strain limiting works on.

use super::triangulate::Triangulation;
use crate::flatten::Chart;
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};

use super::cloth::Sheet;

/// A patch sewn to the scan's edge. Vertices in order: the patch's inner ones, its rim, the scan's around it.
#[derive(Debug, Clone)]
pub(super) struct Hem {
    rest: Vec<Vec2>,
    faces: Vec<[u32; 3]>,
    free: usize,
    /// Positions of the rim and of the scan's vertices around it.
    held: Vec<Vec3>,
    /// Vertices of the rim.
    corners: usize,
}

impl Hem {
    /// Sews a triangulated hole to the region; `rim` holds the region vertices of its polygon.
    pub fn around(rim: &[u32], tiled: &Triangulation, region: &Region, chart: &Chart) -> Hem {
        let corners = rim.len();
        let free = tiled.points.len() - corners;
        let place = |v: u32| place(v, corners, free);
        let mut rest = tiled.points[corners..].to_vec();
        rest.extend_from_slice(&tiled.points[..corners]);
        let mut faces: Vec<[u32; 3]> = tiled.faces.iter().map(|f| f.map(place)).collect();
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
                let place = &mut index[v as usize];
                if *place == u32::MAX {
                    *place = rest.len() as u32;
                    rest.push(chart.flat[v as usize]);
                    held.push(position(&v));
                }
                *place
            }));
        }
        Hem {
            rest,
            faces,
            free,
            held,
            corners,
        }
    }

    /// The cloth in its rest shape.
    pub fn sheet(&self) -> Sheet<'_> {
        Sheet {
            rest: &self.rest,
            faces: &self.faces,
            free: self.free,
        }
    }

    /// Where a vertex of the patch (its rim first) comes in the hem.
    pub fn place(&self, patch_vertex: u32) -> u32 {
        place(patch_vertex, self.corners, self.free)
    }

    /// Positions of all vertices, given the inner ones'.
    pub fn with_inner(&self, mut inner: Vec<Vec3>) -> Vec<Vec3> {
        inner.extend_from_slice(&self.held);
        inner
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.rest[..]) + size_of_val(&self.faces[..]) + size_of_val(&self.held[..])
    }
}

fn place(v: u32, corners: usize, free: usize) -> u32 {
    if (v as usize) < corners {
        v + free as u32
    } else {
        v - corners as u32
    }
}
