//! OBJ and PLY in and out: everything but the patch stays as it was, and the patch is that of the same mesh as a glTF.

use darn_budget::Budget;
use darn_contract::port::ScanForm;
use darn_contract::{Constraints, Cut, HoleSelector, codes};
use darn_geometry::mesh::TriMesh;
use darn_gltf_scan::ScanLimits;
use darn_mend::strip;

use super::cloth::{MendedScan, ROUND, holed, mended, packed, sheet};

/// A mesh as OBJ: with materials, texture coordinates and normals, in a file as exporters write it.
pub fn obj(mesh: &TriMesh) -> Vec<u8> {
    let mut text = String::from("# exported\r\nmtllib cloth.mtl\r\no cloth\r\nusemtl linen\r\n");
    for p in &mesh.positions {
        text += &format!("v {} {} {}\r\n", p.x as f32, p.y as f32, p.z as f32);
        text += &format!("vt {:.5} {:.5}\r\nvn 0 0 1\r\n", p.x, 1.0 - p.y);
    }
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| format!("{0}/{0}/{0}", v + 1));
        text += &format!("f {a} {b} {c}\r\n");
    }
    text.into_bytes()
}

/// A mesh as binary PLY with a property that darn does not know.
pub fn ply(mesh: &TriMesh) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float confidence\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        mesh.positions.len(),
        mesh.faces.len()
    );
    let mut bytes = header.into_bytes();
    for p in &mesh.positions {
        p.iter()
            .for_each(|x| bytes.extend((*x as f32).to_le_bytes()));
        bytes.extend([200, 30, 30]);
        bytes.extend(0.5f32.to_le_bytes());
    }
    for face in &mesh.faces {
        bytes.push(3);
        face.iter()
            .for_each(|v| bytes.extend((*v as i32).to_le_bytes()));
    }
    bytes
}

/// The mended scan of a mesh file: its loops are those of the mended glTF, and its new vertices lie where those do.
fn check(file: &[u8], mesh: &TriMesh) -> Vec<u8> {
    let own = mended(file, &Constraints::default()).expect("a mended mesh file");
    let twin = mended(&packed(mesh, &[]), &Constraints::default()).expect("a mended glTF");
    assert_eq!(own.report.holes.len(), 1);
    let (own_scan, twin) = (MendedScan::of(&own.bytes), MendedScan::of(&twin.bytes));
    assert_eq!(own_scan.loops.len(), 1, "the outer boundary");
    assert_eq!(own_scan.topology.components, 1);
    let (new, expected) = (&own_scan.welded.mesh, &twin.welded.mesh);
    assert_eq!(new.faces.len(), expected.faces.len());
    let added = &new.positions[mesh.positions.len()..];
    let near = |p: &&darn_geometry::mesh::Vec3| {
        let distance = expected.positions.iter().map(|q| (*p - q).norm());
        distance.fold(f64::INFINITY, f64::min) < 1e-3
    };
    assert!(added.iter().all(|p| near(&p)));
    own.bytes
}

fn check_strip(mended: &[u8], before: &[u8]) {
    let limits = ScanLimits::default();
    let stripped = strip(
        mended.to_vec(),
        ScanForm::AsReceived,
        &limits,
        Budget::unlimited(),
    );
    let stripped = stripped.expect("something to strip");
    assert!(stripped.report.exact && stripped.report.patches == 1);
    assert!(stripped.bytes == before, "the bytes from before");
}

#[test]
fn an_obj_goes_out_as_it_came_in_with_the_patch_at_its_end() {
    let mesh = holed(sheet(0), &ROUND).mesh;
    let file = obj(&mesh);
    let mended = check(&file, &mesh);
    let added = mended
        .strip_prefix(&file[..])
        .expect("every line of the file");
    let added = std::str::from_utf8(added).expect("text");
    for kind in ["v ", "vt ", "vn ", "f "] {
        assert!(added.lines().any(|line| line.starts_with(kind)), "{kind}");
    }
    // The material in use goes on.
    assert!(!added.contains("usemtl"));
    check_strip(&mended, &file);
}

#[test]
fn a_ply_keeps_its_properties_and_gets_the_patch_behind_its_rows() {
    let mesh = holed(sheet(0), &ROUND).mesh;
    let file = ply(&mesh);
    let mended = check(&file, &mesh);
    let body = |bytes: &[u8]| {
        let end = b"end_header\n";
        let at = bytes
            .windows(end.len())
            .position(|w| w == end)
            .expect("a header");
        at + end.len()
    };
    let rows = 19 * mesh.positions.len();
    let (old, new) = (&file[body(&file)..], &mended[body(&mended)..]);
    assert!(new.starts_with(&old[..rows]), "the vertices");
    // The cloth's colour goes on.
    assert_eq!(&new[rows + 12..rows + 15], [200, 30, 30]);
    check_strip(&mended, &file);
}

#[test]
fn cloth_cannot_be_cut_out_of_an_obj() {
    let mesh = holed(sheet(0), &ROUND).mesh;
    let cut = Cut::Ball {
        center: mesh.positions[0].into(),
        radius: 0.05,
    };
    let constraints = Constraints {
        holes: vec![HoleSelector::Cut(cut)],
        ..Constraints::default()
    };
    let error = mended(&obj(&mesh), &constraints).expect_err("a refusal");
    assert_eq!(error.code(), codes::CONSTRAINTS_DO_NOT_FIT);
    let fields = error.fields();
    assert_eq!(fields[0].pointer, "/holes/0/cut");
    assert!(
        fields[0].detail.contains("send the scan as a glTF"),
        "{}",
        fields[0].detail
    );
}
