//! Rims that touch themselves in a point: when welded, such a rim is one loop that visits a point more than once.

use std::collections::HashSet;

use darn_contract::Constraints;
use darn_geometry::mesh::loops::LoopKind;
use darn_geometry::mesh::{TriMesh, Vec3};

use super::cloth::{MendedScan, mended, packed};

/// A wavy sheet of squares of two triangles each: `#` has both, `/` only the lower one, `7` only the upper one, `.`
/// none.
fn sheet_of(rows: &[String]) -> TriMesh {
    let n = rows.len();
    let at = |k: usize| {
        let [u, v] = [k % (n + 1), k / (n + 1)].map(|x| x as f64 / n as f64);
        Vec3::new(u, v, 0.05 * (9.0 * u).sin() * (5.0 * v).cos())
    };
    let mut faces = Vec::new();
    for (j, row) in rows.iter().enumerate() {
        for (i, square) in row.chars().enumerate() {
            let a = (j * (n + 1) + i) as u32;
            let (b, c) = (a + 1, a + n as u32 + 1);
            if "#/".contains(square) {
                faces.push([a, b, c]);
            }
            if "#7".contains(square) {
                faces.push([b, c + 1, c]);
            }
        }
    }
    let whole = TriMesh {
        positions: (0..(n + 1) * (n + 1)).map(at).collect(),
        faces: Vec::new(),
    };
    whole.part(faces)
}

fn rows(of: &[&str]) -> Vec<String> {
    of.iter().map(|row| (*row).to_owned()).collect()
}

/// Two square holes that touch in a corner.
fn two_squares() -> Vec<String> {
    let sides = [4usize..9, 9..14];
    let hole = |i: usize, j: usize| sides.iter().any(|s| s.contains(&i) && s.contains(&j));
    let square = |i: usize, j: usize| if hole(i, j) { '.' } else { '#' };
    let row = |j: usize| (0..18).map(|i| square(i, j)).collect::<String>();
    (0..18).map(row).collect()
}

/// Mends a sheet and checks its triangles, by the positions of their corners: closed and manifold wherever there is a
/// patch.
fn mends_soundly(rows: &[String]) {
    let bytes = packed(&sheet_of(rows), &[]);
    let mended = mended(&bytes, &Constraints::default()).expect("a closed sheet");
    let seen = MendedScan::of(&mended.bytes);
    let surface = &seen.scan.surface;
    let place = |v: u32| {
        let p = surface.positions[v as usize];
        [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())
    };
    let (mut runs, mut new) = (HashSet::new(), Vec::new());
    for (f, face) in (0u32..).zip(&surface.faces) {
        let [a, b, c] = face.map(place);
        let apart = a != b && b != c && c != a;
        assert!(apart, "two corners of face {f} are in one place");
        let part = seen.scan.part_of_face(f).expect("a part");
        for run in [(a, b), (b, c), (c, a)] {
            assert!(runs.insert(run), "two faces run the same way along {run:?}");
            if seen.scan.parts[part].reconstructed {
                new.push(run);
            }
        }
    }
    assert!(!new.is_empty());
    for (a, b) in new {
        assert!(runs.contains(&(b, a)), "the patch is open at {a:?}");
    }
    assert!(seen.loops.iter().all(|l| l.kind != LoopKind::Hole));
}

#[test]
fn two_holes_that_touch_in_a_corner_are_closed() {
    mends_soundly(&two_squares());
}

#[test]
fn a_chain_of_holes_is_closed() {
    mends_soundly(&rows(&[
        "##########",
        "##########",
        "####.#####",
        "###.######",
        "##.##.####",
        "##.#.##.##",
        "#####.#.##",
        "##########",
        "##########",
        "##########",
    ]));
}

#[test]
fn holes_with_torn_squares_are_closed() {
    mends_soundly(&rows(&[
        "#######7###",
        "#7#########",
        "#####7#####",
        "##.7.##..##",
        "######.7###",
        "##########/",
        "##..####7##",
        "#######..##",
        "###.#######",
        "########/##",
        "#######7###",
    ]));
}
