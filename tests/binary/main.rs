//! The binary as a user meets it: `darn serve` on a real socket, and the commands beside it.

mod commands;
mod cook;
mod files;
#[cfg(target_os = "linux")]
mod full_disk;
mod kills;
mod many;
mod materials;
#[path = "../../crates/jobs/tests/laws/postgres.rs"]
mod postgres;
mod provenance;
mod running;
#[cfg(target_os = "linux")]
#[path = "../../crates/jobs/tests/laws/small_disk.rs"]
mod small_disk;
mod traces;
mod webhooks;

use commands::{code_and_lines, holes};
use running::Service;
use std::{
    io::Write as _,
    path::Path,
    process::{Command, Stdio},
};

const EXAMPLE: &[u8] = include_bytes!("../../examples/scarf_hole.glb");

fn darn() -> Command {
    Command::new(env!("CARGO_BIN_EXE_darn"))
}

#[tokio::test]
async fn the_service_and_the_command_give_the_same_bytes_and_sigterm_ends_it() {
    let mut service = Service::start();
    let client = running::client();
    for _ in 0..600 {
        if client
            .get(service.url("/readyz"))
            .send()
            .await
            .is_ok_and(|r| r.status() == 200)
        {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    }
    let answer = client
        .post(service.url("/inpaint"))
        .header("content-type", "model/gltf-binary")
        .body(EXAMPLE)
        .send()
        .await
        .expect("an answer");
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["content-type"], "model/gltf-binary");
    let over_http = answer.bytes().await.expect("a body");

    let folder = tempfile::tempdir().expect("a folder");
    let (scan, out) = (folder.path().join("in.glb"), folder.path().join("out.glb"));
    std::fs::write(&scan, EXAMPLE).expect("written");
    let status = darn()
        .arg("inpaint")
        .arg(&scan)
        .arg("-o")
        .arg(&out)
        .status()
        .expect("darn runs");
    assert!(status.success());
    assert!(
        over_http == std::fs::read(&out).expect("a result"),
        "HTTP and command differ"
    );

    let garbage = client
        .post(service.url("/inpaint"))
        .header("content-type", "model/gltf-binary")
        .body("glTF, but not really")
        .send()
        .await
        .expect("an answer");
    assert_eq!(garbage.status(), 400);
    assert_eq!(
        garbage.headers()["content-type"],
        "application/problem+json"
    );

    let healthy = darn()
        .args(["healthcheck", "--listen", &service.address.to_string()])
        .status();
    assert!(healthy.expect("darn runs").success());
    let stopped = Command::new("kill")
        .arg(service.child.id().to_string())
        .status();
    assert!(stopped.expect("kill runs").success());
    assert!(
        service.child.wait().expect("it ends").success(),
        "SIGTERM is a clean end"
    );
}

#[tokio::test]
async fn jobs_outlive_a_process_that_is_killed_and_end_as_requests_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = ["--data", folder.path().to_str().expect("a name")];
    let client = running::client();
    let post = |service: &Service, path: &str| {
        let request = client.post(service.url(path));
        let request = request.header("content-type", "model/gltf-binary");
        request.body(EXAMPLE).send()
    };
    let mut first = Service::start_with(&data);
    let mut jobs = Vec::new();
    for _ in 0..4 {
        let answer = post(&first, "/jobs").await.expect("an answer");
        assert_eq!(answer.status(), 202);
        jobs.push(
            answer.headers()["location"]
                .to_str()
                .expect("a path")
                .to_owned(),
        );
    }
    for path in jobs.iter().cycle() {
        if first.job(&client, path).await["state"] == "RUNNING" {
            break;
        }
    }
    first.child.kill().expect("killed");
    first.child.wait().expect("it ends");

    let second = Service::start_with(&data);
    let mut attempts = Vec::new();
    for path in &jobs {
        let begun = std::time::Instant::now();
        let done = loop {
            let job = second.job(&client, path).await;
            if job["state"] == "DONE" {
                break job;
            }
            let is_underway = job["state"] == "WAITING" || job["state"] == "RUNNING";
            assert!(is_underway && begun.elapsed().as_secs() < 60, "{job}");
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        };
        attempts.push(done["attempt"].as_u64());
    }
    assert!(
        attempts.contains(&Some(2)),
        "none was broken off: {attempts:?}"
    );
    let request = post(&second, "/inpaint").await.expect("an answer");
    let digest = request.headers()["repr-digest"].clone();
    let expected = request.bytes().await.expect("a body");
    for path in &jobs {
        let result = client
            .get(second.url(&format!("{path}/result")))
            .send()
            .await;
        let result = result.expect("an answer");
        assert_eq!(result.headers()["repr-digest"], digest);
        assert!(result.bytes().await.expect("a body") == expected, "{path}");
    }
}

#[test]
fn wrong_usage_exits_with_64_and_an_unreadable_scan_with_1() {
    let usage = darn().args(["inpaint"]).output().expect("darn runs");
    assert_eq!(usage.status.code(), Some(64));
    let missing = darn()
        .args(["holes", "/nowhere/scan.glb"])
        .output()
        .expect("darn runs");
    assert_eq!(missing.status.code(), Some(1));
    let said = String::from_utf8_lossy(&missing.stderr).into_owned();
    assert!(said.contains("/nowhere/scan.glb"), "{said}");
}

#[test]
fn samples_are_fixed_size_records_that_depend_on_the_seed_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let sheets = folder.path().to_str().expect("a name");
    let made = darn()
        .args(["scarffolds", "--count", "1", "--out", sheets])
        .output();
    assert!(made.expect("darn runs").status.success());
    let samples = |seed: &str| {
        let told = [
            "samples", "--sheets", sheets, "--count", "3", "--alike", "2",
        ];
        let found = darn().args(told).args(["--seed", seed]).output();
        found.expect("darn runs").stdout
    };
    let first = samples("4");
    // A record: two grids of 3 × 4096 f32, the up direction as 3 f32, one byte of flags per cell.
    assert_eq!(first.len(), 3 * ((2 * 3 * 4096 + 3) * 4 + 4096));
    assert!(first == samples("4") && first != samples("5"));
    let missing = darn().args(["samples", "--sheets", "/nowhere"]).output();
    assert_eq!(missing.expect("darn runs").status.code(), Some(1));
}

/// The example as glTF with its buffer beside it, in `folder`; returns the glTF's path.
fn separate(folder: &Path) -> std::path::PathBuf {
    let length = |at: usize| u32::from_le_bytes(EXAMPLE[at..at + 4].try_into().unwrap()) as usize;
    let end = 20 + length(12);
    let mut json: serde_json::Value = serde_json::from_slice(&EXAMPLE[20..end]).expect("JSON");
    json["buffers"][0]["uri"] = "bins/my%20scarf.bin".into();
    std::fs::create_dir_all(folder.join("bins")).expect("a folder");
    std::fs::write(folder.join("bins/my scarf.bin"), &EXAMPLE[end + 8..]).expect("written");
    let scan = folder.join("scarf.gltf");
    std::fs::write(&scan, json.to_string()).expect("written");
    scan
}

#[test]
fn a_scan_of_several_files_is_mended_as_its_glb() {
    let folder = tempfile::tempdir().expect("a folder");
    let scan = separate(folder.path());
    let glb = folder.path().join("scarf.glb");
    std::fs::write(&glb, EXAMPLE).expect("written");
    assert_eq!(holes(&scan), holes(&glb));
    let mend = |scan: &Path, out: &str| {
        let out = folder.path().join(out);
        std::fs::create_dir_all(out.parent().expect("a folder")).expect("made");
        let mended = darn().arg("inpaint").arg(scan).arg("-o").arg(&out).status();
        assert!(mended.expect("darn runs").success());
        holes(&out)
    };
    let expected = mend(&glb, "mended.glb");
    // Beside its files; in another folder, where they follow it; and as one file.
    assert_eq!(mend(&scan, "mended.gltf"), expected);
    assert_eq!(mend(&scan, "elsewhere/mended.gltf"), expected);
    assert_eq!(mend(&scan, "packed/mended.glb"), expected);
    let bin = |path: &str| std::fs::read(folder.path().join(path)).expect("a file");
    assert_eq!(bin("elsewhere/bins/my scarf.bin"), bin("bins/my scarf.bin"));
    assert!(!folder.path().join("packed/bins").exists());
    std::fs::remove_file(folder.path().join("bins/my scarf.bin")).expect("removed");
    let missing = darn().arg("holes").arg(&scan).output().expect("darn runs");
    let said = String::from_utf8_lossy(&missing.stderr).into_owned();
    assert!(said.contains("/buffers/0/uri"), "{said}");
}

#[test]
fn commands_have_the_limits_of_the_service() {
    let folder = tempfile::tempdir().expect("a folder");
    let scan = folder.path().join("scarf.glb");
    std::fs::write(&scan, EXAMPLE).expect("written");
    let out = folder.path().join("out");
    for verb in ["inpaint", "render"] {
        for (limit, words) in [
            (["--max-faces", "10"], "max_faces = 10"),
            (["--max-vertices", "10"], "max_vertices = 10"),
            (["--deadline", "1ms"], "deadline has passed"),
        ] {
            let mut command = darn();
            command.arg(verb).arg(&scan).args(limit).arg("-o").arg(&out);
            let refused = command.output().expect("darn runs");
            assert_eq!(refused.status.code(), Some(1), "{verb} {limit:?}");
            let said = String::from_utf8_lossy(&refused.stderr).into_owned();
            assert!(said.contains(words), "{verb} {limit:?}: {said}");
            assert!(!out.exists(), "{verb} {limit:?}");
        }
    }
}

/// A square of two triangles as OBJ: no holes.
const WHOLE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

/// Runs a batch over a folder: its exit code, and its lines by the name of their scans.
fn batch(scans: &Path, out: &Path, more: &[&str]) -> (Option<i32>, Vec<serde_json::Value>) {
    let mut command = darn();
    command
        .arg("inpaint")
        .arg("--batch")
        .arg(scans)
        .arg("-o")
        .arg(out)
        .args(more);
    code_and_lines(command.output().expect("darn runs"))
}

#[test]
fn a_batch_tells_of_each_scan_goes_on_after_failures_and_is_resumed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scans, out) = (folder.path().join("scans"), folder.path().join("out"));
    std::fs::create_dir_all(scans.join("below")).expect("folders");
    std::fs::write(scans.join("a.glb"), EXAMPLE).expect("written");
    std::fs::write(scans.join("b.ply"), b"ply\nformat ascii 1.0\nend_header\n").expect("written");
    std::fs::write(scans.join("below/c.obj"), WHOLE).expect("written");
    let (code, lines) = batch(&scans, &out, &[]);
    assert_eq!(code, Some(1));
    let told =
        |key: &str| -> Vec<&serde_json::Value> { lines.iter().map(|line| &line[key]).collect() };
    assert_eq!(told("status"), ["mended", "failed", "failed"]);
    assert_eq!(lines[0]["filled"], 1);
    assert_eq!(
        lines[0]["report"]["holes"].as_array().map(Vec::len),
        Some(1)
    );
    assert_eq!(told("code")[1..], ["invalid_mesh_file", "no_holes"]);
    assert_eq!(told("done"), [1, 2, 3]);
    assert_eq!(told("of"), [3, 3, 3]);
    // The bytes are those of a mend by itself.
    let alone = folder.path().join("alone.glb");
    let status = darn()
        .arg("inpaint")
        .arg(scans.join("a.glb"))
        .arg("-o")
        .arg(&alone)
        .status();
    assert!(status.expect("darn runs").success());
    let read = |path: std::path::PathBuf| std::fs::read(path).expect("a file");
    assert!(read(out.join("a.glb")) == read(alone));
    let report: serde_json::Value =
        serde_json::from_slice(&read(out.join("a.glb.report.json"))).expect("JSON");
    assert_eq!(report, lines[0]["report"]);
    // Again: what is there is done, and a scan without holes is copied if that is asked for.
    std::fs::remove_file(scans.join("b.ply")).expect("removed");
    let (code, lines) = batch(&scans, &out, &["--if-no-holes", "copy"]);
    assert_eq!(code, Some(0));
    let statuses: Vec<&serde_json::Value> = lines.iter().map(|line| &line["status"]).collect();
    assert_eq!(statuses, ["done_before", "copied"]);
    assert_eq!(read(out.join("below/c.obj")), WHOLE.as_bytes());
}

#[test]
fn lines_of_json_tell_stages_and_the_outcome() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scan, out) = (folder.path().join("a.obj"), folder.path().join("b.obj"));
    std::fs::write(&scan, WHOLE).expect("written");
    let run = |more: &[&str]| {
        let mut command = darn();
        command
            .arg("inpaint")
            .arg(&scan)
            .arg("-o")
            .arg(&out)
            .arg("--json-lines")
            .args(more);
        let ran = command.output().expect("darn runs");
        let text = String::from_utf8(ran.stdout).expect("text");
        let lines: Vec<serde_json::Value> = (text.lines())
            .map(|line| serde_json::from_str(line).expect("a line of JSON"))
            .collect();
        (ran.status.code(), lines)
    };
    let (code, lines) = run(&[]);
    assert_eq!(code, Some(1));
    let (last, stages) = lines.split_last().expect("lines");
    assert!(stages.iter().all(|line| line["type"] == "stage"));
    assert_eq!(
        (&last["type"], &last["status"], &last["code"]),
        (&"report".into(), &"failed".into(), &"no_holes".into())
    );
    let (code, lines) = run(&["--if-no-holes", "copy"]);
    assert_eq!(
        (code, lines.last().map(|line| line["status"] == "copied")),
        (Some(0), Some(true))
    );
}

#[test]
fn a_batch_tells_how_far_it_is_to_programs_and_to_people() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (there, missing) = (folder.path().join("a.glb"), folder.path().join("b.glb"));
    std::fs::write(&there, EXAMPLE).expect("written");
    let list = format!("{}\n{}\n", there.display(), missing.display());
    let mut child = darn()
        .args(["inpaint", "--batch", "-", "--json-lines", "-o"])
        .arg(folder.path().join("out"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("darn runs");
    let mut input = child.stdin.take().expect("piped");
    input.write_all(list.as_bytes()).expect("written");
    drop(input);
    let ran = child.wait_with_output().expect("darn runs");
    assert_eq!(ran.status.code(), Some(1));
    let text = String::from_utf8(ran.stdout).expect("text");
    let lines: Vec<serde_json::Value> = (text.lines())
        .map(|line| serde_json::from_str(line).expect("a line of JSON"))
        .collect();
    let of = |kind: &str| -> Vec<&serde_json::Value> {
        lines.iter().filter(|line| line["type"] == kind).collect()
    };
    let stages = of("stage");
    let first: Vec<&serde_json::Value> = (stages.iter())
        .filter(|line| line["scan"] == there.to_str().expect("a name"))
        .map(|line| &line["stage"])
        .collect();
    assert_eq!(first, ["reading", "mending", "writing"]);
    assert!(stages.iter().all(|line| line["of"] == 2));
    assert_eq!(
        (&stages[0]["done"], &stages[3]["done"]),
        (&0.into(), &1.into())
    );
    let reports = of("report");
    assert_eq!(reports[0]["status"], "mended");
    assert_eq!(
        (&reports[1]["status"], &reports[1]["code"]),
        (&"failed".into(), &"not_found".into())
    );
    let told = String::from_utf8(ran.stderr).expect("text");
    assert!(
        told.contains("1 of 2: ") && told.contains("a.glb: mended, "),
        "{told}"
    );
    assert!(
        told.contains("2 of 2: ") && told.contains("b.glb: failed, "),
        "{told}"
    );
}

/// What `darn key new` prints: the secret, and the entry.
fn new_key(options: &[&str]) -> (String, String) {
    let output = darn().args(["key", "new"]).args(options).output();
    let output = output.expect("darn runs");
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).expect("text");
    let mut lines = text.lines().map(str::to_owned);
    let (secret, entry) = (lines.next(), lines.next());
    assert_eq!(lines.next(), None, "{text}");
    let note = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(note.contains("Authorization: Bearer") && note.contains("--keys"));
    let secret = secret.expect("the secret");
    assert!(!note.contains(&secret));
    (secret, entry.expect("the entry"))
}

#[tokio::test]
async fn a_new_key_opens_the_service_whose_file_has_its_entry() {
    let (secret, entry) = new_key(&["--id", "lab"]);
    let (other, _) = new_key(&["--id", "lab"]);
    assert_ne!(secret, other);
    let options = ["--scopes", "metrics", "--expires", "2000-01-01T00:00:00Z"];
    let (expired, second) = new_key(&[&["--id", "old"], &options[..]].concat());
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("keys.json");
    std::fs::write(&file, format!("{{\"keys\": [{entry}, {second}]}}")).expect("written");
    let service = Service::start_with(&["--keys", file.to_str().expect("a path")]);
    let client = running::client();
    for (key, status) in [(&secret, 200), (&other, 401), (&expired, 401)] {
        let request = client.get(service.url("/info")).bearer_auth(key);
        assert_eq!(request.send().await.expect("an answer").status(), status);
    }
}

#[test]
fn wrong_settings_of_keys_end_the_program_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("keys.json");
    std::fs::write(&file, "{\"keys\": [}").expect("written");
    let file = file.to_str().expect("a path");
    for (options, said) in [
        (vec!["serve", "--listen", "0.0.0.0:0"], "--allow-anonymous"),
        (
            vec!["serve", "--listen", "127.0.0.1:0", "--keys", file],
            "line 1 column 11",
        ),
        (
            vec!["serve", "--keys", file, "--allow-anonymous"],
            "cannot be used with",
        ),
        (
            vec!["key", "new", "--id", "a b"],
            "an id has 1 to 64 letters",
        ),
        (
            vec!["key", "new", "--id", "a", "--scopes", "all"],
            "[possible values: mend, jobs",
        ),
        (
            vec!["key", "new", "--id", "a", "--expires", "soon"],
            "RFC 3339",
        ),
    ] {
        let output = darn().args(&options).output().expect("darn runs");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(64), "{options:?}: {text}");
        assert!(text.contains(said), "{options:?}: {text}");
    }
}
