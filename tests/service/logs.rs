//! A log that nobody reads, or that cannot be written, and threads that cannot be started: the service in another process.

use std::{
    fs::OpenOptions,
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    process::{Command, Stdio},
};

use crate::signals::{Process, TIMEOUT, ends, metrics, service_behind, signal, start};

/// The log of the first requests fills a pipe, which holds 64 KiB.
const REQUESTS: usize = 1000;

/// Sends requests on one connection and waits for each answer.
fn send_requests(address: SocketAddr) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    for sent in 0..REQUESTS {
        stream
            .write_all(b"GET /livez HTTP/1.1\r\nhost: x\r\n\r\n")
            .unwrap();
        let mut answer = Vec::new();
        while !answer.ends_with(b"alive\n") {
            let mut piece = [0; 1024];
            let read = stream.read(&mut piece);
            let read = read.unwrap_or_else(|error| panic!("request {sent}: {error}"));
            assert_ne!(read, 0, "request {sent}: the connection ended");
            answer.extend_from_slice(&piece[..read]);
        }
    }
}

/// The metric of dropped lines; the sum of both reasons.
fn dropped_lines(address: SocketAddr) -> u64 {
    let text = metrics(address);
    let values = text
        .lines()
        .filter(|line| line.starts_with("darn_log_lines_dropped_total{"))
        .map(|line| line.rsplit(' ').next().unwrap().parse::<u64>().unwrap());
    let values: Vec<u64> = values.collect();
    assert_eq!(values.len(), 2, "{text}");
    values.iter().sum()
}

fn ends_cleanly(mut child: Process) {
    signal(&child.0);
    assert!(ends(&mut child.0, TIMEOUT), "it did not end");
    assert!(child.0.wait().unwrap().success());
}

#[test]
fn a_service_whose_log_reader_has_gone_goes_on_and_counts_the_lines() {
    let (mut child, address) = start(Stdio::piped());
    drop(child.0.stderr.take());
    send_requests(address);
    assert!(dropped_lines(address) > 0);
    ends_cleanly(child);
}

#[test]
fn a_service_whose_log_has_no_space_goes_on_and_counts_the_lines() {
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let (child, address) = start(full.into());
    send_requests(address);
    assert!(dropped_lines(address) > 0);
    ends_cleanly(child);
}

#[test]
fn a_service_whose_log_is_not_read_goes_on_and_ends() {
    let (mut child, address) = start(Stdio::piped());
    let unread = child.0.stderr.take();
    send_requests(address);
    ends_cleanly(child);
    drop(unread);
}

#[test]
fn the_log_is_complete_at_the_end() {
    let (mut child, address) = start(Stdio::piped());
    let mut log = child.0.stderr.take().unwrap();
    let reader = std::thread::spawn(move || {
        let mut text = String::new();
        log.read_to_string(&mut text).map(|_| text)
    });
    send_requests(address);
    ends_cleanly(child);
    let text = reader.join().unwrap().unwrap();
    let answered = text.lines().filter(|line| line.contains("/livez")).count();
    assert_eq!(answered, REQUESTS);
    assert!(text.lines().last().unwrap().contains("stopped"), "{text}");
}

#[test]
fn a_service_whose_threads_cannot_be_started_says_so_and_ends() {
    // Stacks of 1 GiB in 4 GiB of addresses: some of the threads can be started, not all.
    let mut shell = Command::new("sh");
    shell
        .args(["-c", "ulimit -v 4194304; exec \"$0\" \"$@\""])
        .arg(std::env::current_exe().unwrap())
        .env("RUST_MIN_STACK", (1_u64 << 30).to_string());
    let (mut program, _) = service_behind(shell);
    let mut child = program.stderr(Stdio::piped()).spawn().unwrap();
    let ended = ends(&mut child, TIMEOUT);
    child.kill().ok();
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(ended, "it neither serves nor ends: {said}");
    assert!(!output.status.success(), "{said}");
    assert!(said.contains("threads cannot be started"), "{said}");
}
