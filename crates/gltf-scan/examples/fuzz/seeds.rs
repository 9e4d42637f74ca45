//! The small scans that are mutated, of every kind that is read.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{Cursor, Write as _};

use darn_geometry::mesh::Vec3;
use darn_gltf_scan::{PatchPoint, PatchPrimitive, Scan, ScanLimits, Siblings};
use serde_json::{Value, json};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

#[allow(dead_code, reason = "tests use the rest")]
#[path = "../../src/compressed/encoded.rs"]
mod encoded;

use encoded::{Coding, PlainMesh, glb};

/// What is mutated.
pub struct Target {
    pub name: &'static str,
    pub seeds: Vec<Seed>,
}

/// A scan, and the files beside it, which stay as they are.
#[derive(Clone)]
pub struct Seed {
    pub bytes: Vec<u8>,
    pub siblings: Siblings,
}

impl From<Vec<u8>> for Seed {
    fn from(bytes: Vec<u8>) -> Self {
        let siblings = Siblings::default();
        Self { bytes, siblings }
    }
}

/// All targets.
pub fn targets() -> Result<Vec<Target>, Box<dyn Error>> {
    let mesh = cloth();
    let of = |codings: &[Coding]| -> Vec<Seed> {
        let each = codings.iter().map(|coding| mesh.encode(*coding).into());
        each.collect()
    };
    let plain = Rich::new()?;
    let rich = glb(&plain.json, &plain.bin);
    let mended = mended(&rich)?;
    let quantized = separate(&mesh.encode(Coding::Quantized))?;
    let separate_rich = separate(&plain.beside())?;
    let zipped_files = |seed: &Seed| {
        let siblings = seed.siblings.0.iter();
        let siblings = siblings.map(|(name, bytes)| (format!("./scan/{name}"), bytes.to_vec()));
        let main = ("./scan/cloth.gltf".to_owned(), seed.bytes.clone());
        zipped(siblings.chain([main]).collect())
    };
    let zips = [
        zipped_files(&quantized)?,
        zipped_files(&separate_rich)?,
        zipped(vec![("scan.glb".to_owned(), rich.clone())])?,
    ];
    // With the entry that undoes the mend.
    let mended_zip = Scan::read(zips[2].clone(), &ScanLimits::default())?;
    let mended_zip = mended_zip.write(&[patch(&mended_zip)])?;
    let zips = zips.into_iter().chain([mended_zip]);
    let target = |name, seeds| Target { name, seeds };
    Ok(vec![
        target("glb", {
            let mut seeds = of(&[Coding::Quantized]);
            seeds.extend([rich.into(), mended.into()]);
            seeds
        }),
        target("json", vec![quantized, separate_rich]),
        target(
            "draco",
            of(&[Coding::DracoEdgebreaker, Coding::DracoSequential]),
        ),
        target(
            "meshopt",
            of(&[
                Coding::MeshoptQuantized,
                Coding::MeshoptFloat,
                Coding::MeshoptExponential,
            ]),
        ),
        target("zip", zips.map(Seed::from).collect()),
        target("obj", vec![obj(&mesh).into()]),
        target(
            "ply",
            [false, true].map(|ascii| ply(&mesh, ascii).into()).into(),
        ),
    ])
}

/// Cloth of several primitives (triangles, a strip, a fan), with a skin, morph targets, a sparse accessor, colours, images, variants, another
/// scene and another level of detail.
struct Rich {
    json: Value,
    bin: Vec<u8>,
}

/// How an image of [`Rich`] is stored.
const PICTURES: [&str; 2] = ["plaid%20weave.png", "twill.png"];

impl Rich {
    fn new() -> Result<Self, Box<dyn Error>> {
        let mut views = Views::default();
        let corners = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.1],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.2],
        ];
        let positions = views.add(&floats(&corners));
        let triangles = views.add(&[0, 0, 1, 0, 2, 0, 0, 0, 2, 0, 3, 0]);
        let strip = views.add(&[0, 1, 3, 2, 255, 0, 1, 3]);
        let colors = views.add(&[255, 0, 0, 9, 0, 255, 0, 9, 0, 0, 255, 9, 9, 9, 9, 9]);
        let sparse_index = views.add(&[1, 0, 0, 0]);
        let sparse_value = views.add(&floats(&[[1.0, 0.0, 0.5]]));
        let joints = views.add(&[0, 1, 0, 0].repeat(4));
        let weights = views.add(&floats(&[[0.75, 0.25, 0.0, 0.0]; 4]));
        let texcoords = views.add(&floats(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]));
        let normals = views.add(&floats(&[[0.0, 0.0, 1.0]; 4]));
        let offsets = views.add(&floats(&[[0.0, 0.0, 0.3]; 4]));
        let inverse: Vec<[f32; 4]> = [0, 1, 2, 3, 0, 1, 2, 3]
            .map(|k| std::array::from_fn(|i| f32::from(u8::from(i == k))))
            .to_vec();
        let inverse = views.add(&floats(&inverse));
        let picture = views.add(&png()?);
        let vector = |view: usize, kind: &str| json!({"bufferView": view, "componentType": 5126, "type": kind, "count": 4});
        let bytes = |view: usize, kind: &str, count: usize| json!({"bufferView": view, "componentType": 5121, "type": kind, "count": count});
        let mut sparse = vector(positions, "VEC3");
        sparse["sparse"] = json!({
            "count": 1,
            "indices": {"bufferView": sparse_index, "componentType": 5121},
            "values": {"bufferView": sparse_value},
        });
        let mut color = bytes(colors, "VEC3", 4);
        color["normalized"] = json!(true);
        let index =
            json!({"bufferView": triangles, "componentType": 5123, "type": "SCALAR", "count": 6});
        let matrices =
            json!({"bufferView": inverse, "componentType": 5126, "type": "MAT4", "count": 2});
        let skinned = json!({
            "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3, "JOINTS_0": 4, "WEIGHTS_0": 5,
        });
        let data = format!(
            "data:image/png;base64,{}",
            base64::Engine::encode(&base64::engine::general_purpose::STANDARD, png()?)
        );
        let variants =
            json!({"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [0]}]}});
        let mut view_list = views.list;
        view_list[colors]["byteStride"] = json!(4);
        let json = json!({
            "asset": {"version": "2.0"}, "extensionsUsed": ["KHR_materials_variants", "MSFT_lod"],
            "extensions": {"KHR_materials_variants": {"variants": [{"name": "red"}]}},
            "scene": 0, "scenes": [{"nodes": [0, 3]}, {"nodes": [4]}],
            "nodes": [
                {"mesh": 0, "skin": 0, "extensions": {"MSFT_lod": {"ids": [4]}}}, {"children": [2]}, {},
                {"children": [1, 5], "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, -2, 0, 1, 2, 3, 1]},
                {"mesh": 1}, {"mesh": 2, "rotation": [0, 0, 0, 1], "scale": [1, 1, -1]},
            ],
            "skins": [{"joints": [1, 2], "inverseBindMatrices": 9}],
            "meshes": [
                {"weights": [0.5], "primitives": [{
                    "attributes": skinned, "indices": 6, "material": 0, "targets": [{"POSITION": 8}], "extensions": variants,
                }]},
                {"primitives": [{"attributes": {"POSITION": 0}, "indices": 6}]},
                {"primitives": [
                    {"attributes": {"POSITION": 7, "TEXCOORD_0": 2}, "indices": 10, "mode": 5, "material": 1},
                    {"attributes": {"POSITION": 0}, "mode": 6},
                    {"attributes": {"POSITION": 0}, "mode": 0},
                ]},
            ],
            "materials": [
                {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "normalTexture": {"index": 1}},
                {"doubleSided": true, "emissiveTexture": {"index": 2}},
            ],
            "textures": [{"source": 0}, {"source": 1}, {"source": 2}], "samplers": [],
            "images": [{"bufferView": picture, "mimeType": "image/png"}, {"uri": data}, {"uri": data}],
            "accessors": [
                vector(positions, "VEC3"), vector(normals, "VEC3"), vector(texcoords, "VEC2"), color,
                bytes(joints, "VEC4", 4), vector(weights, "VEC4"), index, sparse, vector(offsets, "VEC3"), matrices,
                bytes(strip, "SCALAR", 8),
            ],
            "bufferViews": view_list,
            "buffers": [{"byteLength": views.bin.len()}],
        });
        Ok(Self {
            json,
            bin: views.bin,
        })
    }

    /// As a GLB two of whose images lie beside it.
    fn beside(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["images"][1] = json!({"uri": PICTURES[0]});
        json["images"][2] = json!({"uri": format!("./{}", PICTURES[1])});
        glb(&json, &self.bin)
    }
}

/// Buffer views in one buffer.
#[derive(Default)]
struct Views {
    list: Vec<Value>,
    bin: Vec<u8>,
}

impl Views {
    /// Appends a view; returns its index.
    fn add(&mut self, bytes: &[u8]) -> usize {
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend_from_slice(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.list.push(view);
        self.list.len() - 1
    }
}

fn floats<const N: usize>(rows: &[[f32; N]]) -> Vec<u8> {
    rows.iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect()
}

/// A small picture.
fn png() -> Result<Vec<u8>, Box<dyn Error>> {
    let picture =
        image::RgbImage::from_fn(6, 5, |x, y| image::Rgb([40 * x as u8, 50 * y as u8, 7]));
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, image::ImageFormat::Png)?;
    Ok(png.into_inner())
}

/// The scan with a patch and the record that undoes it.
fn mended(scan: &[u8]) -> Result<Vec<u8>, Box<dyn Error>> {
    let scan = Scan::read(scan.to_vec(), &ScanLimits::default())?;
    Ok(scan.write(&[patch(&scan)])?)
}

/// A triangle at the first part of a scan.
fn patch(scan: &Scan) -> PatchPrimitive {
    let part = &scan.parts[0];
    let first = part.vertices.start;
    PatchPrimitive {
        name: "patch".into(),
        deviations: Vec::new(),
        part: 0,
        material_of: 0,
        points: vec![
            PatchPoint::Scan(first),
            PatchPoint::Scan(first + 1),
            PatchPoint::New(Vec3::new(0.5, 0.5, 1.0)),
        ],
        normals: vec![Vec3::z(); 3],
        tangents: Vec::new(),
        texcoords: vec![vec![[0.25, 0.5]; 3]; part.texcoords.len()],
        colors: vec![vec![[0.1, 0.2, 0.3, 0.4]; 3]; part.colors.len()],
        faces: vec![[0, 1, 2]],
        both_sides: false,
        appearance: Default::default(),
        hole: Default::default(),
        method: Default::default(),
    }
}

fn zipped(files: Vec<(String, Vec<u8>)>) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        zip.start_file(name, SimpleFileOptions::default())?;
        zip.write_all(&bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

/// A GLB as glTF with its buffer and pictures beside it.
fn separate(glb: &[u8]) -> Result<Seed, Box<dyn Error>> {
    let length = u32::from_le_bytes(glb[12..16].try_into()?) as usize;
    let mut json: Value = serde_json::from_slice(&glb[20..20 + length])?;
    json["buffers"][0]["uri"] = "cloth.bin".into();
    let buffer = ("cloth.bin".to_owned(), glb[28 + length..].to_vec().into());
    let mut files = BTreeMap::from([buffer]);
    for picture in PICTURES {
        files.insert(picture.replace("%20", " "), png()?.into());
    }
    Ok(Seed {
        bytes: json.to_string().into_bytes(),
        siblings: Siblings(files),
    })
}

/// The mesh as OBJ, with relative indices and a mark like darn's.
fn obj(mesh: &PlainMesh) -> Vec<u8> {
    let mut text = String::from("mtllib cloth.mtl\nusemtl linen\n");
    for ([x, y, z], [u, v]) in mesh.positions.iter().zip(&mesh.texcoords) {
        text += &format!("v {x} {y} {z} 0.5 0.5 1\nvt {u} {v}\n");
    }
    let count = mesh.positions.len() as i64;
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| i64::from(v) + 1);
        text += &format!("f {a}/{a} {b}/{b} {}/{c}\n", c - count - 1);
    }
    text += "\n# darn: reconstructed cloth; without the lines from here to the end the file is as it was. Patches: 1, \
        SHA-256 of the file before: 00\nv 0 0 1\nf 1 2 -1\n# darn: end of the reconstructed cloth\n";
    text.into_bytes()
}

/// The mesh as PLY, with a property that darn does not know and a comment like darn's.
fn ply(mesh: &PlainMesh, ascii: bool) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
         element face {}\nproperty list uchar int vertex_indices\ncomment darn: reconstructed cloth, 1 patches: 0 vertices in bytes 0..0, \
         0 faces in bytes 0..0, of a body of 9, SHA-256 of the file before: 00\nend_header\n",
        if ascii { "ascii" } else { "binary_little_endian" },
        mesh.positions.len(),
        mesh.faces.len()
    )
    .into_bytes();
    for [x, y, z] in &mesh.positions {
        if ascii {
            bytes.extend(format!("{x} {y} {z} 7\n").bytes());
        } else {
            bytes.extend([x, y, z].into_iter().flat_map(|x| x.to_le_bytes()));
            bytes.push(7);
        }
    }
    for [a, b, c] in &mesh.faces {
        if ascii {
            bytes.extend(format!("3 {a} {b} {c}\n").bytes());
        } else {
            bytes.push(3);
            bytes.extend([a, b, c].into_iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    bytes
}

/// A wave of 9 × 9 vertices.
fn cloth() -> PlainMesh {
    const N: u32 = 9;
    let at = |k: u32| [(k % N) as f32 / 8.0, (k / N) as f32 / 8.0];
    let cells = (0..N * (N - 1)).filter(|k| k % N < N - 1);
    PlainMesh {
        positions: (0..N * N)
            .map(at)
            .map(|[u, v]| [u, v, 0.1 * (5.0 * u).sin()])
            .collect(),
        normals: vec![[0.0, 0.0, 1.0]; (N * N) as usize],
        texcoords: (0..N * N).map(at).collect(),
        faces: cells
            .flat_map(|k| [[k, k + 1, k + N + 1], [k, k + N + 1, k + N]])
            .collect(),
    }
}
