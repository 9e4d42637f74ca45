//! A PostgreSQL server for tests and measurements: started by the first who asks, ended with this process, however that ends.
//!
//! It lives in a temporary folder and listens on a socket there, so any number of them run beside each other.

use std::{
    io::{BufRead, BufReader},
    path::PathBuf,
    process::{Child, Command, Stdio},
    sync::OnceLock,
};

use sqlx::{Connection, PgConnection};

/// Runs the server until the standard input ends: the pipe from this process, which the system closes whenever this process is gone.
const SCRIPT: &str = r#"
set -eu
trap '' INT TERM HUP
folder=$(mktemp -d "${TMPDIR:-/tmp}/darn-postgres.XXXXXX")
trap 'rm -rf "$folder"' EXIT
"$0/initdb" --pgdata "$folder/data" --username darn --auth trust --encoding UTF8 --no-sync >"$folder/log"
"$0/postgres" -D "$folder/data" -k "$folder" -c listen_addresses= -c max_connections=300 "$@" >>"$folder/log" 2>&1 </dev/null &
server=$!
until "$0/pg_isready" --quiet --host "$folder"; do
  kill -0 $server || { cat "$folder/log" >&2; exit 1; }
  sleep 0.05
done
echo "$folder"
cat >/dev/null
kill -INT $server
wait $server || true
"#;

/// A running server.
#[derive(Debug)]
pub struct Server {
    // Its standard input keeps the server alive.
    _script: Child,
    folder: String,
}

impl Server {
    /// The server of this process. It does not wait for the disk.
    #[allow(dead_code)] // The example that measures has its own.
    ///
    /// # Panics
    /// Where PostgreSQL is missing or does not start.
    pub fn shared() -> &'static Self {
        static SERVER: OnceLock<Server> = OnceLock::new();
        SERVER.get_or_init(|| Self::start(&["-c", "fsync=off"]))
    }

    /// Starts a server with arguments of its own.
    ///
    /// # Panics
    /// Where PostgreSQL is missing or does not start.
    pub fn start(arguments: &[&str]) -> Self {
        let mut command = as_somebody_else();
        let mut script = command
            .args(["sh", "-c", SCRIPT])
            .arg(programs())
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("a shell");
        let mut folder = String::new();
        let output = script.stdout.take().expect("it is piped");
        BufReader::new(output)
            .read_line(&mut folder)
            .expect("the script writes text");
        assert!(
            folder.ends_with('\n'),
            "PostgreSQL did not start; what it says stands above"
        );
        Self {
            _script: script,
            folder: folder.trim_end().to_owned(),
        }
    }

    /// The URL of a new, empty database.
    pub async fn database(&self) -> String {
        let name = format!("t{}", uuid::Uuid::new_v4().simple());
        let mut connection = PgConnection::connect(&self.url("postgres"))
            .await
            .expect("the server runs");
        sqlx::query(&format!("CREATE DATABASE {name}"))
            .execute(&mut connection)
            .await
            .expect("a database can be made");
        connection.close().await.expect("the server runs");
        self.url(&name)
    }

    fn url(&self, database: &str) -> String {
        format!("postgres:///{database}?user=darn&host={}", self.folder)
    }
}

/// The folder of the newest PostgreSQL's programs, where Debian puts them.
fn programs() -> PathBuf {
    let versions = std::fs::read_dir("/usr/lib/postgresql");
    let newest = versions.ok().and_then(|versions| {
        versions
            .filter_map(Result::ok)
            .map(|version| version.path().join("bin"))
            .filter(|programs| programs.join("initdb").exists())
            .max()
    });
    newest.expect(
        "PostgreSQL is missing; install the Debian package `postgresql` (scripts/setup does)",
    )
}

/// PostgreSQL does not run as root: what root runs runs as the package's user.
fn as_somebody_else() -> Command {
    let id = Command::new("id").arg("-u").output().expect("id");
    if id.stdout.trim_ascii() != b"0" {
        return Command::new("env");
    }
    let mut command = Command::new("setpriv");
    command.args(["--reuid=postgres", "--regid=postgres", "--clear-groups"]);
    // A folder that this user may enter.
    command.current_dir("/");
    command
}
