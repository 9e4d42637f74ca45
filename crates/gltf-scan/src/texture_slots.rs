//! The places of a glTF material that take a texture, and the factors that multiply what it says.

use serde_json::{Map, Value};

/// How the texels of a texture are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum TextureKind {
    /// sRGB colour and linear alpha, multiplied by the vertices' colours.
    BaseColour,
    /// sRGB colour and linear alpha.
    Colour,
    /// Tangent-space normals.
    Normal,
    /// A direction in the tangent plane in red and green, and its strength in blue.
    Direction,
    /// Linear numbers.
    Data,
}

/// A place of a material that takes a texture.
#[derive(Debug)]
pub(super) struct TextureSlot {
    /// Path of the texture's info in the material.
    pub path: &'static [&'static str],
    pub kind: TextureKind,
    /// Numbers of the material that multiply channels of the texels.
    pub factors: &'static [Factor],
}

/// A number or a list of numbers that multiplies channels of a texture's texels.
#[derive(Debug)]
pub(super) struct Factor {
    pub path: &'static [&'static str],
    /// The channel that each number multiplies.
    pub channels: &'static [usize],
    /// The number where the material has none.
    pub default: f64,
}

const fn slot(
    path: &'static [&'static str],
    kind: TextureKind,
    factors: &'static [Factor],
) -> TextureSlot {
    TextureSlot {
        path,
        kind,
        factors,
    }
}

const fn factor(path: &'static [&'static str], channels: &'static [usize], default: f64) -> Factor {
    Factor {
        path,
        channels,
        default,
    }
}

const PBR: &str = "pbrMetallicRoughness";
const EXT: &str = "extensions";
const SHEEN: &str = "KHR_materials_sheen";
const CLEARCOAT: &str = "KHR_materials_clearcoat";
const SPECULAR: &str = "KHR_materials_specular";
const TRANSMISSION: &str = "KHR_materials_transmission";
const DIFFUSE_TRANSMISSION: &str = "KHR_materials_diffuse_transmission";
const VOLUME: &str = "KHR_materials_volume";
const IRIDESCENCE: &str = "KHR_materials_iridescence";
const ANISOTROPY: &str = "KHR_materials_anisotropy";
const GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// All places that glTF 2.0 and its ratified material extensions have. The factors of a normal texture scale x and y. What
/// cannot be said as a factor of a texel (`occlusionTexture.strength`, `anisotropyStrength`, and `thicknessFactor`, a length) stays in the material.
pub(super) static SLOTS: &[TextureSlot] = &[
    slot(
        &[PBR, "baseColorTexture"],
        TextureKind::BaseColour,
        &[factor(&[PBR, "baseColorFactor"], &[0, 1, 2, 3], 1.0)],
    ),
    slot(
        &[PBR, "metallicRoughnessTexture"],
        TextureKind::Data,
        &[
            factor(&[PBR, "roughnessFactor"], &[1], 1.0),
            factor(&[PBR, "metallicFactor"], &[2], 1.0),
        ],
    ),
    slot(
        &["normalTexture"],
        TextureKind::Normal,
        &[factor(&["normalTexture", "scale"], &[0], 1.0)],
    ),
    slot(&["occlusionTexture"], TextureKind::Data, &[]),
    slot(
        &["emissiveTexture"],
        TextureKind::Colour,
        &[factor(&["emissiveFactor"], &[0, 1, 2], 0.0)],
    ),
    slot(
        &[EXT, GLOSSINESS, "diffuseTexture"],
        TextureKind::BaseColour,
        &[factor(
            &[EXT, GLOSSINESS, "diffuseFactor"],
            &[0, 1, 2, 3],
            1.0,
        )],
    ),
    slot(
        &[EXT, GLOSSINESS, "specularGlossinessTexture"],
        TextureKind::Colour,
        &[
            factor(&[EXT, GLOSSINESS, "specularFactor"], &[0, 1, 2], 1.0),
            factor(&[EXT, GLOSSINESS, "glossinessFactor"], &[3], 1.0),
        ],
    ),
    slot(
        &[EXT, SHEEN, "sheenColorTexture"],
        TextureKind::Colour,
        &[factor(&[EXT, SHEEN, "sheenColorFactor"], &[0, 1, 2], 0.0)],
    ),
    slot(
        &[EXT, SHEEN, "sheenRoughnessTexture"],
        TextureKind::Data,
        &[factor(&[EXT, SHEEN, "sheenRoughnessFactor"], &[3], 0.0)],
    ),
    slot(
        &[EXT, CLEARCOAT, "clearcoatTexture"],
        TextureKind::Data,
        &[factor(&[EXT, CLEARCOAT, "clearcoatFactor"], &[0], 0.0)],
    ),
    slot(
        &[EXT, CLEARCOAT, "clearcoatRoughnessTexture"],
        TextureKind::Data,
        &[factor(
            &[EXT, CLEARCOAT, "clearcoatRoughnessFactor"],
            &[1],
            0.0,
        )],
    ),
    slot(
        &[EXT, CLEARCOAT, "clearcoatNormalTexture"],
        TextureKind::Normal,
        &[factor(
            &[EXT, CLEARCOAT, "clearcoatNormalTexture", "scale"],
            &[0],
            1.0,
        )],
    ),
    slot(
        &[EXT, SPECULAR, "specularTexture"],
        TextureKind::Data,
        &[factor(&[EXT, SPECULAR, "specularFactor"], &[3], 1.0)],
    ),
    slot(
        &[EXT, SPECULAR, "specularColorTexture"],
        TextureKind::Colour,
        &[factor(
            &[EXT, SPECULAR, "specularColorFactor"],
            &[0, 1, 2],
            1.0,
        )],
    ),
    slot(
        &[EXT, TRANSMISSION, "transmissionTexture"],
        TextureKind::Data,
        &[factor(
            &[EXT, TRANSMISSION, "transmissionFactor"],
            &[0],
            0.0,
        )],
    ),
    slot(
        &[EXT, DIFFUSE_TRANSMISSION, "diffuseTransmissionTexture"],
        TextureKind::Data,
        &[factor(
            &[EXT, DIFFUSE_TRANSMISSION, "diffuseTransmissionFactor"],
            &[3],
            0.0,
        )],
    ),
    slot(
        &[EXT, DIFFUSE_TRANSMISSION, "diffuseTransmissionColorTexture"],
        TextureKind::Colour,
        &[factor(
            &[EXT, DIFFUSE_TRANSMISSION, "diffuseTransmissionColorFactor"],
            &[0, 1, 2],
            1.0,
        )],
    ),
    slot(&[EXT, VOLUME, "thicknessTexture"], TextureKind::Data, &[]),
    slot(
        &[EXT, IRIDESCENCE, "iridescenceTexture"],
        TextureKind::Data,
        &[factor(&[EXT, IRIDESCENCE, "iridescenceFactor"], &[0], 0.0)],
    ),
    slot(
        &[EXT, IRIDESCENCE, "iridescenceThicknessTexture"],
        TextureKind::Data,
        &[],
    ),
    slot(
        &[EXT, ANISOTROPY, "anisotropyTexture"],
        TextureKind::Direction,
        &[],
    ),
];

/// The value at a path of an object.
pub(super) fn at<'v>(object: &'v Map<String, Value>, path: &[&str]) -> Option<&'v Value> {
    let (first, rest) = path.split_first()?;
    rest.iter()
        .try_fold(object.get(*first)?, |value, key| value.get(*key))
}

/// Sets the value at a path; objects on the way are made.
pub(super) fn set(object: &mut Map<String, Value>, path: &[&str], value: Value) {
    let Some((first, rest)) = path.split_first() else {
        return;
    };
    if rest.is_empty() {
        object.insert((*first).to_owned(), value);
        return;
    }
    let inner = object
        .entry(*first)
        .or_insert_with(|| Value::Object(Map::new()));
    if let Some(inner) = inner.as_object_mut() {
        set(inner, rest, value);
    }
}

/// Removes the value at a path.
pub(super) fn remove(object: &mut Map<String, Value>, path: &[&str]) {
    match path {
        [] => {}
        [last] => drop(object.shift_remove(*last)),
        [first, rest @ ..] => {
            if let Some(inner) = object.get_mut(*first).and_then(Value::as_object_mut) {
                remove(inner, rest);
            }
        }
    }
}

impl TextureSlot {
    /// What multiplies the four channels of a texel in a material; for normals and directions the first number scales x and y.
    pub fn factor(&self, material: &Map<String, Value>) -> [f32; 4] {
        let mut all = [1.0f32; 4];
        for factor in self.factors {
            let value = at(material, factor.path);
            for (k, channel) in factor.channels.iter().enumerate() {
                let number = value.and_then(|value| match factor.channels.len() {
                    1 => value.as_f64(),
                    _ => value.get(k)?.as_f64(),
                });
                all[*channel] = number.unwrap_or(factor.default) as f32;
            }
        }
        all
    }
}
