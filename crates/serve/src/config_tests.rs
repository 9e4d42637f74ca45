//! What settings are taken, and what they come to.

use clap::Parser;

use super::*;

#[derive(Debug, Parser)]
struct Command {
    #[command(flatten)]
    serve: ServeArgs,
}

#[test]
fn settings_have_units_and_bounds() {
    assert_eq!(size("64MiB"), Ok(64 << 20));
    assert_eq!(size("12"), Ok(12));
    assert_eq!(duration("500ms"), Ok(Duration::from_millis(500)));
    assert_eq!(duration("2m"), Ok(Duration::from_secs(120)));
    for bad in ["", "0", "MiB", "1MB", "-1", "99999999999999GiB"] {
        assert!(size(bad).is_err(), "{bad}");
    }
    for bad in ["", "30", "0s", "s", "99999999999m", "18446744073709551615m"] {
        assert!(duration(bad).is_err(), "{bad}");
    }
}

#[test]
fn defaults_parse_and_bad_values_are_named() {
    let settings = Command::try_parse_from(["darn"]).unwrap().serve;
    assert_eq!(settings.body_limit, 512 << 20);
    assert!(settings.workers() >= 1);
    assert!((1..=1024).contains(&settings.connections()));
    assert_eq!(settings.body_rate, 512);
    let unlimited = Command::try_parse_from(["darn", "--body-rate", "0"]);
    assert_eq!(unlimited.unwrap().serve.body_rate, 0);
    let error = Command::try_parse_from(["darn", "--workers", "1025"])
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("--workers") && error.contains("from 0 to 1024"),
        "{error}"
    );
    for bad in [
        ["--instance", "worker-1"],
        ["--database", "postgres://database"],
        ["--blobs", "s3://scans/darn"],
        ["--queue", "99999999999999999999"],
        ["--queue", "65537"],
        ["--uploads", "0"],
        ["--connections", "0"],
        ["--connections-per-address", "1048577"],
        ["--body-rate", "fast"],
    ] {
        assert!(
            Command::try_parse_from(["darn"].iter().chain(&bad)).is_err(),
            "{bad:?}"
        );
    }
}

#[test]
fn files_of_jobs_are_in_one_place() {
    let place = |options: &[&str]| {
        let settings = Command::try_parse_from([&["darn"], options].concat());
        settings.map(|settings| settings.serve.place())
    };
    let database = ["--database", "postgres://database"];
    let bucket = ["--blobs", "s3://scans/darn/"];
    let folder = ["--data", "shared"];
    let found = place(&[database, bucket].concat()).unwrap().unwrap();
    assert_eq!(found.files().to_string(), "s3://scans/darn");
    let found = place(&[database, folder].concat()).unwrap().unwrap();
    assert_eq!(found.files().to_string(), "shared");
    // A bucket without a database would have nobody who keeps a second process out.
    for bad in [
        &[folder, bucket].concat()[..],
        &[database, folder, bucket].concat(),
    ] {
        assert!(place(bad).is_err(), "{bad:?}");
    }
    let error = place(&[database, ["--blobs", "https://scans"]].concat()).unwrap_err();
    assert!(error.to_string().contains("must be s3://BUCKET"), "{error}");
}

#[test]
fn an_address_beyond_loopback_needs_keys_or_a_decision() {
    let exposed = |options: &[&str]| {
        let settings = Command::try_parse_from([&["darn"], options].concat());
        settings.unwrap().serve.exposed().map(|it| it.to_string())
    };
    for guarded in [
        &["--listen", "127.0.0.2:80"][..],
        &["--listen", "[::1]:80"],
        &["--listen", "[::ffff:127.0.0.1]:80"],
        &["--listen", "0.0.0.0:80", "--allow-anonymous"],
        &["--listen", "[::]:80", "--keys", "keys.json"],
    ] {
        assert_eq!(exposed(guarded), None, "{guarded:?}");
    }
    for (listen, grpc) in [("0.0.0.0:80", "127.0.0.1:81"), ("127.0.0.1:81", "[::]:80")] {
        assert!(exposed(&["--listen", listen, "--grpc-listen", grpc]).is_some());
    }
    let half = ["darn", "--tls-cert", "chain.pem"];
    assert!(Command::try_parse_from(half).is_err());
    let both = ["darn", "--keys", "keys.json", "--allow-anonymous"];
    assert!(Command::try_parse_from(both).is_err());
}

#[test]
fn origins_are_those_a_browser_sends() {
    for good in [
        "*",
        "https://example.org",
        "http://localhost:3000",
        "http://[::1]:80",
    ] {
        assert_eq!(origin(good).as_deref(), Ok(good));
    }
    assert_eq!(
        origin("HTTPS://Example.org").as_deref(),
        Ok("https://example.org")
    );
    for bad in [
        "",
        "example.org",
        "https://",
        "https://:80",
        "https://example.org/",
        "https://a b",
        "https://example.org:port",
        "://x",
    ] {
        assert!(origin(bad).is_err(), "{bad}");
    }
}
