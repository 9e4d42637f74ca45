//! OBJ with its material library and images, on the command line and over HTTP.

use std::{
    io::{Cursor, Read as _},
    path::Path,
};

use reqwest::multipart::{Form, Part};
use zip::ZipArchive;

use crate::{
    commands::zipped,
    darn,
    running::{Service, client, sheet},
};

const MTL: &str = "newmtl linen\nKd 1 1 1\nmap_Kd -s 1 1 1 maps/my linen.png\nbump ../above.png\n";
const PICTURE: &[u8] = b"\x89PNG of linen";

/// A sheet with a hole that uses a material.
fn obj() -> String {
    format!("mtllib my cloth.mtl\nusemtl linen\n{}", sheet(24, 10..14))
}

/// The three files in a folder, and one above it that they name.
fn write(folder: &Path) {
    std::fs::create_dir_all(folder.join("maps")).expect("folders");
    std::fs::write(folder.join("cloth.obj"), obj()).expect("written");
    std::fs::write(folder.join("my cloth.mtl"), MTL).expect("written");
    std::fs::write(folder.join("maps/my linen.png"), PICTURE).expect("written");
    std::fs::write(folder.join("../above.png"), PICTURE).expect("written");
}

/// Checks the files of a mended scan: its materials are beside it, and nothing else came.
fn check(folder: &Path, obj_name: &str) {
    let read = |name: &str| std::fs::read(folder.join(name)).expect("a file");
    let mended = read(obj_name);
    assert!(mended.starts_with(obj().as_bytes()) && mended.len() > obj().len());
    assert_eq!(read("my cloth.mtl"), MTL.as_bytes());
    assert_eq!(read("maps/my linen.png"), PICTURE);
    assert!(!folder.join("../above.png").exists());
}

#[test]
fn the_materials_of_an_obj_go_where_it_goes() {
    let folder = tempfile::tempdir().expect("a folder");
    let scans = folder.path().join("in/scans");
    write(&scans);
    let alone = folder.path().join("a/b/mended.obj");
    std::fs::create_dir_all(alone.parent().expect("a folder")).expect("made");
    let mended = darn()
        .arg("inpaint")
        .arg(scans.join("cloth.obj"))
        .arg("-o")
        .arg(&alone)
        .status();
    assert!(mended.expect("darn runs").success());
    check(alone.parent().expect("a folder"), "mended.obj");
    let back = folder.path().join("back/cloth.obj");
    std::fs::create_dir_all(back.parent().expect("a folder")).expect("made");
    let stripped = darn()
        .arg("strip")
        .arg(&alone)
        .arg("-o")
        .arg(&back)
        .output();
    assert!(stripped.expect("darn runs").status.success());
    for (name, bytes) in [
        ("cloth.obj", obj().as_bytes()),
        ("my cloth.mtl", MTL.as_bytes()),
        ("maps/my linen.png", PICTURE),
    ] {
        let there = std::fs::read(folder.path().join("back").join(name));
        assert_eq!(there.expect("a file"), bytes, "{name}");
    }
    let batch = folder.path().join("c/d");
    let mended = darn()
        .args(["inpaint", "--batch"])
        .arg(&scans)
        .arg("-o")
        .arg(&batch)
        .output();
    assert!(mended.expect("darn runs").status.success());
    check(&batch, "cloth.obj");
    // A scan without holes is copied with them, too.
    let whole = "mtllib my cloth.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    std::fs::write(scans.join("whole.obj"), whole).expect("written");
    let copy = folder.path().join("e/f");
    std::fs::create_dir_all(&copy).expect("made");
    let copied = darn()
        .args(["inpaint", "--if-no-holes", "copy"])
        .arg(scans.join("whole.obj"))
        .arg("-o")
        .arg(copy.join("whole.obj"))
        .output();
    assert!(copied.expect("darn runs").status.success());
    assert_eq!(
        std::fs::read(copy.join("my cloth.mtl")).expect("a file"),
        MTL.as_bytes()
    );
}

fn zip_of_all() -> Vec<u8> {
    zipped(&[
        ("cloth/cloth.obj", obj().as_bytes()),
        ("cloth/my cloth.mtl", MTL.as_bytes()),
        ("cloth/maps/my linen.png", PICTURE),
    ])
}

#[tokio::test]
async fn an_obj_with_materials_is_taken_in_parts_and_in_a_zip() {
    let service = Service::start();
    service.ready().await;
    let client = client();
    let part = |bytes: &[u8]| Part::bytes(bytes.to_vec());
    let form = || {
        Form::new()
            // Names as browsers and curl write them.
            .percent_encode_noop()
            .part("scan", part(obj().as_bytes()))
            .part("my cloth.mtl", part(MTL.as_bytes()))
            .part("maps/my linen.png", part(PICTURE))
    };
    let answer = client
        .post(service.url("/inpaint"))
        .multipart(form())
        .send()
        .await;
    let answer = answer.expect("an answer");
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["content-type"], "model/obj");
    let alone = answer.bytes().await.expect("a body");
    assert!(alone.starts_with(obj().as_bytes()) && alone.len() > obj().len());

    let names = |zip: &[u8]| -> Vec<(String, Vec<u8>)> {
        let mut archive = ZipArchive::new(Cursor::new(zip.to_vec())).expect("a zip");
        let entries = (0..archive.len()).map(|index| {
            let mut entry = archive.by_index(index).expect("an entry");
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).expect("bytes");
            (entry.name().to_owned(), bytes)
        });
        entries
            .filter(|(name, _)| !name.contains("darn-undo-"))
            .collect()
    };
    let request = client
        .post(service.url("/inpaint"))
        .header("accept", "application/zip");
    let answer = request.multipart(form()).send().await.expect("an answer");
    assert_eq!(answer.headers()["content-type"], "application/zip");
    let zip = answer.bytes().await.expect("a body");
    let mut expected = vec![
        ("maps/my linen.png".to_owned(), PICTURE.to_vec()),
        ("my cloth.mtl".to_owned(), MTL.as_bytes().to_vec()),
        ("scan.obj".to_owned(), alone.to_vec()),
    ];
    assert_eq!(names(&zip), expected);

    // A zip for a zip; `/holes` finds what there is, and `/strip` takes the patch out again.
    let sent = zip_of_all();
    let send = |path: &str, zip: &[u8]| {
        let request = client
            .post(service.url(path))
            .header("content-type", "application/zip");
        request.body(zip.to_vec()).send()
    };
    let holes = send("/holes", &sent).await.expect("an answer");
    assert_eq!(holes.status(), 200);
    let answer = send("/inpaint", &sent).await.expect("an answer");
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["content-type"], "application/zip");
    let mended = answer.bytes().await.expect("a body");
    expected = vec![
        ("cloth/cloth.obj".to_owned(), alone.to_vec()),
        ("cloth/my cloth.mtl".to_owned(), MTL.as_bytes().to_vec()),
        ("cloth/maps/my linen.png".to_owned(), PICTURE.to_vec()),
    ];
    assert_eq!(names(&mended), expected);
    let stripped = send("/strip", &mended).await.expect("an answer");
    assert_eq!(stripped.headers()["darn-strip"], "exact");
    assert!(stripped.bytes().await.expect("a body") == sent);
}
