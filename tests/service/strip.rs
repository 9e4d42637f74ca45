//! Taking out what darn put in, over HTTP and gRPC.

use darn_contract::v1::{Constraints, ScanChunk, strip_chunk::Part as ChunkPart};
use darn_serve::generated::darn_client::DarnClient;
use tonic::{Code, codegen::tokio_stream};

use crate::fake::FakeScan;
use crate::harness::{Service, problem};

#[tokio::test]
async fn a_mended_scan_comes_back_as_it_was_and_the_header_says_how() {
    let service = Service::start(&[]).await;
    let strip = |scan: Vec<u8>, accept: &'static str| {
        let request = service.post("/strip").header("accept", accept);
        let request = request.header("content-type", "model/gltf-binary");
        request.body(scan).send()
    };
    let mended = FakeScan::named("cloth").mended();
    let answer = strip(mended.clone(), "*/*").await.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["content-type"], "model/gltf-binary");
    assert_eq!(answer.headers()["darn-strip"], "exact");
    assert_eq!(
        answer.bytes().await.unwrap(),
        FakeScan::named("cloth").bytes()
    );

    let changed = [mended.clone(), b"!".to_vec()].concat();
    let answer = strip(changed, "multipart/mixed").await.unwrap();
    assert_eq!(answer.headers()["darn-strip"], "structural");
    let text = answer.text().await.unwrap();
    assert!(
        text.contains("name=\"report\"") && text.contains("\"patches\":1"),
        "{text}"
    );
    assert!(text.contains("name=\"scan\""), "{text}");

    let answer = strip(FakeScan::named("cloth").bytes(), "*/*")
        .await
        .unwrap();
    assert_eq!(answer.status(), 422);
    assert_eq!(problem(answer).await["code"], "nothing_to_strip");
}

#[tokio::test]
async fn grpc_strips_and_takes_no_constraints() {
    let service = Service::start(&[]).await;
    let mut client = DarnClient::connect(service.url("")).await.unwrap();
    let chunk = |constraints| ScanChunk {
        constraints,
        data: FakeScan::named("cloth").mended().into(),
        ..Default::default()
    };
    let asked = tokio_stream::iter(vec![chunk(None)]);
    let mut answer = client.strip(asked).await.unwrap().into_inner();
    let Some(ChunkPart::Report(report)) = answer.message().await.unwrap().unwrap().part else {
        panic!("the report comes first");
    };
    assert_eq!((report.exact, report.patches), (true, 1));
    let mut scan = Vec::new();
    while let Some(chunk) = answer.message().await.unwrap() {
        let Some(ChunkPart::Data(data)) = chunk.part else {
            panic!("then the scan")
        };
        scan.extend_from_slice(&data);
    }
    assert_eq!(scan, FakeScan::named("cloth").bytes());

    let asked = tokio_stream::iter(vec![chunk(Some(Constraints::default()))]);
    let Err(refused) = client.strip(asked).await else {
        panic!("constraints")
    };
    assert_eq!(refused.code(), Code::InvalidArgument);
}
