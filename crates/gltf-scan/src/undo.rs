//! Records with which a mend is undone byte for byte, and undoing it.
//!
//! Every write leaves one, in `extras.darn.undo` of the last buffer view that it appended:
//!
//! - `sha256`: of the whole file before;
//! - `json`: the length of its JSON text, without padding of zeros, in bytes;
//! - `edits`: how the text was edited, in order: the place in the old text, the length of what was put there (the value of
//!   `undo` counted as `null`), and the text that was there, if any;
//! - `zeros`: how many zeros padded the JSON chunk, if any (the format wants spaces);
//! - `bin`: the length of the BIN chunk, if there was one.
//!
//! All else that a file had is in the file it was mended to: its other bytes, chunks and trailing bytes. A file that was
//! mended several times has a record of each time, and the last one is undone first.
//!
//! Records do not hold for a glTF that darn packs with its files into a GLB: every index and offset is another there. `extras.darn.packed`
//! takes the place of the first one and keeps the `sha256` of the glTF from before the first mend.

use serde_json::{Value, json};

use super::container::{self, Container, ContainerLayout};
use super::digests::sha256;
use super::error::ScanError;
use super::json_edit::{EditedText, JsonEdit};
use super::scan::Scan;

/// Most zeros that pad a JSON chunk whose mend is undone byte for byte; the format needs three.
const MAX_ZEROS: usize = 1 << 16;

/// What stands in for the record while the text around it is edited.
pub(super) const PLACEHOLDER: Value = Value::Null;
const PLACEHOLDER_TEXT: &str = "null";

/// `extras` of the buffer view that takes the record.
pub(super) fn extras() -> Value {
    json!({ "darn": { "undo": PLACEHOLDER } })
}

/// An edited text with the record of its edits in place of the [`PLACEHOLDER`].
///
/// # Errors
/// [`ScanError::Invalid`] where the placeholder is missing.
pub(super) fn with_record(scan: &Scan, edited: EditedText) -> Result<String, ScanError> {
    let (bytes, layout) = (&scan.bytes, &scan.layout);
    let edits = edited.splices.into_iter().map(|splice| {
        let mut edit = vec![json!(splice.at), json!(splice.inserted)];
        if !splice.removed.is_empty() {
            edit.push(splice.removed.into());
        }
        Value::Array(edit)
    });
    let mut record = json!({
        "sha256": scan.digests().sha256,
        "json": layout.json.len(),
        "edits": edits.collect::<Vec<_>>(),
    });
    let zeros = zeros_after(bytes, layout);
    if zeros > 0 {
        record["zeros"] = json!(zeros);
    }
    if let Some(bin) = &layout.bin {
        record["bin"] = json!(bin.len());
    }
    let place = record_in(&edited.text)?.ok_or_else(|| ScanError::Invalid {
        pointer: "/bufferViews".into(),
        detail: "holds no place for the record of the mend".into(),
    })?;
    let mut text = edited.text;
    text.replace_range(place, &record.to_string());
    Ok(text)
}

/// What a file says of the mend that it comes from.
pub(super) enum Undone {
    /// Nothing.
    NoRecord,
    /// A record that does not lead back to the file it tells of: it is broken, or the file was changed afterwards.
    Changed,
    /// The file as it was before the mend.
    Before(Vec<u8>),
}

/// Undoes the last mend of a GLB or of a glTF's JSON.
///
/// # Errors
/// The file is no glTF.
pub(super) fn undone(bytes: &[u8]) -> Result<Undone, ScanError> {
    let layout = container::layout(bytes)?;
    let text = bytes.get(layout.json.clone()).unwrap_or_default();
    let Ok(text) = std::str::from_utf8(text) else {
        return Ok(Undone::NoRecord);
    };
    let Ok(Some(place)) = record_in(text) else {
        return Ok(Undone::NoRecord);
    };
    let record = text.get(place.clone()).unwrap_or_default();
    let Ok(record) = darn_json::value(record.as_bytes()) else {
        return Ok(Undone::Changed);
    };
    let mut bare = text.to_owned();
    bare.replace_range(place, PLACEHOLDER_TEXT);
    let before = text_before(&bare, &record).and_then(|text| {
        let before = file_before(bytes, &layout, &text, &record)?;
        (record.get("sha256")?.as_str()? == sha256(&before)).then_some(before)
    });
    Ok(before.map_or(Undone::Changed, Undone::Before))
}

/// Where the record of the last mend is in a JSON text.
fn record_in(text: &str) -> Result<Option<std::ops::Range<usize>>, ScanError> {
    let mut json = JsonEdit::new(text.as_bytes())?;
    let Some(last) = json
        .length(&["bufferViews"])?
        .and_then(|n| n.checked_sub(1))
    else {
        return Ok(None);
    };
    json.place(&["bufferViews", &last.to_string(), "extras", "darn", "undo"])
}

/// The text before the edits of a record; `None` if they do not fit the text.
fn text_before(text: &str, record: &Value) -> Option<String> {
    let mut before = String::with_capacity(text.len());
    // Where the text is read, and how many bytes of the old text are there.
    let (mut at, mut old) = (0_usize, 0_usize);
    for edit in record.get("edits")?.as_array()? {
        let place = number(edit.get(0)?)?;
        let end = at.checked_add(place.checked_sub(old)?)?;
        before.push_str(text.get(at..end)?);
        at = end.checked_add(number(edit.get(1)?)?)?;
        let removed = match edit.get(2) {
            Some(removed) => removed.as_str()?,
            None => "",
        };
        before.push_str(removed);
        old = place.checked_add(removed.len())?;
    }
    before.push_str(text.get(at..)?);
    let length = number(record.get("json")?)?;
    // The JSON chunk of the mended file was padded anew.
    before
        .get(length..)?
        .bytes()
        .all(|b| b == b' ')
        .then_some(())?;
    before.truncate(length);
    Some(before)
}

/// The whole file with its old JSON text.
fn file_before(
    bytes: &[u8],
    layout: &ContainerLayout,
    text: &str,
    record: &Value,
) -> Option<Vec<u8>> {
    if layout.container == Container::Gltf {
        let head = bytes.get(..layout.json.start)?;
        return Some([head, text.as_bytes()].concat());
    }
    let optional = |key: &str| record.get(key).map(number);
    let zeros = optional("zeros").unwrap_or(Some(0))?;
    // A record must not make a large file of a small one.
    (zeros <= MAX_ZEROS).then_some(())?;
    let json = [text.as_bytes(), &vec![0; zeros]].concat();
    let bin = match optional("bin") {
        Some(length) => Some(bytes.get(layout.bin.clone()?)?.get(..length?)?),
        None => None,
    };
    let mut before = container::glb_of_chunks(&json, bin, bytes.get(layout.rest.clone())?)?;
    before.extend_from_slice(bytes.get(layout.trailing.clone())?);
    Some(before)
}

/// Replaces the records of a glTF that is packed by the mark that says so.
pub(super) fn mark_packed(json: &mut Value) {
    let views = json.get_mut("bufferViews").and_then(Value::as_array_mut);
    let views = views.into_iter().flatten();
    let records = views.filter_map(|view| view.pointer_mut("/extras/darn")?.as_object_mut());
    let mut is_first = true;
    for darn in records {
        let Some(record) = darn.shift_remove("undo") else {
            continue;
        };
        if is_first {
            darn.insert("packed".into(), json!({ "sha256": record.get("sha256") }));
        }
        is_first = false;
    }
}

/// The SHA-256 that the mark of a packed glTF keeps.
pub(super) fn packed_from(json: &Value) -> Option<&str> {
    let views = json.get("bufferViews")?.as_array()?;
    let mut marks = views
        .iter()
        .filter_map(|view| view.pointer("/extras/darn/packed/sha256"));
    let digest = marks.next()?.as_str()?;
    let is_digest = digest.len() == 64 && digest.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_digest.then_some(digest)
}

fn number(value: &Value) -> Option<usize> {
    usize::try_from(value.as_u64()?).ok()
}

/// How many zeros pad the JSON chunk.
fn zeros_after(bytes: &[u8], layout: &ContainerLayout) -> usize {
    let length = match layout.container {
        Container::Glb => container::json_chunk_length(bytes).unwrap_or(0),
        _ => 0,
    };
    length.saturating_sub(layout.json.len())
}
