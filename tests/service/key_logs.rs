//! What the log says of keys: their ids, and never a secret, whatever its filter; the service in another process.

use std::{
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    process::{Command, Stdio},
    time::Duration,
};

use darn_serve::generated::darn_client::DarnClient;
use serde_json::json;

use crate::keyed::{bearer, entry, secret};
use crate::protocols::chunks;
use crate::signals::{TIMEOUT, ends, service_behind, signal, start_behind};

/// An answer over HTTP/1.1 to a request without a body.
fn ask(address: SocketAddr, path: &str, authorization: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    let request = format!(
        "GET {path} HTTP/1.1\r\nhost: x\r\nconnection: close\r\nauthorization: {authorization}\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text
}

/// The same over HTTP/2, as gRPC.
async fn ask_by_grpc(address: SocketAddr, authorization: &str) {
    let mut client = DarnClient::connect(format!("http://{address}"))
        .await
        .unwrap();
    let mut request = tonic::Request::new(chunks("cloth", None));
    (request.metadata_mut()).insert("authorization", authorization.parse().unwrap());
    // Whether it is answered depends on the key.
    drop(client.find_holes(request).await);
}

#[test]
fn a_secret_stands_in_no_log_line_and_no_answer() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("keys.json");
    let keys = json!({ "keys": [entry("lab", &["mend"])] });
    std::fs::write(&file, keys.to_string()).unwrap();
    let (mut program, address) = service_behind(Command::new(std::env::current_exe().unwrap()));
    program
        .env("DARN_KEYS", &file)
        .env("DARN_LOG", "trace")
        .stderr(Stdio::piped());
    let mut child = start_behind(program, address);
    let mut log = child.0.stderr.take().unwrap();
    let reader = std::thread::spawn(move || {
        let mut text = String::new();
        log.read_to_string(&mut text).map(|_| text)
    });
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    let mut answers = String::new();
    // A known key, an unknown one, and a known one in another scheme.
    let known = bearer("lab");
    let other = known.replace("Bearer", "Token");
    for authorization in [&known, &bearer("stranger"), &other] {
        for path in ["/info", "/metrics", "/sessions/0", "/nothing"] {
            answers += &ask(address, path, authorization);
        }
        runtime.block_on(ask_by_grpc(address, authorization));
    }
    // Its tasks hold the connections open.
    drop(runtime);
    // A file with a secret in place of its digest.
    let wrong = json!({ "keys": [{ "id": "lab", "sha256": secret("lab").text(), "scopes": [] }] });
    std::fs::write(&file, wrong.to_string()).unwrap();
    std::thread::sleep(Duration::from_millis(2500));
    signal(&child.0);
    assert!(ends(&mut child.0, TIMEOUT), "it did not end");
    let log = reader.join().unwrap().unwrap();
    assert!(
        log.contains("TRACE") && log.contains("h2"),
        "not all is logged"
    );
    assert!(log.contains("key=\"lab\""), "the log names the key");
    let complaint = log
        .lines()
        .find(|line| line.contains("keys stay as they are"));
    assert!(
        complaint.is_some_and(|line| line.contains("line 1 column")),
        "{complaint:?}"
    );
    for id in ["lab", "stranger"] {
        let text = secret(id).text();
        for (what, said) in [("an answer", &answers), ("the log", &log)] {
            let line = said.lines().find(|line| line.contains(&text[5..]));
            assert_eq!(line, None, "{what} repeats a secret");
        }
    }
}
