//! Materials of patches: copies of the scan's, marked as reconstructions.

use serde_json::{Map, Value};

use super::append::Appender;
use super::error::ScanError;
use super::scan::Scan;

const RECONSTRUCTION: &str = "darn reconstruction";

/// Appends a copy of a material that is marked as a reconstruction, and returns its index. A material that has the mark
/// is used as it is.
pub(super) fn copy_material(
    scan: &Scan,
    out: &mut Appender<'_>,
    source: usize,
) -> Result<usize, ScanError> {
    let invalid = || ScanError::Invalid {
        pointer: format!("/materials/{source}"),
        detail: "must be an object".into(),
    };
    let mut copy = scan
        .json
        .pointer(&format!("/materials/{source}"))
        .cloned()
        .ok_or_else(invalid)?;
    if copy.pointer("/extras/darn/reconstructed") == Some(&Value::Bool(true)) {
        return Ok(source);
    }
    let name = match copy.get("name").and_then(Value::as_str) {
        Some(name) => format!("{name} ({RECONSTRUCTION})"),
        None => RECONSTRUCTION.into(),
    };
    copy.as_object_mut()
        .ok_or_else(invalid)?
        .insert("name".into(), name.into());
    // Extras that are not an object cannot take the mark; the primitive's extras have it too.
    if let Some(darn) = member_object(&mut copy, "extras")
        .and_then(|extras| member_object(extras, "darn"))
        .and_then(Value::as_object_mut)
    {
        darn.insert("reconstructed".into(), Value::Bool(true));
    }
    Ok(out.push("materials", copy))
}

/// The object `key` of an object, created if it is missing; `None` if `key` is something else.
fn member_object<'v>(object: &'v mut Value, key: &str) -> Option<&'v mut Value> {
    let member = object
        .as_object_mut()?
        .entry(key)
        .or_insert_with(|| Value::Object(Map::new()));
    member.is_object().then_some(member)
}
