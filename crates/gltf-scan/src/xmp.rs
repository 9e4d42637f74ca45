//! `KHR_xmp_json_ld`: a packet of metadata about the mend, on the file and on the materials of its patches.
//!
//! Programs that know no darn read there what was done: the file before by its digest, the tool, a description in words, and
//! the kind of digital source that IPTC has for pictures to which a trained model added something. Packets that are there
//! stay, and the file's own packet stays the file's. There is no date: the same scan gives the same bytes.

use serde_json::{Value, json};

use super::append::{Appender, extension_list};
use super::scan::Scan;

/// Name of the extension.
pub(super) const EXTENSION: &str = "KHR_xmp_json_ld";
/// Name of its list.
pub(super) const PACKETS: &str = "packets";

/// How the tool's name starts in darn's packets.
const TOOL: &str = "darn ";
/// A picture, or a scan, with parts made by a model that was trained (IPTC NewsCodes).
const SOURCE_TYPE: &str =
    "http://cv.iptc.org/newscodes/digitalsourcetype/compositeWithTrainedAlgorithmicMedia";

/// Appends the packet of a mend of so many holes, refers to it on the file, and returns its index; `None` if the scan uses
/// the extension in a way that cannot be added to.
pub(super) fn append_packet(scan: &Scan, out: &mut Appender<'_>, holes: usize) -> Option<usize> {
    extension_list(&scan.json, EXTENSION, PACKETS)?;
    let version = env!("CARGO_PKG_VERSION");
    let holes = match holes {
        1 => "One hole".to_owned(),
        holes => format!("{holes} holes"),
    };
    let words = format!(
        "{holes} of this scan of cloth were closed by darn {version}. The new cloth is a reconstruction and no evidence of the \
         original; extras.darn of each of its primitives says how it was made."
    );
    let packet = json!({
        "@context": {
            "Iptc4xmpExt": "http://iptc.org/std/Iptc4xmpExt/2008-02-29/",
            "dc": "http://purl.org/dc/elements/1.1/",
            "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
            "xmp": "http://ns.adobe.com/xap/1.0/",
        },
        "dc:source": format!("urn:sha256:{}", scan.digests().sha256),
        "dc:description": {
            "@type": "rdf:Alt",
            "rdf:_1": { "@language": "en", "@value": words },
        },
        "xmp:CreatorTool": format!("{TOOL}{version}"),
        "Iptc4xmpExt:DigitalSourceType": SOURCE_TYPE,
    });
    let index = out.push_to_extension(EXTENSION, PACKETS, packet);
    out.uses(EXTENSION);
    let path = |keys: &[&str]| keys.iter().map(|key| (*key).to_owned()).collect();
    let reference = reference(index);
    match scan.json.pointer("/asset/extensions") {
        None => {
            let extensions = json!({ EXTENSION: reference });
            out.set(path(&["asset", "extensions"]), extensions);
        }
        Some(Value::Object(extensions)) if !extensions.contains_key(EXTENSION) => {
            out.set(path(&["asset", "extensions", EXTENSION]), reference);
        }
        Some(_) => {}
    }
    Some(index)
}

/// What refers to a packet, in an object's `extensions`.
pub(super) fn reference(packet: usize) -> Value {
    json!({ "packet": packet })
}

/// Whether a packet is darn's.
pub(super) fn is_own(packet: &Value) -> bool {
    let tool = packet.get("xmp:CreatorTool").and_then(Value::as_str);
    tool.is_some_and(|tool| tool.starts_with(TOOL))
}
