//! Scans of several files, however the files and the URIs are spelled: by HTTP and by the command.

use super::EXAMPLE;
use super::commands::{holes, zipped};
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
