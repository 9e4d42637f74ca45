//! The service's settings, each a flag or a `DARN_*` variable. All are parsed before a socket is bound.

use std::{net::SocketAddr, ops::RangeInclusive, path::PathBuf, time::Duration};

use clap::Args;

use darn_jobs::{
    Place,
    blobs::{Bucket, Files},
};

use super::{instance::InstanceName, telemetry::LogFormat, tls::TlsFiles, webhook::WebhookArgs};

/// Upper bound of the settings `queue` and `uploads`.
const MAX_WAITING: usize = 65_536;
/// Upper bound of the settings of connections.
const MAX_CONNECTIONS: usize = 1 << 20;
/// Connections without a setting, where the process may open enough files.
const DEFAULT_CONNECTIONS: usize = 1024;
/// Files that the process opens beside connections.
const OTHER_FILES: usize = 32;

/// Memory of a machine that does not say.
const UNKNOWN_MEMORY: usize = 4 << 30;

/// Serve HTTP and gRPC.
#[derive(Debug, Clone, Args)]
pub struct ServeArgs {
    /// Address to listen on, for HTTP and gRPC alike
    #[arg(
        long,
        env = "DARN_LISTEN",
        value_name = "ADDRESS",
        default_value = "127.0.0.1:8080"
    )]
    pub listen: SocketAddr,

    /// Address for gRPC alone; left out, gRPC shares the port
    #[arg(long, env = "DARN_GRPC_LISTEN", value_name = "ADDRESS")]
    pub grpc_listen: Option<SocketAddr>,

    /// File of the keys that the service takes; read again when it changes. `darn key new` makes keys. Left out, anybody may call
    #[arg(long, env = "DARN_KEYS", value_name = "FILE")]
    pub keys: Option<PathBuf>,

    /// Listen beyond this machine's loopback without keys: whoever reaches the address may call
    #[arg(long, env = "DARN_ALLOW_ANONYMOUS", conflicts_with = "keys")]
    pub allow_anonymous: bool,

    /// File of the certificate chain, in PEM, with which HTTP and gRPC are served over TLS (1.2 and 1.3); read again when it changes.
    /// Left out, connections are plain
    #[arg(long, env = "DARN_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,

    /// File of the certificate's private key, in PEM, not encrypted; read again when it changes
    #[arg(long, env = "DARN_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,

    /// Longest time of a TLS handshake, such as 10s
    #[arg(long, env = "DARN_TLS_HANDSHAKE", value_name = "TIME", default_value = "10s", value_parser = duration)]
    pub tls_handshake: Duration,

    /// Folder in which jobs are kept, which survive the process; left out, the service takes no jobs
    #[arg(long, env = "DARN_DATA", value_name = "DIR", group = "files")]
    pub data: Option<PathBuf>,

    /// PostgreSQL (15 or newer) that several processes share for their jobs, as `postgres://user:password@host/database`; the data folder
    /// then is one that they all see, and has the files, unless `--blobs` says where they are. Left out, the folder is this process's alone
    #[arg(
        long,
        env = "DARN_DATABASE",
        value_name = "URL",
        requires = "files",
        hide_env_values = true
    )]
    pub database: Option<String>,

    /// Bucket of S3-compatible storage that has the files of jobs in place of a data folder, as `s3://BUCKET/PREFIX`, for this service alone; it takes
    /// a database. Its address and credentials are in `AWS_ENDPOINT_URL`, `AWS_REGION`, `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY` and so on
    #[arg(
        long,
        env = "DARN_BLOBS",
        value_name = "URL",
        requires = "database",
        group = "files"
    )]
    pub blobs: Option<Bucket>,

    /// Name of this process among those that serve together, 1 to 12 hexadecimal digits: the ids of its sessions begin with it. Left out,
    /// a random one
    #[arg(long, env = "DARN_INSTANCE", value_name = "NAME")]
    pub instance: Option<InstanceName>,

    /// Webhooks of jobs.
    #[command(flatten)]
    pub webhooks: WebhookArgs,

    /// Scans mended at once, at most 1024, and one small one more of a client that has nothing running; left out, two per processor. With 0 the process takes jobs for others to run, and needs a database
    #[arg(long, env = "DARN_WORKERS", value_name = "N", value_parser = workers)]
    pub workers: Option<usize>,

    /// Scans that may wait for a worker, at most 65536; more are refused with 503
    #[arg(long, env = "DARN_QUEUE", value_name = "N", default_value = "32", value_parser = queue)]
    pub queue: usize,

    /// Connections open at once, at most 1048576; left out, 1024, or fewer where the process may open fewer files. A new one then takes
    /// the place of the one that was silent for longest
    #[arg(long, env = "DARN_CONNECTIONS", value_name = "N", value_parser = connections)]
    pub connections: Option<usize>,

    /// Connections of one address (IPv6: of one /64 network) open at once; 0 for any number. Each address may also hold only as
    /// many uploads as it leaves free, unless this is 0. Behind a reverse proxy, to which all clients owe their address, set 0 or what the proxy opens
    #[arg(
        long,
        env = "DARN_CONNECTIONS_PER_ADDRESS",
        value_name = "N",
        default_value = "64",
        value_parser = connections_per_address
    )]
    pub connections_per_address: usize,

    /// Bodies above 1 MiB, or of undeclared length, received at once, and eight times as many smaller ones; left out, four times workers
    /// and queue together. Bodies take at most this plus workers plus queue times the body limit of memory
    #[arg(long, env = "DARN_UPLOADS", value_name = "N", value_parser = uploads)]
    pub uploads: Option<usize>,

    /// Memory for answers of /inpaint that may be asked for again, such as 1GiB; left out, none is kept
    #[arg(long, env = "DARN_RESULT_CACHE", value_name = "SIZE", value_parser = size)]
    pub result_cache: Option<usize>,

    /// Longest time a scan may wait and be mended, such as 30s or 500ms
    #[arg(long, env = "DARN_DEADLINE", value_name = "TIME", default_value = "60s", value_parser = duration)]
    pub deadline: Duration,

    /// CPU time that any request may take; requests with more than 50 KB may take 40 microseconds a byte
    #[arg(long, env = "DARN_WORK", value_name = "TIME", default_value = "2s", value_parser = duration)]
    pub work: Duration,

    /// Memory that bodies, jobs and answers may take together, such as 4GiB; left out, half of the machine's, or of what its control group
    /// allows
    #[arg(long, env = "DARN_MEMORY", value_name = "SIZE", value_parser = size)]
    pub memory: Option<usize>,

    /// Largest request body, such as 64MiB
    #[arg(long, env = "DARN_BODY_LIMIT", value_name = "SIZE", default_value = "512MiB", value_parser = size)]
    pub body_limit: usize,

    /// Longest pause between two pieces of a request or of an answer that is taken; a whole body or answer may take eight times as long.
    /// Who sends no request for so long is let go
    #[arg(long, env = "DARN_BODY_TIMEOUT", value_name = "TIME", default_value = "15s", value_parser = duration)]
    pub body_timeout: Duration,

    /// Fewest bytes per second of a request's body, and of an answer that is taken, over any time longer than the body timeout, such as
    /// 512 or 4KiB; 0 for no such limit
    #[arg(long, env = "DARN_BODY_RATE", value_name = "SIZE", default_value = "512", value_parser = rate)]
    pub body_rate: usize,

    /// Longest time a shutdown waits for requests under way
    #[arg(long, env = "DARN_DRAIN", value_name = "TIME", default_value = "20s", value_parser = duration)]
    pub drain: Duration,

    /// Time without a request after which a session ends, such as 15m
    #[arg(long, env = "DARN_SESSION_IDLE", value_name = "TIME", default_value = "15m", value_parser = duration)]
    pub session_idle: Duration,

    /// Most memory that all sessions together may take; the least recently used ones end first
    #[arg(long, env = "DARN_SESSION_MEMORY", value_name = "SIZE", default_value = "512MiB", value_parser = size)]
    pub session_memory: usize,

    /// Origins of web pages that may call the service, such as `https://example.org`; `*` for any
    #[arg(
        long,
        env = "DARN_ALLOW_ORIGIN",
        value_name = "ORIGIN",
        value_delimiter = ',',
        value_parser = origin
    )]
    pub allow_origin: Vec<String>,

    /// Leave out the editor, the web page at `/`
    #[arg(long, env = "DARN_NO_EDITOR")]
    pub no_editor: bool,

    /// Which log lines are written, such as info or darn=debug
    #[arg(long, env = "DARN_LOG", value_name = "FILTER", default_value = "info")]
    pub log: String,

    /// How log lines look
    #[arg(
        long,
        env = "DARN_LOG_FORMAT",
        value_name = "FORMAT",
        default_value = "text"
    )]
    pub log_format: LogFormat,
}

impl ServeArgs {
    /// The first address that strangers might reach and that no key guards; `None` where that is allowed.
    pub(crate) fn exposed(&self) -> Option<SocketAddr> {
        if self.keys.is_some() || self.allow_anonymous {
            return None;
        }
        let mut addresses = [Some(self.listen), self.grpc_listen].into_iter().flatten();
        addresses.find(|address| !address.ip().to_canonical().is_loopback())
    }

    /// Where the jobs are kept; `None` where none are.
    pub(crate) fn place(&self) -> Option<Place> {
        match (self.database.clone(), self.blobs.clone()) {
            (Some(url), Some(bucket)) => Some(Place::Shared {
                url,
                files: Files::Bucket(bucket),
            }),
            (Some(url), None) => Some(Place::Shared {
                url,
                files: Files::Folder(self.data.clone()?),
            }),
            (None, _) => self.data.clone().map(Place::Folder),
        }
    }

    /// The files of the certificate; `None` for plain connections.
    pub(crate) fn tls_files(&self) -> Option<TlsFiles> {
        Some(TlsFiles {
            certificate: self.tls_cert.clone()?,
            key: self.tls_key.clone()?,
        })
    }

    /// Worker threads. Without a setting two per processor, since a worker waits while the shared threads do its parallel work.
    pub fn workers(&self) -> usize {
        self.workers.unwrap_or_else(|| {
            2 * std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
        })
    }

    /// Memory for bodies, jobs and answers. Without a setting half of the machine's.
    pub fn memory(&self) -> usize {
        self.memory.unwrap_or_else(|| machine_memory() / 2)
    }

    /// Connections open at once. Without a setting 1024, or what the files leave that the process may open.
    pub fn connections(&self) -> usize {
        self.connections.unwrap_or_else(|| {
            let files = open_file_limit().unwrap_or(usize::MAX);
            let least = OTHER_FILES / 2;
            (files.saturating_sub(OTHER_FILES)).clamp(least, DEFAULT_CONNECTIONS)
        })
    }

    /// Bodies received at once. Without a setting four times the workers and the queue together.
    pub fn uploads(&self) -> usize {
        self.uploads
            .unwrap_or_else(|| (4 * (self.workers() + self.queue)).min(MAX_WAITING))
    }
}

/// Bytes of memory of the machine, or what its control group or the process's limit of address space allows where that is less; 4 GiB where the
/// system says nothing.
fn machine_memory() -> usize {
    let kibibytes = |text: String| -> Option<usize> {
        let row = text
            .lines()
            .find_map(|line| line.strip_prefix("MemTotal:"))?;
        row.split_whitespace().next()?.parse().ok()
    };
    let machine = std::fs::read_to_string("/proc/meminfo").ok();
    let machine = machine.and_then(kibibytes).map(|kib| kib << 10);
    // Version 2 of control groups, then version 1; "max" or a number beyond the machine's means no limit.
    let groups = [
        "/sys/fs/cgroup/memory.max",
        "/sys/fs/cgroup/memory/memory.limit_in_bytes",
    ];
    let group = groups.iter().find_map(|path| {
        let text = std::fs::read_to_string(path).ok()?;
        text.trim().parse::<usize>().ok()
    });
    let own = process_limit("Max address space");
    let known = machine.into_iter().chain(group).chain(own);
    known.min().unwrap_or(UNKNOWN_MEMORY)
}

fn workers(text: &str) -> Result<usize, String> {
    within(text, 0..=1024)
}

fn queue(text: &str) -> Result<usize, String> {
    within(text, 0..=MAX_WAITING)
}

fn uploads(text: &str) -> Result<usize, String> {
    within(text, 1..=MAX_WAITING)
}

fn connections(text: &str) -> Result<usize, String> {
    within(text, 1..=MAX_CONNECTIONS)
}

fn connections_per_address(text: &str) -> Result<usize, String> {
    within(text, 0..=MAX_CONNECTIONS)
}

/// Files that the process may open; `None` where the system does not say.
fn open_file_limit() -> Option<usize> {
    process_limit("Max open files")
}

/// A soft limit of the process by its name in `/proc/self/limits`; `None` where there is none, or the system does not say.
fn process_limit(name: &str) -> Option<usize> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let row = limits.lines().find_map(|line| line.strip_prefix(name))?;
    row.split_whitespace().next()?.parse().ok()
}

fn within(text: &str, range: RangeInclusive<usize>) -> Result<usize, String> {
    match text.parse() {
        Ok(number) if range.contains(&number) => Ok(number),
        _ => Err(format!(
            "must be a whole number from {} to {}",
            range.start(),
            range.end()
        )),
    }
}

/// `*`, or scheme://host with an optional port, in lower case and without a path, as browsers send it.
fn origin(text: &str) -> Result<String, String> {
    let text = text.trim();
    let is_origin = || {
        let (scheme, host) = text.split_once("://")?;
        let mut letters = scheme.bytes();
        let scheme = letters.next()?.is_ascii_alphabetic()
            && letters.all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b));
        let is_plain = |b: u8| b.is_ascii_alphanumeric() || b"-._:[]".contains(&b);
        let (name, port) = match host.rsplit_once(':') {
            Some((name, port)) if !port.ends_with(']') => (name, Some(port)),
            _ => (host, None),
        };
        let port = port.is_none_or(|port| port.parse::<u16>().is_ok());
        Some(scheme && port && !name.is_empty() && name.bytes().all(is_plain))
    };
    if text == "*" || is_origin() == Some(true) {
        Ok(text.to_ascii_lowercase())
    } else {
        Err("must be `*` or scheme://host, such as https://example.org, without a path".to_owned())
    }
}

/// A size, or 0.
fn rate(text: &str) -> Result<usize, String> {
    if text == "0" { Ok(0) } else { size(text) }
}

/// `64MiB`, `512KiB`, `1GiB` or plain bytes.
fn size(text: &str) -> Result<usize, String> {
    let (number, unit) = split(text);
    let factor: usize = match unit {
        "" | "B" => 1,
        "KiB" => 1 << 10,
        "MiB" => 1 << 20,
        "GiB" => 1 << 30,
        _ => return Err("unit must be B, KiB, MiB or GiB".to_owned()),
    };
    let number: usize = number
        .parse()
        .map_err(|_| "must be a whole number and a unit, such as 64MiB")?;
    match number.checked_mul(factor) {
        Some(0) | None => {
            Err("must be at least 1 byte and at most what memory can address".to_owned())
        }
        Some(bytes) => Ok(bytes),
    }
}

/// A time with its unit, such as `30s`: whole milliseconds (`ms`), seconds (`s`) or minutes (`m`), from 1 ms to a year.
///
/// # Errors
/// What a text must be instead.
pub fn duration(text: &str) -> Result<Duration, String> {
    let (number, unit) = split(text);
    let milliseconds: u64 = match unit {
        "ms" => 1,
        "s" => 1000,
        "m" => 60_000,
        _ => return Err("needs a unit: ms, s or m".to_owned()),
    };
    let number: u64 = number
        .parse()
        .map_err(|_| "must be a whole number and a unit, such as 30s")?;
    // Longer than any use, and far from overflowing an `Instant`.
    match number.checked_mul(milliseconds) {
        Some(ms @ 1..=31_536_000_000) => Ok(Duration::from_millis(ms)),
        _ => Err("must be between 1ms and a year".to_owned()),
    }
}

fn split(text: &str) -> (&str, &str) {
    let end = text
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(text.len());
    text.split_at(end)
}

#[cfg(test)]
#[path = "config_tests.rs"]
mod tests;
