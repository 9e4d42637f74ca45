//! The provenance of a mend as linked data: what came in, what went out, by which software, weights and parameters.
//!
//! One JSON-LD document in two vocabularies that museums and archives keep: CRMdig 4.0 (the extension of CIDOC CRM for
//! digital objects), in which a mend is a software execution, and PREMIS 3, in which it is an event that changes a file. Files are
//! named by their SHA-256. A zip is such a file, and the glTF in it another one, by whose digest the report and the scan's own packet
//! of metadata name the scan. There is no date unless the caller gives one. Its JSON Schema is `docs/provenance.schema.json`.

use super::provenance_date::MendDate;
use darn_contract::v1::{FileDigests, Report};
use serde_json::{Value, json};

/// What is known of a mend.
pub struct Mend<'a> {
    /// Its report.
    pub report: &'a Report,
    /// The scan that came.
    pub input: ScanFiles<'a>,
    /// The mended scan.
    pub output: ScanFiles<'a>,
    /// What was asked for, as JSON.
    pub constraints: &'a [u8],
    /// The report's file, if it was written.
    pub log: Option<NamedFile<'a>>,
    /// When it was.
    pub date: Option<&'a MendDate>,
}

/// A file and its name.
#[derive(Clone, Copy)]
pub struct NamedFile<'a> {
    pub name: &'a str,
    pub bytes: &'a [u8],
}

/// A scan on disk.
pub struct ScanFiles<'a> {
    /// The file that was named: a glTF, a mesh file, or a zip.
    pub main: NamedFile<'a>,
    /// Of a zip: the path of the glTF in it, and its digests.
    pub inner: Option<(&'a str, FileDigests)>,
    /// The files beside a glTF that it refers to.
    pub beside: Vec<NamedFile<'a>>,
}

impl<'a> ScanFiles<'a> {
    /// A scan in one file.
    pub fn alone(main: NamedFile<'a>) -> Self {
        Self {
            main,
            inner: None,
            beside: Vec::new(),
        }
    }
}

/// The document.
pub fn document(mend: &Mend<'_>) -> Value {
    let report = mend.report;
    let weights = report.weights.clone().unwrap_or_default();
    let [input, output] = [&mend.input, &mend.output].map(FileNodes::of);
    let parameters = darn_mend::file_digests(mend.constraints);
    let (parameters_id, weights_id) = (urn(&parameters.sha256), urn(&weights.sha256));
    let software = format!("darn {}", report.version);
    let words = format!(
        "{software} closed {} hole(s) of {} with reconstructed cloth",
        report.holes.len(),
        mend.input.main.name
    );
    let mut execution = json!({
        "@id": "#execution",
        "@type": "crmdig:D10_Software_Execution",
        "rdfs:label": words,
        "crmdig:L10_had_input": input.with_files_beside(),
        "crmdig:L11_had_output": id(&output.main),
        "crmdig:L13_used_parameters": id(&parameters_id),
        "crmdig:L23_used_software_or_firmware": [id("#darn"), id(&weights_id)],
    });
    let mut event = json!({
        "@id": "#event",
        "@type": "premis:Event",
        "dcterms:type": id("http://id.loc.gov/vocabulary/preservation/eventType/mod"),
        "premis:note": words,
        "premis:outcome": id("http://id.loc.gov/vocabulary/preservation/eventOutcome/suc"),
        "eventRelatedObjectRole:sou": input.with_files_beside(),
        "eventRelatedObjectRole:out": id(&output.main),
        "eventRelatedAgentRole:exe": id("#darn"),
    });
    let mut graph = vec![
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
    let mut files = input.nodes;
    files.extend(output.nodes);
    if let Some(log) = mend.log {
        let digests = darn_mend::file_digests(log.bytes);
        execution["crmdig:L24_created_logfile"] = id(&urn(&digests.sha256));
        files.push(file(log.name, &digests));
    }
    // A file that came and stays, such as one beside the glTF, is named once.
    let mut named: Vec<Value> = graph.iter().map(|node| node["@id"].clone()).collect();
    for file in files {
        if !named.contains(&file["@id"]) {
            named.push(file["@id"].clone());
            graph.push(file);
        }
    }
    if let Some(date) = mend.date {
        let date = json!({ "@type": date.datatype, "@value": date.text });
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

/// The files of a scan as nodes.
struct FileNodes {
    /// Name of the file that was named.
    main: String,
    /// Names of those beside it.
    beside: Vec<String>,
    nodes: Vec<Value>,
}

impl FileNodes {
    fn of(scan: &ScanFiles<'_>) -> Self {
        let digests = darn_mend::file_digests(scan.main.bytes);
        let mut main = file(scan.main.name, &digests);
        let mut nodes = Vec::new();
        if let Some((name, digests)) = &scan.inner {
            main["dcterms:hasPart"] = id(&urn(&digests.sha256));
            nodes.push(file(name, digests));
        }
        let mut beside = Vec::new();
        for other in &scan.beside {
            let digests = darn_mend::file_digests(other.bytes);
            beside.push(urn(&digests.sha256));
            nodes.push(file(other.name, &digests));
        }
        if !beside.is_empty() {
            let all: Vec<Value> = beside.iter().map(|place| id(place)).collect();
            main["dcterms:requires"] = json!(all);
        }
        nodes.insert(0, main);
        Self {
            main: urn(&digests.sha256),
            beside,
            nodes,
        }
    }

    /// The file that was named, and those beside it, if there are any.
    fn with_files_beside(&self) -> Value {
        let main = id(&self.main);
        match &self.beside[..] {
            [] => main,
            beside => [main]
                .into_iter()
                .chain(beside.iter().map(|place| id(place)))
                .collect(),
        }
    }
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
fn file(name: &str, digests: &FileDigests) -> Value {
    let functions = "http://id.loc.gov/vocabulary/preservation/cryptographicHashFunctions";
    let fixity = [("sha256", &digests.sha256), ("sha512", &digests.sha512)];
    let fixity = fixity.map(|(function, digest)| {
        json!({
            "@type": "premis:Fixity",
            "dcterms:type": id(&format!("{functions}/{function}")),
            "rdf:value": digest,
        })
    });
    json!({
        "@id": urn(&digests.sha256),
        "@type": ["crmdig:D1_Digital_Object", "premis:File"],
        "rdfs:label": name,
        "premis:fixity": fixity,
    })
}

fn id(place: &str) -> Value {
    json!({ "@id": place })
}

/// The name of a file with this SHA-256.
fn urn(sha256: &str) -> String {
    format!("urn:sha256:{sha256}")
}
