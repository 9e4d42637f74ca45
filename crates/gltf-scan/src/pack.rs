//! Packing a glTF with its separate files as one GLB.

use bytes::Bytes;
use darn_budget::Budget;
use darn_mesh_files::MeshFormat;
use serde_json::{Map, Value, json};

use super::buffers::decode_data_uri;
use super::compressed::{DecodeAllowance, meshopt};
use super::container::{Container, layout, pack_glb};
use super::error::ScanError;
use super::files::{Companions, json_of_text};
use super::json::JsonPlace;
use super::limits::ScanLimits;
use super::mesh_file::mesh_container;
use super::patch_buffer::ends_in_a_file;
use super::scan::Scan;
use super::undo;
use super::zip_files::ZipFiles;

impl Scan {
    /// A mended scan ([`Scan::write`]) as one GLB with all its files in it; one that is a GLB already stays.
    ///
    /// # Errors
    /// A buffer's file is missing; the GLB would be too large; an OBJ or a PLY.
    pub fn packed(&self, mended: &[u8]) -> Result<Vec<u8>, ScanError> {
        if self.origin.is_some() {
            return Err(ScanError::NotPacked);
        }
        let limits = ScanLimits::default();
        let allowance = DecodeAllowance::new(&limits, Budget::unlimited());
        match (&self.companions, self.layout.container) {
            (Companions::Zip(_), _) => {
                let mended = Bytes::copy_from_slice(mended);
                repacked(mended, Container::Glb, &limits, Budget::unlimited())
                    .map(|(_, bytes)| bytes)
            }
            (_, Container::Glb) => Ok(mended.to_vec()),
            (files, _) => packed(mended, files, &allowance),
        }
    }
}

/// The scan of a zip in another container: the glTF alone, or a GLB with all its files. Also returns the container: a zip's
/// GLB stays a GLB, its OBJ or PLY stays one and comes alone, and a zip with a patch in a file of its own
/// ([`PatchBuffer::File`](super::PatchBuffer)) is no glTF alone.
///
/// # Errors
/// As [`Scan::packed`]; `Exhausted`.
pub fn repacked(
    zip: impl Into<Bytes>,
    container: Container,
    limits: &ScanLimits,
    budget: &Budget<'_>,
) -> Result<(Container, Vec<u8>), ScanError> {
    let allowance = DecodeAllowance::new(limits, budget);
    let zip = ZipFiles::open(zip.into())?;
    let main = zip.main(&allowance)?;
    if let Some(format) = MeshFormat::of(&main) {
        return Ok((mesh_container(format), main.to_vec()));
    }
    let found = layout(&main)?.container;
    let bytes = match (container, found) {
        (Container::Glb, Container::Gltf) => {
            let bytes = packed(&main, &Companions::Zip(zip), &allowance)?;
            budget.check_output(bytes.len())?;
            return Ok((Container::Glb, bytes));
        }
        (Container::Gltf, Container::Gltf) if ends_in_a_file(&json_of_text(&main)?) => {
            return Ok((Container::Zip, zip.bytes.to_vec()));
        }
        _ => main.to_vec(),
    };
    Ok((found, bytes))
}

/// A GLB of a glTF: its buffers one after another in the BIN chunk, its images as buffer views. Images that are not there
/// keep their URIs.
fn packed(
    gltf: &[u8],
    companions: &Companions,
    allowance: &DecodeAllowance<'_>,
) -> Result<Vec<u8>, ScanError> {
    let mut json = json_of_text(gltf)?;
    undo::mark_packed(&mut json);
    let mut bin = Vec::new();
    let places = merge_buffers(&mut json, &mut bin, companions, allowance)?;
    for view in list(&mut json, "bufferViews") {
        move_view(view, &places);
        let extensions = view.get_mut("extensions").and_then(Value::as_object_mut);
        for (name, extension) in extensions.into_iter().flatten() {
            if meshopt::NAMES.contains(&name.as_str()) {
                move_view(extension, &places);
            }
        }
    }
    embed_images(&mut json, &mut bin, companions, allowance)?;
    if let Some(first) = list(&mut json, "buffers").first_mut() {
        first["byteLength"] = json!(bin.len());
    }
    let text = json.to_string();
    pack_glb(text.as_bytes(), Some(&bin), &[]).ok_or_else(|| ScanError::Container {
        offset: text.len(),
        detail: "the packed scan would exceed the 4 GiB of a GLB".into(),
    })
}

/// Where a buffer has gone: its new index, and the offset of its first byte there.
type BufferPlace = (usize, usize);

/// Moves all buffers with bytes into one; buffers without (stand-ins for compressed bytes) follow it.
fn merge_buffers(
    json: &mut Value,
    bin: &mut Vec<u8>,
    companions: &Companions,
    allowance: &DecodeAllowance<'_>,
) -> Result<Vec<BufferPlace>, ScanError> {
    let (mut places, mut merged) = (Vec::new(), vec![json!({})]);
    if let Some(buffers) = JsonPlace::root(json).get("buffers")? {
        for buffer in buffers.items()? {
            let Some(uri) = buffer.get("uri")? else {
                places.push((merged.len(), 0));
                merged.push(buffer.value.clone());
                continue;
            };
            let bytes = uri_bytes(&uri, companions, allowance)?;
            let bytes = bytes.ok_or_else(|| ScanError::external(&uri))?;
            let length = buffer.need("byteLength")?.integer()?;
            let bytes = bytes.get(..length).unwrap_or(&bytes);
            append(bin, bytes, allowance)?;
            places.push((0, bin.len() - bytes.len()));
        }
    }
    json["buffers"] = Value::Array(merged);
    Ok(places)
}

fn move_view(view: &mut Value, places: &[BufferPlace]) {
    let index = view.get("buffer").and_then(Value::as_u64);
    let place = index.and_then(|index| places.get(usize::try_from(index).ok()?));
    if let Some(&(buffer, start)) = place {
        let offset = view.get("byteOffset").and_then(Value::as_u64).unwrap_or(0);
        view["buffer"] = json!(buffer);
        view["byteOffset"] = json!(offset + start as u64);
    }
}

fn embed_images(
    json: &mut Value,
    bin: &mut Vec<u8>,
    companions: &Companions,
    allowance: &DecodeAllowance<'_>,
) -> Result<(), ScanError> {
    let mut views = Vec::new();
    let before = list(json, "bufferViews").len();
    for (index, image) in list(json, "images").iter_mut().enumerate() {
        let Some(object) = image.as_object_mut() else {
            continue;
        };
        let Some(uri) = object.get("uri").cloned() else {
            continue;
        };
        let place = JsonPlace {
            value: &uri,
            pointer: format!("/images/{index}/uri"),
        };
        let text = place.text()?;
        let kind = object.get("mimeType").and_then(Value::as_str);
        let (Some(kind), Some(bytes)) = (
            kind.or_else(|| media_type(text)).map(str::to_owned),
            uri_bytes(&place, companions, allowance)?,
        ) else {
            continue;
        };
        append(bin, &bytes, allowance)?;
        let start = bin.len() - bytes.len();
        object.shift_remove("uri");
        object.insert("bufferView".into(), json!(before + views.len()));
        object.insert("mimeType".into(), json!(kind));
        views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": bytes.len()}));
    }
    if !views.is_empty() {
        let all = json.as_object_mut().map(|root| {
            root.entry("bufferViews")
                .or_insert_with(|| Value::Array(Vec::new()))
        });
        if let Some(all) = all.and_then(Value::as_array_mut) {
            all.extend(views);
        }
    }
    Ok(())
}

/// Appends bytes at a multiple of four.
fn append(
    bin: &mut Vec<u8>,
    bytes: &[u8],
    allowance: &DecodeAllowance<'_>,
) -> Result<(), ScanError> {
    allowance.budget.hold(bytes.len())?;
    bin.resize(bin.len().next_multiple_of(4), 0);
    bin.extend_from_slice(bytes);
    Ok(())
}

fn uri_bytes(
    uri: &JsonPlace<'_>,
    companions: &Companions,
    allowance: &DecodeAllowance<'_>,
) -> Result<Option<Bytes>, ScanError> {
    let text = uri.text()?;
    if text.starts_with("data:") {
        return decode_data_uri(uri).map(|bytes| Some(bytes.into()));
    }
    companions.file(text, allowance)
}

/// The media type of an image by the end of its name, or of its data URI by its head.
fn media_type(uri: &str) -> Option<&'static str> {
    const TYPES: [(&str, &str); 5] = [
        ("png", "image/png"),
        ("jpg", "image/jpeg"),
        ("jpeg", "image/jpeg"),
        ("webp", "image/webp"),
        ("ktx2", "image/ktx2"),
    ];
    if let Some(data) = uri.strip_prefix("data:") {
        return TYPES
            .iter()
            .map(|(_, kind)| *kind)
            .find(|kind| data.starts_with(kind));
    }
    let (_, end) = uri.rsplit_once('.')?;
    let known = TYPES
        .iter()
        .find(|(name, _)| end.eq_ignore_ascii_case(name));
    known.map(|(_, kind)| *kind)
}

fn list<'j>(json: &'j mut Value, key: &str) -> &'j mut [Value] {
    let list = json
        .as_object_mut()
        .and_then(|root: &mut Map<_, _>| root.get_mut(key));
    list.and_then(Value::as_array_mut)
        .map_or(&mut [], Vec::as_mut_slice)
}
