//! Compresses small meshes for tests, so that no binary file is in the repository. The end-to-end tests of `darn` compile
//! this file too.

use draco_core::{
    DataType, EncoderBuffer, EncoderOptions, GeometryAttributeType, Mesh, MeshEncoder,
    PointAttribute, PointIndex,
};
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{
    ExpMode, IndexEncoding, VertexEncoding, encode_filter_exp, encode_filter_oct,
    encode_index_buffer, encode_vertex_buffer,
};
use serde_json::{Value, json};

/// A mesh as a plain glTF stores it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlainMesh {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub texcoords: Vec<[f32; 2]>,
    pub faces: Vec<[u32; 3]>,
}

/// A way to store it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// `KHR_mesh_quantization`: positions u16, normals i8, texture coordinates u16, as gltfpack does.
    Quantized,
    /// The same, the buffer views compressed by `KHR_meshopt_compression`, codec version 1, normals octahedral.
    MeshoptQuantized,
    /// `EXT_meshopt_compression`, codec version 0, positions f32 without loss.
    MeshoptFloat,
    /// `EXT_meshopt_compression`, positions by the filter EXPONENTIAL.
    MeshoptExponential,
    /// `KHR_draco_mesh_compression`, edgebreaker connectivity.
    DracoEdgebreaker,
    /// `KHR_draco_mesh_compression`, sequential connectivity.
    DracoSequential,
}

impl Coding {
    pub const ALL: [Self; 6] = [
        Self::Quantized,
        Self::MeshoptQuantized,
        Self::MeshoptFloat,
        Self::MeshoptExponential,
        Self::DracoEdgebreaker,
        Self::DracoSequential,
    ];

    fn extensions(self) -> Vec<&'static str> {
        const QUANTIZATION: &str = "KHR_mesh_quantization";
        match self {
            Self::Quantized => vec![QUANTIZATION],
            Self::MeshoptQuantized => vec![QUANTIZATION, "KHR_meshopt_compression"],
            Self::MeshoptFloat | Self::MeshoptExponential => {
                vec![QUANTIZATION, "EXT_meshopt_compression"]
            }
            Self::DracoEdgebreaker | Self::DracoSequential => vec!["KHR_draco_mesh_compression"],
        }
    }
}

/// The lattice of quantized positions: `offset` + `step` · integers of 14 bits.
struct Lattice {
    offset: [f32; 3],
    step: f32,
}

impl Lattice {
    fn of(points: &[[f32; 3]]) -> Self {
        let low = |k: usize| points.iter().map(|p| p[k]).fold(f32::INFINITY, f32::min);
        let high = |k: usize| {
            let all = points.iter().map(|p| p[k]);
            all.fold(f32::NEG_INFINITY, f32::max)
        };
        let extent = (0..3).map(|k| high(k) - low(k)).fold(0.0, f32::max);
        Self {
            offset: [low(0), low(1), low(2)],
            step: extent / 16383.0,
        }
    }

    fn integers(&self, point: &[f32; 3]) -> [u16; 3] {
        [0, 1, 2].map(|k| ((point[k] - self.offset[k]) / self.step).round() as u16)
    }
}

/// A buffer view: its elements as an accessor reads them, and the stream that decodes to them.
struct View {
    plain: Vec<u8>,
    stream: Vec<u8>,
    stride: usize,
    count: usize,
    filter: &'static str,
}

impl PlainMesh {
    /// The mesh, stored in this way, as a GLB of one node.
    pub fn encode(&self, coding: Coding) -> Vec<u8> {
        match coding {
            Coding::DracoEdgebreaker => self.draco(coding, 1),
            Coding::DracoSequential => self.draco(coding, 0),
            _ => self.views(coding),
        }
    }

    /// How far a position may move when it is stored in this way.
    pub fn tolerance(&self, coding: Coding) -> f64 {
        match coding {
            Coding::MeshoptFloat => 0.0,
            _ => f64::from(Lattice::of(&self.positions).step),
        }
    }

    fn views(&self, coding: Coding) -> Vec<u8> {
        let lattice = Lattice::of(&self.positions);
        let quantized = matches!(coding, Coding::Quantized | Coding::MeshoptQuantized);
        let version = match coding {
            Coding::MeshoptQuantized => 1,
            _ => 0,
        };
        let mut work = Workspace::default();
        let positions = if quantized {
            let rows = self.positions.iter().map(|p| lattice.integers(p));
            let rows = rows.flat_map(|[x, y, z]| [x, y, z, 0]);
            View::new(rows.flat_map(u16::to_le_bytes).collect(), 8, version)
        } else {
            let rows: Vec<f32> = self.positions.iter().flatten().copied().collect();
            let mut view = View::new(
                rows.iter().flat_map(|x| x.to_le_bytes()).collect(),
                12,
                version,
            );
            if coding == Coding::MeshoptExponential {
                let count = self.positions.len();
                let bytes =
                    encode_filter_exp(count, 12, 18, &rows, ExpMode::SharedVector, &mut work);
                view = View::new(bytes.expect("finite positions"), 12, version);
                view.filter = "EXPONENTIAL";
            }
            view
        };
        let normals = if coding == Coding::Quantized {
            let rows = self.normals.iter().flat_map(|&[x, y, z]| [x, y, z, 0.0]);
            View::new(
                rows.map(|x| (x * 127.0).round() as i8 as u8).collect(),
                4,
                version,
            )
        } else {
            let rows = self.normals.iter().flat_map(|&[x, y, z]| [x, y, z, 0.0]);
            let rows: Vec<f32> = rows.collect();
            let bytes = encode_filter_oct(self.normals.len(), 4, 8, &rows, &mut work);
            let mut view = View::new(bytes.expect("unit normals"), 4, version);
            view.filter = "OCTAHEDRAL";
            view
        };
        let texcoords = self.texcoords.iter().flatten();
        let texcoords = texcoords.flat_map(|x| ((x * 65535.0).round() as u16).to_le_bytes());
        let texcoords = View::new(texcoords.collect(), 4, version);
        let indices: Vec<u32> = self.faces.iter().flatten().copied().collect();
        let triangles = View {
            plain: indices.iter().flat_map(|i| i.to_le_bytes()).collect(),
            stream: encode_index_buffer(
                &indices,
                IndexEncoding::new(1).expect("a version"),
                &mut work,
            )
            .expect("triangles"),
            stride: 4,
            count: indices.len(),
            filter: "NONE",
        };
        let n = self.positions.len();
        let mut json = self.document(coding, triangles.count);
        json["accessors"][0]["componentType"] = json!(if quantized { 5123 } else { 5126 });
        json["accessors"][1]["componentType"] = json!(5120);
        json["accessors"][1]["normalized"] = json!(true);
        json["accessors"][2]["componentType"] = json!(5123);
        json["accessors"][2]["normalized"] = json!(true);
        if quantized {
            let all: Vec<[u16; 3]> = self.positions.iter().map(|p| lattice.integers(p)).collect();
            let high = |k: usize| all.iter().map(|p| p[k]).max();
            json["accessors"][0]["min"] = json!([0, 0, 0]);
            json["accessors"][0]["max"] = json!([high(0), high(1), high(2)]);
            json["nodes"][0]["translation"] = json!(lattice.offset.map(f64::from));
            json["nodes"][0]["scale"] = json!(vec![f64::from(lattice.step); 3]);
        }
        let compressed = coding != Coding::Quantized;
        let (mut bin, mut decoded) = (Vec::new(), 0);
        let views = [positions, normals, texcoords, triangles];
        let views: Vec<Value> = (views.iter().enumerate())
            .map(|(index, view)| {
                json["accessors"][index]["bufferView"] = json!(index);
                let mut place =
                    json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": view.plain.len()});
                if compressed {
                    let stream = json!({
                        "buffer": 0, "byteOffset": bin.len(), "byteLength": view.stream.len(),
                        "byteStride": view.stride, "count": view.count, "filter": view.filter,
                        "mode": if index == 3 { "TRIANGLES" } else { "ATTRIBUTES" },
                    });
                    place["buffer"] = json!(1);
                    place["byteOffset"] = json!(decoded);
                    place["extensions"] = json!({ coding.extensions()[1]: stream });
                    bin.extend_from_slice(&view.stream);
                } else {
                    bin.extend_from_slice(&view.plain);
                }
                if index < 3 {
                    place["byteStride"] = json!(view.stride);
                    assert_eq!(view.count, n, "an element for each vertex");
                }
                decoded += view.plain.len();
                bin.resize(bin.len().next_multiple_of(4), 0);
                place
            })
            .collect();
        json["bufferViews"] = json!(views);
        json["buffers"] = json!([{"byteLength": bin.len()}]);
        if compressed {
            let fallback = json!({"byteLength": decoded, "extensions": {coding.extensions()[1]: {"fallback": true}}});
            json["buffers"] = json!([{"byteLength": bin.len()}, fallback]);
        }
        glb(&json, &bin)
    }

    fn draco(&self, coding: Coding, method: i32) -> Vec<u8> {
        let mut mesh = Mesh::new();
        for &[a, b, c] in &self.faces {
            mesh.add_face([PointIndex(a), PointIndex(b), PointIndex(c)]);
        }
        mesh.set_num_points(self.positions.len());
        let mut options = EncoderOptions::new();
        options.set_encoding_method(method);
        let kinds = [
            (GeometryAttributeType::Position, 14),
            (GeometryAttributeType::Normal, 10),
            (GeometryAttributeType::TexCoord, 12),
        ];
        let rows: [Vec<f32>; 3] = [
            self.positions.iter().flatten().copied().collect(),
            self.normals.iter().flatten().copied().collect(),
            self.texcoords.iter().flatten().copied().collect(),
        ];
        for ((kind, bits), rows) in kinds.into_iter().zip(&rows) {
            let n = self.positions.len();
            let mut attribute = PointAttribute::new();
            let components = (rows.len() / n) as u8;
            attribute.init(kind, components, DataType::Float32, false, n);
            attribute.buffer_mut().update_f32s_le(0, rows);
            let id = mesh.add_attribute(attribute);
            options.set_attribute_int(id, "quantization_bits", bits);
        }
        let mut encoder = MeshEncoder::new();
        encoder.set_mesh(mesh);
        let mut stream = EncoderBuffer::new();
        encoder.encode(&options, &mut stream).expect("a mesh");
        let stream = stream.data();
        let mut json = self.document(coding, 3 * self.faces.len());
        json["bufferViews"] = json!([{"buffer": 0, "byteLength": stream.len()}]);
        json["buffers"] = json!([{"byteLength": stream.len()}]);
        json["meshes"][0]["primitives"][0]["extensions"] = json!({
            coding.extensions()[0]: {
                "bufferView": 0,
                "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2},
            }
        });
        glb(&json, stream)
    }

    /// The JSON without buffers and views; accessors: positions, normals, texture coordinates, indices.
    fn document(&self, coding: Coding, indices: usize) -> Value {
        let n = self.positions.len();
        let bound = |pick: fn(f32, f32) -> f32| {
            let all = |k: usize| self.positions.iter().map(move |p| p[k]).reduce(pick);
            [all(0), all(1), all(2)].map(|x| f64::from(x.unwrap_or_default()))
        };
        let (min, max) = (bound(f32::min), bound(f32::max));
        json!({
            "asset": {"version": "2.0"},
            "extensionsUsed": coding.extensions(),
            "extensionsRequired": coding.extensions(),
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{
                "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0,
            }]}],
            "materials": [{"name": "cloth"}],
            "accessors": [
                {"componentType": 5126, "type": "VEC3", "count": n,
                 "min": min, "max": max},
                {"componentType": 5126, "type": "VEC3", "count": n},
                {"componentType": 5126, "type": "VEC2", "count": n},
                {"componentType": 5125, "type": "SCALAR", "count": indices},
            ],
        })
    }
}

impl View {
    /// Elements of `stride` bytes and their stream of the vertex codec. With a filter, `plain` has only the right length.
    fn new(plain: Vec<u8>, stride: usize, version: u8) -> Self {
        let count = plain.len() / stride;
        let encoding = VertexEncoding::new(version, 2).expect("a version");
        let stream =
            encode_vertex_buffer(&plain, count, stride, encoding, &mut Workspace::default());
        Self {
            plain,
            stream: stream.expect("a stride of the codec"),
            stride,
            count,
            filter: "NONE",
        }
    }
}

/// Packs a GLB of a JSON and a BIN chunk.
pub fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let total = 12 + 8 + text.len() + 8 + bin.len();
    let mut out = b"glTF".to_vec();
    for word in [2, total as u32, text.len() as u32, 0x4E4F_534A] {
        out.extend_from_slice(&word.to_le_bytes());
    }
    out.extend_from_slice(&text);
    for word in [bin.len() as u32, 0x004E_4942] {
        out.extend_from_slice(&word.to_le_bytes());
    }
    out.extend_from_slice(&bin);
    out
}
