//! Traces as a collector receives them.

use std::{
    io::{BufRead, BufReader, Read, Write},
    net::{TcpListener, TcpStream},
    sync::mpsc::{Receiver, Sender, channel},
    time::{Duration, Instant},
};

use opentelemetry_proto::tonic::{
    collector::trace::v1::ExportTraceServiceRequest,
    trace::v1::{Span, span::SpanKind},
};
use prost::Message as _;

use crate::{
    EXAMPLE,
    running::{Service, client},
};

/// A collector that takes what comes over HTTP, and where it listens.
fn collector() -> (Receiver<Span>, String) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let url = format!("http://{}", listener.local_addr().expect("an address"));
    let (spans, received) = channel();
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let spans = spans.clone();
            std::thread::spawn(move || receive(stream, &spans));
        }
    });
    (received, url)
}

/// Answers the requests of a connection, until it ends.
fn receive(mut stream: TcpStream, spans: &Sender<Span>) -> Option<()> {
    let mut reader = BufReader::new(stream.try_clone().ok()?);
    loop {
        let mut length = 0;
        let mut line = String::new();
        reader.read_line(&mut line).ok().filter(|read| *read > 0)?;
        assert!(line.starts_with("POST /v1/traces "), "{line}");
        while line != "\r\n" {
            line.clear();
            reader.read_line(&mut line).ok()?;
            let lower = line.to_ascii_lowercase();
            if let Some(value) = lower.strip_prefix("content-length:") {
                length = value.trim().parse().expect("a number");
            }
        }
        let mut body = vec![0; length];
        reader.read_exact(&mut body).ok()?;
        let request = ExportTraceServiceRequest::decode(&body[..]).expect("a request");
        for scope in request
            .resource_spans
            .into_iter()
            .flat_map(|it| it.scope_spans)
        {
            for span in scope.spans {
                spans.send(span).ok()?;
            }
        }
        stream
            .write_all(b"HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n")
            .ok()?;
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The first span of this name for which `is_it` says so.
fn found<'a>(spans: &'a [Span], name: &str, is_it: impl Fn(&Span) -> bool) -> &'a Span {
    let names: Vec<_> = spans.iter().map(|span| span.name.as_str()).collect();
    (spans.iter().find(|span| span.name == name && is_it(span)))
        .unwrap_or_else(|| panic!("no {name} in {names:?}"))
}

#[tokio::test]
async fn a_request_and_its_job_are_traced_with_their_stages() {
    let (received, collector) = collector();
    let folder = tempfile::tempdir().expect("a folder");
    let service = Service::start_in(
        &[
            ("OTEL_EXPORTER_OTLP_ENDPOINT", &collector),
            ("OTEL_BSP_SCHEDULE_DELAY", "100"),
        ],
        &["--data", folder.path().to_str().expect("a name")],
    );
    service.ready().await;
    let client = client();
    let trace = "4bf92f3577b34da6a3ce929d0e0e4736";
    let request = |path: &str| {
        (client.post(service.url(path)))
            .header("content-type", "model/gltf-binary")
            .header("traceparent", format!("00-{trace}-00f067aa0ba902b7-01"))
            .body(EXAMPLE)
    };
    let answer = request("/inpaint").send().await.expect("an answer");
    assert_eq!(answer.status(), 200);
    let answer = request("/jobs").send().await.expect("an answer");
    let job = answer.headers()["location"]
        .to_str()
        .expect("a path")
        .to_owned();
    let mut spans: Vec<Span> = Vec::new();
    let end = Instant::now() + Duration::from_secs(60);
    while !spans.iter().any(|span| span.name == "job") {
        assert!(Instant::now() < end, "no span of {job}");
        tokio::time::sleep(Duration::from_millis(20)).await;
        spans.extend(received.try_iter());
    }

    let ours = |span: &Span| hex(&span.trace_id) == trace;
    let mend = found(&spans, "POST /inpaint", ours);
    assert_eq!(hex(&mend.parent_span_id), "00f067aa0ba902b7");
    assert_eq!(mend.kind, SpanKind::Server as i32);
    for stage in ["queue", "read", "weld", "holes", "write"] {
        let stage = found(&spans, stage, |span| span.parent_span_id == mend.span_id);
        assert!(stage.start_time_unix_nano <= stage.end_time_unix_nano);
    }
    let submitted = found(&spans, "POST /jobs", ours);
    let attempt = found(&spans, "job", |_| true);
    assert_ne!(hex(&attempt.trace_id), trace);
    assert_eq!(attempt.links[0].span_id, submitted.span_id);
    found(&spans, "holes", |span| {
        span.parent_span_id == attempt.span_id
    });
    assert!(service.has_logged(&format!("trace=\"{trace}\"")));
}

#[tokio::test]
async fn a_collector_that_does_not_answer_holds_nobody_up() {
    // It accepts, and says nothing.
    let silent = TcpListener::bind("127.0.0.1:0").expect("a port");
    let url = format!("http://{}", silent.local_addr().expect("an address"));
    let mut service = Service::start_in(&[("OTEL_EXPORTER_OTLP_ENDPOINT", &url)], &[]);
    service.ready().await;
    let request = client().post(service.url("/inpaint"));
    let request = request.header("content-type", "model/gltf-binary");
    let answer = request.body(EXAMPLE).send().await.expect("an answer");
    assert_eq!(answer.status(), 200);
    service.signal("TERM");
    assert!(service.child.wait().expect("it ends").success());
}
