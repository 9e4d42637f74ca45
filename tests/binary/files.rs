//! Scans of several files, however the files and the URIs are spelled: by HTTP and by the command.

use super::EXAMPLE;
use super::commands::{holes, zipped};
use super::darn;
use super::running::{self, Service};

/// A URI of a glTF, the name of the part or zip entry that its sender gives to the file, and the file's path beside the glTF.
const SPELLINGS: [[&str; 3]; 8] = [
    ["./cloth.bin", "./cloth.bin", "cloth.bin"],
    ["./cloth.bin", "cloth.bin", "cloth.bin"],
    ["cloth.bin", "./cloth.bin", "cloth.bin"],
    ["sub//x.bin", "sub//x.bin", "sub/x.bin"],
    ["sub/./x.bin", "sub/./x.bin", "sub/x.bin"],
    ["sub\\x.bin", "sub\\x.bin", "sub/x.bin"],
    ["./sub/my%20x.bin", "./sub/my%20x.bin", "sub/my x.bin"],
    ["buffer0", "buffer0", "buffer0"],
];

/// The example as glTF whose buffer has this URI, and the buffer.
fn separate(uri: &str) -> (Vec<u8>, &'static [u8]) {
    let length = u32::from_le_bytes(EXAMPLE[12..16].try_into().expect("four bytes")) as usize;
    let json = &EXAMPLE[20..20 + length];
    let mut json: serde_json::Value = serde_json::from_slice(json).expect("JSON");
    json["buffers"][0]["uri"] = uri.into();
    (json.to_string().into_bytes(), &EXAMPLE[28 + length..])
}

/// A body of multipart/form-data with these names, byte for byte.
fn form(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, bytes) in parts {
        let head = format!("--cut\r\ncontent-disposition: form-data; name=\"{name}\"\r\n\r\n");
        body.extend([head.as_bytes(), bytes, b"\r\n"].concat());
    }
    body.extend(b"--cut--\r\n");
    body
}

#[tokio::test]
async fn parts_and_entries_are_found_however_they_are_spelled() {
    let service = Service::start();
    service.ready().await;
    let client = running::client();
    let post = async |media_type: &str, body: Vec<u8>| {
        let request = client.post(service.url("/inpaint")).body(body);
        let request = request.header("content-type", media_type);
        let answer = request.header("accept", "model/gltf-binary").send().await;
        let answer = answer.expect("an answer");
        let filled = answer.headers().get("darn-holes-filled").cloned();
        let filled = filled.map(|count| count.to_str().expect("a number").to_owned());
        let status = answer.status().as_u16();
        (
            status,
            filled,
            answer.bytes().await.expect("a body").to_vec(),
        )
    };
    const FORM: &str = "multipart/form-data; boundary=cut";
    const ZIP: &str = "application/zip";
    let is_mended = |(status, filled, _): (u16, Option<String>, Vec<u8>)| {
        (status, filled) == (200, Some("1".into()))
    };
    for [uri, name, _] in SPELLINGS {
        let (gltf, bin) = separate(uri);
        let parts = post(FORM, form(&[(name, bin), ("scan", &gltf)])).await;
        assert!(is_mended(parts), "{uri} {name}");
        // As bsdtar, and as programs on Windows, write the folder.
        for folder in ["", "./", "scans/", "scans\\", ".\\scans\\"] {
            let [scan, file] = ["cloth.gltf", name].map(|name| format!("{folder}{name}"));
            let zip = zipped(&[(&scan, &gltf), (&file, bin)]);
            assert!(is_mended(post(ZIP, zip).await), "{uri} {scan} {file}");
        }
    }
    for misspelled in ["buffer1", "constraint", "query", "holes", "Scan", ""] {
        let form = form(&[("scan", EXAMPLE), (misspelled, b"{}")]);
        let (status, _, problem) = post(FORM, form).await;
        let problem = String::from_utf8_lossy(&problem).into_owned();
        let named = format!("there is no part `{misspelled}`");
        assert!(status == 400 && problem.contains(&named), "{problem}");
    }
}

#[test]
fn the_command_reads_siblings_however_their_uri_is_spelled() {
    let folder = tempfile::tempdir().expect("a folder");
    let glb = folder.path().join("cloth.glb");
    std::fs::write(&glb, EXAMPLE).expect("written");
    let expected = holes(&glb);
    for [uri, _, path] in SPELLINGS {
        let folder = tempfile::tempdir().expect("a folder");
        let (gltf, bin) = separate(uri);
        std::fs::create_dir_all(folder.path().join("sub")).expect("a folder");
        std::fs::write(folder.path().join(path), bin).expect("written");
        let scan = folder.path().join("cloth.gltf");
        std::fs::write(&scan, gltf).expect("written");
        assert_eq!(holes(&scan), expected, "{uri}");
    }
}

/// The names of a zip's entries.
fn entries(zip: &[u8]) -> Vec<String> {
    let archive = zip::ZipArchive::new(std::io::Cursor::new(zip)).expect("a zip");
    archive.file_names().map(str::to_owned).collect()
}

#[tokio::test]
async fn a_patch_comes_in_a_file_of_its_own_where_that_is_asked_for() {
    const ASKED: &str = r#"{"patchBuffer": "file"}"#;
    let is_of_patch = |name: &&String| name.starts_with("darn-patch-") && name.ends_with(".bin");
    let (gltf, bin) = separate("cloth.bin");
    let service = Service::start();
    service.ready().await;
    let post = async |path: &str, media_type: &str, accept: &str, body: Vec<u8>| {
        let request = running::client().post(service.url(path)).body(body);
        let request = request.header("content-type", media_type);
        let answer = request.header("accept", accept).send().await;
        let answer = answer.expect("an answer");
        assert_eq!(answer.status(), 200);
        let kind = answer.headers()["content-type"].to_str().expect("text");
        (kind.to_owned(), answer.bytes().await.expect("a body"))
    };
    let parts: [(&str, &[u8]); 3] = [
        ("scan", &gltf),
        ("cloth.bin", bin),
        ("constraints", ASKED.as_bytes()),
    ];
    let form_data = "multipart/form-data; boundary=cut";
    for accept in ["*/*", "model/gltf+json"] {
        let (kind, zip) = post("/inpaint", form_data, accept, form(&parts)).await;
        assert_eq!(kind, "application/zip", "a glTF alone would miss the file");
        assert_eq!(entries(&zip).iter().filter(is_of_patch).count(), 1);
        let (_, before) = post("/strip", &kind, "model/gltf+json", zip.to_vec()).await;
        assert!(before == gltf);
    }
    let (kind, _) = post("/inpaint", form_data, "model/gltf-binary", form(&parts)).await;
    assert_eq!(kind, "model/gltf-binary");

    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    for (name, bytes) in [
        ("cloth.gltf", &gltf[..]),
        ("cloth.bin", bin),
        ("asked.json", ASKED.as_bytes()),
    ] {
        std::fs::write(path(name), bytes).expect("written");
    }
    let run = |arguments: &[&str]| {
        let mut command = darn();
        command.current_dir(folder.path()).args(arguments);
        let done = command.output().expect("darn runs");
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{arguments:?}: {said}");
    };
    for output in ["out/mended.gltf", "mended.glb"] {
        std::fs::create_dir_all(path("out")).expect("a folder");
        run(&["inpaint", "cloth.gltf", "-o", output, "-c", "asked.json"]);
        run(&["holes", output]);
    }
    let names_in = |folder: &str| -> Vec<String> {
        let list = std::fs::read_dir(path(folder)).expect("a folder");
        let name = |entry: std::fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
        list.map(|entry| name(entry.expect("an entry"))).collect()
    };
    let names = names_in("out");
    assert_eq!(names.iter().filter(is_of_patch).count(), 1, "{names:?}");
    // The scan from before goes into another folder with its files, and without the patch's.
    std::fs::create_dir_all(path("back")).expect("a folder");
    run(&["strip", "out/mended.gltf", "-o", "back/cloth.gltf"]);
    let read = |name: &str| std::fs::read(path(name)).expect("a file");
    assert!(read("back/cloth.gltf") == gltf && read("back/cloth.bin") == bin);
    assert_eq!(names_in("back").iter().filter(is_of_patch).count(), 0);
}
