//! The provenance of a mend as linked data: what came in, what went out, by which software, weights and parameters.
//!
//! One JSON-LD document in two vocabularies that museums and archives keep: CRMdig 4.0 (the extension of CIDOC CRM for
//! digital objects), in which a mend is a software execution, and PREMIS 3, in which it is an event that changes a file. Files are
//! named by their SHA-256, as in the report and in the scan's own packet of metadata. There is no date unless the
//! caller gives one.

use darn_contract::v1::{FileDigests, Report};
use serde_json::{Value, json};

/// What is known of a mend.
pub struct Mend<'a> {
    /// Its report.
    pub report: &'a Report,
    /// Name of the scan's file.
    pub input: &'a str,
    /// Name of the mended scan's file.
    pub output: &'a str,
    /// What was asked for, as JSON.
    pub constraints: &'a [u8],
    /// Name of the report's file and its bytes, if it was written.
    pub log: Option<(&'a str, &'a [u8])>,
    /// When it was, as ISO 8601 has it.
    pub date: Option<&'a str>,
}

/// The document.
pub fn document(mend: &Mend<'_>) -> Value {
    let report = mend.report;
    let weights = report.weights.clone().unwrap_or_default();
    let [input, output] = [&report.input, &report.output].map(Option::as_ref);
    let [input_id, output_id] = [input, output].map(|digests| urn(digests.map(|it| &*it.sha256)));
    let parameters = darn_mend::file_digests(mend.constraints);
    let (parameters_id, weights_id) = (urn(Some(&parameters.sha256)), urn(Some(&weights.sha256)));
    let software = format!("darn {}", report.version);
    let words = format!(
        "{software} closed {} hole(s) of {} with reconstructed cloth",
        report.holes.len(),
        mend.input
    );
    let mut execution = json!({
        "@id": "#execution",
        "@type": "crmdig:D10_Software_Execution",
        "rdfs:label": words,
        "crmdig:L10_had_input": id(&input_id),
        "crmdig:L11_had_output": id(&output_id),
        "crmdig:L13_used_parameters": id(&parameters_id),
        "crmdig:L23_used_software_or_firmware": [id("#darn"), id(&weights_id)],
    });
    let mut event = json!({
        "@id": "#event",
        "@type": "premis:Event",
        "dcterms:type": id("http://id.loc.gov/vocabulary/preservation/eventType/mod"),
        "premis:note": words,
        "premis:outcome": id("http://id.loc.gov/vocabulary/preservation/eventOutcome/suc"),
        "eventRelatedObjectRole:sou": id(&input_id),
        "eventRelatedObjectRole:out": id(&output_id),
        "eventRelatedAgentRole:exe": id("#darn"),
    });
    let mut graph = vec![
        file(&input_id, mend.input, input),
        file(&output_id, mend.output, output),
        json!({
            "@id": "#darn",
            "@type": ["crmdig:D14_Software", "premis:SoftwareAgent"],
            "rdfs:label": software,
        }),
        json!({
            "@id": weights_id,
            "@type": "crmdig:D14_Software",
            "rdfs:label": format!("weights {}", weights.name),
        }),
        json!({
            "@id": parameters_id,
            "@type": "crmdig:D1_Digital_Object",
            "rdfs:label": "constraints",
            "crm:P3_has_note": String::from_utf8_lossy(mend.constraints),
        }),
    ];
    if let Some((name, bytes)) = mend.log {
        let digests = darn_mend::file_digests(bytes);
        let log = urn(Some(&digests.sha256));
        execution["crmdig:L24_created_logfile"] = id(&log);
        graph.push(file(&log, name, Some(&digests)));
    }
    if let Some(date) = mend.date {
        let date = json!({ "@type": "xsd:dateTime", "@value": date });
        event["dcterms:date"] = date.clone();
        execution["crm:P4_has_time-span"] = id("#time");
        graph.push(json!({
            "@id": "#time",
            "@type": "crm:E52_Time-Span",
            "crm:P82_at_some_time_within": date,
        }));
    }
    graph.splice(0..0, [execution, event]);
    json!({ "@context": context(), "@graph": graph })
}

fn context() -> Value {
    json!({
        "crm": "http://www.cidoc-crm.org/cidoc-crm/",
        "crmdig": "http://www.cidoc-crm.org/extensions/crmdig/",
        "dcterms": "http://purl.org/dc/terms/",
        "eventRelatedAgentRole": "http://id.loc.gov/vocabulary/preservation/eventRelatedAgentRole/",
        "eventRelatedObjectRole": "http://id.loc.gov/vocabulary/preservation/eventRelatedObjectRole/",
        "premis": "http://www.loc.gov/premis/rdf/v3/",
        "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
        "rdfs": "http://www.w3.org/2000/01/rdf-schema#",
        "xsd": "http://www.w3.org/2001/XMLSchema#",
    })
}

/// A file with its digests.
fn file(place: &str, name: &str, digests: Option<&FileDigests>) -> Value {
    let functions = "http://id.loc.gov/vocabulary/preservation/cryptographicHashFunctions";
    let fixity = digests.map(|digests| {
        [("sha256", &digests.sha256), ("sha512", &digests.sha512)].map(|(function, digest)| {
            json!({
                "@type": "premis:Fixity",
                "dcterms:type": id(&format!("{functions}/{function}")),
                "rdf:value": digest,
            })
        })
    });
    json!({
        "@id": place,
        "@type": ["crmdig:D1_Digital_Object", "premis:File"],
        "rdfs:label": name,
        "premis:fixity": fixity.into_iter().flatten().collect::<Vec<_>>(),
    })
}

fn id(place: &str) -> Value {
    json!({ "@id": place })
}

/// The name of a file with this SHA-256.
fn urn(sha256: Option<&str>) -> String {
    format!("urn:sha256:{}", sha256.unwrap_or_default())
}

/// A date, or a date and time with its zone, as ISO 8601 has them.
pub fn date(text: &str) -> Result<String, String> {
    let shape: String = (text.chars())
        .map(|c| if c.is_ascii_digit() { '0' } else { c })
        .collect();
    let (day, time) = shape.split_once('T').unwrap_or((&shape, "00:00:00Z"));
    let clock = ["Z", "+00:00", "-00:00"]
        .iter()
        .find_map(|zone| time.strip_suffix(zone));
    let seconds = clock.map(|clock| clock.split('.').next().unwrap_or_default());
    match (day, seconds) {
        ("0000-00-00", Some("00:00:00")) => Ok(text.to_owned()),
        _ => Err("must be a date such as 2026-11-28, or 2026-11-28T09:30:00Z".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_contract::v1::{HoleReport, Weights};
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

    fn classes(node: &Value) -> Vec<&str> {
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
        let classes = classes(node);
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
                    assert!(self::classes(target).contains(class), "{key}: {target}");
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
        let digests = |bytes: &[u8]| Some(darn_mend::file_digests(bytes));
        Report {
            version: "1.2.3".to_owned(),
            weights: Some(Weights {
                name: "standard".to_owned(),
                sha256: darn_mend::file_digests(b"weights").sha256,
            }),
            holes: vec![HoleReport::default(); 2],
            input: digests(b"scan"),
            output: digests(b"mended"),
            ..Report::default()
        }
    }

    #[test]
    fn the_document_keeps_to_its_schema_and_has_a_date_only_when_one_is_given() {
        let report = report();
        let mut mend = Mend {
            report: &report,
            input: "cloth.glb",
            output: "mended.glb",
            constraints: br#"{"fill": "all"}"#,
            log: None,
            date: None,
        };
        let plain = document(&mend);
        check(&plain);
        assert_eq!(plain, document(&mend), "the same mend, the same document");
        assert!(!plain.to_string().contains("dateTime"));
        let execution = &plain["@graph"][0];
        let weights = execution["crmdig:L23_used_software_or_firmware"][1]["@id"].as_str();
        let digest = darn_mend::file_digests(b"weights").sha256;
        assert_eq!(weights, Some(&*format!("urn:sha256:{digest}")));

        mend.log = Some(("report.json", b"{}"));
        mend.date = Some("2026-11-28");
        let full = document(&mend);
        check(&full);
        let execution = &full["@graph"][0];
        assert!(execution.get("crmdig:L24_created_logfile").is_some());
        assert_eq!(full["@graph"][1]["dcterms:date"]["@value"], "2026-11-28");
    }

    #[test]
    fn dates_are_those_of_iso_8601() {
        for good in [
            "2026-11-28",
            "2026-11-28T09:30:00Z",
            "2026-11-28T09:30:00.25+01:00",
        ] {
            assert_eq!(date(good).as_deref(), Ok(good));
        }
        for bad in [
            "",
            "today",
            "28.11.2026",
            "2026-11-28T09:30",
            "2026-11-28T09:30:00",
        ] {
            assert!(date(bad).is_err(), "{bad}");
        }
    }
}
