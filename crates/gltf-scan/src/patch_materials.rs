//! Materials of patches: copies of the scan's that are marked as reconstructions, and others that show it.
//!
//! A patch blends in by default. In the variant that marks it, its cloth is dark and bluish, and bright stripes glow on it:
//! they are seen on any cloth, whatever its colours and the light, and by people with any colour vision. No material of
//! the scan itself changes.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::append::Appender;
use super::error::ScanError;
use super::export::MeshLook;
use super::hatch;
use super::patch_appearance::{MaterialStyle, PatchAppearance, StyleKind};
use super::patch_primitive::{PatchPrimitive, is_reconstructed};
use super::scan::Scan;
use super::variants::{MaterialChoices, PatchMaterials};
use super::xmp;

const RECONSTRUCTION: &str = "darn reconstruction";

/// What is left of the cloth's own light where a patch is marked: red, green, blue, opacity.
const DARKENED: [f64; 4] = [0.1, 0.16, 0.28, 1.0];
/// The light of a marked patch that has no room for the hatch's texture coordinates: half of its orange.
const GLOW: [f64; 3] = [0.39, 0.17, 0.0];
/// Extensions in which a material does not glow, or as bright as it likes.
const WITHOUT_GLOW: [&str; 2] = ["KHR_materials_unlit", "KHR_materials_emissive_strength"];

/// What decides a copy of a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct BlendedKey {
    source: Option<usize>,
    /// Number of the style.
    style: usize,
    /// The variant, where the style depends on it.
    variant: Option<usize>,
}

/// The materials that a patch's are made of.
pub(super) struct MaterialRequest<'c> {
    /// The cloth's.
    pub choices: &'c MaterialChoices,
    /// What makes them the patch's.
    pub style: &'c MaterialStyle<'c>,
    /// The set of texture coordinates of the hatch.
    pub hatch: Option<usize>,
}

/// Makes the materials of patches, each once.
pub(super) struct PatchMaterialsMaker<'s> {
    scan: &'s Scan,
    blended: BTreeMap<BlendedKey, usize>,
    /// By the set of texture coordinates of the hatch, too.
    marked: BTreeMap<(BlendedKey, Option<usize>), usize>,
    /// The texture of the hatch, once it is appended.
    hatch: Option<usize>,
    /// The packet of metadata that they refer to.
    packet: Option<usize>,
}

impl<'s> PatchMaterialsMaker<'s> {
    /// Nothing made yet; all materials that are made refer to the packet of metadata.
    pub fn new(scan: &'s Scan, packet: Option<usize>) -> Self {
        Self {
            scan,
            blended: BTreeMap::new(),
            marked: BTreeMap::new(),
            hatch: None,
            packet,
        }
    }

    /// The materials of a patch.
    ///
    /// # Errors
    /// [`ScanError::Invalid`] for a material of the scan that is missing or no object.
    pub fn make(
        &mut self,
        out: &mut Appender<'_>,
        request: &MaterialRequest<'_>,
    ) -> Result<PatchMaterials, ScanError> {
        let MaterialRequest { choices, style, .. } = request;
        let default = self.blended(out, choices.default, style, None)?;
        let mut mapped = BTreeMap::new();
        for variant in choices.mapped.keys().copied().chain(style.variants()) {
            let source = choices.mapped.get(&variant).copied().or(choices.default);
            mapped.insert(variant, self.blended(out, source, style, Some(variant))?);
        }
        let known = choices
            .marked
            .filter(|_| matches!(style.kind, StyleKind::Continued));
        let marked = match known {
            Some(marked) => marked,
            None => self.marked(out, request)?,
        };
        Ok(PatchMaterials {
            default,
            mapped,
            marked,
        })
    }

    /// A copy of a material that looks like it. A material that is a patch's already is used as it is, where the style
    /// changes nothing.
    pub fn blended(
        &mut self,
        out: &mut Appender<'_>,
        source: Option<usize>,
        style: &MaterialStyle<'_>,
        variant: Option<usize>,
    ) -> Result<usize, ScanError> {
        let is_continued = matches!(style.kind, StyleKind::Continued);
        let key = BlendedKey {
            source,
            style: style.number,
            variant: variant.filter(|_| !is_continued),
        };
        if let Some(known) = self.blended.get(&key) {
            return Ok(*known);
        }
        let mut copy = copy_of(self.scan, source)?;
        let own = is_reconstructed(copy.get("extras"));
        let made = match (source, own && is_continued) {
            (Some(source), true) => source,
            _ => {
                style.apply(&mut copy, variant);
                mark(&mut copy, RECONSTRUCTION, &["reconstructed"]);
                self.refer(&mut copy);
                out.push("materials", Value::Object(copy))
            }
        };
        self.blended.insert(key, made);
        Ok(made)
    }

    fn marked(
        &mut self,
        out: &mut Appender<'_>,
        request: &MaterialRequest<'_>,
    ) -> Result<usize, ScanError> {
        let (source, hatch) = (request.choices.default, request.hatch);
        let key = BlendedKey {
            source,
            style: request.style.number,
            variant: None,
        };
        if let Some(known) = self.marked.get(&(key, hatch)) {
            return Ok(*known);
        }
        let mut copy = copy_of(self.scan, source)?;
        request.style.apply(&mut copy, None);
        let name = format!("{RECONSTRUCTION}, marked");
        mark(&mut copy, &name, &["reconstructed", "marked"]);
        if let Some(extensions) = object(&mut copy, "extensions") {
            WITHOUT_GLOW
                .iter()
                .for_each(|name| drop(extensions.shift_remove(*name)));
            if let Some(other) = object(extensions, "KHR_materials_pbrSpecularGlossiness") {
                darken(other, "diffuseFactor");
            }
            if extensions.is_empty() {
                copy.shift_remove("extensions");
            }
        }
        let plain = copy
            .entry("pbrMetallicRoughness")
            .or_insert_with(|| json!({}));
        if let Some(plain) = plain.as_object_mut() {
            darken(plain, "baseColorFactor");
        }
        match hatch {
            Some(set) => {
                let texture = json!({ "index": self.hatch(out), "texCoord": set });
                copy.insert("emissiveTexture".into(), texture);
                copy.insert("emissiveFactor".into(), json!([1.0, 1.0, 1.0]));
            }
            None => {
                copy.shift_remove("emissiveTexture");
                copy.insert("emissiveFactor".into(), json!(GLOW));
            }
        }
        self.refer(&mut copy);
        let made = out.push("materials", Value::Object(copy));
        self.marked.insert((key, hatch), made);
        Ok(made)
    }

    /// Lets a material refer to the packet of metadata.
    fn refer(&self, material: &mut Map<String, Value>) {
        let Some(packet) = self.packet else {
            return;
        };
        let extensions = material.entry("extensions").or_insert_with(|| json!({}));
        if let Some(extensions) = extensions.as_object_mut() {
            extensions.insert(xmp::EXTENSION.into(), xmp::reference(packet));
        }
    }

    /// The texture of the hatch; it repeats, as textures do without a sampler.
    fn hatch(&mut self, out: &mut Appender<'_>) -> usize {
        *self.hatch.get_or_insert_with(|| {
            let view = out.view("darn hatch", hatch::PNG, None);
            let image =
                json!({ "name": "darn hatch", "bufferView": view, "mimeType": "image/png" });
            let image = out.push("images", image);
            out.push("textures", json!({ "name": "darn hatch", "source": image }))
        })
    }
}

impl Scan {
    /// How a patch looks beside the scan, without a variant and in its base colour alone; as all others do where it continues the scan.
    ///
    /// # Errors
    /// [`ScanError::Invalid`] for a material of the scan that is missing or no object.
    pub fn mesh_look<'p>(&self, patch: &'p PatchPrimitive) -> Result<MeshLook<'p>, ScanError> {
        let kind = match &patch.appearance {
            PatchAppearance::Continued => return Ok(MeshLook::Cloth),
            PatchAppearance::Own(own) => return Ok(MeshLook::Images(own)),
            PatchAppearance::Flat(look, means) => StyleKind::Flat(look, means),
            PatchAppearance::Plain => StyleKind::Plain,
        };
        let cloth = self.parts.get(patch.material_of);
        let mut material = copy_of(self, cloth.and_then(|part| part.material))?;
        MaterialStyle { number: 0, kind }.apply(&mut material, None);
        let mut pbr = match material.remove("pbrMetallicRoughness") {
            Some(Value::Object(pbr)) => pbr,
            _ => Map::new(),
        };
        // Beside the scan there are none of its textures.
        pbr.retain(|key, _| !key.ends_with("Texture"));
        Ok(MeshLook::Plain(Value::Object(pbr)))
    }
}

/// A copy of a material of the scan; without one, glTF's default.
fn copy_of(scan: &Scan, source: Option<usize>) -> Result<Map<String, Value>, ScanError> {
    let Some(source) = source else {
        return Ok(Map::new());
    };
    let pointer = format!("/materials/{source}");
    let material = scan.json.pointer(&pointer).and_then(Value::as_object);
    material.cloned().ok_or_else(|| ScanError::Invalid {
        pointer,
        detail: "must be an object".into(),
    })
}

/// Names a material after what it is, and sets flags in `extras.darn`. Extras that are not an object cannot take them; the
/// primitive's extras have the first one, too.
fn mark(material: &mut Map<String, Value>, what: &str, flags: &[&str]) {
    let of_patch = format!(" ({RECONSTRUCTION})");
    let name = match material.get("name").and_then(Value::as_str) {
        Some(name) => format!("{} ({what})", name.strip_suffix(&of_patch).unwrap_or(name)),
        None => what.into(),
    };
    material.insert("name".into(), name.into());
    let extras = material.entry("extras").or_insert_with(|| json!({}));
    let extras = extras.as_object_mut();
    let darn = extras.map(|extras| extras.entry("darn").or_insert_with(|| json!({})));
    if let Some(darn) = darn.and_then(Value::as_object_mut) {
        for flag in flags {
            darn.insert((*flag).into(), Value::Bool(true));
        }
    }
}

fn object<'m>(of: &'m mut Map<String, Value>, key: &str) -> Option<&'m mut Map<String, Value>> {
    of.get_mut(key).and_then(Value::as_object_mut)
}

/// Multiplies a colour factor of four numbers, which are 1 if they are left out.
fn darken(material: &mut Map<String, Value>, key: &str) {
    let old = material.get(key).and_then(Value::as_array);
    let channel = |k: usize| {
        let old = old.and_then(|old| old.get(k)?.as_f64());
        // Three digits: no reader needs more.
        ((old.unwrap_or(1.0) * DARKENED[k]).clamp(0.0, 1.0) * 1000.0).round() / 1000.0
    };
    let factor = [channel(0), channel(1), channel(2), channel(3)];
    material.insert(key.into(), json!(factor));
}
