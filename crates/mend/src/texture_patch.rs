//! The primitive of a patch in its own images, or with the scan's texture coordinates continued.

use std::sync::Arc;

use darn_geometry::mesh::Vec3;
use darn_gltf_scan::{OwnTexture, PatchAppearance, PatchPrimitive};

use crate::addition::{DressedPatch, PatchSource};
use crate::hole_report::FilledHole;
use crate::texture::OwnImages;

impl PatchSource<'_> {
    /// The patch in its own images.
    pub fn in_own_images(
        &self,
        filled: &FilledHole,
        dressed: &DressedPatch,
        own: &OwnImages,
    ) -> PatchPrimitive {
        let appearance = OwnTexture {
            look: Arc::clone(&own.look),
            width: own.texture.width,
            height: own.texture.height,
            layers: Arc::clone(&own.layers),
        };
        let positions = points(&filled.patch.positions);
        let tangents = darn_texture::tangents(&own.chart, &positions, &points(&dressed.normals));
        let columns: Vec<Vec<f64>> = (own.texture.texcoords.iter().zip(&tangents))
            .map(|(place, tangent)| place.iter().chain(tangent).map(|x| f64::from(*x)).collect())
            .collect();
        let (primitive, columns) = self.undivided(filled, dressed, &columns);
        let number = |row: &Vec<f64>, k: usize| row.get(k).copied().unwrap_or_default() as f32;
        let places = columns.iter().map(|row| [0, 1].map(|k| number(row, k)));
        let tangents = columns
            .iter()
            .filter(|_| appearance.has_normals())
            .map(|row| [2, 3, 4, 5].map(|k| number(row, k)));
        PatchPrimitive {
            texcoords: vec![places.collect()],
            tangents: tangents.collect(),
            ..with(primitive, PatchAppearance::Own(appearance))
        }
    }

    /// The patch with the scan's texture coordinates continued, and tangents where its material has a normal map.
    pub fn continued(&self, filled: &FilledHole, dressed: DressedPatch) -> PatchPrimitive {
        let primitive = dressed.primitive;
        let map = self.scan.normal_places(primitive.material_of);
        let set = map.and_then(|map| Some((map, primitive.texcoords.get(map.texcoords)?)));
        let tangents = set.map_or_else(Vec::new, |(map, set)| {
            // Images begin at the top: v goes down, while normal maps have +y upward (glTF 2.0, 3.9.3).
            let flat = set.iter().map(|place| {
                let [u, v] = map.place(*place);
                [f64::from(u), -f64::from(v)]
            });
            let chart = darn_texture::PatchChart {
                flat: flat.collect(),
                faces: primitive.faces.clone(),
            };
            let positions = points(&filled.patch.positions);
            let vertices = dressed.vertex_of.iter();
            let positions: Vec<[f64; 3]> = vertices.map(|v| positions[*v as usize]).collect();
            darn_texture::tangents(&chart, &positions, &points(&primitive.normals))
        });
        PatchPrimitive {
            tangents,
            ..primitive
        }
    }
}

fn points(of: &[Vec3]) -> Vec<[f64; 3]> {
    of.iter().map(|p| [p.x, p.y, p.z]).collect()
}

/// A primitive of another appearance.
pub fn with(primitive: PatchPrimitive, appearance: PatchAppearance) -> PatchPrimitive {
    PatchPrimitive {
        appearance,
        ..primitive
    }
}

/// Per vertex of a patch nothing of its own.
pub fn no_columns(dressed: &DressedPatch) -> Vec<Vec<f64>> {
    vec![Vec::new(); dressed.normals.len()]
}

/// A patch with the mean of its colours at every vertex.
pub fn flat_colours(mut primitive: PatchPrimitive) -> PatchPrimitive {
    for set in &mut primitive.colors {
        let count = set.len().max(1) as f64;
        let mean = [0, 1, 2, 3].map(|k: usize| {
            let sum: f64 = set.iter().map(|colour| f64::from(colour[k])).sum();
            (sum / count) as f32
        });
        set.fill(mean);
    }
    primitive
}
