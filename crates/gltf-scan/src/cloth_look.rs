//! How the cloth around a hole looks: the textures of its materials, in every variant, as layers that a patch is to have.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::append::extension_list;
use super::scan::Scan;
use super::texture_slots::{self, SLOTS, TextureKind, TextureSlot};
use super::variants::{EXTENSION, MaterialChoices, VARIANTS, Variants, mapped_materials};

/// Most layers of a patch: a scan may have many variants.
const MOST_LAYERS: usize = 32;

/// What a sampler does with texture coordinates outside of 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TextureWrap {
    /// The image is repeated.
    #[default]
    Repeat,
    /// The image is repeated, every second time mirrored.
    Mirror,
    /// The texels at the border go on.
    Clamp,
}

/// Where a layer's texels come from in one material.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureSource {
    /// Index of the image; without one the layer is `factor` everywhere.
    pub image: Option<usize>,
    /// The set of texture coordinates.
    pub texcoords: usize,
    /// `KHR_texture_transform`: what u and v become, as rows of an affine map.
    pub transform: [[f32; 3]; 2],
    /// For u and v.
    pub wrap: [TextureWrap; 2],
    /// Multiplied with the linear texels; for normals and directions the first number scales x and y.
    pub factor: [f32; 4],
    /// The sampler of the texture.
    pub(crate) sampler: Option<usize>,
}

/// One image that a patch is to have.
#[derive(Debug, Clone, PartialEq)]
pub struct LookLayer {
    /// How its texels are read.
    pub kind: TextureKind,
    /// Per material of the look.
    pub sources: Vec<TextureSource>,
}

/// How the cloth around a hole looks.
#[derive(Debug, Clone, PartialEq)]
pub struct ClothLook {
    /// The material, as an index into the sources of every layer, of each part of the scan.
    pub material_of: BTreeMap<usize, usize>,
    /// The layers of all variants.
    pub layers: Vec<LookLayer>,
    /// The default first, then each variant that looks otherwise.
    pub(crate) choices: Vec<LookChoice>,
}

/// The look that a variant, or none, chooses.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LookChoice {
    /// Index of the variant; `None` is the default.
    pub variant: Option<usize>,
    pub layers: Vec<LayerUse>,
}

/// A layer in a place of a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LayerUse {
    /// Index into [`SLOTS`].
    pub slot: usize,
    /// Index into [`ClothLook::layers`].
    pub layer: usize,
    /// Whether the layer's sources have the material's factors in them.
    pub has_factors: bool,
}

/// Why the cloth's textures cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoLook {
    /// No material of the cloth has a texture.
    #[error("the cloth around the hole has no texture")]
    NoTexture,
    /// A texture in a place or of a kind that is not known.
    #[error("{pointer}: {detail}")]
    Unknown {
        /// The place in the scan.
        pointer: String,
        /// What is not known.
        detail: &'static str,
    },
    /// More layers than a patch can have.
    #[error(
        "the cloth around the hole has {found} different textures; at most {MOST_LAYERS} can be continued together"
    )]
    TooMany {
        /// How many.
        found: usize,
    },
}

impl Scan {
    /// How the cloth of these parts looks, for a patch that takes the material of `home`.
    ///
    /// # Errors
    /// Why its textures cannot be read.
    pub fn cloth_look(&self, parts: &[usize], home: usize) -> Result<ClothLook, NoLook> {
        let variants = Variants::of(self);
        let choices = |part: usize| {
            let part = &self.parts[part];
            match &variants {
                Some(variants) => variants.choices(self, part),
                None => MaterialChoices::of(part),
            }
        };
        let mut all: Vec<MaterialChoices> = vec![choices(home)];
        let mut material_of = BTreeMap::new();
        for part in parts.iter().filter(|part| **part < self.parts.len()) {
            let own = choices(*part);
            let at = all.iter().position(|known| *known == own);
            let at = at.unwrap_or_else(|| {
                all.push(own);
                all.len() - 1
            });
            material_of.insert(*part, at);
        }
        material_of.entry(home).or_insert(0);
        let mut mapped: Vec<usize> = all.iter().flat_map(|c| c.mapped.keys().copied()).collect();
        mapped.sort_unstable();
        mapped.dedup();
        let mut look = ClothLook {
            material_of,
            layers: Vec::new(),
            choices: Vec::new(),
        };
        for variant in [None].into_iter().chain(mapped.into_iter().map(Some)) {
            let chosen = all.iter().map(|choices| match variant {
                Some(variant) => choices.mapped.get(&variant).copied().or(choices.default),
                None => choices.default,
            });
            let layers = self.choice(&chosen.collect::<Vec<_>>(), &mut look.layers)?;
            look.choices.push(LookChoice { variant, layers });
        }
        match look.layers.len() {
            0 => Err(NoLook::NoTexture),
            found if found > MOST_LAYERS => Err(NoLook::TooMany { found }),
            _ => Ok(look),
        }
    }

    /// The index of a variant by its name.
    pub fn variant(&self, name: &str) -> Option<usize> {
        let names = extension_list(&self.json, EXTENSION, VARIANTS)?;
        (names.iter()).position(|it| it.get("name").and_then(Value::as_str) == Some(name))
    }

    /// The base colour and the emission of a part, without a variant or in one. Textures that cannot be read are left out.
    pub fn part_colours(&self, part: usize, variant: Option<usize>) -> [TextureSource; 2] {
        let part = &self.parts[part];
        let mapped = variant.and_then(|v| mapped_materials(self, part).get(&v).copied());
        let material = mapped.or(part.material);
        let object = material.and_then(|m| self.json.get("materials")?.get(m)?.as_object());
        [TextureKind::BaseColour, TextureKind::Colour].map(|kind| {
            // Of each kind the first is glTF's own.
            let slot = SLOTS.iter().find(|slot| slot.kind == kind);
            let source = slot.zip(object).map(|(slot, object)| {
                let factor = slot.factor(object);
                let info = texture_slots::at(object, slot.path);
                let read = info.and_then(|info| self.texture_source(info, factor).ok());
                read.unwrap_or_else(|| TextureSource::plain(factor))
            });
            let without = match kind {
                TextureKind::BaseColour => [1.0; 4],
                _ => [0.0; 4],
            };
            source.unwrap_or_else(|| TextureSource::plain(without))
        })
    }

    /// Where a part's normal map takes its texture coordinates from, without a variant or, if only a variant has one, in the first that has: what
    /// the directions of `TANGENT` belong to. Other maps of directions count as well. `None` if no material of the part has such a map.
    pub fn normal_places(&self, part: usize) -> Option<TexturePlaces> {
        let part = self.parts.get(part)?;
        let mapped = mapped_materials(self, part).into_values();
        let materials = part.material.into_iter().chain(mapped);
        let is_directed =
            |slot: &&TextureSlot| matches!(slot.kind, TextureKind::Normal | TextureKind::Direction);
        let mut infos = materials.filter_map(|material| {
            let object = self.json.get("materials")?.get(material)?.as_object()?;
            let mut slots = SLOTS.iter().filter(is_directed);
            slots.find_map(|slot| texture_slots::at(object, slot.path))
        });
        infos.next().map(TexturePlaces::of)
    }

    /// The layers of one choice of materials; those that are not known yet are added.
    fn choice(
        &self,
        materials: &[Option<usize>],
        layers: &mut Vec<LookLayer>,
    ) -> Result<Vec<LayerUse>, NoLook> {
        let none = Map::new();
        let objects: Vec<&Map<String, Value>> = materials
            .iter()
            .map(|material| {
                let of = material.and_then(|m| self.json.get("materials")?.get(m)?.as_object());
                of.unwrap_or(&none)
            })
            .collect();
        for (object, index) in objects.iter().zip(materials) {
            if let Some(place) = unknown_texture(object) {
                return Err(NoLook::Unknown {
                    pointer: format!("/materials/{}{place}", index.unwrap_or_default()),
                    detail: "a texture that darn does not know",
                });
            }
        }
        let mut used = Vec::new();
        for (slot, known) in SLOTS.iter().enumerate() {
            let infos = objects.iter().map(|o| texture_slots::at(o, known.path));
            let infos: Vec<Option<&Value>> = infos.collect();
            if infos.iter().all(Option::is_none) {
                continue;
            }
            let factors: Vec<[f32; 4]> = objects.iter().map(|o| known.factor(o)).collect();
            let has_factors = factors.iter().any(|f| *f != factors[0]);
            let sources = infos.iter().zip(&factors).map(|(info, factor)| {
                let factor = if has_factors { *factor } else { [1.0; 4] };
                match info {
                    Some(info) => self.texture_source(info, factor),
                    None => Ok(TextureSource::plain(factor)),
                }
            });
            let layer = LookLayer {
                kind: known.kind,
                sources: sources.collect::<Result<_, _>>()?,
            };
            let at = layers.iter().position(|known| *known == layer);
            let layer = at.unwrap_or_else(|| {
                layers.push(layer);
                layers.len() - 1
            });
            used.push(LayerUse {
                slot,
                layer,
                has_factors,
            });
        }
        Ok(used)
    }

    /// The image and the sampling of a texture info (glTF 2.0, 5.28).
    fn texture_source(&self, info: &Value, factor: [f32; 4]) -> Result<TextureSource, NoLook> {
        let number = |value: &Value| usize::try_from(value.as_u64()?).ok();
        let index = info.get("index").and_then(number);
        let pointer = format!("/textures/{}", index.unwrap_or_default());
        let unknown = |detail| NoLook::Unknown {
            pointer: pointer.clone(),
            detail,
        };
        let texture = index.and_then(|index| self.json.get("textures")?.get(index));
        let texture = texture.ok_or_else(|| unknown("is not there"))?;
        let webp = texture.pointer("/extensions/EXT_texture_webp/source");
        let image = webp.or_else(|| texture.get("source")).and_then(number);
        let image = image.ok_or_else(|| unknown("has no PNG, JPEG or WebP image"))?;
        let sampler = texture.get("sampler").and_then(number);
        let wrap = |key: &str| {
            let code = sampler.and_then(|s| self.json.get("samplers")?.get(s)?.get(key)?.as_u64());
            match code {
                Some(33071) => TextureWrap::Clamp,
                Some(33648) => TextureWrap::Mirror,
                _ => TextureWrap::Repeat,
            }
        };
        let places = TexturePlaces::of(info);
        Ok(TextureSource {
            image: Some(image),
            texcoords: places.texcoords,
            transform: places.transform,
            wrap: [wrap("wrapS"), wrap("wrapT")],
            factor,
            sampler,
        })
    }
}

/// Where a texture takes its texture coordinates from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexturePlaces {
    /// The set of texture coordinates.
    pub texcoords: usize,
    /// `KHR_texture_transform`, as in [`TextureSource`].
    pub transform: [[f32; 3]; 2],
}

impl TexturePlaces {
    /// Of a texture info (glTF 2.0, 5.28).
    fn of(info: &Value) -> Self {
        let moved = info.pointer("/extensions/KHR_texture_transform");
        let set = moved.and_then(|it| it.get("texCoord"));
        let set = set.or_else(|| info.get("texCoord")).and_then(Value::as_u64);
        let set = set.and_then(|set| usize::try_from(set).ok());
        Self {
            texcoords: set.unwrap_or(0),
            transform: moved.map_or(IDENTITY, transform),
        }
    }

    /// Texture coordinates as the image takes them.
    pub fn place(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        self.transform.map(|[a, b, c]| a * u + b * v + c)
    }
}

const IDENTITY: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

impl TextureSource {
    /// Without an image.
    fn plain(factor: [f32; 4]) -> Self {
        Self {
            image: None,
            texcoords: 0,
            transform: IDENTITY,
            wrap: Default::default(),
            factor,
            sampler: None,
        }
    }

    /// Texture coordinates as the image takes them.
    pub fn place(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        self.transform.map(|[a, b, c]| a * u + b * v + c)
    }
}

impl ClothLook {
    /// The look of a variant, or the default.
    pub(crate) fn choice(&self, variant: Option<usize>) -> Option<&LookChoice> {
        let own = self.choices.iter().find(|choice| choice.variant == variant);
        own.or_else(|| self.choices.first())
    }

    /// The images that its layers read.
    pub fn images(&self) -> impl Iterator<Item = usize> {
        let sources = self.layers.iter().flat_map(|layer| &layer.sources);
        sources.filter_map(|source| source.image)
    }
}

/// `KHR_texture_transform`: translation × rotation × scale.
fn transform(of: &Value) -> [[f32; 3]; 2] {
    let pair = |key: &str, default: f64| {
        let read = |k: usize| of.get(key).and_then(|list| list.get(k)?.as_f64());
        [0, 1].map(|k| read(k).unwrap_or(default))
    };
    let (offset, scale) = (pair("offset", 0.0), pair("scale", 1.0));
    let turn = of.get("rotation").and_then(Value::as_f64).unwrap_or(0.0);
    let (sin, cos) = turn.sin_cos();
    let rows = [
        [cos * scale[0], sin * scale[1], offset[0]],
        [-sin * scale[0], cos * scale[1], offset[1]],
    ];
    rows.map(|row| row.map(|x| x as f32))
}

/// The pointer in a material of a texture that is in none of the known places.
fn unknown_texture(material: &Map<String, Value>) -> Option<String> {
    fn walk<'v>(object: &'v Map<String, Value>, path: &mut Vec<&'v str>) -> Option<String> {
        for (key, value) in object {
            let Some(inner) = value.as_object() else {
                continue;
            };
            path.push(key);
            let is_texture = key.ends_with("Texture") && inner.contains_key("index");
            if is_texture && !SLOTS.iter().any(|slot| slot.path == path.as_slice()) {
                return Some(format!("/{}", path.join("/")));
            }
            if !is_texture && key != "extras" && path.len() < 4 {
                let found = walk(inner, path);
                if found.is_some() {
                    return found;
                }
            }
            path.pop();
        }
        None
    }
    walk(material, &mut Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Builder;
    use serde_json::json;

    fn square(material: Value) -> Scan {
        let mut out = Builder::square();
        out.json["materials"][0] = material;
        out.json["textures"] = json!([{"source": 3, "sampler": 0}, {"extensions": {"EXT_texture_webp": {"source": 4}}}, {"extensions": {"KHR_texture_basisu": {"source": 5}}}]);
        out.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648}]);
        Scan::read(out.glb(), &Default::default()).unwrap()
    }

    #[test]
    fn a_texture_is_read_with_its_sampler_transform_and_set() {
        let turn = std::f64::consts::FRAC_PI_2;
        let moved =
            json!({"rotation": turn, "offset": [0.25, 0.5], "scale": [2.0, 1.0], "texCoord": 2});
        let scan = square(json!({
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": moved}}},
            "emissiveTexture": {"index": 1, "texCoord": 1},
        }));
        let look = scan.cloth_look(&[0], 0).unwrap();
        let [base, glow] = &look.layers[..] else {
            panic!("{:?}", look.layers);
        };
        let source = &base.sources[0];
        assert_eq!((source.image, source.texcoords), (Some(3), 2));
        assert_eq!(source.wrap, [TextureWrap::Clamp, TextureWrap::Mirror]);
        // The specification's rotation turns counter-clockwise as seen in the image: u to −v.
        let [u, v] = source.place([0.5, 0.0]);
        assert!((u - 0.25).abs() < 1e-6 && (v + 0.5).abs() < 1e-6, "{u} {v}");
        assert_eq!(
            (glow.sources[0].image, glow.sources[0].texcoords),
            (Some(4), 1)
        );
    }

    #[test]
    fn what_cannot_be_continued_together_is_named() {
        let basis = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 2}}});
        let error = square(basis).cloth_look(&[0], 0).unwrap_err();
        assert_eq!(
            error.to_string(),
            "/textures/2: has no PNG, JPEG or WebP image"
        );
        let unknown = json!({"extensions": {"ACME_x": {"inner": {"dustTexture": {"index": 0}}}}});
        let error = square(unknown).cloth_look(&[0], 0).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("/materials/0/extensions/ACME_x/inner/dustTexture")
        );
        assert_eq!(
            square(json!({})).cloth_look(&[0], 0),
            Err(NoLook::NoTexture)
        );
    }
}
