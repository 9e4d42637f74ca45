//! `darn healthcheck`: asks a running service whether it is ready, for containers that have no curl.

use super::failure::{Failure, OrFail};
use darn_serve::Listening;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub struct HealthcheckArgs {
    /// Where the service listens; 0.0.0.0 is asked on the loopback
    #[arg(
        long,
        env = "DARN_LISTEN",
        value_name = "ADDRESS",
        default_value = "127.0.0.1:8080"
    )]
    listen: SocketAddr,
    /// File of the certificate that the service has, when it speaks TLS
    #[arg(long, env = "DARN_TLS_CERT", value_name = "FILE")]
    tls_cert: Option<PathBuf>,
    /// Seconds to wait for an answer
    #[arg(long, value_name = "SECONDS", default_value_t = 2, value_parser = clap::value_parser!(u64).range(1..=60))]
    patience: u64,
}

/// Runs `darn healthcheck`.
pub fn run(args: &HealthcheckArgs) -> Result<(), Failure> {
    let listening = Listening {
        address: args.listen,
        certificate: args.tls_cert.clone(),
    };
    darn_serve::healthcheck(&listening, Duration::from_secs(args.patience))
        .or_fail("see the service ready")?;
    println!("{}: ready", args.listen);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::TcpListener;

    /// The outcome against a server that answers with `answer`.
    fn outcome_for(answer: &'static str) -> Result<(), Failure> {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let listen = listener.local_addr().expect("an address");
        let server = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().expect("a client");
            // The client may close before it has read the whole answer.
            let _ = stream.read(&mut [0; 512]);
            let _ = stream.write_all(answer.as_bytes());
        });
        let outcome = run(&HealthcheckArgs {
            listen,
            tls_cert: None,
            patience: 2,
        });
        server.join().expect("the server ended");
        outcome
    }

    #[test]
    fn only_a_200_is_ready() {
        assert!(outcome_for("HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n").is_ok());
        for other in [
            "HTTP/1.1 503 Service Unavailable\r\n\r\n",
            "SSH-2.0-OpenSSH\r\n",
            "",
        ] {
            assert_eq!(outcome_for(other).expect_err(other).code(), 1);
        }
    }

    #[test]
    fn no_server_is_a_failure() {
        let listen = TcpListener::bind("127.0.0.1:0")
            .and_then(|l| l.local_addr())
            .expect("a free port");
        assert_eq!(
            run(&HealthcheckArgs {
                listen,
                tls_cert: None,
                patience: 1
            })
            .expect_err("nobody listens")
            .code(),
            1
        );
    }
}
