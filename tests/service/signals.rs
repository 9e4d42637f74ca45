//! Signals, sent to a service in another process: this test program, started again.

use std::{
    io::{Read, Write},
    net::{SocketAddr, TcpListener, TcpStream},
    process::{Child, Command, Stdio},
    sync::Arc,
    time::{Duration, Instant},
};

use clap::Parser;
use darn_serve::{Listening, LogDelivery, LogFormat, healthcheck, run, start_logging};

use crate::fake::{FakeMender, FakeScan};
use crate::harness::Settings;

const ADDRESS: &str = "DARN_TEST_SIGNALS_ADDRESS";
pub const TIMEOUT: Duration = Duration::from_secs(10);

/// Not a test: what the other process runs.
#[test]
#[ignore = "run by the tests of signals and logs"]
fn serves_until_signalled() {
    if let Some(address) = std::env::var_os(ADDRESS) {
        let settings = [
            "darn".into(),
            "--listen".into(),
            address,
            "--drain".into(),
            "60s".into(),
        ];
        let settings = Settings::parse_from(settings).serve;
        let _log = start_logging(&settings.log, LogFormat::Text, LogDelivery::Queued).unwrap();
        run(&settings, Arc::new(FakeMender::default())).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// A service in another process, not started yet, and its address; `program` runs the test program with the arguments after it.
pub fn service_behind(mut program: Command) -> (Command, SocketAddr) {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap();
    program
        .args(["--exact", "signals::serves_until_signalled", "--ignored"])
        .args(["--test-threads", "1"])
        .env(ADDRESS, address.to_string())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    (program, address)
}

/// Another process; killed when dropped.
pub struct Process(pub Child);

impl Drop for Process {
    fn drop(&mut self) {
        self.0.kill().ok();
        self.0.wait().ok();
    }
}

/// Starts a service in another process, whose log goes to `stderr`, and waits until it is ready.
pub fn start(stderr: Stdio) -> (Process, SocketAddr) {
    let (mut program, address) = service_behind(Command::new(std::env::current_exe().unwrap()));
    program.stderr(stderr);
    (start_behind(program, address), address)
}

/// Starts a service in another process and waits until it is ready.
pub fn start_behind(mut program: Command, address: SocketAddr) -> Process {
    let child = Process(program.spawn().unwrap());
    let end = Instant::now() + TIMEOUT;
    while healthcheck(&Listening::plain(address), TIMEOUT).is_err() {
        assert!(Instant::now() < end, "the service never was ready");
        std::thread::sleep(Duration::from_millis(10));
    }
    child
}

pub fn signal(child: &Child) {
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-TERM", &id]).status();
    assert!(sent.unwrap().success());
}

pub fn metrics(address: SocketAddr) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream
        .write_all(b"GET /metrics HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n")
        .unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text
}

pub fn ends(child: &mut Child, within: Duration) -> bool {
    let end = Instant::now() + within;
    while Instant::now() < end {
        if child.try_wait().unwrap().is_some() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    false
}

#[test]
fn a_second_signal_ends_the_service_at_once() {
    let (mut child, address) = start(Stdio::null());

    // A running job, which the drain waits for.
    let mut held = TcpStream::connect(address).unwrap();
    let scan = FakeScan::holding("held").bytes();
    let head = format!(
        "POST /inpaint HTTP/1.1\r\nhost: x\r\ncontent-type: model/gltf-binary\r\ncontent-length: {}\r\n\r\n",
        scan.len()
    );
    held.write_all(head.as_bytes()).unwrap();
    held.write_all(&scan).unwrap();
    let end = Instant::now() + TIMEOUT;
    while !metrics(address).contains("darn_jobs{state=\"running\"} 1") {
        assert!(Instant::now() < end, "the work never began");
        std::thread::sleep(Duration::from_millis(10));
    }
    signal(&child.0);
    let early = ends(&mut child.0, Duration::from_millis(500));
    if !early {
        signal(&child.0);
    }
    let ended = ends(&mut child.0, TIMEOUT);
    assert!(!early, "one signal cut the work off");
    assert!(ended, "the second signal did not end it");
}
