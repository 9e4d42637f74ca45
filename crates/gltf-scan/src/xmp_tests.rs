//! Laws of the packets of metadata, after the rules of `KHR_xmp_json_ld`.

use serde_json::{Value, json};

use super::digests::sha256;
use super::testing::Builder;
use super::xmp::EXTENSION;
use super::{PatchPoint, PatchPrimitive, Scan, ScanLimits};
use darn_geometry::mesh::Vec3;

/// The scan with a patch, as bytes and as JSON.
fn mended(bytes: &[u8]) -> (Vec<u8>, Value) {
    let scan = Scan::read(bytes.to_vec(), &ScanLimits::default()).unwrap();
    let patch = PatchPrimitive {
        name: "patch".into(),
        deviations: Vec::new(),
        part: 0,
        material_of: 0,
        points: vec![
            PatchPoint::Scan(0),
            PatchPoint::Scan(1),
            PatchPoint::New(Vec3::z()),
        ],
        normals: Vec::new(),
        tangents: Vec::new(),
        texcoords: Vec::new(),
        colors: Vec::new(),
        faces: vec![[0, 1, 2]],
        both_sides: false,
        appearance: Default::default(),
        hole: Default::default(),
        method: Default::default(),
    };
    let out = scan.write(&[patch]).unwrap();
    let layout = super::container::layout(&out).unwrap();
    let json = serde_json::from_slice(&out[layout.json]).unwrap();
    (out, json)
}

/// Asserts the extension's rules for a value of a packet with these prefixes.
fn check(value: &Value, prefixes: &Value, in_list: bool) {
    match value {
        Value::Array(values) => {
            assert!(in_list, "arrays stand under @list or @set alone");
            values
                .iter()
                .for_each(|value| check(value, prefixes, false));
        }
        Value::Object(members) => {
            for (key, value) in members {
                match key.split_once(':') {
                    Some((prefix, _)) => assert!(prefixes[prefix].is_string(), "{key}"),
                    None => assert!(
                        ["@list", "@set", "@type", "@language", "@value"].contains(&&**key),
                        "{key}"
                    ),
                }
                check(value, prefixes, matches!(&**key, "@list" | "@set"));
            }
        }
        _ => {}
    }
}

#[test]
fn the_file_and_the_patches_have_a_packet_that_keeps_to_the_rules() {
    let before = Builder::square().glb();
    let (after, json) = mended(&before);
    let packets = json["extensions"][EXTENSION]["packets"].as_array().unwrap();
    let [packet] = &packets[..] else {
        panic!("one packet")
    };
    let mut members = packet.clone();
    let context = members.as_object_mut().unwrap().remove("@context").unwrap();
    check(&members, &context, false);
    assert_eq!(
        packet["dc:source"],
        format!("urn:sha256:{}", sha256(&before))
    );
    let tool = packet["xmp:CreatorTool"].as_str().unwrap();
    assert!(tool.starts_with("darn "), "{tool}");
    let kind = packet["Iptc4xmpExt:DigitalSourceType"].as_str().unwrap();
    assert!(
        kind.ends_with("/compositeWithTrainedAlgorithmicMedia"),
        "{kind}"
    );
    let words = packet["dc:description"]["rdf:_1"]["@value"]
        .as_str()
        .unwrap();
    assert!(
        words.starts_with("One hole") && words.contains("reconstruction"),
        "{words}"
    );

    let reference = json!({ "packet": 0 });
    assert_eq!(json["asset"]["extensions"][EXTENSION], reference);
    let materials = json["materials"].as_array().unwrap();
    assert!(materials[0].get("extensions").is_none(), "the cloth's own");
    for material in &materials[1..] {
        assert_eq!(material["extensions"][EXTENSION], reference);
    }
    let used = json["extensionsUsed"].as_array().unwrap();
    assert!(used.contains(&json!(EXTENSION)));
    assert_eq!(mended(&before).0, after, "no date, the same bytes");
}

#[test]
fn packets_that_are_there_stay_and_stay_the_file_s() {
    let mut scan = Builder::square();
    let own = json!({"@context": {"dc": "http://purl.org/dc/elements/1.1/"}, "dc:creator": {"@list": ["A. Weaver"]}});
    scan.json["extensions"] = json!({EXTENSION: {"packets": [own]}});
    scan.json["asset"]["extensions"] = json!({EXTENSION: {"packet": 0}});
    scan.json["materials"][0]["extensions"] = json!({EXTENSION: {"packet": 0}});
    scan.json["extensionsUsed"] = json!([EXTENSION]);
    let (once, json) = mended(&scan.glb());
    let packets = json["extensions"][EXTENSION]["packets"].as_array().unwrap();
    assert_eq!((packets.len(), &packets[0]), (2, &own));
    assert_eq!(json["asset"]["extensions"][EXTENSION]["packet"], 0);
    assert_eq!(json["materials"][0]["extensions"][EXTENSION]["packet"], 0);
    assert_eq!(json["materials"][1]["extensions"][EXTENSION]["packet"], 1);

    let (_, twice) = mended(&once);
    let packets = twice["extensions"][EXTENSION]["packets"]
        .as_array()
        .unwrap();
    assert_eq!(packets.len(), 3);
    assert_eq!(
        packets[2]["dc:source"],
        format!("urn:sha256:{}", sha256(&once))
    );
}
