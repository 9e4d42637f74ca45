//! Asks a running service whether it is ready, as a container's health check does.

use std::{
    io::{Read, Write},
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpStream},
    time::Duration,
};

/// Why a service is not known to be ready.
#[derive(Debug, thiserror::Error)]
pub enum HealthError {
    /// Nobody answered.
    #[error("{address} does not answer: {source}")]
    Silent {
        /// Where it was asked.
        address: SocketAddr,
        /// What came instead.
        source: std::io::Error,
    },
    /// It answered that it is not ready.
    #[error("{address} is not ready: {answer}")]
    NotReady {
        /// Where it was asked.
        address: SocketAddr,
        /// Its status line.
        answer: String,
    },
}

/// Asks `/readyz` of the service that listens on `listen`; an unspecified address (`0.0.0.0`) is asked on the loopback.
///
/// # Errors
/// When it does not answer within `patience`, or answers anything but 200.
pub fn healthcheck(listen: SocketAddr, patience: Duration) -> Result<(), HealthError> {
    let ip = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    let address = SocketAddr::new(ip, listen.port());
    let answer =
        ask(address, patience).map_err(|source| HealthError::Silent { address, source })?;
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

fn ask(address: SocketAddr, patience: Duration) -> std::io::Result<String> {
    let mut stream = TcpStream::connect_timeout(&address, patience)?;
    stream.set_read_timeout(Some(patience))?;
    stream.set_write_timeout(Some(patience))?;
    stream.write_all(
        format!("GET /readyz HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n\r\n").as_bytes(),
    )?;
    let mut answer = Vec::new();
    stream.take(4096).read_to_end(&mut answer)?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}
