//! Asks a running service whether it is ready, for a container's health check.

use std::{
    io::{Read, Write},
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpStream},
    time::Duration,
};

/// Why a service does not count as ready.
#[derive(Debug, thiserror::Error)]
pub enum HealthError {
    /// There was no answer.
    #[error("{address} does not answer: {source}")]
    NoAnswer {
        /// The address asked.
        address: SocketAddr,
        /// The I/O error.
        source: std::io::Error,
    },
    /// The answer was not 200.
    #[error("{address} is not ready: {answer}")]
    NotReady {
        /// The address asked.
        address: SocketAddr,
        /// Its status line.
        answer: String,
    },
}

/// Requests `/readyz` of the service that listens on `listen`; for an unspecified address (`0.0.0.0`, `::`) on the loopback address.
///
/// # Errors
/// The service does not answer within `timeout`, or answers anything but 200.
pub fn healthcheck(listen: SocketAddr, timeout: Duration) -> Result<(), HealthError> {
    let ip = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    let address = SocketAddr::new(ip, listen.port());
    let answer =
        ask(address, timeout).map_err(|source| HealthError::NoAnswer { address, source })?;
    let line = answer.lines().next().unwrap_or_default();
    if line.split(' ').nth(1) == Some("200") {
        Ok(())
    } else {
        Err(HealthError::NotReady {
            address,
            answer: line.to_owned(),
        })
    }
}

fn ask(address: SocketAddr, timeout: Duration) -> std::io::Result<String> {
    let mut stream = TcpStream::connect_timeout(&address, timeout)?;
    stream.set_read_timeout(Some(timeout))?;
    stream.set_write_timeout(Some(timeout))?;
    stream.write_all(
        format!("GET /readyz HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n\r\n").as_bytes(),
    )?;
    let mut answer = Vec::new();
    stream.take(4096).read_to_end(&mut answer)?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}
