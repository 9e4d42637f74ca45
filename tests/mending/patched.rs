//! Sheets of known fabrics as files, and what a viewer shows on a patch.

use std::io::Cursor;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use darn_contract::port::Mended;
use darn_contract::{Constraints, TextureChoice, v1};
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_texture::testset::{TestScan, ciede2000, lab};
use serde_json::{Value, json};

use super::cloth::packed;

/// Texels to a unit of the scene.
const SCALE: f64 = 100.0;
/// Radius of the cylinder that the sheets lie on, texels.
pub const BEND: f64 = 300.0;

/// A point of the flat sheet on the cylinder.
pub fn bent([x, y]: [f64; 2]) -> Vec3 {
    let angle = x / BEND;
    Vec3::new(BEND * angle.sin(), y, BEND * (angle.cos() - 1.0)) / SCALE
}

/// The place on the flat sheet.
pub fn unbent(p: Vec3) -> [f64; 2] {
    let p = p * SCALE;
    [BEND * p.x.atan2(p.z + BEND), p.y]
}

pub fn png(side: usize, texels: &[[u8; 4]]) -> Vec<u8> {
    let bytes: Vec<u8> = texels.iter().flatten().copied().collect();
    let picture = image::RgbaImage::from_raw(side as u32, side as u32, bytes).expect("all texels");
    let mut out = Cursor::new(Vec::new());
    let written = picture.write_to(&mut out, image::ImageFormat::Png);
    written.expect("a PNG");
    out.into_inner()
}

pub fn push(list: &mut Value, value: Value) {
    list.as_array_mut().expect("a list").push(value);
}

/// Adds a second material, which the variant `swapped` chooses.
pub fn push_variant(json: &mut Value, material: Value) {
    push(&mut json["materials"], material);
    json["extensionsUsed"] = json!(["KHR_materials_variants"]);
    json["extensions"] = json!({"KHR_materials_variants": {"variants": [{ "name": "swapped" }]}});
    json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_materials_variants": {"mappings": [{ "material": 1, "variants": [0] }]}});
}

pub fn data_uri(bytes: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(bytes))
}

/// The chunks of a GLB: its JSON and the bytes of its buffer.
pub fn chunks(glb: &[u8]) -> (Value, &[u8]) {
    let word =
        |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().expect("four bytes")) as usize;
    let text = &glb[20..20 + word(12)];
    let bin = 28 + word(12);
    (
        serde_json::from_slice(text).expect("JSON"),
        glb.get(bin..).unwrap_or_default(),
    )
}

/// A GLB with an edited JSON.
pub fn edited(glb: &[u8], edit: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (mut json, bin) = chunks(glb);
    edit(&mut json);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    let length = 12 + 8 + text.len() + 8 + bin.len();
    out.extend((length as u32).to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(text);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

/// A sheet of a fabric as a file: bent, with its image as base colour.
pub fn fabric(sheet: &TestScan) -> Vec<u8> {
    fabric_at(sheet, bent)
}

/// The same with the flat sheet's points at other places.
pub fn fabric_at(sheet: &TestScan, place: impl Fn([f64; 2]) -> Vec3) -> Vec<u8> {
    let positions = sheet.mesh.positions.iter().map(|p| place([p.x, p.y]));
    let mesh = TriMesh {
        positions: positions.collect(),
        faces: sheet.mesh.faces.clone(),
    };
    edited(&packed(&mesh, &sheet.texcoords), |json| {
        json["images"] = json!([{ "uri": data_uri(&png(sheet.side, &sheet.texels)) }]);
        json["textures"] = json!([{ "source": 0 }]);
        json["materials"][0] = json!({
            "name": "cloth",
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "metallicFactor": 0.0 },
        });
    })
}

pub fn with_texture(texture: Option<TextureChoice>) -> Constraints {
    Constraints {
        texture,
        ..Constraints::default()
    }
}

/// A mended file and the primitive of its patch.
pub struct Patched {
    pub json: Value,
    pub bin: Vec<u8>,
    pub primitive: Value,
    pub report: v1::TextureReport,
    /// The notes of the hole.
    pub notes: Vec<String>,
}

impl Patched {
    pub fn of(mended: &Mended) -> Patched {
        let (json, bin) = chunks(&mended.bytes);
        let all = json["meshes"].as_array().expect("meshes").iter();
        let mut all = all.flat_map(|mesh| mesh["primitives"].as_array().expect("primitives"));
        let new = |primitive: &&Value| primitive.pointer("/extras/darn/reconstructed").is_some();
        Patched {
            primitive: all.find(new).expect("a patch").clone(),
            bin: bin.to_vec(),
            report: mended.report.holes[0].texture.clone().expect("a texture"),
            notes: mended.report.holes[0].notes.clone(),
            json,
        }
    }

    fn view(&self, index: &Value) -> &[u8] {
        let view = &self.json["bufferViews"][index.as_u64().expect("an index") as usize];
        let number = |key: &str| view[key].as_u64().unwrap_or(0) as usize;
        &self.bin[number("byteOffset")..][..number("byteLength")]
    }

    pub fn floats<const N: usize>(&self, attribute: &str) -> Vec<[f32; N]> {
        let accessor = self.primitive["attributes"][attribute].as_u64();
        let accessor = &self.json["accessors"][accessor.expect(attribute) as usize];
        let bytes = self.view(&accessor["bufferView"]);
        let numbers: Vec<f32> = (bytes.chunks_exact(4))
            .map(|b| f32::from_le_bytes(b.try_into().expect("four bytes")))
            .collect();
        numbers.as_chunks().0.to_vec()
    }

    fn faces(&self) -> Vec<[usize; 3]> {
        let accessor =
            &self.json["accessors"][self.primitive["indices"].as_u64().expect("i") as usize];
        let bytes = self.view(&accessor["bufferView"]);
        let size = if accessor["componentType"] == 5123 {
            2
        } else {
            4
        };
        let numbers: Vec<usize> = (bytes.chunks_exact(size))
            .map(|b| b.iter().rev().fold(0, |n, b| 256 * n + usize::from(*b)))
            .take(accessor["count"].as_u64().expect("a count") as usize)
            .collect();
        numbers.as_chunks().0.to_vec()
    }

    /// The material without a variant, or in one.
    pub fn material(&self, variant: Option<&str>) -> &Value {
        let own = variant.map(|name| {
            let names = &self.json["extensions"]["KHR_materials_variants"]["variants"];
            let names = names.as_array().expect("variants");
            let index = names
                .iter()
                .position(|it| it["name"] == name)
                .expect("the variant");
            let mappings = &self.primitive["extensions"]["KHR_materials_variants"]["mappings"];
            let mut mappings = mappings.as_array().expect("mappings").iter();
            let of = |it: &&Value| {
                it["variants"]
                    .as_array()
                    .expect("list")
                    .contains(&json!(index))
            };
            &mappings.find(of).expect("mapped")["material"]
        });
        let index = own.unwrap_or(&self.primitive["material"]);
        &self.json["materials"][index.as_u64().expect("an index") as usize]
    }

    /// The picture of a texture info.
    pub fn picture(&self, info: &Value) -> image::RgbaImage {
        let texture = &self.json["textures"][info["index"].as_u64().expect("a texture") as usize];
        let image = &self.json["images"][texture["source"].as_u64().expect("an image") as usize];
        let bytes = match image["uri"].as_str() {
            Some(uri) => STANDARD
                .decode(uri.split_once(',').expect("a data URI").1)
                .expect("base64"),
            None => self.view(&image["bufferView"]).to_vec(),
        };
        image::load_from_memory(&bytes)
            .expect("an image")
            .into_rgba8()
    }

    /// For each face its middle in space, and what the base colour shows there.
    pub fn shown(&self, variant: Option<&str>) -> Vec<(Vec3, [u8; 3])> {
        let info = &self.material(variant)["pbrMetallicRoughness"]["baseColorTexture"];
        let picture = self.picture(info);
        let set = info["texCoord"].as_u64().unwrap_or(0);
        let places = self.floats::<2>(&format!("TEXCOORD_{set}"));
        let positions = self.floats::<3>("POSITION");
        let middle = |face: [usize; 3]| {
            let at = face.map(|v| Vec3::from(positions[v].map(f64::from)));
            let mean = |k: usize| face.map(|v| places[v][k]).iter().sum::<f32>() / 3.0;
            let texel =
                |x: f32, side: u32| ((x.rem_euclid(1.0) * side as f32) as u32).min(side - 1);
            let (x, y) = (
                texel(mean(0), picture.width()),
                texel(mean(1), picture.height()),
            );
            let [r, g, b, _] = picture.get_pixel(x, y).0;
            ((at[0] + at[1] + at[2]) / 3.0, [r, g, b])
        };
        self.faces().into_iter().map(middle).collect()
    }

    /// The share of its faces that show the fabric's colour there, within a ΔE of 10.
    pub fn share_right(&self, sheet: &TestScan) -> f64 {
        let shown = self.shown(None);
        let right = shown.iter().filter(|(at, colour)| {
            let truth = sheet.truth(unbent(*at)).map(|x| (255.0 * x + 0.5) as u8);
            ciede2000(lab(truth), lab(*colour)) < 10.0
        });
        right.count() as f64 / shown.len() as f64
    }
}
