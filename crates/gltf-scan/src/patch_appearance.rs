//! How a patch looks: as the cloth that goes on, in images of its own, in one colour, or plain.

use std::sync::Arc;

use serde_json::{Map, Value, json};

use super::cloth_look::{ClothLook, LayerUse};
use super::texture_slots::{self, SLOTS, TextureKind, TextureSlot};

/// Grey of a patch without colour, linear.
const PLAIN_GREY: f64 = 0.5;

/// How a patch looks.
#[derive(Debug, Clone, Default)]
pub enum PatchAppearance {
    /// As the cloth at its rim: material, texture coordinates and colours go on.
    #[default]
    Continued,
    /// In images of its own. Its only set of texture coordinates lies in them, and it has no colours at its vertices.
    Own(OwnTexture),
    /// In one colour, without texture coordinates and colours at its vertices: per layer of the look the mean of the cloth's texels,
    /// linear.
    Flat(Arc<ClothLook>, Vec<[f32; 4]>),
    /// Grey, without texture coordinates and colours at its vertices.
    Plain,
}

/// Images of a patch's own.
#[derive(Debug, Clone)]
pub struct OwnTexture {
    /// What the images are.
    pub look: Arc<ClothLook>,
    /// Columns of every image.
    pub width: u32,
    /// Rows of every image.
    pub height: u32,
    /// Per layer of the look: `width` × `height` texels, row by row.
    pub layers: Arc<Vec<Vec<[u8; 4]>>>,
}

impl PatchAppearance {
    /// How many sets of texture coordinates and of colours such a patch has, where the cloth has so many.
    pub(super) fn sets(&self, cloth: [usize; 2]) -> [usize; 2] {
        match self {
            Self::Continued => cloth,
            Self::Own(_) => [1, 0],
            Self::Flat(..) | Self::Plain => [0, 0],
        }
    }

    /// The images, if it has its own.
    pub fn own(&self) -> Option<&OwnTexture> {
        match self {
            Self::Own(own) => Some(own),
            _ => None,
        }
    }
}

impl OwnTexture {
    /// The layer of the base colour, without a variant.
    pub(super) fn base_colour(&self) -> Option<usize> {
        let choice = self.look.choice(None)?;
        let is_base = |used: &&LayerUse| {
            let slot = SLOTS.get(used.slot);
            slot.is_some_and(|slot| slot.kind == TextureKind::BaseColour)
        };
        choice.layers.iter().find(is_base).map(|used| used.layer)
    }

    /// Whether a material has a texture that needs tangents.
    pub fn has_normals(&self) -> bool {
        let mut layers = self.look.layers.iter();
        layers.any(|it| matches!(it.kind, TextureKind::Normal | TextureKind::Direction))
    }
}

/// What makes a copy of the cloth's material that of a patch.
pub(super) struct MaterialStyle<'p> {
    /// Different styles have different numbers.
    pub number: usize,
    pub kind: StyleKind<'p>,
}

/// The kinds of styles, by the appearances of patches.
pub(super) enum StyleKind<'p> {
    Continued,
    /// The look, and the texture of each of its layers.
    Own(&'p ClothLook, Vec<usize>),
    Flat(&'p ClothLook, &'p [[f32; 4]]),
    Plain,
}

impl MaterialStyle<'_> {
    /// The variants, beside those that are mapped on the cloth of the patch's own material, in which it looks otherwise.
    pub fn variants(&self) -> impl Iterator<Item = usize> {
        let look = match &self.kind {
            StyleKind::Own(look, _) | StyleKind::Flat(look, _) => Some(look),
            StyleKind::Continued | StyleKind::Plain => None,
        };
        let choices = look.into_iter().flat_map(|look| &look.choices);
        choices.filter_map(|choice| choice.variant)
    }

    /// Changes a copy of the cloth's material in a variant to the patch's.
    pub fn apply(&self, material: &mut Map<String, Value>, variant: Option<usize>) {
        let layers = |look: &ClothLook| {
            let choice = look.choice(variant);
            choice.map_or_else(Vec::new, |choice| choice.layers.clone())
        };
        match &self.kind {
            StyleKind::Continued => {}
            StyleKind::Own(look, textures) => {
                for used in layers(look) {
                    if let Some(texture) = textures.get(used.layer) {
                        set_texture(material, used, *texture);
                    }
                }
            }
            StyleKind::Flat(look, means) => {
                for used in layers(look) {
                    if let Some(mean) = means.get(used.layer) {
                        set_mean(material, used, *mean);
                    }
                }
            }
            StyleKind::Plain => set_plain(material),
        }
    }
}

/// Puts a texture of the patch's own in a place of its material.
fn set_texture(material: &mut Map<String, Value>, used: LayerUse, texture: usize) {
    let Some(slot) = SLOTS.get(used.slot) else {
        return;
    };
    let old = texture_slots::at(material, slot.path).and_then(Value::as_object);
    let mut info = old.cloned().unwrap_or_default();
    info.insert("index".into(), json!(texture));
    info.shift_remove("texCoord");
    if let Some(extensions) = info.get_mut("extensions").and_then(Value::as_object_mut) {
        extensions.shift_remove("KHR_texture_transform");
        if extensions.is_empty() {
            info.shift_remove("extensions");
        }
    }
    texture_slots::set(material, slot.path, Value::Object(info));
    if used.has_factors {
        slot.set_factors(material, [1.0; 4]);
    }
}

/// Puts the mean of a texture in place of it.
fn set_mean(material: &mut Map<String, Value>, used: LayerUse, mean: [f32; 4]) {
    let Some(slot) = SLOTS.get(used.slot) else {
        return;
    };
    let own = match used.has_factors {
        true => [1.0; 4],
        false => slot.factor(material),
    };
    texture_slots::remove(material, slot.path);
    if !matches!(slot.kind, TextureKind::Normal | TextureKind::Direction) {
        slot.set_factors(material, [0, 1, 2, 3].map(|k: usize| own[k] * mean[k]));
    }
}

/// Leaves of a material what is not its look.
fn set_plain(material: &mut Map<String, Value>) {
    material.retain(|key, _| ["name", "extras", "doubleSided"].contains(&key.as_str()));
    let [grey, opaque] = [PLAIN_GREY, 1.0];
    let pbr = json!({
        "baseColorFactor": [grey, grey, grey, opaque],
        "metallicFactor": 0.0,
        "roughnessFactor": 1.0,
    });
    material.insert("pbrMetallicRoughness".into(), pbr);
}

impl TextureSlot {
    /// Sets the numbers of a material that multiply the texture's texels.
    fn set_factors(&self, material: &mut Map<String, Value>, values: [f32; 4]) {
        // Four digits: no reader needs more.
        let number = |channel: &usize| (f64::from(values[*channel]) * 1e4).round() / 1e4;
        for factor in self.factors {
            let all: Vec<f64> = factor.channels.iter().map(number).collect();
            let value = match all[..] {
                [one] => json!(one),
                _ => json!(all),
            };
            texture_slots::set(material, factor.path, value);
        }
    }
}
