//! A `darn serve` that runs as a process of its own.

use std::{
    io::{BufRead, BufReader},
    net::SocketAddr,
    ops::Range,
    process::{Child, Command, Stdio},
    sync::{Arc, Mutex},
    time::Duration,
};

use crate::darn;

/// A client of HTTP. Its TLS, which no test here speaks, wants a provider of cryptography all the same.
pub fn client() -> reqwest::Client {
    rustls::crypto::ring::default_provider()
        .install_default()
        .ok();
    reqwest::Client::new()
}

/// A wavy sheet of so many vertices a side, with a square hole, as OBJ.
pub fn sheet(side: usize, hole: Range<usize>) -> String {
    let places = || (0..side * side).map(|k| (k / side, k % side));
    let mut text = String::new();
    for (i, j) in places() {
        let height = (i as f64 * 0.1).sin() * 0.02;
        let (x, y) = (i as f64 * 0.01, j as f64 * 0.01);
        text.push_str(&format!("v {x} {y} {height:.6}\n"));
    }
    for (i, j) in places() {
        let is_inside = i + 1 < side && j + 1 < side;
        if is_inside && !(hole.contains(&i) && hole.contains(&j)) {
            let a = i * side + j + 1;
            let (b, c, d) = (a + side, a + side + 1, a + 1);
            text.push_str(&format!("f {a} {b} {c} {d}\n"));
        }
    }
    text
}

/// A running `darn serve`; killed when dropped.
pub struct Service {
    pub child: Child,
    pub address: SocketAddr,
    log: Arc<Mutex<Vec<String>>>,
}

impl Service {
    /// Starts on a free port and waits until the log says which.
    pub fn start() -> Service {
        Service::start_with(&[])
    }

    /// The same with settings.
    pub fn start_with(settings: &[&str]) -> Service {
        Service::start_in(&[], settings)
    }

    /// The same with variables of the environment, too.
    pub fn start_in(variables: &[(&str, &str)], settings: &[&str]) -> Service {
        let mut command = darn();
        command
            .args(["serve", "--listen", "127.0.0.1:0"])
            .args(settings)
            .envs(variables.iter().copied());
        Service::of(command)
    }

    /// Starts a command that becomes a `darn serve` on a free port.
    pub fn of(mut command: Command) -> Service {
        let mut child = command
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .expect("darn starts");
        let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines();
        let address = lines
            .by_ref()
            .map_while(Result::ok)
            .find_map(|line| {
                line.split("address=")
                    .nth(1)?
                    .split_whitespace()
                    .next()?
                    .parse()
                    .ok()
            })
            .expect("the log names the address");
        // Also because the service blocks on a full pipe.
        let log = Arc::<Mutex<Vec<String>>>::default();
        let kept = Arc::clone(&log);
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                kept.lock().expect("no test panics here").push(line);
            }
        });
        Service {
            child,
            address,
            log,
        }
    }

    /// Whether a line of its log has these words.
    pub fn has_logged(&self, words: &str) -> bool {
        let log = self.log.lock().expect("no test panics here");
        log.iter().any(|line| line.contains(words))
    }

    /// Sends it a signal, such as `STOP`.
    pub fn signal(&self, signal: &str) {
        let id = self.child.id().to_string();
        let sent = Command::new("kill").args(["-s", signal, &id]).status();
        assert!(sent.expect("kill runs").success());
    }

    /// Waits until it is ready.
    pub async fn ready(&self) {
        let client = client();
        let ready = || client.get(self.url("/readyz")).send();
        while !ready().await.is_ok_and(|answer| answer.status() == 200) {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    /// A job, by its path.
    pub async fn job(&self, client: &reqwest::Client, path: &str) -> serde_json::Value {
        let answer = client.get(self.url(path)).send().await.expect("an answer");
        answer.json().await.expect("JSON")
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
