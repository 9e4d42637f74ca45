//! Laws of reading and writing mesh files.

use bytes::Bytes;
use darn_budget::Budget;
use proptest::prelude::*;

use crate::{
    AddedPatch, AddedPoint, FileMesh, MeshFile, MeshFileError, MeshFileLimits, MeshFormat,
    without_patches,
};

const LIMITS: MeshFileLimits = MeshFileLimits {
    max_vertices: 1000,
    max_faces: 1000,
    max_materials: 100,
};
const DIGEST: &str = "00ff";

fn read(bytes: &[u8]) -> Result<MeshFile, MeshFileError> {
    let format = MeshFormat::of(bytes).expect("a mesh file");
    MeshFile::read(
        Bytes::copy_from_slice(bytes),
        format,
        LIMITS,
        Budget::unlimited(),
    )
}

/// A strip of `n` squares as OBJ, with attributes as asked for.
fn obj(n: usize, texcoords: bool, normals: bool, end: &str) -> Vec<u8> {
    let mut text = String::from("# made for a test\nmtllib cloth.mtl\no cloth\nusemtl linen\n");
    for k in 0..=n {
        text += &format!("v {k}.25 0 -1.5e0\nv {k}.25 1 0\n");
    }
    if texcoords {
        (0..2 * (n + 1)).for_each(|k| text += &format!("vt 0.{k} 0.5\n"));
    }
    if normals {
        text += "vn 0 0 1\n";
    }
    for k in 0..n {
        let corner = |v: usize| match (texcoords, normals) {
            (false, false) => format!("{v}"),
            (true, false) => format!("{v}/{v}"),
            (false, true) => format!("{v}//1"),
            (true, true) => format!("{v}/{v}/1"),
        };
        let [a, b, c, d] = [1, 3, 4, 2].map(|v| corner(2 * k + v));
        text += &format!("f {a} {b} {c} {d}\n");
    }
    format!("{}{end}", text.trim_end()).into_bytes()
}

/// The same strip as PLY with properties that darn does not know, an element behind the faces, and bytes behind all.
fn ply(n: usize, format: &str) -> Vec<u8> {
    let header = format!(
        "ply\nformat {format} 1.0\ncomment made for a test\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty float quality\nelement face {n}\n\
         property list uchar int vertex_indices\nproperty short flags\nelement note 1\nproperty list uchar uchar text\nend_header\n",
        2 * (n + 1)
    );
    let mut bytes = header.into_bytes();
    let ascii = format == "ascii";
    let big = format.ends_with("big_endian");
    let number = |bytes: &mut Vec<u8>, little: &[u8], text: String| {
        if ascii {
            bytes.extend(text.bytes().chain([b' ']));
        } else if big {
            bytes.extend(little.iter().rev());
        } else {
            bytes.extend(little);
        }
    };
    let end = |bytes: &mut Vec<u8>| bytes.extend(ascii.then_some(b'\n'));
    for k in 0..2 * (n + 1) {
        for x in [(k / 2) as f32, (k % 2) as f32, 0.5] {
            number(&mut bytes, &x.to_le_bytes(), x.to_string());
        }
        for c in [k as u8, 255, 0] {
            number(&mut bytes, &[c], c.to_string());
        }
        number(&mut bytes, &0.75f32.to_le_bytes(), "0.75".into());
        end(&mut bytes);
    }
    for k in 0..n {
        number(&mut bytes, &[4], "4".into());
        for v in [0, 2, 3, 1] {
            let v = (2 * k + v) as i32;
            number(&mut bytes, &v.to_le_bytes(), v.to_string());
        }
        number(&mut bytes, &7i16.to_le_bytes(), "7".into());
        end(&mut bytes);
    }
    for c in [2, 104, 105] {
        number(&mut bytes, &[c], c.to_string());
    }
    end(&mut bytes);
    bytes.extend(b"rest");
    bytes
}

/// A patch that hangs on the first two vertices.
fn patch(mesh: &FileMesh) -> AddedPatch {
    let each = |has: bool| if has { 3 } else { 0 };
    AddedPatch {
        name: "darn reconstruction, hole 1".into(),
        material: mesh.groups.first().and_then(|group| group.material.clone()),
        points: vec![
            AddedPoint::Old(0),
            AddedPoint::Old(1),
            AddedPoint::New([0.5, 0.25, 3.0]),
        ],
        normals: vec![[0.0, 0.0, 1.0]; each(!mesh.normals.is_empty())],
        texcoords: vec![[0.125, 0.5]; each(!mesh.texcoords.is_empty())],
        colours: vec![[0.2, 0.4, 1.0, 1.0]; each(!mesh.colours.is_empty())],
        faces: vec![[0, 1, 2], [2, 1, 0]],
    }
}

fn file() -> impl Strategy<Value = Vec<u8>> {
    let end = prop::sample::select(vec!["", "\n", "\r\n", "\n\n"]);
    let objs = (1usize..8, any::<bool>(), any::<bool>(), end)
        .prop_map(|(n, vt, vn, end)| obj(n, vt, vn, end));
    let format = prop::sample::select(vec!["ascii", "binary_little_endian", "binary_big_endian"]);
    let plys = (1usize..8, format).prop_map(|(n, format)| ply(n, format));
    prop_oneof![objs, plys]
}

proptest! {
    #[test]
    fn a_patch_is_added_behind_what_is_there_and_comes_out_again(bytes in file(), times in 1usize..4) {
        let mut steps = vec![bytes];
        for k in 0..times {
            let file = read(&steps[k]).unwrap();
            let mended = file.with_patches(&[patch(file.mesh()), patch(file.mesh())], DIGEST);
            let after = read(&mended).unwrap();
            let (before, after) = (file.mesh(), after.mesh());
            let count = before.positions.len();
            prop_assert_eq!(&after.positions[..count], &before.positions[..]);
            prop_assert_eq!(&after.positions[count..], &[[0.5, 0.25, 3.0]; 2]);
            prop_assert_eq!(&after.colours[..before.colours.len()], &before.colours[..]);
            prop_assert_eq!(after.groups.len(), before.groups.len());
            let (old, new) = (&before.groups[0].faces, &after.groups[0].faces);
            prop_assert_eq!(&new[..old.len()], &old[..]);
            let corners = new[old.len()..].iter().map(|face| face.map(|c| c.position as usize));
            let expected = [[0, 1, count], [count, 1, 0], [0, 1, count + 1], [count + 1, 1, 0]];
            prop_assert_eq!(corners.collect::<Vec<_>>(), expected);
            steps.push(mended);
        }
        while let Some(mended) = steps.pop() {
            let format = MeshFormat::of(&mended).unwrap();
            let without = without_patches(&mended, format);
            match steps.last() {
                Some(before) => {
                    let without = without.unwrap();
                    prop_assert_eq!((without.patches, without.sha256.as_str()), (2, DIGEST));
                    prop_assert!(without.bytes == *before);
                }
                None => prop_assert!(without.is_none()),
            }
        }
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in file(), cut in any::<prop::sample::Index>(), at in any::<prop::sample::Index>(), byte: u8) {
        let mut changed = bytes.clone();
        changed.truncate(cut.index(bytes.len() + 1));
        if !changed.is_empty() {
            let at = at.index(changed.len());
            changed[at] = byte;
        }
        if let Some(format) = MeshFormat::of(&changed) {
            let bytes = Bytes::from(changed.clone());
            if let Ok(file) = MeshFile::read(bytes, format, LIMITS, Budget::unlimited())
                && file.mesh().positions.len() > 1
            {
                file.with_patches(&[patch(file.mesh())], DIGEST);
            }
            without_patches(&changed, format);
        }
    }
}

#[test]
fn indices_count_from_the_first_or_back_from_the_last() {
    let text = b"v 0 0 0\nv 1 0 0 # corner\nv 0 1 0\n  f -3 -2 \\\n-1\nv 5 5 5\nf 1 2 -1 # far\n";
    let file = read(text).unwrap();
    let faces = file.mesh().groups[0].faces.iter();
    let positions: Vec<_> = faces.map(|face| face.map(|c| c.position)).collect();
    assert_eq!(positions, [[0, 1, 2], [0, 1, 3]]);
}

#[test]
fn errors_name_the_line_and_what_is_wrong() {
    let cases: [(&[u8], &str); 10] = [
        (b"v 0 0 0\nf 1 2 3\n", "line 2: \"2\": there is no v 2; 1 come before"),
        (b"v 0 0 0\nf 0 1 1\n", "line 2: \"0\": there is no v 0; 1 come before"),
        (b"v 0 -2e31 0\n", "line 1: -2e31 is beyond 1e30"),
        (b"v 0 nan 0\n", "line 1: \"nan\" is no finite number"),
        (b"v 0 0\n", "line 1: has 2 of at least 3 numbers"),
        (b"v 0 0 0\nf 1 1\n", "line 2: a face has 2 corners; it needs three"),
        (b"v 0 0 0\nf 1/x 1 1\n", "line 2: \"1/x\": \"x\" is no index"),
        (b"ply\nformat ascii 2\nelement vertex many\n", "line 3: \"many\" is no number of rows"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
              property list uchar int vertex_index\nend_header\n0 0 0\n1 2\n",
            "the file ends in its element \"vertex\": row 1 of 2 is not complete",
        ),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
              property list uchar int vertex_index\nend_header\n0 0 0\n3 0 0 9\n",
            "row 0 of the element \"face\": there is no vertex 9; the file has 1",
        ),
    ];
    for (bytes, expected) in cases {
        let error = read(bytes).expect_err("a mistake");
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn a_point_cloud_is_refused_by_name() {
    let text = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
    let error = read(text).unwrap_err().to_string();
    assert!(error.contains("point clouds"), "{error}");
}

#[test]
fn limits_are_named() {
    let limits = MeshFileLimits {
        max_vertices: 3,
        max_faces: 2,
        max_materials: 1,
    };
    for (bytes, expected) in [
        (
            obj(3, false, false, "\n"),
            "the file has 4 vertices; the limit max_vertices = 3",
        ),
        (
            ply(3, "ascii"),
            "the file has 8 vertices; the limit max_vertices = 3",
        ),
        (
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 1 2 3 1 2\n".to_vec(),
            "the file has 3 triangles; the limit max_faces = 2",
        ),
        (
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n".to_vec(),
            "the file has 2 materials; the limit max_primitives = 1",
        ),
    ] {
        let format = MeshFormat::of(&bytes).unwrap();
        let error = MeshFile::read(bytes.into(), format, limits, Budget::unlimited()).unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn other_files_are_no_mesh_files() {
    for bytes in [
        &b"glTF\x02\0\0\0"[..],
        b"{\"asset\": {}}",
        b"PK\x03\x04",
        b"",
        b"# a note\n",
        b"plywood",
        b"v\0 1 2 3",
        b"g",
        b"v\n",
    ] {
        assert_eq!(MeshFormat::of(bytes), None, "{bytes:?}");
    }
    assert_eq!(
        MeshFormat::of(b"\xEF\xBB\xBF# x\r\n\r\nmtllib a.mtl"),
        Some(MeshFormat::Obj)
    );
}
