//! The cloth around a hole and its patch as the texture completion takes them: in the chart, with places in the scan's images.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::addition::DressedPatch;
use crate::laid_cloth::LaidCloth;
use darn_geometry::mesh::Vec2;
use darn_gltf_scan::{ClothLook, DecodedImage, Scan, ScanPart, TextureKind, TextureWrap};
use darn_texture::{
    Cloth, ContinuedPatch, CornerTexcoords, LayerKind, PatchChart, Source, SourceImage, Wrap,
};

/// The decoded images of a scan by their indices.
pub type Images = BTreeMap<usize, Arc<DecodedImage>>;

/// How far the directions of +u over the cloth may spread for the chart to be turned to them: the length of their mean.
const ALIGNED: f64 = 0.9;

/// A hole's cloth and patch as the texture completion takes them.
pub struct TextureCloth<'i> {
    /// The cloth around the hole.
    pub cloth: Cloth<'i>,
    /// The patch.
    pub patch: PatchChart,
    /// The patch with the scan's texture coordinates continued.
    pub continued: ContinuedPatch,
}

/// A set of texture coordinates after a transform, as one material reads it.
#[derive(PartialEq, Clone)]
struct PlacedSet {
    set: usize,
    transform: [[f32; 3]; 2],
}

impl<'i> TextureCloth<'i> {
    /// Lays out a hole's cloth. Faces whose corners belong to several parts are left out.
    pub fn of(
        laid: &LaidCloth,
        dressed: &DressedPatch,
        scan: &Scan,
        look: &ClothLook,
        images: &'i Images,
    ) -> TextureCloth<'i> {
        let mut sets: Vec<PlacedSet> = Vec::new();
        let layers = look.layers.iter();
        // Per layer, per material.
        let by_layer: Vec<Vec<Source<'i>>> = layers
            .map(|layer| {
                let sources = layer.sources.iter().map(|source| {
                    let set = PlacedSet {
                        set: source.texcoords,
                        transform: source.transform,
                    };
                    let at = sets.iter().position(|known| *known == set);
                    let texcoords = at.unwrap_or_else(|| {
                        sets.push(set);
                        sets.len() - 1
                    });
                    let image = source.image.and_then(|index| images.get(&index));
                    Source {
                        image: image.map(|image| SourceImage {
                            width: image.width,
                            height: image.height,
                            texels: image.texels(),
                        }),
                        texcoords,
                        wrap: source.wrap.map(wrap),
                        factor: source.factor,
                    }
                });
                sources.collect()
            })
            .collect();
        let materials = by_layer.first().map_or(0, Vec::len);
        let mut cloth = Cloth {
            layers: look.layers.iter().map(|layer| kind(layer.kind)).collect(),
            materials: (0..materials)
                .map(|m| by_layer.iter().map(|layer| layer[m]).collect())
                .collect(),
            texcoords: vec![Vec::new(); sets.len()],
            ..Cloth::default()
        };
        let mut parts = laid.sources.iter().flatten().map(|source| source.part);
        let is_coloured = parts.any(|p| !scan.parts[p].colors.is_empty());
        for (face, source) in laid.region.mesh.faces.iter().zip(&*laid.sources) {
            let Some(source) = source else { continue };
            let part = &scan.parts[source.part];
            let Some(material) = look.material_of.get(&source.part) else {
                continue;
            };
            if !source.corners.iter().all(|v| part.vertices.contains(v)) {
                continue;
            }
            cloth.faces.push(*face);
            cloth.material_of.push(*material as u32);
            for (all, set) in cloth.texcoords.iter_mut().zip(&sets) {
                all.push(source.corners.map(|v| set.of_vertex(part, v)));
            }
            if is_coloured {
                let colour = |v: u32| {
                    let first = part.colors.first();
                    first.map_or([1.0; 4], |set| set[(v - part.vertices.start) as usize])
                };
                cloth.colours.push(source.corners.map(colour));
            }
        }
        let turn = turn(&laid.flat, &cloth);
        let turned = |p: &Vec2| [turn[0] * p.x + turn[1] * p.y, turn[0] * p.y - turn[1] * p.x];
        cloth.flat = laid.flat.iter().map(turned).collect();
        let patch = PatchChart {
            flat: laid.patch_flat.iter().map(turned).collect(),
            faces: dressed.patch_faces.to_vec(),
        };
        let continued = continued(dressed, &patch, look, &sets, is_coloured);
        TextureCloth {
            cloth,
            patch,
            continued,
        }
    }
}

impl PlacedSet {
    fn of_vertex(&self, part: &ScanPart, vertex: u32) -> [f32; 2] {
        let set = part.texcoords.get(self.set);
        let own = set.map_or([0.0; 2], |set| set[(vertex - part.vertices.start) as usize]);
        self.of(own)
    }

    fn of(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        self.transform.map(|[a, b, c]| a * u + b * v + c)
    }
}

/// The patch as its continued texture coordinates show it.
fn continued(
    dressed: &DressedPatch,
    patch: &PatchChart,
    look: &ClothLook,
    sets: &[PlacedSet],
    is_coloured: bool,
) -> ContinuedPatch {
    let primitive = &dressed.primitive;
    let material = look.material_of.get(&primitive.material_of);
    let material = material.copied().unwrap_or_default() as u32;
    let corners = |values: &dyn Fn(usize) -> [f32; 2]| -> CornerTexcoords {
        let faces = primitive.faces.iter();
        faces.map(|f| f.map(|v| values(v as usize))).collect()
    };
    let texcoords = sets.iter().map(|set| {
        let own = primitive.texcoords.get(set.set);
        corners(&|v| set.of(own.map_or([0.0; 2], |own| own[v])))
    });
    let colours = primitive.colors.first().filter(|_| is_coloured);
    ContinuedPatch {
        flat: (dressed.vertex_of.iter())
            .map(|v| patch.flat[*v as usize])
            .collect(),
        faces: primitive.faces.clone(),
        material_of: vec![material; primitive.faces.len()],
        texcoords: texcoords.collect(),
        colours: colours.map_or_else(Vec::new, |set| {
            let faces = primitive.faces.iter();
            faces.map(|f| f.map(|v| set[v as usize])).collect()
        }),
    }
}

/// Cosine and sine of the direction of +u in the chart, where it is about the same over all of the cloth: rows of texels then stay
/// rows, and the chart keeps more of their detail. Otherwise no turn.
fn turn(flat: &[Vec2], cloth: &Cloth) -> [f64; 2] {
    const NONE: [f64; 2] = [1.0, 0.0];
    let first = cloth.materials.iter().find_map(|sources| {
        let with_image = sources.iter().find(|source| source.image.is_some());
        with_image.map(|source| source.texcoords)
    });
    let Some(set) = first.and_then(|set| cloth.texcoords.get(set)) else {
        return NONE;
    };
    let mut sum = Vec2::zeros();
    let mut weight = 0.0;
    for (face, texcoords) in cloth.faces.iter().zip(set) {
        let [a, b, c] = face.map(|v| flat[v as usize]);
        let [ta, tb, tc] = texcoords.map(|t| Vec2::from(t.map(f64::from)));
        let (e, f) = (b - a, c - a);
        let (s, t) = (tb - ta, tc - ta);
        let det = s.x * t.y - s.y * t.x;
        // ∂p/∂u, up to its length.
        let along = (e * t.y - f * s.y) * det.signum();
        let area = (e.x * f.y - e.y * f.x).abs();
        if let Some(unit) = along.try_normalize(f64::MIN_POSITIVE)
            && det != 0.0
        {
            sum += unit * area;
            weight += area;
        }
    }
    match sum.try_normalize(ALIGNED * weight) {
        Some(unit) if weight > 0.0 => [unit.x, unit.y],
        _ => NONE,
    }
}

fn wrap(of: TextureWrap) -> Wrap {
    match of {
        TextureWrap::Repeat => Wrap::Repeat,
        TextureWrap::Mirror => Wrap::Mirror,
        TextureWrap::Clamp => Wrap::Clamp,
    }
}

fn kind(of: TextureKind) -> LayerKind {
    match of {
        TextureKind::BaseColour => LayerKind::BaseColour,
        TextureKind::Colour => LayerKind::Colour,
        TextureKind::Normal => LayerKind::Normal,
        TextureKind::Direction => LayerKind::Direction,
        TextureKind::Data => LayerKind::Data,
    }
}
