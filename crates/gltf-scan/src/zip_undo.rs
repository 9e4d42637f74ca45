//! The entry of a mended zip with which its mend is undone, byte for byte.
//!
//! The entry starts with a line of JSON: `sha256` and `length` of the zip before, and `copies`, the runs of it that the
//! mended zip has, too: `[start before, start now, length]`, ascending. All other bytes of the zip before follow, one run
//! after another: headers, the directory, and the glTF as it was compressed.

use serde_json::{Value, json};

use super::compressed::DecodeAllowance;
use super::digests::sha256;
use super::error::ScanError;
use super::zip_files::ZipFiles;

/// Nanoseconds of work a byte that is copied and checked.
const BYTE_WORK: u64 = 5;

/// A run of bytes that both zips have.
struct Copy {
    before: usize,
    now: usize,
    length: usize,
}

/// The entry's bytes for a zip and the mended one, without this entry.
pub(super) fn record(before: &ZipFiles, now: &ZipFiles) -> Result<Vec<u8>, ScanError> {
    let mut copies = Vec::new();
    for name in before.names().filter(|name| *name != before.main) {
        let (Some(old), Some(new)) = (before.compressed(name)?, now.compressed(name)?) else {
            continue;
        };
        let same = before.bytes.get(old.clone()) == now.bytes.get(new.clone());
        if same && !old.is_empty() {
            copies.push(Copy {
                before: old.start,
                now: new.start,
                length: old.len(),
            });
        }
    }
    copies.sort_by_key(|copy| copy.before);
    let mut rest = Vec::new();
    let mut at = 0;
    // Entries that share bytes, which a zip may have, are copied once.
    copies.retain(|copy| {
        let Some(between) = before.bytes.get(at..copy.before) else {
            return false;
        };
        rest.extend_from_slice(between);
        at = copy.before + copy.length;
        true
    });
    rest.extend_from_slice(before.bytes.get(at..).unwrap_or_default());
    let copies = copies
        .iter()
        .map(|it| json!([it.before, it.now, it.length]));
    let head = json!({
        "sha256": sha256(&before.bytes),
        "length": before.bytes.len(),
        "copies": copies.collect::<Vec<_>>(),
    });
    let mut record = head.to_string().into_bytes();
    record.push(b'\n');
    record.append(&mut rest);
    Ok(record)
}

/// The zip before; `None` if the record does not fit the zip.
pub(super) fn before(
    now: &[u8],
    record: &[u8],
    allowance: &DecodeAllowance<'_>,
) -> Result<Option<Vec<u8>>, ScanError> {
    let Some(end) = record.iter().position(|byte| *byte == b'\n') else {
        return Ok(None);
    };
    let (head, rest) = record.split_at(end);
    let Ok(head) = darn_json::value(head) else {
        return Ok(None);
    };
    let number = |value: &Value| usize::try_from(value.as_u64()?).ok();
    // What a record claims is checked before it is allocated.
    let Some(length) = head.get("length").and_then(number) else {
        return Ok(None);
    };
    if length > now.len().saturating_add(record.len()) {
        return Ok(None);
    }
    allowance.take(length, "")?;
    (allowance.budget).spend_at_once(BYTE_WORK.saturating_mul(length as u64))?;
    Ok(rebuilt(
        now,
        &head,
        rest.get(1..).unwrap_or_default(),
        length,
    ))
}

fn rebuilt(now: &[u8], head: &Value, mut rest: &[u8], length: usize) -> Option<Vec<u8>> {
    let number = |value: Option<&Value>| usize::try_from(value?.as_u64()?).ok();
    let mut before = Vec::with_capacity(length);
    for copy in head.get("copies")?.as_array()? {
        let start = number(copy.get(0))?;
        let (own, after) = rest.split_at_checked(start.checked_sub(before.len())?)?;
        before.extend_from_slice(own);
        rest = after;
        let from = number(copy.get(1))?;
        let run = now.get(from..from.checked_add(number(copy.get(2))?)?)?;
        if before.len() + run.len() > length {
            return None;
        }
        before.extend_from_slice(run);
    }
    before.extend_from_slice(rest);
    (head.get("sha256")?.as_str()? == sha256(&before)).then_some(before)
}
