//! Entity tags, and answers that are kept for requests that come again.

use reqwest::Response;

use crate::{
    fake::{Behaviour, FakeScan},
    harness::{Service, until_state},
};

fn header(answer: &Response, name: &str) -> Option<String> {
    let value = answer.headers().get(name)?;
    Some(value.to_str().unwrap().to_owned())
}

fn cache_status(answer: &Response) -> Option<String> {
    header(answer, "cache-status")
}

#[tokio::test]
async fn a_request_that_comes_again_has_the_answer_that_was_kept() {
    let service = Service::start(&["--result-cache", "1MiB"]).await;
    let first = service.scan("cloth").send().await.unwrap();
    assert_eq!(
        cache_status(&first).as_deref(),
        Some("darn; fwd=miss; stored")
    );
    let again = service.scan("cloth").send().await.unwrap();
    assert_eq!(cache_status(&again).as_deref(), Some("darn; hit"));
    for name in [
        "etag",
        "repr-digest",
        "content-type",
        "content-length",
        "darn-result",
        "darn-holes-filled",
    ] {
        assert!(first.headers().contains_key(name), "{name}");
        assert_eq!(header(&first, name), header(&again, name));
    }
    assert_eq!(
        first.bytes().await.unwrap(),
        FakeScan::named("cloth").mended()
    );
    assert_eq!(
        again.bytes().await.unwrap(),
        FakeScan::named("cloth").mended()
    );
    // It was mended once.
    assert_eq!(service.metric("darn_holes_filled_total").await, Some(1.0));

    // With its report, too.
    let both = service.scan("cloth").header("accept", "multipart/mixed");
    let both = both.send().await.unwrap();
    assert_eq!(cache_status(&both).as_deref(), Some("darn; hit"));
    assert_eq!(header(&both, "etag"), None);
    assert!(both.text().await.unwrap().contains("name=\"report\""));

    let other = service.scan("linen").send().await.unwrap();
    assert_eq!(
        cache_status(&other).as_deref(),
        Some("darn; fwd=miss; stored")
    );
    // What is refused is not kept.
    for _ in 0..2 {
        let refused = service
            .scan(Behaviour::RefuseNotADisk)
            .send()
            .await
            .unwrap();
        assert_eq!(
            (refused.status().as_u16(), cache_status(&refused)),
            (422, None)
        );
    }
}

#[tokio::test]
async fn nothing_is_kept_unless_the_operator_says_so() {
    let service = Service::start(&[]).await;
    for _ in 0..2 {
        let answer = service.scan("cloth").send().await.unwrap();
        assert_eq!(cache_status(&answer), None);
        assert!(answer.headers().contains_key("etag"));
    }
    assert_eq!(service.metric("darn_holes_filled_total").await, Some(2.0));
}

#[tokio::test]
async fn a_result_that_the_client_has_is_not_sent_again() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(&["--data", folder.path().to_str().unwrap()]).await;
    let request = service
        .post("/jobs")
        .header("content-type", "model/gltf-binary");
    let answer = request
        .body(FakeScan::named("cloth").bytes())
        .send()
        .await
        .unwrap();
    let job = header(&answer, "location").unwrap();
    until_state(&service, &job, "DONE").await;
    let result = format!("{job}/result");
    let first = service.get(&result).send().await.unwrap();
    let tag = header(&first, "etag").unwrap();
    let again = service.get(&result).header("if-none-match", &tag);
    let again = again.send().await.unwrap();
    assert_eq!(
        (again.status().as_u16(), header(&again, "etag")),
        (304, Some(tag))
    );
    assert!(again.bytes().await.unwrap().is_empty());
    let other = service.get(&result).header("if-none-match", "\"other\"");
    assert_eq!(other.send().await.unwrap().status(), 200);
}
