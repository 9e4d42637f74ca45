//! The OpenAPI document: the committed copy, its references, and its paths.

use serde_json::Value;

use crate::harness::Service;

const COMMITTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/proto/openapi.json");

#[tokio::test]
async fn the_committed_document_is_the_served_one() {
    let service = Service::start(&[]).await;
    let served: Value = service
        .get("/openapi.json")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let text = serde_json::to_string_pretty(&served).unwrap() + "\n";
    if std::env::var_os("DARN_BLESS").is_some() {
        std::fs::write(COMMITTED, &text).unwrap();
    }
    let committed = std::fs::read_to_string(COMMITTED).unwrap_or_default();
    assert!(
        committed == text,
        "proto/openapi.json has drifted; `DARN_BLESS=1 cargo test --test service` rewrites it"
    );
}

#[test]
fn every_reference_leads_somewhere() {
    let document = darn_serve::openapi::document();
    let schemas = document["components"]["schemas"].as_object().unwrap();
    let mut open = vec![&document];
    while let Some(value) = open.pop() {
        match value {
            Value::Object(fields) => {
                if let Some(Value::String(reference)) = fields.get("$ref") {
                    let pointer = reference.strip_prefix('#').unwrap();
                    assert!(document.pointer(pointer).is_some(), "{reference}");
                }
                open.extend(fields.values());
            }
            Value::Array(items) => open.extend(items),
            _ => {}
        }
    }
    let unprocessable = &document["paths"]["/inpaint"]["post"]["responses"]["422"];
    assert!(unprocessable.to_string().contains("no_holes"));
    assert!(schemas["HoleReport"]["properties"]["chart"]["$ref"].is_string());
    assert!(
        !schemas["Report"]["description"]
            .as_str()
            .unwrap()
            .is_empty()
    );
}

#[tokio::test]
async fn every_path_is_routed_for_its_methods() {
    let service = Service::start(&[]).await;
    let document = darn_serve::openapi::document();
    for (path, methods) in document["paths"].as_object().unwrap() {
        let path = path.replace("{id}", "0");
        for method in methods.as_object().unwrap().keys() {
            let method = reqwest::Method::from_bytes(method.to_uppercase().as_bytes()).unwrap();
            let answer = service.request(method, &path).send().await.unwrap();
            let (status, text) = (answer.status(), answer.text().await.unwrap());
            assert_ne!(status, 405, "{path}");
            assert!(!text.contains("\"code\":\"not_found\""), "{path}");
        }
    }
}
