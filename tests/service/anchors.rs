//! The anchor search over HTTP and gRPC.

use darn_contract::v1::{AnchorQuery, Constraints, ScanChunk};
use darn_serve::generated::darn_client::DarnClient;
use reqwest::{
    RequestBuilder,
    multipart::{Form, Part},
};
use serde_json::Value;
use tonic::{Code, codegen::tokio_stream};

use crate::fake::{Behaviour, FakeScan};
use crate::harness::{Service, problem};

const QUERY: &str = r#"{"target": [0.25, 0, 0], "map": true}"#;

fn search(service: &Service, scan: impl Into<FakeScan>, query: &'static str) -> RequestBuilder {
    let query = Part::text(query).mime_str("application/json").unwrap();
    let form = Form::new()
        .part("scan", Part::bytes(scan.into().bytes()))
        .part("query", query);
    service.post("/optimize-anchor").multipart(form)
}

#[tokio::test]
async fn the_answer_is_a_place_or_a_mended_scan_as_accept_says() {
    let service = Service::start(&[]).await;
    let response = search(&service, "cloth", QUERY).send().await.unwrap();
    assert_eq!(response.status(), 200);
    let found: Value = response.json().await.unwrap();
    assert_eq!(found["distance"], 0.25);
    assert_eq!(found["uv"], serde_json::json!([0.5, 0.5]));
    assert_eq!(found["map"], serde_json::json!([1.0, null]));

    let mended = search(&service, "cloth", QUERY).header("accept", "model/gltf-binary");
    let mended = mended.send().await.unwrap();
    assert_eq!(mended.headers()["content-type"], "model/gltf-binary");
    assert_eq!(mended.headers()["darn-anchor-distance"], "0.25");
    assert_eq!(mended.headers()["darn-holes-filled"], "1");
    assert_eq!(
        mended.bytes().await.unwrap(),
        FakeScan::named("cloth").mended()
    );
}

#[tokio::test]
async fn a_refused_search_names_the_field() {
    let service = Service::start(&[]).await;
    let scan = Part::bytes(b"cloth".as_slice());
    let constraints = Part::text("{}").mime_str("application/json").unwrap();
    let foreign = Form::new()
        .part("scan", scan)
        .part("constraints", constraints);
    let raw = service
        .post("/optimize-anchor")
        .header("content-type", "model/gltf-binary")
        .body("cloth");
    let foreign = service.post("/optimize-anchor").multipart(foreign);
    let cases = [
        ("search_without_query", raw),
        ("search_with_constraints", foreign),
        ("search_not_json", search(&service, "cloth", "{")),
        (
            "search_unknown_field",
            search(&service, "cloth", r#"{"goal": [0, 0, 0]}"#),
        ),
        (
            "search_invalid",
            search(&service, "cloth", r#"{"start": [0.5, 2], "hole": 1}"#),
        ),
        (
            "search_of_a_cone",
            search(&service, Behaviour::RefuseNotADisk, QUERY),
        ),
    ];
    for (name, request) in cases {
        let document = problem(request.send().await.unwrap()).await;
        insta::assert_snapshot!(name, format!("{document:#}"));
    }
    let large = Form::new()
        .part("scan", Part::bytes(b"cloth".as_slice()))
        .part("query", Part::bytes(vec![b' '; 2 << 20]));
    let refused = service.post("/optimize-anchor").multipart(large);
    let document = problem(refused.send().await.unwrap()).await;
    assert_eq!(document["code"], "query_too_large");
}

fn chunks(chunks: Vec<ScanChunk>) -> tokio_stream::Iter<std::vec::IntoIter<ScanChunk>> {
    tokio_stream::iter(chunks)
}

fn query(target: &[f64]) -> Option<AnchorQuery> {
    Some(AnchorQuery {
        target: target.to_vec(),
        ..Default::default()
    })
}

#[tokio::test]
async fn grpc_searches_with_the_query_of_the_first_chunk() {
    let service = Service::start(&[]).await;
    let mut client = DarnClient::connect(service.url("")).await.unwrap();
    let scan = FakeScan::named("cloth").bytes();
    let (head, tail) = scan.split_at(scan.len() / 2);
    let first = ScanChunk {
        query: query(&[0.25, 0.0, 0.0]),
        data: head.to_vec().into(),
        ..Default::default()
    };
    let more = ScanChunk {
        data: tail.to_vec().into(),
        ..Default::default()
    };
    let asked = chunks(vec![first.clone(), more.clone()]);
    let found = client.optimize_anchor(asked).await.unwrap().into_inner();
    assert_eq!((found.hole, found.distance), (2, 0.25));
    assert!(service.fake.saw("cloth"));

    let constrained = ScanChunk {
        constraints: Some(Constraints::default()),
        ..first.clone()
    };
    let wrong = ScanChunk {
        query: query(&[0.25]),
        ..first.clone()
    };
    for (asked, code) in [
        (vec![more.clone()], "no_query"),
        (vec![more, first.clone()], "malformed_request"),
        (vec![constrained], "malformed_request"),
        (vec![wrong], "invalid_query"),
    ] {
        let status = client.optimize_anchor(chunks(asked)).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument, "{code}");
        assert_eq!(status.metadata().get("darn-code").unwrap(), code);
    }
    let refused = client.inpaint(chunks(vec![first])).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
}
