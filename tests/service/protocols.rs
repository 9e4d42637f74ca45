//! Successful answers over HTTP and gRPC, and the errors of gRPC.

use darn_contract::v1::{
    Anchor, Constraints, HolesQuery, ScanChunk, inpaint_chunk::Part as ChunkPart,
};
use darn_serve::{Listening, generated::darn_client::DarnClient};
use reqwest::multipart::{Form, Part};
use serde_json::Value;
use tonic::{Code, codegen::tokio_stream};

use crate::fake::{Behaviour, FakeScan};
use crate::harness::Service;

/// A scan in two chunks, the first with the constraints.
pub fn chunks(
    scan: impl Into<FakeScan>,
    constraints: Option<Constraints>,
) -> tokio_stream::Iter<std::vec::IntoIter<ScanChunk>> {
    let scan = scan.into().bytes();
    let (head, tail) = scan.split_at(scan.len() / 2);
    tokio_stream::iter(vec![
        ScanChunk {
            constraints,
            query: None,
            holes: None,
            data: head.to_vec().into(),
        },
        ScanChunk {
            constraints: None,
            query: None,
            holes: None,
            data: tail.to_vec().into(),
        },
    ])
}

#[tokio::test]
async fn a_scan_is_mended() {
    let service = Service::start(&[]).await;
    let response = service.scan("cloth").send().await.unwrap();
    assert_eq!(response.status(), 200);
    assert_eq!(response.headers()["content-type"], "model/gltf-binary");
    assert_eq!(response.headers()["darn-holes-filled"], "1");
    assert_eq!(
        response.bytes().await.unwrap(),
        FakeScan::named("cloth").mended()
    );
    assert_eq!(service.metric("darn_holes_filled_total").await, Some(1.0));
}

#[tokio::test]
async fn multipart_mixed_has_the_report_and_the_scan() {
    let service = Service::start(&[]).await;
    let constraints = r#"{"anchors": [{"hole": 2, "uv": [0.5, 0.5], "position": [0, 0, 0]}]}"#;
    let form = Form::new()
        .part("scan", Part::bytes(FakeScan::named("cloth").bytes()))
        .part(
            "constraints",
            Part::text(constraints)
                .mime_str("application/json")
                .unwrap(),
        );
    let request = service
        .post("/inpaint")
        .multipart(form)
        .header("accept", "multipart/mixed");
    let response = request.send().await.unwrap();
    assert_eq!(response.status(), 200);
    let media = response.headers()["content-type"]
        .to_str()
        .unwrap()
        .to_owned();
    let boundary = media.strip_prefix("multipart/mixed; boundary=").unwrap();
    let text = response.text().await.unwrap();
    let parts: Vec<&str> = text.split(&format!("--{boundary}")).collect();
    let [_, report, scan, "--\r\n"] = parts[..] else {
        panic!("{text}")
    };
    let report: Value =
        serde_json::from_str(report.split_once("\r\n\r\n").unwrap().1.trim()).unwrap();
    assert_eq!(report["notes"][0], "1 anchors");
    let mended = String::from_utf8(FakeScan::named("cloth").mended()).unwrap();
    assert!(scan.ends_with(&format!("\r\n\r\n{mended}\r\n")));
}

#[tokio::test]
async fn holes_are_described() {
    let service = Service::start(&[]).await;
    let request = service
        .post("/holes")
        .header("content-type", "model/gltf+json; charset=utf-8")
        .body("{}");
    let report: Value = request.send().await.unwrap().json().await.unwrap();
    assert_eq!(report["loops"][0]["kind"], "HOLE");
    assert_eq!(report["suspects"][0], Value::Null);
    for (query, listed) in [
        ("suspects=true", true),
        ("suspects", true),
        ("suspects=false", false),
    ] {
        let request = service
            .post(&format!("/holes?{query}"))
            .header("content-type", "model/gltf+json")
            .body("{}");
        let report: Value = request.send().await.unwrap().json().await.unwrap();
        assert_eq!(
            report["suspects"][0]["reason"] == "stretched",
            listed,
            "{query}"
        );
    }
    let request = service
        .post("/holes?suspect=1")
        .header("content-type", "model/gltf+json")
        .body("{}");
    let refused = request.send().await.unwrap();
    assert_eq!(refused.status(), 400);
    assert!(refused.text().await.unwrap().contains("suspects=true"));
}

#[tokio::test]
async fn grpc_shares_the_port() {
    let service = Service::start(&["--body-limit", "1KiB"]).await;
    let mut client = DarnClient::connect(service.url("")).await.unwrap();

    let holes = client
        .find_holes(chunks("cloth", None))
        .await
        .unwrap()
        .into_inner();
    assert_eq!((holes.loops[0].id, holes.suspects.len()), (2, 0));
    let asked = ScanChunk {
        holes: Some(HolesQuery { suspects: true }),
        data: FakeScan::named("cloth").bytes().into(),
        ..Default::default()
    };
    let holes = client
        .find_holes(tokio_stream::iter(vec![asked.clone()]))
        .await;
    assert_eq!(holes.unwrap().into_inner().suspects.len(), 1);
    let Err(refused) = client.inpaint(tokio_stream::iter(vec![asked])).await else {
        panic!("a query of another method");
    };
    assert_eq!(refused.code(), Code::InvalidArgument);

    let anchor = Anchor {
        uv: vec![0.5, 0.5],
        position: vec![0.0; 3],
        ..Default::default()
    };
    let asked = Constraints {
        anchors: vec![anchor],
        ..Default::default()
    };
    let answer = client.inpaint(chunks("cloth", Some(asked))).await.unwrap();
    let result = answer.metadata().get("darn-result").unwrap();
    assert_eq!(result, "filled=1 skipped=0 doubtful=0");
    let mut answer = answer.into_inner();
    let Some(ChunkPart::Report(report)) = answer.message().await.unwrap().unwrap().part else {
        panic!("the report comes first");
    };
    assert_eq!(report.notes, ["1 anchors"]);
    let mut scan = Vec::new();
    while let Some(chunk) = answer.message().await.unwrap() {
        let Some(ChunkPart::Data(data)) = chunk.part else {
            panic!("then the scan")
        };
        scan.extend_from_slice(&data);
    }
    assert_eq!(scan, FakeScan::named("cloth").mended());
}

#[tokio::test]
async fn grpc_has_the_codes_of_http() {
    let service = Service::start(&["--body-limit", "1KiB"]).await;
    let mut client = DarnClient::connect(service.url("")).await.unwrap();
    let wrong = Constraints {
        up: vec![0.0],
        ..Default::default()
    };
    let large = ScanChunk {
        data: vec![0; 2048].into(),
        ..Default::default()
    };
    let huge = ScanChunk {
        data: vec![0; 5 << 20].into(),
        ..Default::default()
    };
    let anchor = Anchor {
        uv: vec![2.0, 2.0],
        position: vec![0.0; 3],
        ..Default::default()
    };
    let all_wrong = Constraints {
        anchors: vec![anchor; 300],
        ..Default::default()
    };
    let cases = [
        (
            client
                .inpaint(chunks(Behaviour::RefuseNotADisk, None))
                .await,
            Code::FailedPrecondition,
            "not_a_disk",
        ),
        (
            client
                .inpaint(chunks(Behaviour::RefuseTruncated, None))
                .await,
            Code::InvalidArgument,
            "truncated",
        ),
        (
            client.inpaint(chunks(Behaviour::Panic, None)).await,
            Code::Internal,
            "internal",
        ),
        (
            client.inpaint(chunks("cloth", Some(wrong))).await,
            Code::InvalidArgument,
            "invalid_constraints",
        ),
        (
            client.inpaint(chunks("cloth", Some(all_wrong))).await,
            Code::InvalidArgument,
            "invalid_constraints",
        ),
        (
            client.inpaint(tokio_stream::iter([huge])).await,
            Code::ResourceExhausted,
            "message_too_large",
        ),
        (
            client
                .inpaint(tokio_stream::iter([ScanChunk::default()]))
                .await,
            Code::InvalidArgument,
            "empty_body",
        ),
        (
            client.inpaint(tokio_stream::iter([large])).await,
            Code::ResourceExhausted,
            "body_too_large",
        ),
    ];
    for (answer, code, word) in cases {
        let status = answer.expect_err(word);
        assert_eq!(status.code(), code, "{word}");
        assert_eq!(status.metadata().get("darn-code").unwrap(), word);
        let result = status.metadata().get("darn-result");
        let expected = (word == "not_a_disk").then_some("filled=0 skipped=1 doubtful=0");
        assert_eq!(result.map(|r| r.to_str().unwrap()), expected, "{word}");
        let document = status
            .metadata()
            .get_bin("darn-problem-bin")
            .unwrap()
            .to_bytes()
            .unwrap();
        let parsed: Value = serde_json::from_slice(&document).unwrap();
        assert_eq!(parsed["code"], word);
        // Even after base64 well within the 8 KiB of headers that every client accepts.
        assert!(document.len() <= 3 << 10, "{}", document.len());
        assert!(status.message().len() <= 600);
    }
}

#[tokio::test]
async fn a_health_check_tells_whether_the_service_is_ready() {
    let service = Service::start(&[]).await;
    let ask = |address| {
        let timeout = std::time::Duration::from_secs(5);
        tokio::task::spawn_blocking(move || {
            darn_serve::healthcheck(&Listening::plain(address), timeout)
        })
    };
    ask(service.address).await.unwrap().unwrap();
    service.stop.cancel();
    service.ended.await.unwrap().unwrap();
    assert!(ask(service.address).await.unwrap().is_err());
}

#[tokio::test]
async fn grpc_may_have_its_own_port() {
    let service = Service::start(&["--grpc-listen", "127.0.0.1:0"]).await;
    let grpc = service.grpc.expect("a port of its own");
    let mut client = DarnClient::connect(format!("http://{grpc}")).await.unwrap();
    assert!(client.find_holes(chunks("cloth", None)).await.is_ok());
    let mut shared = DarnClient::connect(service.url("")).await.unwrap();
    assert!(shared.find_holes(chunks("cloth", None)).await.is_err());
}
