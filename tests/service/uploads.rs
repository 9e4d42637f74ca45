//! Request bodies: size, speed, number at once, media types; and connections whose peer is silent.

use std::io::Write as _;
use std::time::{Duration, Instant};

use clap::Parser;
use flate2::Compression;
use flate2::write::{DeflateEncoder, GzEncoder, ZlibEncoder};
use reqwest::multipart::{Form, Part};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    time::timeout,
};

use crate::harness::{Service, Settings, client, connect_from, problem};

const TIMEOUT: Duration = Duration::from_secs(10);

/// More than a small body.
const LARGE: usize = 2 << 20;

/// A request that declares a body of `body` bytes and sends three of them.
async fn stalled(service: &Service, body: usize) -> TcpStream {
    stall(TcpStream::connect(service.address).await.unwrap(), body).await
}

/// So many of them.
async fn some_stalled(service: &Service, body: usize, count: usize) -> Vec<TcpStream> {
    let mut streams = Vec::new();
    for _ in 0..count {
        streams.push(stalled(service, body).await);
    }
    streams
}

/// The same on a connection.
async fn stall(mut stream: TcpStream, body: usize) -> TcpStream {
    let head = format!(
        "POST /inpaint HTTP/1.1\r\nhost: x\r\ncontent-type: model/gltf-binary\r\ncontent-length: {body}\r\n\r\nclo"
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    stream
}

/// The status line's first twelve bytes.
async fn status(stream: &mut TcpStream) -> String {
    let mut answer = [0; 12];
    let read = timeout(TIMEOUT, stream.read_exact(&mut answer)).await;
    read.expect("no answer").unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

fn form(scan: Vec<u8>, constraints: Vec<u8>, media: &str) -> Form {
    let constraints = Part::bytes(constraints).file_name("c.json");
    Form::new()
        .part("scan", Part::bytes(scan))
        .part("constraints", constraints.mime_str(media).unwrap())
}

#[tokio::test]
async fn a_multipart_scan_may_be_as_large_as_a_bare_one() {
    let service = Service::start(&["--body-limit", "8MiB"]).await;
    let form = form(vec![7; 5 << 20], b"{}".to_vec(), "application/json");
    let answer = service.post("/inpaint").multipart(form).send().await;
    let answer = answer.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.bytes().await.unwrap().len(), (5 << 20) + 5);
}

#[tokio::test]
async fn constraints_have_a_limit_of_their_own() {
    let service = Service::start(&[]).await;
    let form = form(b"cloth".to_vec(), vec![b' '; 3 << 20], "application/json");
    let answer = service.post("/inpaint").multipart(form).send().await;
    let document = problem(answer.unwrap()).await;
    insta::assert_snapshot!("constraints_too_large", format!("{document:#}"));
}

#[tokio::test]
async fn constraints_are_read_as_curl_sends_files() {
    let service = Service::start(&[]).await;
    let send = async |constraints: &str, media| {
        let form = form(b"cloth".to_vec(), constraints.into(), media);
        let request = service.post("/inpaint").multipart(form);
        request.send().await.unwrap()
    };
    let answer = send("{}", "application/octet-stream").await;
    assert_eq!(answer.status(), 200);
    let loose =
        r#"{"holes": null, "anchors": [{"hole": 2.0, "uv": [0, 1.0], "position": [0, 0, 0]}]}"#;
    assert_eq!(send(loose, "application/json").await.status(), 200);
    let document = problem(send("{}", "text/plain").await).await;
    insta::assert_snapshot!("constraints_media", format!("{document:#}"));
    let document = problem(send("null", "application/json").await).await;
    insta::assert_snapshot!("constraints_null", format!("{document:#}"));
}

#[tokio::test]
async fn a_body_in_an_unknown_coding_is_refused() {
    let service = Service::start(&[]).await;
    let plain = service.scan("cloth").header("content-encoding", "identity");
    assert_eq!(plain.send().await.unwrap().status(), 200);
    let packed = service.scan("cloth").header("content-encoding", "br");
    let refused = packed.send().await.unwrap();
    assert_eq!(refused.headers()["accept-encoding"], "gzip, deflate");
    insta::assert_snapshot!("compressed", format!("{:#}", problem(refused).await));
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn deflate(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[tokio::test]
async fn compressed_bodies_are_read_within_the_body_limit() {
    let service = Service::start(&["--body-limit", "1MiB"]).await;
    let post = |coding: &'static str, body: Vec<u8>| {
        let request = service.scan("cloth").header("content-encoding", coding);
        async move { request.body(body).send().await.unwrap() }
    };
    for (coding, body) in [
        ("gzip", gzip(b"cloth")),
        ("gzip", [gzip(b"clo"), gzip(b"th")].concat()),
        ("deflate", zlib(b"cloth")),
        ("deflate", deflate(b"cloth")),
    ] {
        let answer = post(coding, body).await;
        assert_eq!(answer.status(), 200, "{coding}");
        assert!(
            answer.bytes().await.unwrap().starts_with(b"glTF cloth"),
            "{coding}"
        );
    }
    let bomb = gzip(&vec![0; 64 << 20]);
    assert!(bomb.len() < 1 << 20);
    assert_eq!(post("gzip", bomb).await.status(), 413);
    let mut broken = gzip(b"cloth");
    broken.truncate(12);
    assert_eq!(post("gzip", broken).await.status(), 400);
}

#[tokio::test]
async fn a_body_without_a_media_type_is_told_by_its_first_bytes() {
    let service = Service::start(&[]).await;
    let url = format!("http://{}/inpaint", service.address);
    let client = client();
    let post = |media: Option<&'static str>, body: &'static [u8]| {
        let request = client.post(&url).body(body);
        let request = match media {
            Some(media) => request.header("content-type", media),
            None => request,
        };
        async move { request.send().await.unwrap().status().as_u16() }
    };
    let curl = "application/x-www-form-urlencoded";
    for media in [None, Some("application/octet-stream"), Some(curl)] {
        assert_eq!(post(media, b"glTF and more").await, 200);
        assert_eq!(post(media, b"\xEF\xBB\xBF {\"asset\": 2}").await, 200);
        assert_eq!(post(media, b"PK\x03\x04").await, 200);
        assert_eq!(post(media, b"solid cloth").await, 415);
        assert_eq!(post(media, b"").await, 400);
    }
    assert_eq!(post(Some("text/plain"), b"glTF").await, 415);
}

#[tokio::test]
async fn files_of_a_scan_come_as_parts_named_by_their_uris() {
    let service = Service::start(&[]).await;
    let url = format!("http://{}/inpaint", service.address);
    let send = |form: Form| {
        let request = client().post(&url).multipart(form);
        async move { request.send().await.unwrap() }
    };
    let scan = || Part::bytes(b"{}".to_vec());
    let file = || Part::bytes(b"weft".to_vec());
    // Otherwise reqwest writes `name*`, which multipart/form-data does not have (RFC 7578, section 4.2).
    let form = Form::new()
        .percent_encode_noop()
        .part("scan", scan())
        .part("maps/cloth%20plaid.png", file());
    let answer = send(form.part("cloth.bin", file())).await;
    // The fake sends back what it was given.
    let bytes = answer.bytes().await.unwrap();
    let said = String::from_utf8_lossy(&bytes);
    assert!(bytes.starts_with(b"glTF PK\x03\x04"), "{said}");
    let has = |name: &[u8]| bytes.windows(name.len()).any(|at| at == name);
    assert!(has(b"maps/cloth%20plaid.png") && has(b"cloth.bin") && has(b"scan.gltf"));
    let nameless = send(Form::new().part("scan", scan()).part("clothbin", file())).await;
    assert_eq!(nameless.status(), 400);
    let twice = Form::new().part("scan", scan()).part("a.bin", file());
    assert_eq!(send(twice.part("a.bin", file())).await.status(), 400);
}

#[tokio::test]
async fn a_body_declared_too_large_is_refused_at_once() {
    let service = Service::start(&["--body-limit", "1KiB"]).await;
    let begun = Instant::now();
    let mut stream = stalled(&service, 1 << 40).await;
    assert_eq!(status(&mut stream).await, "HTTP/1.1 413");
    assert!(
        begun.elapsed() < Duration::from_millis(1500),
        "the answer waited for the body"
    );
}

#[tokio::test]
async fn stalled_uploads_take_no_place_in_the_queue() {
    let service = Service::start(&["--workers", "1", "--queue", "1"]).await;
    let mut streams = some_stalled(&service, 9, 3).await;
    // A test cannot observe that the service has begun to read them.
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert_eq!(service.scan("cloth").send().await.unwrap().status(), 200);
    streams[0].write_all(b"th 123").await.unwrap();
    assert_eq!(status(&mut streams[0]).await, "HTTP/1.1 200");
}

#[tokio::test]
async fn uploads_are_bounded_and_the_refusal_names_the_setting() {
    let shared = ["--uploads", "3"];
    let anybody = ["--uploads", "2", "--connections-per-address", "0"];
    for (settings, size, most, name) in [
        (&anybody[..], LARGE, 2, "uploads_full"),
        (&anybody[..], 9, 16, "small_uploads_full"),
        (&shared[..], LARGE, 2, "upload_share_full"),
        (&shared[..], 9, 12, "small_upload_share_full"),
    ] {
        let service = Service::start(settings).await;
        let streams = some_stalled(&service, size, most).await;
        let send = async || {
            let request = service.scan("cloth").body(vec![7; size]);
            request.send().await.unwrap()
        };
        let end = Instant::now() + TIMEOUT;
        let refused = loop {
            let answer = send().await;
            if answer.status() != 200 {
                break answer;
            }
            assert!(Instant::now() < end, "nothing was refused");
        };
        assert!(refused.headers().contains_key("retry-after"));
        insta::assert_snapshot!(name, format!("{:#}", problem(refused).await));
        assert_eq!(service.get("/readyz").send().await.unwrap().status(), 200);

        drop(streams);
        while send().await.status() != 200 {
            assert!(
                Instant::now() < end,
                "closed connections keep their upload permits"
            );
        }
    }
}

#[tokio::test]
async fn one_address_leaves_half_of_the_uploads_to_others() {
    let service = Service::start(&["--uploads", "4"]).await;
    let mut streams = some_stalled(&service, LARGE, 6).await;
    for refused in &mut streams[2..] {
        assert_eq!(status(refused).await, "HTTP/1.1 503");
    }
    let mut other = stall(connect_from(&service, "127.0.0.2").await, LARGE).await;
    other.write_all(&vec![7; LARGE - 3]).await.unwrap();
    assert_eq!(status(&mut other).await, "HTTP/1.1 200");
}

#[tokio::test]
async fn sessions_are_served_while_large_uploads_stall() {
    let service = Service::start(&["--uploads", "1"]).await;
    let session = service.session("cloth").await;
    let _stalled = stalled(&service, LARGE).await;
    let mut refused = stalled(&service, LARGE).await;
    assert_eq!(status(&mut refused).await, "HTTP/1.1 503");

    let edit = service.ask(&format!("{session}/inpaint"), "{}");
    assert_eq!(edit.send().await.unwrap().status(), 200);
    // Also one whose length is not declared.
    let mut edit = TcpStream::connect(service.address).await.unwrap();
    let head = format!(
        "POST {session}/inpaint HTTP/1.1\r\nhost: x\r\ncontent-type: application/json\r\ntransfer-encoding: chunked\r\n\r\n"
    );
    edit.write_all(head.as_bytes()).await.unwrap();
    edit.write_all(b"2\r\n{}\r\n0\r\n\r\n").await.unwrap();
    assert_eq!(status(&mut edit).await, "HTTP/1.1 200");
    for path in [session.clone(), format!("{session}/result")] {
        assert_eq!(service.get(&path).send().await.unwrap().status(), 200);
    }
    assert_eq!(service.scan("cloth").send().await.unwrap().status(), 200);
    assert_eq!(service.delete(&session).send().await.unwrap().status(), 204);
}

#[tokio::test]
async fn a_session_is_read_while_small_uploads_stall() {
    let service = Service::start(&["--uploads", "1"]).await;
    let session = service.session("cloth").await;
    let _stalled = some_stalled(&service, 9, 4).await;
    let mut refused = stalled(&service, 9).await;
    assert_eq!(status(&mut refused).await, "HTTP/1.1 503");
    for path in [session.clone(), format!("{session}/result")] {
        assert_eq!(service.get(&path).send().await.unwrap().status(), 200);
    }
    assert_eq!(service.delete(&session).send().await.unwrap().status(), 204);
}

/// Sends a body of so many pieces of so many bytes, one each 20 ms, until it is answered; the answer as far as it is read at once.
async fn trickled(service: &Service, pieces: usize, bytes: usize) -> String {
    let mut stream = stalled(service, 3 + pieces * bytes).await;
    for _ in 0..pieces {
        tokio::time::sleep(Duration::from_millis(20)).await;
        if stream.write_all(&vec![7; bytes]).await.is_err() {
            break;
        }
    }
    let mut answer = vec![0; 4096];
    let read = timeout(TIMEOUT, stream.read(&mut answer)).await;
    let read = read.expect("no answer").unwrap();
    String::from_utf8_lossy(&answer[..read]).into_owned()
}

#[tokio::test]
async fn a_body_must_keep_to_the_rate() {
    let settings = ["--body-timeout", "400ms", "--body-rate", "1000"];
    let service = Service::start(&settings).await;
    // 50 bytes a second, then at most 5000: both longer than the pause.
    let slow = trickled(&service, 50, 1).await;
    assert!(slow.starts_with("HTTP/1.1 408"), "{slow}");
    assert!(slow.contains("body_timeout"), "{slow}");
    assert!(slow.contains("1000 bytes a second"), "{slow}");
    let steady = trickled(&service, 50, 100).await;
    assert!(steady.starts_with("HTTP/1.1 200"), "{steady}");

    let settings = ["--body-timeout", "400ms", "--body-rate", "0"];
    let service = Service::start(&settings).await;
    let slow = trickled(&service, 50, 1).await;
    assert!(slow.starts_with("HTTP/1.1 200"), "{slow}");
}

#[tokio::test]
async fn a_shutdown_waits_for_uploads_and_times_out_stalled_ones() {
    let service = Service::start(&["--body-timeout", "1s", "--drain", "60s"]).await;
    let mut comes = stalled(&service, 9).await;
    let mut stalls = stalled(&service, 9).await;
    tokio::time::sleep(Duration::from_millis(100)).await;
    service.stop.cancel();
    tokio::time::sleep(Duration::from_millis(200)).await;
    comes.write_all(b"th 123").await.unwrap();
    assert_eq!(status(&mut comes).await, "HTTP/1.1 200");
    assert_eq!(status(&mut stalls).await, "HTTP/1.1 408");
    let ended = timeout(TIMEOUT, service.ended).await;
    ended.expect("the drain was held").unwrap().unwrap();
}

#[test]
fn settings_out_of_bounds_are_refused_by_name() {
    for (flag, value, said) in [
        ("--workers", "100000000", "from 0 to 1024"),
        ("--queue", "18446744073709551615", "from 0 to 65536"),
        ("--uploads", "0", "from 1 to 65536"),
        ("--connections", "0", "from 1 to 1048576"),
        ("--connections-per-address", "many", "from 0 to 1048576"),
        ("--body-rate", "1KB", "KiB"),
        ("--allow-origin", "example.org", "scheme://host"),
        (
            "--allow-origin",
            "https://a.org,https://b.org/",
            "scheme://host",
        ),
    ] {
        let refused = Settings::try_parse_from(["darn", flag, value]).err();
        let text = refused.map(|error| error.to_string()).unwrap_or_default();
        assert!(
            text.contains(flag) && text.contains(said),
            "{flag} {value}: {text}"
        );
    }
}

#[tokio::test]
async fn a_silent_connection_is_closed() {
    let service = Service::start(&["--body-timeout", "300ms"]).await;
    let answered = b"GET /livez HTTP/1.1\r\nhost: x\r\n\r\n".as_slice();
    let cases = [
        b"".as_slice(),
        b"POST".as_slice(),
        b"POST /inpaint HTTP/1.1\r\nhost: x\r\n".as_slice(),
        b"PRI * HTTP/2.0\r\n".as_slice(),
        answered,
    ];
    for begun in cases {
        let mut stream = TcpStream::connect(service.address).await.unwrap();
        stream.write_all(begun).await.unwrap();
        let mut answer = Vec::new();
        let ended = timeout(TIMEOUT, stream.read_to_end(&mut answer)).await;
        // Closed or reset.
        ended.expect("still open").ok();
        assert_eq!(answer.starts_with(b"HTTP/1.1 200"), begun == answered);
    }
}

#[tokio::test]
async fn a_connection_that_reads_no_answer_is_closed() {
    // More than the buffers of both sockets hold.
    const SCAN: usize = 32 << 20;
    let service = Service::start(&["--body-timeout", "300ms"]).await;
    let head = format!(
        "POST /inpaint HTTP/1.1\r\nhost: x\r\ncontent-type: model/gltf-binary\r\ncontent-length: {SCAN}\r\n\r\n"
    );
    let mut stream = TcpStream::connect(service.address).await.unwrap();
    stream.write_all(head.as_bytes()).await.unwrap();
    stream.write_all(&vec![7; SCAN]).await.unwrap();
    assert_eq!(status(&mut stream).await, "HTTP/1.1 200");
    tokio::time::sleep(Duration::from_secs(2)).await;
    let mut rest = Vec::new();
    let ended = timeout(TIMEOUT, stream.read_to_end(&mut rest)).await;
    ended.expect("still open").ok();
    assert!(rest.len() < SCAN, "the whole answer was sent");
}

#[tokio::test]
async fn bodies_beyond_the_memory_are_refused_and_their_memory_comes_back() {
    let service = Service::start(&["--memory", "8MiB", "--body-limit", "64MiB"]).await;
    let post = |bytes: usize| {
        let request = service.post("/inpaint");
        let request = request.header("content-type", "model/gltf-binary");
        request.body(vec![7; bytes]).send()
    };
    for _ in 0..3 {
        let refused = post(20 << 20).await.unwrap();
        assert_eq!(refused.status(), 503);
        assert_eq!(refused.headers()["retry-after"], "5");
        assert_eq!(problem(refused).await["code"], "memory_full");
        // Three times: what was counted for the refused body is free again.
        assert_eq!(post(2 << 20).await.unwrap().status(), 200);
    }
}
