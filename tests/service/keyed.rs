//! A service with keys, whose secrets follow from their ids.

use std::path::PathBuf;

use darn_serve::Secret;
use reqwest::{RequestBuilder, StatusCode};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use crate::harness::{Service, until};

/// The secret of a key.
pub fn secret(id: &str) -> Secret {
    Secret::of(Sha256::digest(id).into())
}

/// The header of a key.
pub fn bearer(id: &str) -> String {
    format!("Bearer {}", secret(id).text())
}

/// The entry of a key.
pub fn entry(id: &str, scopes: &[&str]) -> Value {
    json!({ "id": id, "sha256": secret(id).digest().to_string(), "scopes": scopes })
}

/// The entry of a key that mends and hands over jobs within limits.
pub fn limited(id: &str, limits: Value) -> Value {
    let mut entry = entry(id, &["mend", "jobs"]);
    entry["limits"] = limits;
    entry
}

/// A service with keys and jobs.
pub struct Keyed {
    folder: TempDir,
    pub service: Service,
}

impl Keyed {
    /// Starts with these keys.
    pub async fn start(keys: &[Value], settings: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data");
        let file = folder.path().join("keys.json");
        std::fs::write(&file, text(keys)).unwrap();
        let own = [
            "--keys",
            file.to_str().unwrap(),
            "--data",
            data.to_str().unwrap(),
        ];
        let service = Service::start(&[&own, settings].concat()).await;
        Self { folder, service }
    }

    pub fn file(&self) -> PathBuf {
        self.folder.path().join("keys.json")
    }

    /// Replaces the keys.
    pub fn set(&self, keys: &[Value]) {
        std::fs::write(self.file(), text(keys)).unwrap();
    }

    /// Waits until a key is taken, or is not.
    pub async fn until_status(&self, id: &str, status: StatusCode) {
        until(|| async { self.get(id, "/info").send().await.unwrap().status() == status }).await;
    }

    pub fn get(&self, id: &str, path: &str) -> RequestBuilder {
        with_key(self.service.get(path), id)
    }

    pub fn post(&self, id: &str, path: &str) -> RequestBuilder {
        with_key(self.service.post(path), id)
    }
}

fn text(keys: &[Value]) -> String {
    json!({ "keys": keys }).to_string()
}

/// A request with a key.
pub fn with_key(request: RequestBuilder, id: &str) -> RequestBuilder {
    request.header("authorization", bearer(id))
}
