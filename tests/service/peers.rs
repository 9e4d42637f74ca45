//! Peers that take no answers, or too slowly, and connections that are too many.

use std::time::Duration;

use axum::body::Bytes;
use h2::{RecvStream, client::SendRequest};
use reqwest::StatusCode;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    time::{sleep, timeout},
};

use crate::fake::FakeScan;
use crate::harness::{Service, connect_from};

const TIMEOUT: Duration = Duration::from_secs(10);
const PAUSE: &str = "300ms";
/// The pause is over, and a little more.
const AFTER_PAUSE: Duration = Duration::from_millis(600);

/// An HTTP/2 client that answers pings, and grants so many bytes to each answer before it has read it.
async fn http2(service: &Service, window: u32) -> SendRequest<Bytes> {
    let stream = TcpStream::connect(service.address).await.unwrap();
    let mut client = h2::client::Builder::new();
    client.initial_window_size(window);
    let (send, connection) = client.handshake(stream).await.unwrap();
    tokio::spawn(connection);
    send
}

/// Asks over HTTP/2, and gives back the answer's body; a scan is mended to one byte more than itself.
async fn ask(client: &SendRequest<Bytes>, path: &str, scan: Vec<u8>) -> RecvStream {
    let mut client = client.clone().ready().await.unwrap();
    let request = axum::http::Request::builder()
        .method(if scan.is_empty() { "GET" } else { "POST" })
        .uri(format!("http://x{path}"))
        .header("content-type", "model/gltf-binary")
        .body(())
        .unwrap();
    let (answer, mut body) = client.send_request(request, scan.is_empty()).unwrap();
    if !scan.is_empty() {
        body.send_data(scan.into(), true).unwrap();
    }
    let answer = timeout(TIMEOUT, answer).await.expect("no answer").unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    answer.into_body()
}

/// Reads an answer to its end, granting so many bytes at a time; its length.
async fn read(body: &mut RecvStream, pause: Duration) -> Result<usize, h2::Error> {
    let mut length = 0;
    while let Some(data) = timeout(TIMEOUT, body.data()).await.expect("no end") {
        let data = data?;
        length += data.len();
        sleep(pause).await;
        body.flow_control().release_capacity(data.len())?;
    }
    Ok(length)
}

#[tokio::test]
async fn an_http2_stream_whose_answer_is_not_taken_is_reset() {
    let service = Service::start(&["--body-timeout", PAUSE]).await;
    // Nothing is granted; a part is, less and more than what is buffered.
    for window in [0, 1, 100_000, 600_000] {
        let client = http2(&service, window).await;
        let mut answers = Vec::new();
        for (path, scan) in [
            ("/openapi.json", 0),
            ("/livez", 0),
            ("/inpaint", 9),
            ("/inpaint", 2 << 20),
        ] {
            if window as usize <= scan || window <= 1 {
                answers.push(ask(&client, path, vec![7; scan]).await);
            }
        }
        sleep(AFTER_PAUSE).await;
        for mut body in answers {
            let taken = timeout(TIMEOUT, async {
                while let Some(data) = body.data().await {
                    data?;
                }
                Ok::<(), h2::Error>(())
            });
            let error = taken.await.expect("still open").unwrap_err();
            assert!(error.is_reset(), "{window}: {error}");
        }
        // The connection serves on.
        let mut client = client.ready().await.unwrap();
        let request = axum::http::Request::get("http://x/livez").body(()).unwrap();
        let (answer, _) = client.send_request(request, true).unwrap();
        assert_eq!(answer.await.unwrap().status(), StatusCode::OK);
    }
}

#[tokio::test]
async fn an_answer_that_is_taken_in_time_is_complete() {
    const SCAN: usize = 1 << 20;
    let service = Service::start(&["--body-timeout", "1s"]).await;
    let client = http2(&service, 32 << 10).await;
    // Longer than one pause, with a short rest after each piece.
    let mut body = ask(&client, "/inpaint", vec![7; SCAN]).await;
    let length = read(&mut body, Duration::from_millis(20)).await.unwrap();
    assert!(length > SCAN);
    // As many as one connection may ask for at once, and more.
    let many = (0..40).map(|_| {
        let client = client.clone();
        tokio::spawn(async move {
            let mut body = ask(&client, "/inpaint", vec![7; 100_000]).await;
            read(&mut body, Duration::ZERO).await.unwrap()
        })
    });
    for length in many.collect::<Vec<_>>() {
        assert!(length.await.unwrap() > 100_000);
    }
}

#[tokio::test]
async fn an_http2_answer_that_is_taken_byte_by_byte_is_reset() {
    let service = Service::start(&["--body-timeout", PAUSE, "--body-rate", "4KiB"]).await;
    let client = http2(&service, 1).await;
    let mut body = ask(&client, "/inpaint", vec![7; 100_000]).await;
    let taken = timeout(TIMEOUT, read(&mut body, Duration::from_millis(20))).await;
    assert!(taken.expect("still open").unwrap_err().is_reset());
}

#[tokio::test]
async fn a_whole_answer_has_a_time() {
    // More than the buffers of both sockets hold.
    const SCAN: usize = 32 << 20;
    let service = Service::start(&["--body-timeout", PAUSE]).await;
    let head = format!(
        "POST /inpaint HTTP/1.1\r\nhost: x\r\ncontent-type: model/gltf-binary\r\ncontent-length: {SCAN}\r\n\r\n"
    );
    let mut stream = TcpStream::connect(service.address).await.unwrap();
    stream.write_all(head.as_bytes()).await.unwrap();
    stream.write_all(&vec![7; SCAN]).await.unwrap();
    let (mut piece, mut length) = (vec![0; 256 << 10], 0);
    while let Ok(read @ 1..) = stream.read(&mut piece).await {
        length += read;
        sleep(Duration::from_millis(50)).await;
    }
    assert!(length < SCAN, "the whole answer was sent");
}

/// Whether a connection is closed, or reset, soon.
async fn is_closed(stream: &mut TcpStream) -> bool {
    let read = timeout(Duration::from_millis(300), stream.read(&mut [0; 64])).await;
    matches!(read, Ok(Ok(0) | Err(_)))
}

/// The status of `GET /livez` on a connection; empty when it is closed.
async fn livez(stream: &mut TcpStream) -> String {
    let head = b"GET /livez HTTP/1.1\r\nhost: x\r\n\r\n";
    stream.write_all(head).await.ok();
    let mut answer = [0; 12];
    let read = timeout(TIMEOUT, stream.read_exact(&mut answer)).await;
    let is_answered = read.expect("neither answered nor closed").is_ok();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    if is_answered { answer } else { String::new() }
}

#[tokio::test]
async fn a_new_connection_takes_the_place_of_the_most_silent_one() {
    for setting in ["--connections", "--connections-per-address"] {
        let service = Service::start(&[setting, "3"]).await;
        let running = tokio::spawn(service.scan(FakeScan::holding("held")).send());
        service.fake.wait_for_scan("held").await;
        let mut stalled = TcpStream::connect(service.address).await.unwrap();
        let head = b"POST /inpaint HTTP/1.1\r\nhost: x\r\ncontent-type: model/gltf-binary\r\ncontent-length: 9\r\n\r\nclo";
        stalled.write_all(head).await.unwrap();
        sleep(Duration::from_millis(100)).await;
        let mut open = Vec::new();
        for _ in 0..4 {
            let mut stream = TcpStream::connect(service.address).await.unwrap();
            assert_eq!(livez(&mut stream).await, "HTTP/1.1 200", "{setting}");
            open.push(stream);
        }
        assert!(is_closed(&mut stalled).await, "{setting}");
        service.fake.release();
        assert_eq!(running.await.unwrap().unwrap().status(), 200, "{setting}");
    }
}

#[tokio::test]
async fn a_connection_too_many_is_closed_when_all_wait_for_the_service() {
    for (setting, others) in [
        ("--connections", false),
        ("--connections-per-address", true),
    ] {
        let service = Service::start(&[setting, "2", "--workers", "2"]).await;
        let mut running = Vec::new();
        for name in ["first", "second"] {
            running.push(tokio::spawn(service.scan(FakeScan::holding(name)).send()));
            service.fake.wait_for_scan(name).await;
        }
        let mut refused = TcpStream::connect(service.address).await.unwrap();
        assert!(is_closed(&mut refused).await, "{setting}");
        let mut other = connect_from(&service, "127.0.0.2").await;
        let answer = livez(&mut other).await;
        assert_eq!(answer == "HTTP/1.1 200", others, "{setting}");

        service.fake.release();
        for running in running {
            assert_eq!(running.await.unwrap().unwrap().status(), 200, "{setting}");
        }
        let mut stream = TcpStream::connect(service.address).await.unwrap();
        assert_eq!(livez(&mut stream).await, "HTTP/1.1 200", "{setting}");
    }
}
