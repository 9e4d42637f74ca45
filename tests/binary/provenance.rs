//! `darn inpaint --provenance`: the files on disk are those that it names.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use crate::{EXAMPLE, commands::zipped, darn};

fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The example as a glTF and its buffer's file.
fn separate() -> (Vec<u8>, Vec<u8>) {
    let length = u32::from_le_bytes(EXAMPLE[12..16].try_into().expect("four bytes")) as usize;
    let mut json: Value = serde_json::from_slice(&EXAMPLE[20..20 + length]).expect("JSON");
    json["buffers"][0]["uri"] = json!("cloth.bin");
    (
        json.to_string().into_bytes(),
        EXAMPLE[28 + length..].to_vec(),
    )
}

/// Mends a file in a folder; the labels of all files in the provenance by their SHA-256, and the document.
fn provenance(folder: &Path, input: &str, output: &str) -> (BTreeMap<String, String>, Value) {
    let done = darn()
        .current_dir(folder)
        .args(["inpaint", input, "-o", output, "--provenance", "p.jsonld"])
        .args(["--report", "report.json", "--date", "2026-11-28"])
        .output()
        .expect("darn runs");
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    let text = std::fs::read(folder.join("p.jsonld")).expect("the provenance");
    let document: Value = serde_json::from_slice(&text).expect("JSON");
    let nodes = document["@graph"].as_array().expect("a graph");
    let files = nodes.iter().filter_map(|node| {
        let digest = node["premis:fixity"][0]["rdf:value"].as_str()?;
        Some((digest.to_owned(), node["rdfs:label"].as_str()?.to_owned()))
    });
    (files.collect(), document)
}

#[test]
fn every_file_is_named_by_its_own_digest() {
    let (gltf, bin) = separate();
    for (input, output) in [
        ("in.glb", "out.glb"),
        ("in.zip", "out.zip"),
        ("in.zip", "out.glb"),
        ("in.gltf", "out.gltf"),
        ("in.gltf", "out.glb"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let zip = zipped(&[("a/in.gltf", &gltf), ("a/cloth.bin", &bin)]);
        for (name, bytes) in [
            ("in.glb", EXAMPLE),
            ("in.zip", &zip),
            ("in.gltf", &gltf),
            ("cloth.bin", &bin),
        ] {
            std::fs::write(folder.path().join(name), bytes).expect("written");
        }
        let (labels, document) = provenance(folder.path(), input, output);
        let mut expected = BTreeMap::new();
        let is_separate = input == "in.gltf";
        let files = [input, output, "report.json"];
        for name in files.into_iter().chain(is_separate.then_some("cloth.bin")) {
            let bytes = std::fs::read(folder.path().join(name)).expect(name);
            expected.insert(sha256(&bytes), name.to_owned());
        }
        let report = std::fs::read(folder.path().join("report.json")).expect("the report");
        let report: Value = serde_json::from_slice(&report).expect("JSON");
        for (side, name) in [("input", input), ("output", output)] {
            if name.ends_with(".zip") {
                let digest = report[side]["sha256"].as_str().expect("a digest");
                expected.insert(digest.to_owned(), "a/in.gltf".to_owned());
            }
        }
        assert_eq!(labels, expected, "{input} to {output}");
        let event = &document["@graph"][1];
        let date = json!({ "@type": "xsd:date", "@value": "2026-11-28" });
        assert_eq!(event["dcterms:date"], date);
    }
}

#[test]
fn a_day_that_does_not_exist_is_wrong_usage() {
    let done = darn()
        .args([
            "inpaint",
            "in.glb",
            "-o",
            "out.glb",
            "--provenance",
            "p.jsonld",
        ])
        .args(["--date", "2026-02-30"])
        .output()
        .expect("darn runs");
    assert!(!done.status.success());
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(said.contains("must be a day such as 2026-11-28"), "{said}");
}
