//! What the editor draws of a border is what is mended: both are held to one file of stretches and hems.

use super::*;
use crate::testing::scan_of;
use darn_contract::port::HolesQuery;
use darn_geometry::mesh::shapes::{sheet, tube};
use darn_geometry::mesh::weld::weld;
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::sync::Arc;

/// A scan and a border that a request names.
struct Case {
    name: &'static str,
    mesh: TriMesh,
    border: Border,
}

impl Case {
    fn of(name: &'static str, mesh: TriMesh, border: Border) -> Case {
        Case { name, mesh, border }
    }

    /// The scan, the border, the stretches that are mended and the new hems; without those where the border is refused.
    fn told(&self) -> Value {
        let scan = scan_of(&self.mesh);
        let never = Budget::unlimited();
        let whole = WeldedScan::of(&scan, never).unwrap();
        let report = crate::find_holes(&scan, HolesQuery::default(), never).unwrap();
        let loops: Vec<Value> = (report.loops.iter())
            .map(|l| {
                let kind = serde_json::to_value(l).unwrap()["kind"].clone();
                let centroid: Vec<f64> = l.centroid.iter().map(|x| rounded(*x)).collect();
                let (turning, length) = (rounded(l.turning), rounded(l.length));
                json!({"id": l.id, "kind": kind, "turning": turning, "centroid": centroid, "length": length})
            })
            .collect();
        let [mut stretches, mut hems]: [Vec<Vec<[f64; 3]>>; 2] = Default::default();
        if let Ok(closings) = closings_of(&whole, &self.border, never).unwrap() {
            let [closing] = &closings[..] else {
                panic!("{}: {} closings", self.name, closings.len());
            };
            let each = closing.stretches().iter();
            stretches.extend(each.map(|s| s.places(&whole).map(place).collect()));
            let (mut used, mut surface) = (HemVertices::default(), TriMesh::default());
            for hem in closing.hems(&whole) {
                let line = hem.add_strip(&whole, &mut used, &mut surface).unwrap();
                hems.push(line.into_iter().map(place).collect());
            }
        }
        let positions: Vec<f32> = (self.mesh.positions.iter())
            .flat_map(|p| [p.x as f32, p.y as f32, p.z as f32])
            .collect();
        json!({
            "name": self.name, "positions": positions, "triangles": self.mesh.faces.concat(), "loops": loops,
            "border": message(&self.border), "stretches": stretches, "hems": hems,
        })
    }
}

fn message(border: &Border) -> Value {
    let ends = |edge: &TornEdge| json!({"from": edge.from, "to": edge.to});
    match border {
        Border::Auto => json!({"auto": true}),
        Border::Line { from, to, along } => json!({"from": from, "to": to, "along": along}),
        Border::Tear([own, facing]) => {
            json!({"from": own.from, "to": own.to, "along": [], "facing": ends(facing)})
        }
    }
}

fn place(p: Vec3) -> [f64; 3] {
    [p.x, p.y, p.z].map(rounded)
}

/// To 1e-5, so that a last bit of a sine, which machines do not share, is not seen.
fn rounded(x: f64) -> f64 {
    (x * 1e5).round() / 1e5 + 0.0
}

/// A folded sheet of so many squares a side without what `keep` leaves out; positions are multiples of 1/1024.
fn torn(squares: usize, keep: impl Fn(f64, f64) -> bool) -> TriMesh {
    let folded = sheet(squares, keep, |u, v| {
        Vec3::new(u, v, 0.03 * (9.0 * u).sin())
    });
    coarse(Arc::unwrap_or_clone(weld(&folded).mesh))
}

fn coarse(mut mesh: TriMesh) -> TriMesh {
    for p in &mut mesh.positions {
        *p = p.map(|x| (x * 1024.0).round() / 1024.0 + 0.0);
    }
    mesh
}

/// A bag of so many squares around with a round mouth at either end, ripped from the mouth on.
fn ripped_bag(squares: usize) -> TriMesh {
    let width = 1.0 / squares as f64;
    let keep = |u: f64, v: f64| (u - 0.5).abs() > width || v > 0.3;
    let mut mesh = Arc::unwrap_or_clone(weld(&tube(squares, keep)).mesh);
    for p in &mut mesh.positions {
        let polar = 0.8 + (PI - 1.6) * p.z / 4.0;
        *p = Vec3::new(p.x * polar.sin(), p.y * polar.sin(), -1.5 * polar.cos());
    }
    coarse(mesh)
}

fn line(from: [f64; 3], to: [f64; 3]) -> Border {
    let along = Vec::new();
    Border::Line { from, to, along }
}

fn tear(own: [[f64; 3]; 2], facing: [[f64; 3]; 2]) -> Border {
    Border::Tear([own, facing].map(|[from, to]| TornEdge { from, to }))
}

fn cases() -> Vec<Case> {
    let bitten = || torn(16, |u, v| (u - 0.5).hypot(v) > 0.2);
    // A small neck whose bite has a longer edge than what is left of the neck.
    let neck = torn(20, |u, v| {
        (u - 0.5).hypot(v - 0.25) > 0.11 && ((u - 0.5).abs() > 0.05 || !(0.25..0.85).contains(&v))
    });
    let rip = || torn(20, |u, v| (u - 0.5).abs() > 0.05 || v > 0.6);
    let halves = || torn(16, |u, _| (u - 0.5).abs() > 0.07);
    let mut turned = halves();
    for face in &mut turned.faces {
        if turned.positions[face[0] as usize].x > 0.5 {
            face.swap(1, 2);
        }
    }
    let tooth = |v: f64| 0.1 * f64::from((v * 20.0 / 3.0) as u32 % 2);
    let deep = torn(20, |u, v| {
        !(0.3 + tooth(v)..0.6 + tooth(v)).contains(&u) || v > 0.8
    });
    let tubes = coarse(Arc::unwrap_or_clone(
        weld(&tube(16, |_, v| (v - 0.5).abs() > 0.06)).mesh,
    ));
    let lip = |angle: f64| {
        let (sin, cos) = (PI + angle).sin_cos();
        let radius = 0.8_f64.sin();
        [radius * cos, radius * sin, -1.5 * 0.8_f64.cos()].map(rounded)
    };
    let joined = || {
        tear(
            [[0.44, 0.0, 0.0], [0.44, 1.0, 0.0]],
            [[0.56, 0.0, 0.0], [0.56, 1.0, 0.0]],
        )
    };
    vec![
        Case::of(
            "a bitten hem, its ends from right to left",
            bitten(),
            line([0.72, -0.02, 0.0], [0.28, 0.0, 0.0]),
        ),
        Case::of(
            "a bitten hem up to points",
            bitten(),
            Border::Line {
                from: [0.72, 0.0, 0.0],
                to: [0.28, 0.0, 0.0],
                along: vec![[0.6, 0.05, 0.0], [0.45, 0.07, 0.02]],
            },
        ),
        Case::of(
            "a bitten neck, the bite longer than the rest of it",
            neck,
            line([0.45, 0.35, 0.0], [0.55, 0.35, 0.0]),
        ),
        Case::of(
            "a ripped opening of a bag",
            ripped_bag(20),
            line(lip(-0.3), lip(0.3)),
        ),
        Case::of(
            "the lips of one rip",
            rip(),
            tear(
                [[0.45, 0.0, 0.0], [0.45, 0.6, 0.0]],
                [[0.55, 0.6, 0.0], [0.55, 0.0, 0.0]],
            ),
        ),
        Case::of(
            "the lips of one rip, the other way",
            rip(),
            tear(
                [[0.55, 0.0, 0.0], [0.55, 0.6, 0.0]],
                [[0.45, 0.0, 0.0], [0.45, 0.6, 0.0]],
            ),
        ),
        Case::of("cloth torn in two", halves(), joined()),
        Case::of("cloth torn in two, one piece turned over", turned, joined()),
        Case::of(
            "a rip longer than the rest of the edge",
            deep,
            line([0.3, 0.0, 0.0], [0.6, 0.0, 0.0]),
        ),
        Case::of(
            "an edge that faces itself",
            bitten(),
            tear(
                [[0.28, 0.0, 0.0], [0.72, 0.0, 0.0]],
                [[0.28, 0.0, 0.0], [0.72, 0.0, 0.0]],
            ),
        ),
        Case::of(
            "a tube torn in two",
            tubes,
            tear(
                [[1.0, 0.0, 1.7], [-1.0, 0.0, 1.7]],
                [[1.0, 0.0, 2.3], [-1.0, 0.0, 2.3]],
            ),
        ),
    ]
}

/// `DARN_BLESS=1` writes the file anew.
#[test]
fn the_editor_is_told_which_stretches_and_hems_are_mended() {
    let made: Vec<String> = cases().iter().map(|case| case.told().to_string()).collect();
    let made = format!("[\n{}\n]\n", made.join(",\n"));
    let path =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/tests/borders.json");
    if std::env::var_os("DARN_BLESS").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap();
    assert!(
        kept == made,
        "web/tests/borders.json is not what borders are mended as"
    );
}
