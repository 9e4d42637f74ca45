//! Laws of scans that come in several files.

use std::collections::BTreeMap;
use std::io::{Cursor, Read as _, Write as _};

use bytes::Bytes;
use darn_budget::Budget;
use darn_geometry::mesh::Vec3;
use serde_json::{Value, json};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::testing::Builder;
use super::{
    Container, NewFile, PatchBuffer, PatchPoint, PatchPrimitive, Scan, ScanError, ScanLimits,
    Siblings, repacked, sibling_paths, stripped,
};

const PICTURE: &[u8] = b"\x89PNG of a plaid";

/// The unit square, its buffer in `uri` and its picture beside it.
fn separate(uri: &str) -> (Vec<u8>, Vec<u8>) {
    let mut scan = Builder::square();
    scan.json["buffers"][0] = json!({"byteLength": scan.bin.len(), "uri": uri});
    scan.json["images"] = json!([{"uri": "maps/cloth%20plaid.png"}]);
    (scan.json.to_string().into_bytes(), scan.bin)
}

fn siblings(name: &str, bin: Vec<u8>) -> Siblings {
    let picture = (
        "maps/cloth plaid.png".to_owned(),
        Bytes::from_static(PICTURE),
    );
    Siblings(BTreeMap::from([(name.to_owned(), bin.into()), picture]))
}

fn read(gltf: &[u8], files: Siblings) -> Result<Scan, ScanError> {
    let budget = Budget::unlimited();
    Scan::read_with_siblings(gltf.to_vec(), files, &ScanLimits::default(), budget)
}

fn patch() -> PatchPrimitive {
    PatchPrimitive {
        name: "patch".into(),
        deviations: Vec::new(),
        part: 0,
        material_of: 0,
        points: vec![
            PatchPoint::Scan(0),
            PatchPoint::Scan(1),
            PatchPoint::New(Vec3::new(0.5, 0.5, 1.0)),
        ],
        normals: Vec::new(),
        tangents: Vec::new(),
        texcoords: Vec::new(),
        colors: Vec::new(),
        faces: vec![[0, 1, 2]],
        both_sides: false,
        appearance: Default::default(),
        hole: Default::default(),
        method: Default::default(),
    }
}

/// A zip of files; those that end in `.bin` are deflated.
fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        let method = match name.ends_with(".bin") {
            true => CompressionMethod::Deflated,
            false => CompressionMethod::Stored,
        };
        let options = SimpleFileOptions::default().compression_method(method);
        zip.start_file(*name, options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

#[test]
fn a_buffer_beside_the_scan_is_read_and_stays_there() {
    for (uri, name) in [
        ("cloth.bin", "cloth.bin"),
        ("./bins/my%20cloth.bin", "bins/my cloth.bin"),
        ("my cloth.bin", "my cloth.bin"),
        ("100%.bin", "100%.bin"),
    ] {
        let (gltf, bin) = separate(uri);
        assert!(
            sibling_paths(&gltf)
                .unwrap()
                .iter()
                .any(|path| path == name)
        );
        let scan = read(&gltf, siblings(name, bin)).unwrap();
        assert_eq!(scan.surface.faces.len(), 2, "{uri}");
        assert_eq!(scan.container(), Container::Gltf);
        let out = scan.write(&[patch()]).unwrap();
        let json: Value = serde_json::from_slice(&out).unwrap();
        assert_eq!(json["buffers"][0]["uri"], uri);
        assert!(
            json["buffers"][1]["uri"]
                .as_str()
                .unwrap()
                .starts_with("data:")
        );
        assert_eq!(json["images"][0]["uri"], "maps/cloth%20plaid.png");
    }
}

#[test]
fn a_file_that_did_not_come_or_lies_elsewhere_is_named() {
    for uri in [
        "missing.bin",
        "../cloth.bin",
        "/cloth.bin",
        "https://example.org/cloth.bin",
        "C:\\cloth.bin",
    ] {
        let (gltf, bin) = separate(uri);
        let mut files = siblings("cloth.bin", bin.clone());
        files.0.insert("../cloth.bin".to_owned(), bin.into());
        let error = read(&gltf, files).unwrap_err();
        assert_eq!(error.pointer(), Some("/buffers/0/uri"), "{uri}: {error}");
        assert!(
            matches!(error, ScanError::External { .. }),
            "{uri}: {error}"
        );
    }
}

#[test]
fn a_glb_is_packed_with_buffers_and_images_in_it() {
    let (gltf, bin) = separate("cloth.bin");
    let scan = read(&gltf, siblings("cloth.bin", bin.clone())).unwrap();
    let packed = scan.packed(&scan.write(&[patch()]).unwrap()).unwrap();
    let again = Scan::read(packed.clone(), &ScanLimits::default()).unwrap();
    assert_eq!(again.container(), Container::Glb);
    assert_eq!(again.parts.len(), 2);
    assert_eq!(again.surface.positions[..4], scan.surface.positions[..]);
    assert_eq!(again.surface.positions[6], Vec3::new(0.5, 0.5, 1.0));
    let image = &again.json["images"][0];
    assert_eq!(image["mimeType"], "image/png");
    assert!(image.get("uri").is_none());
    assert!(packed.windows(PICTURE.len()).any(|at| at == PICTURE));
    assert_eq!(again.json["buffers"].as_array().map(Vec::len), Some(1));
    let without = Siblings(BTreeMap::from([("cloth.bin".to_owned(), bin.into())]));
    let scan = read(&gltf, without).unwrap();
    let packed = scan.packed(&gltf).unwrap();
    let again = Scan::read(packed, &ScanLimits::default()).unwrap();
    assert_eq!(again.json["images"][0]["uri"], "maps/cloth%20plaid.png");
}

#[test]
fn a_zip_is_read_and_its_other_entries_stay_as_they_are() {
    let (gltf, bin) = separate("cloth.bin");
    let zip = zipped(&[
        ("scan/cloth.bin", &bin),
        ("scan/cloth.gltf", &gltf),
        ("scan/maps/cloth plaid.png", PICTURE),
        ("__MACOSX/scan/._cloth.gltf", b"fork"),
    ]);
    let scan = Scan::read(zip.clone(), &ScanLimits::default()).unwrap();
    assert_eq!(scan.container(), Container::Zip);
    assert_eq!(scan.surface.faces.len(), 2);
    assert_eq!(scan.write(&[]).unwrap(), zip);
    let out = scan.write(&[patch()]).unwrap();
    assert_eq!(
        Scan::read(out.clone(), &ScanLimits::default())
            .unwrap()
            .parts
            .len(),
        2
    );
    let raw = |bytes: &[u8], name: &str| {
        let mut archive = ZipArchive::new(Cursor::new(bytes.to_vec())).unwrap();
        let index = archive.index_for_name(name).unwrap();
        let mut out = Vec::new();
        std::io::copy(&mut archive.by_index_raw(index).unwrap(), &mut out).unwrap();
        out
    };
    for name in [
        "scan/cloth.bin",
        "scan/maps/cloth plaid.png",
        "__MACOSX/scan/._cloth.gltf",
    ] {
        assert_eq!(raw(&out, name), raw(&zip, name), "{name}");
    }
    let form = |container| {
        repacked(
            out.clone(),
            container,
            &ScanLimits::default(),
            Budget::unlimited(),
        )
        .unwrap()
    };
    let (container, gltf) = form(Container::Gltf);
    assert_eq!(container, Container::Gltf);
    assert_eq!(gltf, raw(&out, "scan/cloth.gltf"));
    let (container, glb) = form(Container::Glb);
    assert_eq!(container, Container::Glb);
    assert_eq!(
        Scan::read(glb, &ScanLimits::default()).unwrap().parts.len(),
        2
    );
}

#[test]
fn entries_of_a_zip_are_found_however_they_are_spelled() {
    for uri in [
        "maps/cloth.bin",
        "./maps//cloth.bin",
        "maps/./cloth.bin",
        "maps\\cloth.bin",
    ] {
        let (gltf, bin) = separate(uri);
        for name in [
            "maps/cloth.bin",
            "./maps/cloth.bin",
            "maps\\cloth.bin",
            "maps//cloth.bin",
            "maps/./cloth.bin",
        ] {
            for folder in ["", "./", "a/", "a\\", "./a//"] {
                let names = ["cloth.gltf", name].map(|name| format!("{folder}{name}"));
                let [main, file] = names.each_ref().map(String::as_str);
                let zip = zipped(&[(file, &bin), (main, &gltf), ("./a/._cloth.gltf", b"fork")]);
                let scan = Scan::read(zip.clone(), &ScanLimits::default());
                let scan = scan.unwrap_or_else(|error| panic!("{uri} {file} {main}: {error}"));
                let out = scan.write(&[patch()]).unwrap();
                let before = ZipArchive::new(Cursor::new(zip.as_slice())).unwrap();
                let after = ZipArchive::new(Cursor::new(out.as_slice())).unwrap();
                let spelled = |zip: &ZipArchive<_>| -> Vec<String> {
                    zip.file_names().take(3).map(str::to_owned).collect()
                };
                assert_eq!(spelled(&before), spelled(&after));
                assert_eq!(undone(out), zip, "{uri} {file} {main}");
            }
        }
    }
}

#[test]
fn of_two_entries_at_one_path_the_plainly_spelled_one_counts() {
    let (gltf, bin) = separate("cloth.bin");
    for names in [["./cloth.bin", "cloth.bin"], ["cloth.bin", "./cloth.bin"]] {
        let files = names.map(|name| (name, if name == "cloth.bin" { &bin[..] } else { b"" }));
        let zip = zipped(&[files[0], files[1], ("cloth.gltf", &gltf)]);
        assert!(Scan::read(zip, &ScanLimits::default()).is_ok(), "{names:?}");
    }
}

/// A mended scan whose patch is to be in a file of its own, and that file.
fn mended_beside(scan: &Scan) -> (Vec<u8>, Option<NewFile>) {
    let written = scan.write_within(&[patch()], PatchBuffer::File, Budget::unlimited());
    let written = written.unwrap();
    (written.bytes, written.file)
}

fn undone(mended: Vec<u8>) -> Vec<u8> {
    let stripped = stripped(mended, &ScanLimits::default(), Budget::unlimited()).unwrap();
    let stripped = stripped.unwrap();
    assert!(stripped.exact);
    stripped.bytes
}

#[test]
fn a_patch_goes_into_a_file_beside_the_others_and_comes_out_again() {
    let (gltf, bin) = separate("cloth.bin");
    let mut files = siblings("cloth.bin", bin);
    let once = read(&gltf, files.clone()).unwrap();
    let (mended, file) = mended_beside(&once);
    let file = file.unwrap();
    let json: Value = serde_json::from_slice(&mended).unwrap();
    assert_eq!(json["buffers"][1]["uri"], file.path);
    assert!(sibling_paths(&mended).unwrap().contains(&file.path));
    assert_eq!(undone(mended.clone()), gltf);
    // Without its file it is named; with it, it is the scan that a data URI gives.
    let missing = read(&mended, files.clone()).unwrap_err();
    assert_eq!(missing.pointer(), Some("/buffers/1/uri"));
    files.0.insert(file.path, file.bytes.into());
    let again = read(&mended, files.clone()).unwrap();
    let inline = read(&once.write(&[patch()]).unwrap(), files.clone()).unwrap();
    assert_eq!(again.surface, inline.surface);
    // A second patch on top, in a file or not.
    let (twice, second) = mended_beside(&again);
    assert!(second.is_some());
    assert_eq!(undone(twice), gltf);
    let twice = again.write(&[patch()]).unwrap();
    assert_eq!(read(&twice, files).unwrap().parts.len(), 3);
    assert_eq!(undone(twice), gltf);
}

#[test]
fn in_a_zip_the_file_of_a_patch_is_an_entry_beside_the_gltf() {
    let (gltf, bin) = separate("cloth.bin");
    for folder in ["", "./", "a/b/", "a\\"] {
        let [main, file] = ["cloth.gltf", "cloth.bin"].map(|name| format!("{folder}{name}"));
        let zip = zipped(&[(&file, &bin), (&main, &gltf)]);
        let limits = ScanLimits::default();
        let scan = Scan::read(zip.clone(), &limits).unwrap();
        let (mended, beside) = mended_beside(&scan);
        assert_eq!(beside, None, "it is in the zip");
        let again = Scan::read(mended.clone(), &limits).unwrap();
        let inline = Scan::read(scan.write(&[patch()]).unwrap(), &limits).unwrap();
        assert_eq!(again.surface, inline.surface, "{folder}");
        let (twice, _) = mended_beside(&again);
        assert_eq!(Scan::read(twice.clone(), &limits).unwrap().parts.len(), 3);
        assert_eq!(undone(twice), zip, "{folder}");
        assert_eq!(undone(mended.clone()), zip, "{folder}");
        // A glTF alone would miss the file.
        let form =
            |container| repacked(mended.clone(), container, &limits, Budget::unlimited()).unwrap();
        assert_eq!(form(Container::Gltf), (Container::Zip, mended.clone()));
        let (container, glb) = form(Container::Glb);
        assert_eq!(container, Container::Glb);
        let packed = Scan::read(glb, &limits).unwrap();
        assert_eq!(packed.surface, again.surface);
    }
}

#[test]
fn no_file_of_a_scan_is_taken_for_that_of_its_patch() {
    let (gltf, bin) = separate("cloth.bin");
    let files = siblings("cloth.bin", bin.clone());
    let scan = read(&gltf, files.clone()).unwrap();
    let name = mended_beside(&scan).1.unwrap().path;
    let mut json: Value = serde_json::from_slice(&gltf).unwrap();
    json["images"][0]["uri"] = json!(name);
    let named = json.to_string().into_bytes();
    let free = name.replace(".bin", "-2.bin");
    // Its image is there or not, and a file may be there that it does not name.
    let mut with_image = files.clone();
    with_image.0.insert(name.clone(), PICTURE.into());
    for (gltf, files) in [
        (&named, &files),
        (&named, &with_image),
        (&gltf, &with_image),
    ] {
        let scan = read(gltf, files.clone()).unwrap();
        assert_eq!(mended_beside(&scan).1.unwrap().path, free);
        let mut entries: Vec<(&str, &[u8])> = vec![("cloth.gltf", gltf)];
        entries.extend(files.0.iter().map(|(name, bytes)| (&name[..], &bytes[..])));
        let zip = Scan::read(zipped(&entries), &ScanLimits::default()).unwrap();
        let (mended, _) = mended_beside(&zip);
        let names = ZipArchive::new(Cursor::new(mended)).unwrap();
        assert!(names.file_names().any(|name| name == free));
    }
}

#[test]
fn a_scan_of_one_file_stays_one_file() {
    for bytes in [Builder::square().glb(), Builder::square().gltf()] {
        let scan = Scan::read(bytes, &ScanLimits::default()).unwrap();
        let (mended, file) = mended_beside(&scan);
        assert_eq!((mended, file), (scan.write(&[patch()]).unwrap(), None));
    }
}

#[test]
fn zips_that_are_no_scan_are_refused() {
    let (gltf, bin) = separate("cloth.bin");
    let refused = |files: &[(&str, &[u8])]| {
        let error = Scan::read(zipped(files), &ScanLimits::default()).unwrap_err();
        assert!(
            matches!(
                error,
                ScanError::Container { .. } | ScanError::External { .. }
            ),
            "{error}"
        );
        error.to_string()
    };
    assert!(refused(&[("cloth.bin", &bin)]).contains("no .gltf"));
    let two = refused(&[("a.gltf", &gltf), ("b.glb", &gltf), ("cloth.bin", &bin)]);
    assert!(two.contains("2 scans"), "{two}");
    assert!(refused(&[("a.gltf", &gltf)]).contains("cloth.bin"));
    let names: Vec<String> = (0..10_001).map(|k| k.to_string()).collect();
    let many: Vec<(&str, &[u8])> = names.iter().map(|name| (name.as_str(), &b""[..])).collect();
    assert!(refused(&many).contains("10001 entries"));
    let zeros = vec![0; 64 << 20];
    assert!(refused(&[("a.gltf", &gltf), ("cloth.bin", &zeros)]).contains("200 times"));
    let whole = zipped(&[("a.gltf", &gltf), ("cloth.bin", &bin)]);
    for k in (4..whole.len()).step_by(3) {
        assert!(Scan::read(whole[..k].to_vec(), &ScanLimits::default()).is_err());
    }
    let tight = ScanLimits {
        max_decoded_bytes: gltf.len() + 10,
        ..ScanLimits::default()
    };
    let error = Scan::read(whole, &tight).unwrap_err();
    assert!(error.to_string().contains("max_decoded_bytes"), "{error}");
}

/// A square of two triangles, which uses a material.
const OBJ: &str =
    "mtllib cloth.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl linen\nf 1 2 3\nf 1 3 4\n";
const MTL: &[u8] = b"newmtl linen\nmap_Kd maps/linen.png\n";

#[test]
fn an_obj_in_a_zip_is_mended_there_beside_its_files() {
    let zip = zipped(&[
        ("cloth/cloth.obj", OBJ.as_bytes()),
        ("cloth/cloth.mtl", MTL),
        ("cloth/maps/linen.png", PICTURE),
    ]);
    let limits = ScanLimits::default();
    let scan = Scan::read(zip.clone(), &limits).unwrap();
    assert_eq!(scan.container(), Container::Zip);
    assert_eq!(scan.surface.faces.len(), 2);
    assert_eq!(scan.write(&[]).unwrap(), zip);
    let mended = scan.write(&[patch()]).unwrap();
    let again = Scan::read(mended.clone(), &limits).unwrap();
    assert_eq!(again.surface.faces.len(), 3);
    let mut archive = ZipArchive::new(Cursor::new(mended.clone())).unwrap();
    for (name, bytes) in [("cloth/cloth.mtl", MTL), ("cloth/maps/linen.png", PICTURE)] {
        let mut found = Vec::new();
        archive
            .by_name(name)
            .unwrap()
            .read_to_end(&mut found)
            .unwrap();
        assert_eq!(found, bytes, "{name}");
    }
    // An OBJ is no glTF: in any other form it comes alone.
    for form in [Container::Gltf, Container::Glb] {
        let (container, obj) =
            repacked(mended.clone(), form, &limits, Budget::unlimited()).unwrap();
        assert_eq!(container, Container::Obj);
        assert!(obj.starts_with(OBJ.as_bytes()) && obj.len() > OBJ.len());
    }
    let stripped = stripped(mended, &limits, Budget::unlimited())
        .unwrap()
        .unwrap();
    assert!(stripped.exact && stripped.marks.patches == 1);
    assert_eq!((stripped.container, stripped.bytes), (Container::Zip, zip));
}

#[test]
fn a_mended_obj_that_others_zipped_is_stripped_in_its_zip() {
    let limits = ScanLimits::default();
    let scan = Scan::read(OBJ.as_bytes(), &limits).unwrap();
    let mended = scan.write(&[patch()]).unwrap();
    let zip = zipped(&[("cloth.obj", &mended), ("cloth.mtl", MTL)]);
    let stripped = stripped(zip, &limits, Budget::unlimited())
        .unwrap()
        .unwrap();
    assert!(stripped.exact && stripped.mends == 1);
    let scan = Scan::read(stripped.bytes, &limits).unwrap();
    assert_eq!(scan.digests(), &crate::FileDigests::of(OBJ.as_bytes()));
}

#[test]
fn a_gltf_in_a_zip_goes_before_other_meshes() {
    let (gltf, bin) = separate("cloth.bin");
    let zip = zipped(&[
        ("a.obj", OBJ.as_bytes()),
        ("cloth.gltf", &gltf),
        ("cloth.bin", &bin),
    ]);
    let (limits, budget) = (ScanLimits::default(), Budget::unlimited());
    let (container, main) = repacked(zip, Container::Gltf, &limits, budget).unwrap();
    assert_eq!((container, main), (Container::Gltf, gltf));
    let two = zipped(&[("a.obj", OBJ.as_bytes()), ("b.ply", b"ply\n")]);
    let refused = Scan::read(two, &ScanLimits::default()).unwrap_err();
    assert!(
        refused.to_string().contains("it holds 2 scans"),
        "{refused}"
    );
}
