//! A patch together with the triangles of the scan that touch its rim, which are held: what strain limiting works on.

use super::PatchError;
use super::cloth::{Elastics, Sheet, relax};
use super::triangulate::Triangulation;
use crate::flatten::Chart;
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};

/// A patch sewn to the scan's edge. Vertices in order: the patch's inner ones, its rim, the scan's around it.
pub struct Hem {
    rest: Vec<Vec2>,
    faces: Vec<[u32; 3]>,
    free: usize,
    /// Positions of the rim and of the scan's vertices around it.
    held: Vec<Vec3>,
}

impl Hem {
    /// Sews a triangulated hole to the region; `rim` holds the region vertices of its polygon.
    pub fn around(rim: &[u32], tiled: &Triangulation, region: &Region, chart: &Chart) -> Hem {
        let corners = rim.len();
        let free = tiled.points.len() - corners;
        let place = |v: u32| {
            if (v as usize) < corners {
                v + free as u32
            } else {
                v - corners as u32
            }
        };
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
        }
    }

    /// Relaxes the inner vertices from where they are drawn; also the rounds that took.
    ///
    /// # Errors
    /// `Singular` when triangles degenerate.
    pub fn relax(
        &self,
        inner: Vec<Vec3>,
        elastics: &Elastics,
    ) -> Result<(Vec<Vec3>, usize), PatchError> {
        let mut positions = inner;
        positions.extend_from_slice(&self.held);
        let sheet = Sheet {
            rest: &self.rest,
            faces: &self.faces,
            free: self.free,
        };
        let rounds = relax(&sheet, &mut positions, elastics)
            .map_err(|_| PatchError::Singular { stage: "strain" })?;
        positions.truncate(self.free);
        Ok((positions, rounds))
    }
}
