//! Laws of the provenance of mends.

use super::provenance::{Mend, NamedFile, ScanFiles, document};
use super::provenance_date::MendDate;
use darn_contract::v1::{HoleReport, Report, Weights};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A property: its name, whether it must be there, and the class of what it leads to (for none, a text or a name
/// outside of the document).
type Property = (&'static str, bool, Option<&'static str>);

/// The schema: the properties of each class.
const SCHEMA: &[(&str, &[Property])] = &[
    (
        "crmdig:D10_Software_Execution",
        &[
            ("rdfs:label", true, None),
            (
                "crmdig:L10_had_input",
                true,
                Some("crmdig:D1_Digital_Object"),
            ),
            (
                "crmdig:L11_had_output",
                true,
                Some("crmdig:D1_Digital_Object"),
            ),
            (
                "crmdig:L13_used_parameters",
                true,
                Some("crmdig:D1_Digital_Object"),
            ),
            (
                "crmdig:L23_used_software_or_firmware",
                true,
                Some("crmdig:D14_Software"),
            ),
            (
                "crmdig:L24_created_logfile",
                false,
                Some("crmdig:D1_Digital_Object"),
            ),
            ("crm:P4_has_time-span", false, Some("crm:E52_Time-Span")),
        ],
    ),
    (
        "premis:Event",
        &[
            ("dcterms:type", true, None),
            ("premis:note", true, None),
            ("premis:outcome", true, None),
            ("eventRelatedObjectRole:sou", true, Some("premis:File")),
            ("eventRelatedObjectRole:out", true, Some("premis:File")),
            (
                "eventRelatedAgentRole:exe",
                true,
                Some("premis:SoftwareAgent"),
            ),
            ("dcterms:date", false, None),
        ],
    ),
    (
        "premis:File",
        &[
            ("rdfs:label", true, None),
            ("premis:fixity", true, Some("premis:Fixity")),
            ("dcterms:hasPart", false, Some("premis:File")),
            ("dcterms:requires", false, Some("premis:File")),
        ],
    ),
    (
        "premis:Fixity",
        &[("dcterms:type", true, None), ("rdf:value", true, None)],
    ),
    (
        "crmdig:D1_Digital_Object",
        &[
            ("rdfs:label", true, None),
            ("premis:fixity", false, Some("premis:Fixity")),
            ("dcterms:hasPart", false, Some("premis:File")),
            ("dcterms:requires", false, Some("premis:File")),
            ("crm:P3_has_note", false, None),
        ],
    ),
    ("crmdig:D14_Software", &[("rdfs:label", true, None)]),
    ("premis:SoftwareAgent", &[("rdfs:label", true, None)]),
    (
        "crm:E52_Time-Span",
        &[("crm:P82_at_some_time_within", true, None)],
    ),
];

fn classes_of(node: &Value) -> Vec<&str> {
    let found = node.get("@type").unwrap_or(&Value::Null);
    let several = found
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str);
    found.as_str().into_iter().chain(several).collect()
}

/// Asserts that a document keeps to the schema.
fn check(document: &Value) {
    let context = document["@context"].as_object().unwrap();
    let graph = document["@graph"].as_array().unwrap();
    let nodes: BTreeMap<&str, &Value> = graph
        .iter()
        .map(|node| (node["@id"].as_str().unwrap(), node))
        .collect();
    assert_eq!(nodes.len(), graph.len(), "every node has a name of its own");
    graph
        .iter()
        .for_each(|node| check_node(node, context, &nodes));
}

fn check_node(
    node: &Value,
    context: &serde_json::Map<String, Value>,
    nodes: &BTreeMap<&str, &Value>,
) {
    let classes = classes_of(node);
    let known = SCHEMA.iter().filter(|(class, _)| classes.contains(class));
    let properties: Vec<_> = known.clone().flat_map(|(_, all)| all.iter()).collect();
    assert_eq!(known.count(), classes.len(), "an unknown class in {node}");
    for (key, value) in node.as_object().unwrap() {
        if key.starts_with('@') {
            continue;
        }
        let prefix = key.split(':').next().unwrap();
        assert!(context.contains_key(prefix), "{key}");
        let own: Vec<_> = properties.iter().filter(|(name, ..)| name == key).collect();
        assert!(!own.is_empty(), "{key} is no property of {classes:?}");
        let values = value
            .as_array()
            .cloned()
            .unwrap_or_else(|| vec![value.clone()]);
        assert!(!values.is_empty(), "{key}");
        for (_, _, class) in own {
            let Some(class) = class else {
                continue;
            };
            for value in &values {
                let target = match value["@id"].as_str() {
                    Some(id) => nodes
                        .get(id)
                        .unwrap_or_else(|| panic!("{key} leads nowhere")),
                    None => value,
                };
                assert!(classes_of(target).contains(class), "{key}: {target}");
                if value.get("@id").is_none() {
                    check_node(value, context, nodes);
                }
            }
        }
    }
    for (name, needed, _) in properties {
        assert!(
            !needed || node.get(name).is_some(),
            "{name} is missing in {node}"
        );
    }
}

fn report() -> Report {
    Report {
        version: "1.2.3".to_owned(),
        weights: Some(Weights {
            name: "standard".to_owned(),
            sha256: darn_mend::file_digests(b"weights").sha256,
        }),
        holes: vec![HoleReport::default(); 2],
        ..Report::default()
    }
}

fn alone<'a>(name: &'a str, bytes: &'a [u8]) -> ScanFiles<'a> {
    ScanFiles::alone(NamedFile { name, bytes })
}

fn mend<'a>(report: &'a Report, [input, output]: [ScanFiles<'a>; 2]) -> Mend<'a> {
    Mend {
        report,
        input,
        output,
        constraints: br#"{"fill": "all"}"#,
        log: None,
        date: None,
    }
}

/// The label of every file in a document by its SHA-256.
fn labels(document: &Value) -> BTreeMap<&str, &str> {
    let graph = document["@graph"].as_array().unwrap().iter();
    let files = graph.filter(|node| classes_of(node).contains(&"premis:File"));
    let files = files.map(|node| {
        let digest = node["premis:fixity"][0]["rdf:value"].as_str().unwrap();
        assert_eq!(node["@id"], format!("urn:sha256:{digest}"));
        (digest, node["rdfs:label"].as_str().unwrap())
    });
    files.collect()
}

#[test]
fn the_document_keeps_to_its_schema_and_has_a_date_only_when_one_is_given() {
    let report = report();
    let files = || [alone("cloth.glb", b"scan"), alone("mended.glb", b"mended")];
    let mend = || mend(&report, files());
    let plain = document(&mend());
    check(&plain);
    assert_eq!(plain, document(&mend()), "the same mend, the same document");
    assert!(!plain.to_string().contains("xsd:date"));
    let execution = &plain["@graph"][0];
    let weights = execution["crmdig:L23_used_software_or_firmware"][1]["@id"].as_str();
    let digest = darn_mend::file_digests(b"weights").sha256;
    assert_eq!(weights, Some(&*format!("urn:sha256:{digest}")));

    for (text, datatype) in [
        ("2026-11-28", "xsd:date"),
        ("2026-11-28T09:30:00Z", "xsd:dateTime"),
    ] {
        let date = MendDate::parsed(text).unwrap();
        let full = document(&Mend {
            log: Some(NamedFile {
                name: "report.json",
                bytes: b"{}",
            }),
            date: Some(&date),
            ..mend()
        });
        check(&full);
        let execution = &full["@graph"][0];
        assert!(execution.get("crmdig:L24_created_logfile").is_some());
        let literal = json!({ "@type": datatype, "@value": text });
        assert_eq!(full["@graph"][1]["dcterms:date"], literal);
        let nodes = full["@graph"].as_array().unwrap();
        let time = nodes.iter().find(|node| node["@id"] == "#time").unwrap();
        assert_eq!(time["crm:P82_at_some_time_within"], literal);
    }
}

#[test]
fn every_digest_is_that_of_the_file_it_is_named_with() {
    let report = report();
    let zip = |name, bytes, inner: &[u8]| ScanFiles {
        inner: Some(("a/cloth.gltf", darn_mend::file_digests(inner))),
        ..alone(name, bytes)
    };
    let parts = || {
        let beside = [("cloth.bin", &b"bin"[..]), ("a b.png", b"image")];
        beside.map(|(name, bytes)| NamedFile { name, bytes })
    };
    let separate = |name, bytes| ScanFiles {
        beside: parts().to_vec(),
        ..alone(name, bytes)
    };
    for (files, expected) in [
        (
            [
                zip("in.zip", b"zip", b"gltf"),
                zip("out.zip", b"zip 2", b"gltf 2"),
            ],
            vec![
                ("in.zip", &b"zip"[..]),
                ("out.zip", b"zip 2"),
                ("a/cloth.gltf", b"gltf"),
                ("a/cloth.gltf", b"gltf 2"),
            ],
        ),
        (
            [
                separate("in.gltf", b"gltf"),
                separate("out.gltf", b"gltf 2"),
            ],
            vec![
                ("in.gltf", &b"gltf"[..]),
                ("out.gltf", b"gltf 2"),
                ("cloth.bin", b"bin"),
                ("a b.png", b"image"),
            ],
        ),
        (
            [separate("in.gltf", b"gltf"), alone("out.glb", b"glb")],
            vec![
                ("in.gltf", &b"gltf"[..]),
                ("out.glb", b"glb"),
                ("cloth.bin", b"bin"),
                ("a b.png", b"image"),
            ],
        ),
    ] {
        let found = document(&mend(&report, files));
        check(&found);
        let digests: Vec<String> = (expected.iter())
            .map(|(_, bytes)| darn_mend::file_digests(bytes).sha256)
            .collect();
        let names = expected.iter().map(|(name, _)| *name);
        let expected: BTreeMap<&str, &str> =
            digests.iter().map(String::as_str).zip(names).collect();
        assert_eq!(labels(&found), expected);
    }
}
