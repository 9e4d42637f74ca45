//! A log that nobody reads, or that cannot be written: the service in another process.

use std::{
    fs::OpenOptions,
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    process::{Child, Stdio},
};

use crate::signals::{TIMEOUT, ends, metrics, signal, start};

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

fn ends_cleanly(mut child: Child) {
    signal(&child);
    let ended = ends(&mut child, TIMEOUT);
    child.kill().ok();
    assert!(child.wait().unwrap().success() && ended);
}

#[test]
fn a_service_whose_log_reader_has_gone_goes_on_and_counts_the_lines() {
    let (mut child, address) = start(Stdio::piped());
    drop(child.stderr.take());
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
    let unread = child.stderr.take();
    send_requests(address);
    ends_cleanly(child);
    drop(unread);
}

#[test]
fn the_log_is_complete_at_the_end() {
    let (mut child, address) = start(Stdio::piped());
    let mut log = child.stderr.take().unwrap();
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
