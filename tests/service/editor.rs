//! The editor's page and files, and `GET /info`.

use reqwest::StatusCode;
use serde_json::Value;

use crate::harness::Service;

#[tokio::test]
async fn the_page_and_its_files_are_served_with_their_types_and_policy() {
    let service = Service::start(&[]).await;
    for (path, media_type) in [
        ("/", "text/html; charset=utf-8"),
        ("/editor/main.js", "text/javascript; charset=utf-8"),
        ("/editor/vendor.js", "text/javascript; charset=utf-8"),
        ("/editor/page.css", "text/css; charset=utf-8"),
        ("/editor/icon.svg", "image/svg+xml"),
        ("/editor/scarf_hole.glb", "model/gltf-binary"),
    ] {
        let plain = service.get(path).send().await.unwrap();
        assert_eq!(plain.status(), StatusCode::OK, "{path}");
        assert_eq!(plain.headers()["content-type"], media_type, "{path}");
        assert_eq!(plain.headers()["x-content-type-options"], "nosniff");
        let policy = plain.headers()["content-security-policy"].to_str().unwrap();
        assert!(
            policy.contains("script-src 'self' 'wasm-unsafe-eval';"),
            "{policy}"
        );
        assert!(!policy.contains("unsafe-inline"), "{policy}");
        let tag = plain.headers()["etag"].clone();
        assert!(plain.bytes().await.unwrap().len() > 100, "{path}");

        let again = service
            .get(path)
            .header("if-none-match", &tag)
            .send()
            .await
            .unwrap();
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED, "{path}");
        assert_eq!(again.headers()["etag"], tag, "{path}");

        let gzip = service
            .get(path)
            .header("accept-encoding", "gzip")
            .send()
            .await
            .unwrap();
        assert_eq!(gzip.headers()["content-encoding"], "gzip", "{path}");
        assert_ne!(gzip.headers()["etag"], tag, "{path}");
        assert_eq!(gzip.bytes().await.unwrap()[..2], [0x1f, 0x8b], "{path}");
    }
}

#[tokio::test]
async fn no_editor_leaves_it_out_and_nothing_else() {
    let service = Service::start(&["--no-editor"]).await;
    for path in ["/", "/editor/main.js", "/editor/scarf_hole.glb"] {
        let answer = service.get(path).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::NOT_FOUND, "{path}");
    }
    let info = service.get("/info").send().await.unwrap();
    assert_eq!(info.status(), StatusCode::OK);
}

#[tokio::test]
async fn info_says_the_limits_of_the_settings() {
    let settings = [
        "--body-limit",
        "3MiB",
        "--deadline",
        "9s",
        "--session-idle",
        "2m",
    ];
    let service = Service::start(&settings).await;
    let info: Value = service
        .get("/info")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(info["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(info["build"]["architecture"], std::env::consts::ARCH);
    assert_eq!(info["weights"][0]["name"], "fake");
    assert_eq!(
        info["weights"][0]["sha256"].as_str().map(str::len),
        Some(64)
    );
    let limits = &info["limits"];
    assert_eq!(limits["bodyBytes"], 3 << 20);
    assert_eq!(limits["deadlineSeconds"], 9.0);
    assert_eq!(limits["sessionIdleSeconds"], 120.0);
}
