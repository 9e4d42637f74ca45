//! Appends to a scan's JSON and buffers; all that was there keeps its place.

use std::collections::BTreeMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gltf::json::accessor::{ComponentType, Type};
use serde_json::{Map, Value, json};

use super::buffers::BufferTarget;
use super::compressed::meshopt;
use super::container::{Container, pack_glb_of_pieces, too_long};
use super::error::ScanError;
use super::json_edit::JsonEdit;
use super::patch_buffer::{NewFile, PatchBuffer};
use super::scan::Scan;
use super::undo;

/// What to append to a scan: elements of lists in its JSON, and bytes.
pub(super) struct Appender<'s> {
    scan: &'s Scan,
    /// New elements of the lists at the top of the JSON.
    lists: BTreeMap<&'static str, Vec<Value>>,
    /// New primitives by mesh.
    primitives: BTreeMap<usize, Vec<Value>>,
    /// New elements of a list in an extension at the top of the JSON, by the names of the extension and the list.
    extensions: BTreeMap<(&'static str, &'static str), Vec<Value>>,
    /// Members to set in what is there: their paths and values.
    members: Vec<(Vec<String>, Value)>,
    /// New elements of arrays by the arrays' paths.
    items: Vec<(Vec<String>, Value)>,
    /// The buffer that takes the new bytes.
    buffer: usize,
    /// How many bytes that buffer has before them.
    start: usize,
    /// Whether that buffer is the BIN chunk; if not, it is a new data URI or file.
    in_bin: bool,
    /// Whether it is a file.
    in_file: bool,
    data: Vec<u8>,
}

/// The values of a new accessor.
pub(super) struct AccessorData<'c> {
    pub name: &'c str,
    pub target: BufferTarget,
    pub component: ComponentType,
    pub kind: Type,
    pub bytes: Vec<u8>,
    /// The bounds of the values, where glTF requires them.
    pub bounds: Option<AccessorBounds>,
}

/// The smallest and the largest value of each component.
#[derive(Debug, Clone, Copy)]
pub(super) struct AccessorBounds {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl AccessorBounds {
    /// The bounds of a list of points.
    pub fn of(points: &[[f32; 3]]) -> Self {
        let mut bounds = Self {
            min: [f32::INFINITY; 3],
            max: [f32::NEG_INFINITY; 3],
        };
        for point in points {
            for (k, x) in point.iter().enumerate() {
                bounds.min[k] = bounds.min[k].min(*x);
                bounds.max[k] = bounds.max[k].max(*x);
            }
        }
        bounds
    }
}

impl<'s> Appender<'s> {
    /// Nothing appended yet.
    pub fn new(scan: &'s Scan, wanted: PatchBuffer) -> Self {
        let buffers = scan
            .json
            .get("buffers")
            .and_then(Value::as_array)
            .map_or(&[][..], Vec::as_slice);
        let in_bin = scan.layout.container == Container::Glb
            && match buffers.first() {
                // The BIN chunk is the first buffer's if that has no uri, and is no stand-in for compressed bytes.
                Some(first) => {
                    let stands_in = meshopt::NAMES.iter().any(|name| {
                        first
                            .get("extensions")
                            .is_some_and(|all| all.get(name).is_some())
                    });
                    first.get("uri").is_none() && scan.layout.bin.is_some() && !stands_in
                }
                None => true,
            };
        let start = match &scan.layout.bin {
            Some(bin) if in_bin => bin.len().next_multiple_of(4),
            _ => 0,
        };
        let buffer = if in_bin { 0 } else { buffers.len() };
        let in_file = wanted == PatchBuffer::File
            && scan.layout.container == Container::Gltf
            && scan.companions.are_several();
        Self {
            scan,
            lists: BTreeMap::new(),
            primitives: BTreeMap::new(),
            extensions: BTreeMap::new(),
            members: Vec::new(),
            items: Vec::new(),
            buffer,
            start,
            in_bin,
            in_file,
            data: Vec::new(),
        }
    }

    /// Appends to the list `key` at the top of the JSON; returns the new element's index.
    pub fn push(&mut self, key: &'static str, value: Value) -> usize {
        let old = self
            .scan
            .json
            .get(key)
            .and_then(Value::as_array)
            .map_or(0, Vec::len);
        let list = self.lists.entry(key).or_default();
        list.push(value);
        old + list.len() - 1
    }

    /// Appends to a list of an extension at the top of the JSON, which is created if it is missing; what is there must be
    /// objects and a list ([`extension_list`]). Returns the new element's index.
    pub fn push_to_extension(
        &mut self,
        extension: &'static str,
        list: &'static str,
        value: Value,
    ) -> usize {
        let old = extension_list(&self.scan.json, extension, list).map_or(0, <[Value]>::len);
        let new = self.extensions.entry((extension, list)).or_default();
        new.push(value);
        old + new.len() - 1
    }

    /// Lists an extension as used.
    pub fn uses(&mut self, extension: &'static str) {
        let old = self
            .scan
            .json
            .get("extensionsUsed")
            .and_then(Value::as_array);
        let new = self.lists.get("extensionsUsed");
        let mut all = old.into_iter().chain(new).flatten();
        if !all.any(|name| name == extension) {
            self.push("extensionsUsed", extension.into());
        }
    }

    /// Appends a primitive to a mesh.
    pub fn primitive(&mut self, mesh: usize, primitive: Value) {
        self.primitives.entry(mesh).or_default().push(primitive);
    }

    /// Sets a member of an object that is there.
    pub fn set(&mut self, path: Vec<String>, value: Value) {
        self.members.push((path, value));
    }

    /// Appends to an array that is there.
    pub fn append_at(&mut self, path: Vec<String>, value: Value) {
        self.items.push((path, value));
    }

    /// Sets the extras of the element that was appended last to a list.
    pub fn extras_of_last(&mut self, key: &str, extras: Value) {
        let last = self.lists.get_mut(key).and_then(|list| list.last_mut());
        if let Some(object) = last.and_then(Value::as_object_mut) {
            object.insert("extras".into(), extras);
        }
    }

    /// Appends a buffer view, of vertices or indices if it has a target; returns its index.
    pub fn view(&mut self, name: &str, bytes: &[u8], target: Option<BufferTarget>) -> usize {
        let mut view = json!({
            "name": name,
            "buffer": self.buffer,
            "byteOffset": self.start + self.data.len(),
            "byteLength": bytes.len(),
        });
        if let Some(target) = target {
            view["target"] = json!(target as u32);
        }
        self.data.extend_from_slice(bytes);
        // The next buffer view starts at a multiple of four.
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        self.push("bufferViews", view)
    }

    /// Appends an accessor with a buffer view of its own; returns the accessor's index.
    pub fn accessor(&mut self, data: AccessorData<'_>) -> Value {
        let size = data.component.size() * data.kind.multiplicity();
        let count = data.bytes.len() / size;
        let view = self.view(data.name, &data.bytes, Some(data.target));
        let mut accessor = json!({
            "name": data.name,
            "bufferView": view,
            "componentType": data.component.as_gl_enum(),
            "count": count,
            "type": type_name(data.kind),
        });
        if let (Some(bounds), Some(object)) = (data.bounds, accessor.as_object_mut()) {
            // Written as f64: readers of f32 and of f64 then both get the exact f32.
            object.insert("min".into(), json!(bounds.min.map(f64::from)));
            object.insert("max".into(), json!(bounds.max.map(f64::from)));
        }
        json!(self.push("accessors", accessor))
    }

    /// Bytes of data appended so far, without JSON.
    pub fn appended_bytes(&self) -> usize {
        self.data.len()
    }

    /// The whole glTF, in the container it was read from, and the file that it refers to anew.
    pub fn finish(mut self) -> Result<(Vec<u8>, Option<NewFile>), ScanError> {
        let length = self.start + self.data.len();
        let (bytes, layout) = (&self.scan.bytes, &self.scan.layout);
        let mut edit = JsonEdit::new(bytes.get(layout.json.clone()).unwrap_or_default())?;
        let file = self
            .in_file
            .then(|| NewFile::of(std::mem::take(&mut self.data), self.scan));
        if !self.in_bin {
            let uri = match &file {
                Some(file) => file.path.clone(),
                None => {
                    let data = STANDARD.encode(&self.data);
                    format!("data:application/octet-stream;base64,{data}")
                }
            };
            self.push("buffers", json!({ "byteLength": length, "uri": uri }));
        } else if self.push("buffers", json!({ "byteLength": length })) > 0 {
            // The BIN chunk already has a buffer: its length grows.
            self.lists.remove("buffers");
            edit.replace(&["buffers", "0", "byteLength"], &json!(length))?;
        }
        self.extras_of_last("bufferViews", undo::extras());
        for (path, value) in &self.members {
            let path: Vec<&str> = path.iter().map(String::as_str).collect();
            edit.set(&path, value)?;
        }
        for (path, value) in &self.items {
            let path: Vec<&str> = path.iter().map(String::as_str).collect();
            edit.append(&path, std::slice::from_ref(value))?;
        }
        self.extend_extensions(&mut edit)?;
        for (mesh, primitives) in &self.primitives {
            edit.append(&["meshes", &mesh.to_string(), "primitives"], primitives)?;
        }
        for (key, values) in &self.lists {
            edit.append(&[key], values)?;
        }
        let text = undo::with_record(self.scan, edit.finish())?.into_bytes();
        if layout.container == Container::Gltf {
            let head = bytes.get(..layout.json.start).unwrap_or_default();
            return Ok(([head, &text].concat(), file));
        }
        let old = layout.bin.clone().and_then(|range| bytes.get(range));
        let padding = [0; 4];
        let pieces;
        let bin = if self.in_bin {
            let old = old.unwrap_or_default();
            let padding = padding.get(..self.start - old.len());
            pieces = [old, padding.unwrap_or_default(), &self.data];
            Some(pieces.as_slice())
        } else {
            old.as_ref().map(std::slice::from_ref)
        };
        let rest = bytes.get(layout.rest.clone()).unwrap_or_default();
        let mut out =
            pack_glb_of_pieces(&text, bin, rest).ok_or_else(|| too_long(text.len() + length))?;
        out.extend_from_slice(bytes.get(layout.trailing.clone()).unwrap_or_default());
        Ok((out, None))
    }
}

impl Appender<'_> {
    /// Writes the new elements of lists in extensions at the top of the JSON.
    fn extend_extensions(&self, edit: &mut JsonEdit<'_>) -> Result<(), ScanError> {
        let old = self.scan.json.get("extensions");
        let mut fresh: BTreeMap<&str, Map<String, Value>> = BTreeMap::new();
        for ((extension, list), values) in &self.extensions {
            let known = old.and_then(|old| old.get(*extension));
            match known {
                Some(known) if known.get(*list).is_some() => {
                    edit.append(&["extensions", extension, list], values)?;
                }
                Some(_) => edit.set(&["extensions", extension, list], &json!(values))?,
                None => {
                    let fresh = fresh.entry(extension).or_default();
                    fresh.insert((*list).to_owned(), json!(values));
                }
            }
        }
        if fresh.is_empty() {
            return Ok(());
        }
        if old.is_none() {
            return edit.set(&["extensions"], &json!(fresh));
        }
        for (extension, lists) in &fresh {
            edit.set(&["extensions", extension], &json!(lists))?;
        }
        Ok(())
    }
}

/// A list of an extension at the top of a JSON, empty where it is missing; `None` where there is something else, so that it
/// cannot be appended to.
pub(super) fn extension_list<'j>(
    json: &'j Value,
    extension: &str,
    list: &str,
) -> Option<&'j [Value]> {
    let used = json.get("extensionsUsed");
    used.is_none_or(Value::is_array).then_some(())?;
    let Some(all) = json.get("extensions") else {
        return Some(&[]);
    };
    let Some(own) = all.as_object()?.get(extension) else {
        return Some(&[]);
    };
    match own.as_object()?.get(list) {
        Some(list) => list.as_array().map(Vec::as_slice),
        None => Some(&[]),
    }
}

fn type_name(kind: Type) -> &'static str {
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
