//! Appending to a scan's JSON and buffers, so that nothing before it moves.

use std::collections::BTreeMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gltf::json::accessor::{ComponentType, Type};
use serde_json::{Value, json};

use super::container::{Container, pack_glb};
use super::splice::Splice;
use super::{Scan, ScanError};

/// `ARRAY_BUFFER` and `ELEMENT_ARRAY_BUFFER` (glTF 2.0, 5.11.5).
#[derive(Debug, Clone, Copy)]
pub(super) enum Target {
    Vertices = 34962,
    Indices = 34963,
}

/// What is to be appended to a scan: elements of lists in its JSON, and the bytes that go with them.
pub(super) struct Appender<'s> {
    scan: &'s Scan,
    /// New elements of the lists at the top of the JSON.
    lists: BTreeMap<&'static str, Vec<Value>>,
    /// New primitives by mesh.
    primitives: BTreeMap<usize, Vec<Value>>,
    /// The buffer that takes the new bytes, and how many bytes stand in it before them.
    buffer: usize,
    start: usize,
    /// Whether that buffer is the BIN chunk; otherwise it is a data URI of its own.
    in_bin: bool,
    data: Vec<u8>,
}

/// What an accessor holds.
pub(super) struct Content<'c> {
    pub name: &'c str,
    pub target: Target,
    pub component: ComponentType,
    pub kind: Type,
    pub bytes: Vec<u8>,
    /// Smallest and largest value by component, where glTF wants them.
    pub bounds: Option<[[f32; 3]; 2]>,
}

impl<'s> Appender<'s> {
    pub fn new(scan: &'s Scan) -> Self {
        let buffers = scan
            .json
            .get("buffers")
            .and_then(Value::as_array)
            .map_or(&[][..], Vec::as_slice);
        let in_bin = scan.layout.container == Container::Glb
            && match buffers.first() {
                // The BIN chunk belongs to the first buffer, if that has no uri.
                Some(first) => first.get("uri").is_none() && scan.layout.bin.is_some(),
                None => true,
            };
        let start = match &scan.layout.bin {
            Some(bin) if in_bin => bin.len().next_multiple_of(4),
            _ => 0,
        };
        let buffer = if in_bin { 0 } else { buffers.len() };
        Self {
            scan,
            lists: BTreeMap::new(),
            primitives: BTreeMap::new(),
            buffer,
            start,
            in_bin,
            data: Vec::new(),
        }
    }

    /// Appends to the list `key` at the top of the JSON; the new element's index.
    pub fn push(&mut self, key: &'static str, value: Value) -> usize {
        let there = self
            .scan
            .json
            .get(key)
            .and_then(Value::as_array)
            .map_or(0, Vec::len);
        let list = self.lists.entry(key).or_default();
        list.push(value);
        there + list.len() - 1
    }

    /// Appends a primitive to a mesh.
    pub fn primitive(&mut self, mesh: usize, primitive: Value) {
        self.primitives.entry(mesh).or_default().push(primitive);
    }

    /// Appends an accessor over a buffer view of its own; its index.
    pub fn accessor(&mut self, content: Content<'_>) -> Value {
        let size = content.component.size() * content.kind.multiplicity();
        let count = content.bytes.len() / size;
        let view = json!({
            "name": content.name,
            "buffer": self.buffer,
            "byteOffset": self.start + self.data.len(),
            "byteLength": content.bytes.len(),
            "target": content.target as u32,
        });
        self.data.extend_from_slice(&content.bytes);
        // The next view starts on a multiple of four.
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let view = self.push("bufferViews", view);
        let mut accessor = json!({
            "name": content.name,
            "bufferView": view,
            "componentType": content.component.as_gl_enum(),
            "count": count,
            "type": name(content.kind),
        });
        if let (Some([min, max]), Some(object)) = (content.bounds, accessor.as_object_mut()) {
            // In f64, whose digits give the f32 back exactly to readers of either width.
            object.insert("min".into(), json!(min.map(f64::from)));
            object.insert("max".into(), json!(max.map(f64::from)));
        }
        json!(self.push("accessors", accessor))
    }

    /// The whole scan in its own container.
    pub fn finish(mut self) -> Result<Vec<u8>, ScanError> {
        let too_long = |length: usize| ScanError::Container {
            offset: length,
            detail: "the patched scan would exceed the 4 GiB of a GLB".into(),
        };
        let length = self.start + self.data.len();
        let (bytes, layout) = (&self.scan.bytes, &self.scan.layout);
        let mut splice = Splice::new(bytes.get(layout.json.clone()).unwrap_or_default())?;
        if !self.in_bin {
            let uri = format!(
                "data:application/octet-stream;base64,{}",
                STANDARD.encode(&self.data)
            );
            self.push("buffers", json!({ "byteLength": length, "uri": uri }));
        } else if self.push("buffers", json!({ "byteLength": length })) > 0 {
            // The BIN chunk has its buffer already: that one grows.
            self.lists.remove("buffers");
            splice.replace(&["buffers", "0", "byteLength"], &json!(length))?;
        }
        for (mesh, primitives) in &self.primitives {
            splice.append(&["meshes", &mesh.to_string(), "primitives"], primitives)?;
        }
        for (key, values) in &self.lists {
            splice.append(&[key], values)?;
        }
        let text = splice.finish().into_bytes();
        if layout.container == Container::Gltf {
            return Ok(text);
        }
        let old = layout.bin.clone().and_then(|range| bytes.get(range));
        let bin = if self.in_bin {
            let mut bin = Vec::with_capacity(length);
            bin.extend_from_slice(old.unwrap_or_default());
            bin.resize(self.start, 0);
            bin.append(&mut self.data);
            Some(bin)
        } else {
            old.map(<[u8]>::to_vec)
        };
        let rest = bytes.get(layout.rest.clone()).unwrap_or_default();
        pack_glb(&text, bin.as_deref(), rest).ok_or_else(|| too_long(text.len() + length))
    }
}

fn name(kind: Type) -> &'static str {
    match kind {
        Type::Scalar => "SCALAR",
        Type::Vec2 => "VEC2",
        Type::Vec3 => "VEC3",
        Type::Vec4 => "VEC4",
        Type::Mat2 => "MAT2",
        Type::Mat3 => "MAT3",
        Type::Mat4 => "MAT4",
    }
}
