//! Laws of undoing mends: whatever was mended in between, the bytes from before come back.

use std::io::{Cursor, Write as _};

use darn_budget::Budget;
use darn_geometry::mesh::Vec3;
use proptest::prelude::*;
use serde_json::{Value, json};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::testing::Builder;
use super::{
    Container, Marks, PatchPoint, PatchPrimitive, Scan, ScanError, ScanLimits, Siblings, Stripped,
    stripped,
};

fn strip(bytes: &[u8]) -> Option<Stripped> {
    let limits = ScanLimits::default();
    stripped(bytes.to_vec(), &limits, Budget::unlimited()).unwrap()
}

/// A triangle over the first two vertices of a part.
fn patch(scan: &Scan, part: usize, id: u32) -> PatchPrimitive {
    let look = &scan.parts[part];
    let first = look.vertices.start;
    PatchPrimitive {
        name: "patch".into(),
        deviations: Vec::new(),
        part,
        material_of: part,
        points: vec![
            PatchPoint::Scan(first),
            PatchPoint::Scan(first + 1),
            PatchPoint::New(Vec3::new(0.5, 0.5, 1.0 + f64::from(id))),
        ],
        normals: vec![Vec3::z(); 3],
        tangents: Vec::new(),
        texcoords: vec![vec![[0.5; 2]; 3]; look.texcoords.len()],
        colors: vec![vec![[0.5; 4]; 3]; look.colors.len()],
        faces: vec![[0, 1, 2]],
        both_sides: id % 2 == 1,
        appearance: Default::default(),
        hole: [("id".to_owned(), json!(id))].into_iter().collect(),
        method: Default::default(),
    }
}

/// What is done to a scan in one mend.
#[derive(Debug, Clone, Copy)]
struct Mend {
    patches: u32,
    cuts: bool,
}

fn read(bytes: &[u8], siblings: &Siblings) -> Scan {
    let limits = ScanLimits::default();
    Scan::read_with_siblings(
        bytes.to_vec(),
        siblings.clone(),
        &limits,
        Budget::unlimited(),
    )
    .unwrap()
}

fn mended(bytes: &[u8], siblings: &Siblings, mend: Mend) -> Vec<u8> {
    let mut scan = read(bytes, siblings);
    if mend.cuts {
        let mut faces = vec![0];
        scan.spread_to_instances(&mut faces);
        let cut: Vec<bool> = (0..scan.surface.faces.len() as u32)
            .map(|f| faces.contains(&f))
            .collect();
        scan = scan.without_faces(&cut, Budget::unlimited()).unwrap();
    }
    let patches: Vec<PatchPrimitive> = (0..mend.patches).map(|id| patch(&scan, 0, id)).collect();
    scan.write(&patches).unwrap()
}

/// A scan of two triangles in some container, and the files beside it.
#[derive(Debug, Clone, Copy)]
enum Form {
    Glb,
    DataUri,
    Separate,
    /// A zip of JSON and a buffer, deflated or not.
    Zip(bool),
    /// A GLB in a zip.
    ZippedGlb,
}

/// Oddities of files that are valid, or read all the same.
#[derive(Debug, Clone, Copy)]
struct Oddities {
    /// The builder's scan: 0 a square, 1 with a skin, 2 a strip without indices, 3 with extras that are no objects.
    kind: usize,
    /// JSON with line breaks and a byte order mark.
    spaced: bool,
    /// Zeros that pad the JSON chunk of a GLB, and bytes after the GLB.
    zeros: usize,
    trailing: usize,
    /// A further chunk of a GLB.
    rest: bool,
    /// Bytes of the BIN chunk that no buffer has.
    longer_bin: usize,
}

fn builder(kind: usize) -> Builder {
    match kind {
        1 => Builder::skinned(),
        2 => {
            let mut scan = Builder::new();
            let corners = [0, 1, 2, 3, 4].map(|k| [k as f32, (k % 2) as f32, 0.25]);
            let position = scan.floats(&corners);
            scan.primitive(json!({"attributes": {"POSITION": position}, "mode": 5}));
            scan
        }
        3 => {
            let mut scan = Builder::square();
            scan.json["extras"] = json!("loan 7");
            scan.json["asset"]["extras"] = json!([1.50, "e\u{301}"]);
            scan.json["meshes"][0]["primitives"][0]["extras"] = json!(7);
            scan.json["bufferViews"][0]["extras"] = json!("of the camera");
            scan
        }
        _ => Builder::square(),
    }
}

/// The scan's bytes, and the files beside it.
fn scan_of(form: Form, odd: Oddities) -> (Vec<u8>, Siblings) {
    let mut scan = builder(odd.kind);
    let length = scan.bin.len();
    scan.json["buffers"][0]["byteLength"] = json!(length);
    let text = |json: &Value| match odd.spaced {
        true => format!("\r\n{}\n\t", serde_json::to_string_pretty(json).unwrap()),
        false => json.to_string(),
    };
    let mark: &[u8] = if odd.spaced { b"\xEF\xBB\xBF" } else { b"" };
    let glb = |scan: &Builder| {
        let mut json = text(&scan.json).into_bytes();
        json.resize(json.len() + odd.zeros, 0);
        let bin = [&scan.bin[..], &vec![7; odd.longer_bin]].concat();
        let rest = [4, 0, 0, 0, b'M', b'U', b'S', 0, 1, 2, 3, 4];
        let rest = if odd.rest { &rest[..] } else { &[] };
        let mut bytes = super::container::glb_of_chunks(&json, Some(&bin), rest).unwrap();
        bytes.extend(vec![9; odd.trailing]);
        bytes
    };
    let mut separate = scan.clone();
    separate.json["buffers"][0]["uri"] = json!("cloth.bin");
    let gltf = [mark, text(&separate.json).as_bytes()].concat();
    let zipped = |files: &[(&str, &[u8])], deflated: bool| {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let method = match deflated {
            true => CompressionMethod::Deflated,
            false => CompressionMethod::Stored,
        };
        for (name, bytes) in files {
            let options = SimpleFileOptions::default()
                .compression_method(method)
                .compression_level(deflated.then_some(1))
                .with_alignment(if odd.rest { 64 } else { 1 });
            zip.start_file(*name, options).unwrap();
            zip.write_all(bytes).unwrap();
        }
        zip.set_comment("as lent");
        zip.finish().unwrap().into_inner()
    };
    let none = Siblings::default();
    match form {
        Form::Glb => (glb(&scan), none),
        Form::DataUri => {
            let json: Value = serde_json::from_slice(&scan.gltf()).unwrap();
            ([mark, text(&json).as_bytes()].concat(), none)
        }
        Form::Separate => {
            let file = ("cloth.bin".to_owned(), scan.bin.into());
            (gltf, Siblings([file].into_iter().collect()))
        }
        Form::Zip(deflated) => {
            let files = [("a/scan.gltf", &gltf[..]), ("a/cloth.bin", &scan.bin)];
            (zipped(&files, deflated), none)
        }
        Form::ZippedGlb => {
            let files = [("read me.txt", &b"a loan"[..]), ("scan.glb", &glb(&scan))];
            (zipped(&files, true), none)
        }
    }
}

fn forms() -> impl Strategy<Value = Form> {
    prop_oneof![
        Just(Form::Glb),
        Just(Form::DataUri),
        Just(Form::Separate),
        any::<bool>().prop_map(Form::Zip),
        Just(Form::ZippedGlb),
    ]
}

prop_compose! {
    fn oddities()(
        kind in 0..4_usize,
        spaced in any::<bool>(),
        zeros in 0..5_usize,
        trailing in 0..3_usize,
        rest in any::<bool>(),
        longer_bin in 0..4_usize,
    ) -> Oddities {
        Oddities { kind, spaced, zeros, trailing, rest, longer_bin }
    }
}

fn mends() -> impl Strategy<Value = Vec<Mend>> {
    // Not both of nothing: that mend writes what it read.
    let mend = (0..3_u32, any::<bool>()).prop_filter("something", |(n, cuts)| *n > 0 || *cuts);
    prop::collection::vec(mend, 1..4).prop_map(|all| {
        // A second triangle is left for a second cut, and none for a third.
        let mut cuts = 0;
        let mends = all.into_iter().map(|(patches, cut)| {
            cuts += usize::from(cut);
            let cut = cut && cuts <= 2;
            // The first triangle may be the last that is drawn.
            let patches = if cut && cuts == 1 {
                patches
            } else {
                patches.max(1)
            };
            Mend { patches, cuts: cut }
        });
        mends.collect()
    })
}

proptest! {
    #[test]
    fn a_stripped_scan_has_the_bytes_from_before(
        form in forms(),
        odd in oddities(),
        mends in mends(),
    ) {
        let (before, siblings) = scan_of(form, odd);
        prop_assert!(strip(&before).is_none(), "there is nothing of darn's yet");
        let mut bytes = before.clone();
        for mend in &mends {
            bytes = mended(&bytes, &siblings, *mend);
        }
        let stripped = strip(&bytes).unwrap();
        prop_assert!(stripped.exact, "{:?}", stripped.notes);
        prop_assert_eq!(stripped.mends, mends.len());
        prop_assert!(stripped.bytes == before);
        prop_assert_eq!(stripped.notes, Vec::<String>::new());
        let patches: u32 = mends.iter().map(|mend| mend.patches).sum();
        prop_assert_eq!(stripped.marks.patches, patches as usize);
        prop_assert_eq!(stripped.marks.cuts, usize::from(mends.iter().any(|mend| mend.cuts)));
    }

    #[test]
    fn a_broken_record_is_told_and_never_followed(
        place in any::<prop::sample::Index>(),
        byte in any::<u8>(),
    ) {
        let (before, none) = scan_of(Form::DataUri, PLAIN);
        let mut bytes = mended(&before, &none, Mend { patches: 2, cuts: true });
        let text = String::from_utf8(bytes.clone()).unwrap();
        let start = text.find("\"undo\":").unwrap();
        let at = start + place.index(text.len() - start);
        bytes[at] = byte;
        match stripped(bytes, &ScanLimits::default(), Budget::unlimited()) {
            Ok(Some(stripped)) if stripped.exact => prop_assert!(stripped.bytes == before),
            Ok(Some(stripped)) => {
                let marks = Marks::of(&serde_json::from_slice(&stripped.bytes).unwrap());
                prop_assert_eq!(marks, Marks::default());
            }
            Ok(None) => prop_assert!(false, "the patches are there"),
            Err(error) => prop_assert!(matches!(error, ScanError::Container { .. }), "{error}"),
        }
    }
}

const PLAIN: Oddities = Oddities {
    kind: 0,
    spaced: false,
    zeros: 0,
    trailing: 0,
    rest: false,
    longer_bin: 0,
};

fn triangles(bytes: &[u8]) -> Vec<[Vec3; 3]> {
    let scan = read(bytes, &Siblings::default());
    (0..scan.surface.faces.len())
        .map(|f| scan.surface.triangle(f))
        .collect()
}

/// A GLB with its JSON edited, as other software leaves it.
fn edited(bytes: &[u8], edit: impl Fn(&mut Value)) -> Vec<u8> {
    let layout = super::container::layout(bytes).unwrap();
    let mut json: Value = serde_json::from_slice(&bytes[layout.json]).unwrap();
    edit(&mut json);
    let bin = &bytes[layout.bin.unwrap()];
    super::container::pack_glb(json.to_string().as_bytes(), Some(bin), &[]).unwrap()
}

#[test]
fn patches_of_a_scan_that_others_changed_are_taken_out_of_what_it_is_now() {
    for kind in 0..4 {
        let odd = Oddities { kind, ..PLAIN };
        let (before, none) = scan_of(Form::Glb, odd);
        let mend = Mend {
            patches: 2,
            cuts: true,
        };
        let once = mended(&before, &none, mend);
        let changed = edited(&once, |json| json["asset"]["generator"] = json!("Blender"));
        // Changed after the last mend, and between two.
        for bytes in [changed.clone(), mended(&changed, &none, mend)] {
            let stripped = strip(&bytes).unwrap();
            assert!(!stripped.exact, "{kind}");
            assert_eq!(stripped.notes.len(), 1, "{:?}", stripped.notes);
            assert_eq!(triangles(&stripped.bytes), triangles(&before), "{kind}");
            let text = String::from_utf8_lossy(&stripped.bytes);
            assert!(text.contains("Blender") && !text.contains("\"undo\""));
            assert!(!text.contains("reconstruct"), "{kind}");
            assert!(!text.contains("KHR_"), "{kind}");
            assert!(strip(&stripped.bytes).is_none(), "nothing is left to strip");
        }
    }
}

#[test]
fn variants_of_the_scan_stay_when_patches_are_taken_out() {
    let mut scan = builder(0);
    let variants = json!({"variants": [{"name": "red"}, {"name": "blue"}]});
    scan.push("materials", json!({"name": "blue"}));
    scan.json["extensionsUsed"] = json!(["KHR_materials_variants"]);
    scan.json["extensions"] = json!({ "KHR_materials_variants": variants });
    let mappings = json!([{ "material": 0, "variants": [0] }, { "material": 1, "variants": [1] }]);
    scan.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_materials_variants": { "mappings": mappings }});
    let (before, none) = (scan.glb(), Siblings::default());
    let mend = Mend {
        patches: 1,
        cuts: false,
    };
    let twice = mended(&mended(&before, &none, mend), &none, mend);
    let exact = strip(&twice).unwrap();
    assert!(exact.exact && exact.bytes == before);
    let changed = edited(&twice, |json| json["asset"]["generator"] = json!("Blender"));
    let stripped = strip(&changed).unwrap();
    assert!(!stripped.exact);
    let layout = super::container::layout(&stripped.bytes).unwrap();
    let json: Value = serde_json::from_slice(&stripped.bytes[layout.json]).unwrap();
    assert_eq!(json["extensions"]["KHR_materials_variants"], variants);
    let own = &json["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"];
    assert_eq!(own["mappings"], mappings);
}

#[test]
fn a_cut_whose_triangles_are_gone_stays_and_is_told() {
    let (before, none) = scan_of(Form::Glb, PLAIN);
    let cut = Mend {
        patches: 0,
        cuts: true,
    };
    let bytes = edited(&mended(&before, &none, cut), |json| {
        json["accessors"][1]["count"] = json!(3);
    });
    let stripped = strip(&bytes).unwrap();
    assert!(!stripped.exact);
    let told = stripped
        .notes
        .iter()
        .any(|note| note.contains("could not be put back"));
    assert!(told, "{:?}", stripped.notes);
    assert_eq!(triangles(&stripped.bytes).len(), 1);
}

#[test]
fn a_mesh_of_patches_alone_is_no_longer_drawn() {
    let (before, none) = scan_of(Form::Glb, PLAIN);
    let mend = Mend {
        patches: 1,
        cuts: false,
    };
    let bytes = edited(&mended(&before, &none, mend), |json| {
        let primitives = json["meshes"][0]["primitives"].as_array_mut().unwrap();
        primitives.remove(0);
    });
    let stripped = strip(&bytes).unwrap();
    assert_eq!(stripped.marks.patches, 1);
    let layout = super::container::layout(&stripped.bytes).unwrap();
    let json: Value = serde_json::from_slice(&stripped.bytes[layout.json]).unwrap();
    assert_eq!(json["nodes"], json!([{}]));
}

#[test]
fn a_zip_that_others_packed_again_keeps_its_gltf_exact() {
    let (before, siblings) = scan_of(Form::Separate, PLAIN);
    let mend = Mend {
        patches: 1,
        cuts: false,
    };
    let gltf = mended(&before, &siblings, mend);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let files = siblings
        .0
        .iter()
        .map(|(name, bytes)| (name.as_str(), &bytes[..]));
    for (name, bytes) in files.chain([("scan.gltf", &gltf[..])]) {
        zip.start_file(name, SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    let zip = zip.finish().unwrap().into_inner();
    let stripped = strip(&zip).unwrap();
    assert_eq!((stripped.exact, stripped.container), (true, Container::Zip));
    assert_eq!(stripped.notes.len(), 1);
    let limits = ScanLimits::default();
    let (_, main) = super::repacked(
        stripped.bytes,
        Container::Gltf,
        &limits,
        Budget::unlimited(),
    )
    .unwrap();
    assert_eq!(main, before);
}

#[test]
fn a_gltf_that_darn_packed_is_told_by_its_digest_and_loses_its_patches() {
    let mend = Mend {
        patches: 1,
        cuts: false,
    };
    for form in [Form::DataUri, Form::Separate, Form::Zip(true)] {
        let (before, siblings) = scan_of(form, PLAIN);
        let gltf = read(&before, &siblings).digests().sha256.clone();
        let twice = mended(&mended(&before, &siblings, mend), &siblings, mend);
        let packed = read(&before, &siblings).packed(&twice).unwrap();
        // A GLB of darn's is mended as any other; what was packed before stays so.
        let again = mended(&packed, &Siblings::default(), mend);
        for (bytes, undone) in [(&packed, 0), (&again, 1)] {
            let stripped = strip(bytes).unwrap();
            assert_eq!((stripped.exact, stripped.mends), (false, undone));
            assert_eq!(stripped.marks.patches, 2 + undone);
            assert_eq!(stripped.notes.len(), 1, "{:?}", stripped.notes);
            let note = &stripped.notes[0];
            assert!(note.contains("packed") && note.contains(&gltf), "{note}");
            let untouched = read(&before, &siblings);
            let expected: Vec<_> = (0..untouched.surface.faces.len())
                .map(|f| untouched.surface.triangle(f))
                .collect();
            assert_eq!(triangles(&stripped.bytes), expected);
            assert!(strip(&stripped.bytes).is_none(), "nothing is left to strip");
        }
    }
}

#[test]
fn a_record_is_small() {
    let (before, none) = scan_of(Form::Glb, PLAIN);
    let mend = Mend {
        patches: 200,
        cuts: false,
    };
    let bytes = mended(&before, &none, mend);
    let text = String::from_utf8_lossy(&bytes);
    let record = &text[text.find("\"undo\":").unwrap()..];
    let length = record.find("]]").unwrap();
    assert!(length < 500, "{length}");
}
