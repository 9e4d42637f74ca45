//! Laws that every mended scan obeys.

use darn_contract::Constraints;
use darn_geometry::mesh::loops::LoopKind;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_lab::scarffolds::holed_scan::HoleShape;
use darn_mend::{NetworkMender, mend};
use darn_net::Networks;
use nalgebra::Rotation3;

use super::cloth::{
    MendedScan, ROUND, WEIGHTS, area, holed, laid, mended, network, packed, read, sheet,
};

fn holes() -> [HoleShape; 3] {
    let centre = Vec2::new(0.47, 0.52);
    [
        ROUND,
        HoleShape::Blob {
            centre,
            radius: 0.15,
        },
        HoleShape::Slit {
            centre,
            length: 0.22,
            width: 0.045,
            angle: 0.8,
        },
    ]
}

#[test]
fn holes_of_every_shape_close_and_the_outer_boundary_stays() {
    for (k, hole) in holes().iter().enumerate() {
        let cut = holed(sheet(k), hole);
        let before = MendedScan::of(&packed(&cut.mesh, &[]));
        let mended = mended(&packed(&cut.mesh, &[]), &Constraints::default()).unwrap();
        let after = MendedScan::of(&mended.bytes);

        let kinds: Vec<LoopKind> = after.loops.iter().map(|l| l.kind).collect();
        assert_eq!(kinds, [LoopKind::Outer], "sheet {k}");
        assert!(after.topology.non_manifold.is_empty(), "sheet {k}");
        let kept = after.welded.mesh.faces.len() - after.patch.len();
        assert_eq!(kept, before.welded.mesh.faces.len(), "sheet {k}");
        let share = after.patch_area() / area(&cut.lost);
        assert!((0.85..1.15).contains(&share), "sheet {k}: area {share}");

        let report = &mended.report.holes[0];
        assert_eq!(report.chart.unwrap().flips, 0);
        assert_eq!(report.patch.as_ref().unwrap().seam_gap, 0.0);
        assert_eq!(
            report.patch.as_ref().unwrap().faces as usize,
            after.patch.len()
        );
    }
}

#[test]
fn a_flat_sheet_gets_a_flat_patch_of_the_lost_area() {
    let cut = holed(&laid(|u, v| [u, 0.25, -v]), &ROUND);
    let after = MendedScan::of(
        &mended(&packed(&cut.mesh, &[]), &Constraints::default())
            .unwrap()
            .bytes,
    );
    for p in after.new_positions() {
        assert!((p.y - 0.25).abs() < 2e-3, "{p:?}");
    }
    let share = after.patch_area() / area(&cut.lost);
    assert!((share - 1.0).abs() < 2e-3, "{share}");
}

#[test]
fn the_patch_of_a_cylinder_lies_on_the_cylinder() {
    let radius = 0.4;
    let cut = holed(
        &laid(|u, v| [radius * (u / radius).sin(), v, radius * (u / radius).cos()]),
        &ROUND,
    );
    let after = MendedScan::of(
        &mended(&packed(&cut.mesh, &[]), &Constraints::default())
            .unwrap()
            .bytes,
    );
    let off: Vec<f64> = after
        .new_positions()
        .iter()
        .map(|p| (p.x.hypot(p.z) - f64::from(radius)).abs())
        .collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    // The hole is 0.26 wide and bulges 0.021 out of its rim's plane.
    assert!(mean < 0.004, "{mean}");
}

#[test]
fn smooth_cloth_that_does_not_lie_flat_gets_no_folds() {
    let surfaces: [fn(f32, f32) -> f32; 3] = [
        |x, y| 1.2 * (x * x - y * y),
        |x, y| (0.8 - x * x - y * y).sqrt(),
        |x, y| 0.3 * (4.0 * x).tanh() * (1.6 * y).cos(),
    ];
    for (k, surface) in surfaces.iter().enumerate() {
        for hole in holes() {
            let cut = holed(&laid(|u, v| [u, v, surface(u - 0.5, v - 0.5)]), &hole);
            let mended = mended(&packed(&cut.mesh, &[]), &Constraints::default()).unwrap();
            let after = MendedScan::of(&mended.bytes);
            let off =
                |p: &Vec3| (p.z - f64::from(surface(p.x as f32 - 0.5, p.y as f32 - 0.5))).abs();
            let off: Vec<f64> = after.new_positions().iter().map(off).collect();
            let mean = off.iter().sum::<f64>() / off.len() as f64;
            assert!(mean < 0.001, "surface {k}, {hole:?}: {mean}");
        }
    }
}

#[test]
fn the_folds_of_draped_cloth_go_on() {
    for (k, hole) in holes().iter().enumerate() {
        let cut = holed(sheet(k), hole);
        let mended = mended(&packed(&cut.mesh, &[]), &Constraints::default()).unwrap();
        let patch = mended.report.holes[0].patch.as_ref().unwrap();
        assert!(patch.network_share > 0.9, "{k}: {}", patch.network_share);
    }
}

#[test]
fn the_same_scan_gives_the_same_bytes() {
    let bytes = packed(&holed(sheet(1), &ROUND).mesh, &[]);
    let once = mended(&bytes, &Constraints::default()).unwrap().bytes;
    let again = mended(&bytes, &Constraints::default()).unwrap().bytes;
    assert!(once == again);
}

#[test]
fn a_scan_that_is_turned_together_with_up_gets_the_same_patch_turned() {
    let gravity = network(include_bytes!("../../weights/gravity.safetensors"));
    let mender = NetworkMender::new(Networks::new(network(WEIGHTS), vec![gravity]));
    let hanging = holed(sheet(1), &ROUND).mesh;
    let new_positions = |turn: Rotation3<f64>, up: Vec3| {
        let mesh = TriMesh {
            positions: hanging.positions.iter().map(|p| turn * p).collect(),
            faces: hanging.faces.clone(),
        };
        let asked = Constraints {
            up: Some(up.into()),
            ..Constraints::default()
        };
        let mended = mend(&read(&packed(&mesh, &[])), &asked, &mender).unwrap();
        let weights = mended.report.weights.unwrap();
        assert_eq!(weights.name, "gravity");
        assert_eq!(mended.report.notes, [""; 0]);
        let new = MendedScan::of(&mended.bytes).new_positions();
        let back: Vec<Vec3> = new.iter().map(|p| turn.inverse() * p).collect();
        back
    };
    let apart = |a: &[Vec3], b: &[Vec3]| {
        assert_eq!(a.len(), b.len());
        let each = a.iter().zip(b).map(|(a, b)| (a - b).norm());
        each.fold(0.0, f64::max)
    };
    let turn = Rotation3::from_euler_angles(0.4, -0.9, 2.0);
    let (upright, tilted, sideways) = (
        new_positions(Rotation3::identity(), Vec3::z()),
        new_positions(turn, turn * Vec3::z()),
        new_positions(Rotation3::identity(), Vec3::x()),
    );
    // The effect of up is small; turned together with the cloth, up gives the same patch.
    let [turned, told] = [&tilted, &sideways].map(|other| apart(&upright, other));
    assert!(told > 1.0e-4, "{told}");
    assert!(turned < 0.2 * told, "{turned}, {told}");
}

#[test]
fn texture_coordinates_continue_through_the_patch() {
    let cut = holed(sheet(0), &ROUND);
    let rest: Vec<[f32; 2]> = cut.rest.iter().map(|p| [p.x as f32, p.y as f32]).collect();
    let after = MendedScan::of(
        &mended(&packed(&cut.mesh, &rest), &Constraints::default())
            .unwrap()
            .bytes,
    );
    let part = after.scan.parts.iter().find(|p| p.reconstructed).unwrap();
    let HoleShape::Circle { centre, radius } = ROUND else {
        unreachable!()
    };
    let mut inside = 0;
    for uv in part.texcoords[0].iter() {
        let away = (Vec2::new(uv[0].into(), uv[1].into()) - centre).norm();
        assert!(away < radius + 0.06, "{uv:?} is outside the hole");
        inside += usize::from(away < radius * 0.5);
    }
    // The middle of the hole has texture coordinates, too: about a quarter of the vertices.
    assert!(inside * 10 > part.texcoords[0].len(), "{inside}");
}

#[test]
fn a_texture_seam_continues_through_the_patch() {
    let cut = holed(sheet(1), &ROUND);
    // Right of the middle the texture is a second island, mirrored; vertices on the border between the islands are
    // doubled.
    let mut mesh = cut.mesh.clone();
    let mut texture: Vec<[f32; 2]> = (cut.rest.iter())
        .map(|p| [0.4 * p.x as f32, p.y as f32])
        .collect();
    let mut twin = std::collections::BTreeMap::new();
    for face in &mut mesh.faces {
        let middle: f64 = face.iter().map(|v| cut.rest[*v as usize].x).sum::<f64>() / 3.0;
        if middle > 0.5 {
            *face = face.map(|v| {
                *twin.entry(v).or_insert_with(|| {
                    let rest = cut.rest[v as usize];
                    mesh.positions.push(cut.mesh.positions[v as usize]);
                    texture.push([1.0 - 0.4 * rest.x as f32, rest.y as f32]);
                    mesh.positions.len() as u32 - 1
                })
            });
        }
    }
    let mended = mended(&packed(&mesh, &texture), &Constraints::default()).unwrap();
    let after = MendedScan::of(&mended.bytes);
    assert_eq!(after.loops.len(), 1);
    let part = after.scan.parts.iter().find(|p| p.reconstructed).unwrap();
    let uv = |v: u32| part.texcoords[0][(v - part.vertices.start) as usize];
    let faces = part.faces.start as usize..part.faces.end as usize;
    for face in &after.scan.surface.faces[faces] {
        for k in 0..3 {
            let (a, b) = (uv(face[k]), uv(face[(k + 1) % 3]));
            let smeared = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
            assert!(smeared < 0.1, "a triangle spans two islands: {a:?} {b:?}");
        }
    }
}

#[test]
fn a_mended_scan_has_no_holes() {
    let first = mended(
        &packed(&holed(sheet(2), &ROUND).mesh, &[]),
        &Constraints::default(),
    )
    .unwrap();
    let second = mended(&first.bytes, &Constraints::default()).unwrap_err();
    assert_eq!(second.code().word, "no_holes");
}
