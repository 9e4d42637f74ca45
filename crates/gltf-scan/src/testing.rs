//! Small scans for tests.

use darn_geometry::mesh::Vec3;
use serde_json::{Map, Value, json};

use super::container::pack_glb;
use super::{PatchPoint, PatchPrimitive, Scan};

/// A scan under construction: JSON that a test may edit freely, and the bytes of its first buffer.
#[derive(Debug, Clone)]
pub(crate) struct Builder {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Builder {
    /// A scene of one node with one mesh, which has no primitives yet.
    pub fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0", "extras": {"accession": "TX.1923.14"}},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "materials": [{"name": "cloth", "doubleSided": true, "extras": {"weave": "twill"}}],
            "accessors": [],
            "bufferViews": [],
            "buffers": [{"byteLength": 0}],
        });
        Self {
            json,
            bin: Vec::new(),
        }
    }

    /// The unit square of z = 0, seen from +z, as two triangles with u16 indices and `material` 0.
    pub fn square() -> Self {
        let mut out = Self::new();
        let corners = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
        ];
        let position = out.floats(&corners);
        let indices = out.indices_u16(&[0, 1, 2, 0, 2, 3]);
        out.primitive(
            json!({"attributes": {"POSITION": position}, "indices": indices, "material": 0}),
        );
        out
    }

    /// The unit square with a skin of two joints; the second has most weight at the corner (1, 0, 0). Its node has
    /// another transform.
    pub fn skinned() -> Self {
        let mut out = Self::square();
        let joints = out.accessor(&[0_u8, 1, 0, 0].repeat(4), 5121, "VEC4", 4);
        let weights = out.floats(&[
            [1.0, 0.0, 0.0, 0.0],
            [0.25, 0.75, 0.0, 0.0],
            [0.5, 0.5, 0.0, 0.0],
            [0.9, 0.1, 0.0, 0.0],
        ]);
        let attributes = &mut out.json["meshes"][0]["primitives"][0]["attributes"];
        attributes["JOINTS_0"] = json!(joints);
        attributes["WEIGHTS_0"] = json!(weights);
        out.json["nodes"] = json!([
            {"mesh": 0, "skin": 0, "translation": [10, 0, 0], "scale": [1, 1, -1]},
            {"children": [2]},
            {},
        ]);
        out.json["scenes"][0]["nodes"] = json!([0, 1]);
        out.json["skins"] = json!([{"joints": [1, 2]}]);
        out
    }

    /// Appends a buffer view; returns its index.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend_from_slice(bytes);
        self.push("bufferViews", view)
    }

    /// Appends an accessor over a view of its own; returns its index.
    pub fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": component, "type": kind, "count": count}),
        )
    }

    /// Appends an f32 accessor, VEC`N` with the bounds of its values; returns its index.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values
            .iter()
            .flatten()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        let at = self.accessor(&bytes, 5126, &format!("VEC{N}"), values.len());
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f64> {
            (0..N)
                .map(|i| f64::from(values.iter().map(|v| v[i]).reduce(pick).unwrap_or(0.0)))
                .collect()
        };
        self.json["accessors"][at]["min"] = json!(bound(f32::min));
        self.json["accessors"][at]["max"] = json!(bound(f32::max));
        at
    }

    /// Appends an accessor of u16 indices; returns its index.
    pub fn indices_u16(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        self.accessor(&bytes, 5123, "SCALAR", indices.len())
    }

    /// Appends a primitive to the first mesh.
    pub fn primitive(&mut self, primitive: Value) {
        if let Some(list) = self.json["meshes"][0]["primitives"].as_array_mut() {
            list.push(primitive);
        }
    }

    /// Appends to a list at the top of the JSON; returns the new index.
    pub fn push(&mut self, key: &str, value: Value) -> usize {
        let list = self.json[key].as_array_mut().expect("a list");
        list.push(value);
        list.len() - 1
    }

    /// The scan as a GLB.
    pub fn glb(mut self) -> Vec<u8> {
        self.json["buffers"][0]["byteLength"] = json!(self.bin.len());
        self.glb_as_is()
    }

    /// The scan as a GLB; the length of the first buffer is what the test has set.
    pub fn glb_as_is(self) -> Vec<u8> {
        pack_glb(self.json.to_string().as_bytes(), Some(&self.bin), &[]).expect("a small scan")
    }

    /// The scan as JSON with a data URI.
    pub fn gltf(mut self) -> Vec<u8> {
        use base64::Engine as _;
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bin);
        self.json["buffers"][0] = json!({
            "byteLength": self.bin.len(),
            "uri": format!("data:application/octet-stream;base64,{data}"),
        });
        self.json.to_string().into_bytes()
    }
}

fn object(value: Value) -> Map<String, Value> {
    let Value::Object(object) = value else {
        panic!("{value} is no object")
    };
    object
}

/// A tent over the first three vertices of a part: one new point, three triangles.
pub(crate) fn tent(scan: &Scan, part: usize, top: Vec3) -> PatchPrimitive {
    let look = &scan.parts[part];
    let first = look.vertices.start;
    let rim = (first..first + 3).map(PatchPoint::Scan);
    PatchPrimitive {
        part,
        material_of: part,
        points: rim.chain([PatchPoint::New(top)]).collect(),
        faces: vec![[0, 1, 3], [1, 2, 3], [2, 0, 3]],
        both_sides: false,
        appearance: Default::default(),
        normals: vec![Vec3::new(0.0, 0.0, 3.0); 4],
        tangents: Vec::new(),
        texcoords: vec![vec![[0.25, 0.5]; 4]; look.texcoords.len()],
        colors: vec![vec![[0.1, 0.2, 0.3, 0.4]; 4]; look.colors.len()],
        name: "hole 0".into(),
        deviations: Vec::new(),
        hole: object(json!({"id": 0})),
        method: object(json!({"weights": {"name": "standard"}})),
    }
}

/// The JSON of a file and the bytes of its buffer.
pub(crate) fn parsed(bytes: &[u8]) -> (Value, Vec<u8>) {
    let layout = super::container::layout(bytes).unwrap();
    let bin = layout
        .bin
        .map(|range| bytes[range].to_vec())
        .unwrap_or_default();
    (serde_json::from_slice(&bytes[layout.json]).unwrap(), bin)
}

/// Positions and triangles of the last primitive of the first mesh, as the `gltf` crate reads them.
pub(crate) fn read_by_gltf(bytes: &[u8]) -> (Vec<[f32; 3]>, Vec<u16>) {
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(bytes).unwrap();
    let blob = blob.unwrap();
    let primitive = document
        .meshes()
        .next()
        .unwrap()
        .primitives()
        .last()
        .unwrap();
    let span = |accessor: gltf::Accessor<'_>| {
        let start = accessor.view().unwrap().offset() + accessor.offset();
        blob[start..start + accessor.count() * accessor.size()].to_vec()
    };
    let positions = span(primitive.get(&gltf::Semantic::Positions).unwrap());
    let float = |i: usize| f32::from_le_bytes(positions[4 * i..][..4].try_into().unwrap());
    let indices = primitive.indices().unwrap();
    assert_eq!(indices.data_type(), gltf::accessor::DataType::U16);
    let indices = span(indices);
    (
        (0..positions.len() / 12)
            .map(|i| [0, 1, 2].map(|k| float(3 * i + k)))
            .collect(),
        indices
            .chunks_exact(2)
            .map(|b| u16::from_le_bytes([b[0], b[1]]))
            .collect(),
    )
}
