//! Laws of how openings are told from holes.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::index::FaceId;
use super::loops::{BoundaryLoop, LoopKind, boundary_loops};
use super::openings::{Evidence, PRIOR, SUREST};
use super::pairing::Paired;
use super::shapes::{jitter, sheet, tube};
use super::topology::Topology;
use super::weld::weld;
use super::{TriMesh, Vec3};

fn loops_of(soup: &TriMesh) -> Vec<BoundaryLoop> {
    let welded = weld(soup);
    boundary_loops(&welded.mesh, &welded.topology())
}

fn placed(mesh: TriMesh, place: impl Fn(&Vec3) -> Vec3) -> TriMesh {
    TriMesh {
        positions: mesh.positions.iter().map(place).collect(),
        faces: mesh.faces,
    }
}

/// A sphere with a smooth mouth at either pole, each `mouth` radians wide from the pole, and a torn hole in its side.
fn lantern(n: usize, mouth: f64, hole: f64) -> TriMesh {
    let torn = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > hole;
    placed(tube(n, torn), |p| {
        let polar = mouth + (PI - 2.0 * mouth) * p.z / 4.0;
        Vec3::new(p.x * polar.sin(), p.y * polar.sin(), -polar.cos())
    })
}

/// A flat ring: a simple sheet with a smooth round hole.
fn ring(n: usize, hole: f64) -> TriMesh {
    placed(tube(n, |_, _| true), |p| {
        let r = hole + (1.0 - hole) * (1.0 - p.z / 4.0);
        Vec3::new(p.x * r, p.y * r, 0.0)
    })
}

/// A bag with a wide mouth at either end: what its edges look like is left to `worn`.
fn bag(n: usize, mouth: f64, worn: impl Fn(f64, f64) -> bool) -> TriMesh {
    placed(tube(n, worn), |p| {
        let polar = mouth + (PI - 2.0 * mouth) * p.z / 4.0;
        Vec3::new(p.x * polar.sin(), p.y * polar.sin(), -1.5 * polar.cos())
    })
}

/// Without half of the triangles at the boundary, as reconstructions trim it; in one piece.
fn trimmed(soup: &TriMesh, seed: u64) -> TriMesh {
    let mut mesh = Arc::unwrap_or_clone(weld(soup).mesh);
    let boundary = Topology::new(&mesh).boundary_vertices();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    mesh.faces.retain(|f| {
        let inside = f.iter().all(|v| !boundary[*v as usize]);
        inside || rng.random_bool(0.5)
    });
    // What hangs on by a corner alone is no part of it.
    let topology = Topology::new(&mesh);
    let mut faces = vec![0usize; topology.components];
    let piece = |f: usize| topology.component(FaceId(f as u32));
    (0..mesh.faces.len()).for_each(|f| faces[piece(f) as usize] += 1);
    let largest = (0..faces.len()).max_by_key(|c| faces[*c]).expect("a piece") as u32;
    let kept = (0..mesh.faces.len()).filter(|f| piece(*f) == largest);
    mesh.faces = kept.map(|f| mesh.faces[f]).collect();
    mesh
}

/// Every vertex moved to the middle of its neighbours, at the boundary of its neighbours along it, `rounds` times: as meshes are smoothed
/// before they are handed on.
fn smoothed(soup: &TriMesh, rounds: usize) -> TriMesh {
    let mut mesh = Arc::unwrap_or_clone(weld(soup).mesh);
    let topology = Topology::new(&mesh);
    let boundary = topology.boundary_vertices();
    for _ in 0..rounds {
        let mut sums = vec![(Vec3::zeros(), 0.0); mesh.positions.len()];
        for f in &mesh.faces {
            for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
                for (from, to) in [(a as usize, b as usize), (b as usize, a as usize)] {
                    if !boundary[from] {
                        sums[from].0 += mesh.positions[to];
                        sums[from].1 += 1.0;
                    }
                }
            }
        }
        for h in topology.boundary() {
            let (a, b) = (topology.origin(h).index(), topology.target(h).index());
            for (from, to) in [(a, b), (b, a)] {
                sums[from].0 += mesh.positions[to];
                sums[from].1 += 1.0;
            }
        }
        for (p, (sum, count)) in mesh.positions.iter_mut().zip(sums) {
            *p = sum / count;
        }
    }
    mesh
}

/// The kinds of the loops with more vertices than crumbs have.
fn kinds(soup: &TriMesh) -> Vec<LoopKind> {
    let loops = loops_of(soup);
    let large = loops.iter().filter(|l| l.vertices.len() > 12);
    large.map(|l| l.kind).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn trimmed_and_noisy_mouths_are_no_holes(n in 36usize..60, mouth in 0.7..1.0f64, noise in 0.0..0.3f64, seed: u64) {
        let bag = bag(n, mouth, |_, _| true);
        let edge = TAU * mouth.sin() / n as f64;
        for soup in [trimmed(&bag, seed), jitter(&bag, noise * edge, seed)] {
            let found = kinds(&soup);
            prop_assert!(found.len() == 2 && !found.contains(&LoopKind::Hole), "{:?}", found);
        }
    }

    #[test]
    fn a_large_lobed_hole_of_a_trimmed_bag_is_a_hole(n in 48usize..70, mouth in 0.7..1.0f64, radius in 0.15..0.22f64, lobes in 0.15..0.3f64, seed: u64) {
        let hole = |u: f64, v: f64| {
            let angle = (v - 0.5).atan2(u - 0.5);
            (u - 0.5).hypot(v - 0.5) > radius * (1.0 + lobes * (3.0 * angle).sin() + 0.5 * lobes * (7.0 * angle).cos())
        };
        let mut found = kinds(&trimmed(&bag(n, mouth, hole), seed));
        found.sort_unstable_by_key(|k| *k != LoopKind::Hole);
        prop_assert!(found.len() == 3 && found[0] == LoopKind::Hole && !found[1..].contains(&LoopKind::Hole), "{:?}", found);
    }

    #[test]
    fn a_torn_end_of_a_tube_is_in_doubt(n in 24usize..60, depth in 0.05..0.15f64, seed: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let ends: Vec<f64> = (0..n).map(|_| depth * rng.random_range(0.0..1.0)).collect();
        let torn = |u: f64, v: f64| v > ends[(u * n as f64) as usize % n];
        let loops = loops_of(&tube(n, torn));
        let doubtful = |l: &BoundaryLoop| l.confidence < 1.0 && l.evidence.iter().any(Evidence::is_torn_rim);
        let mut found: Vec<(LoopKind, bool)> = (loops.iter().filter(|l| l.vertices.len() > 12)).map(|l| (l.kind, doubtful(l))).collect();
        found.sort_unstable_by_key(|f| f.1);
        prop_assert_eq!(found, [(LoopKind::TubeEnd, false), (LoopKind::TubeEnd, true)]);
    }

    #[test]
    fn a_mouth_with_one_rip_is_no_hole(n in 36usize..60, mouth in 0.7..1.0f64, depth in 0.1..0.35f64, at in 0.1..0.9f64) {
        let rip = |u: f64, v: f64| (u - at).abs() * n as f64 > 1.0 || v > depth;
        let found = kinds(&bag(n, mouth, rip));
        prop_assert!(found.len() == 2 && !found.contains(&LoopKind::Hole), "{:?}", found);
    }

    #[test]
    fn smoothed_holes_in_a_sheet_are_holes(n in 50usize..80, lobes in 0.0..0.3f64, rounds in 0usize..8, seed: u64) {
        let centres = [(0.25, 0.25, 0.09), (0.7, 0.3, 0.07), (0.3, 0.75, 0.08), (0.72, 0.72, 0.1)];
        let keep = |u: f64, v: f64| centres.iter().all(|(x, y, r)| {
            let angle = (v - y).atan2(u - x);
            (u - x).hypot(v - y) > r * (1.0 + lobes * (5.0 * angle + 9.0 * x).sin())
        });
        let place = |u: f64, v: f64| Vec3::new(u, v, 0.05 * (6.0 * u).sin() * (3.0 * v).cos());
        let soup = smoothed(&jitter(&sheet(n, keep, place), 0.1 / n as f64, seed), rounds);
        let mut found = kinds(&soup);
        found.sort_unstable_by_key(|k| *k == LoopKind::Hole);
        prop_assert_eq!(found, [LoopKind::Outer, LoopKind::Hole, LoopKind::Hole, LoopKind::Hole, LoopKind::Hole]);
    }

    // On coarser spheres the vertices of the torn rim themselves hold so much of the curvature that it turns like a tube's end.
    #[test]
    fn smooth_mouths_are_openings_and_a_torn_hole_is_a_hole(n in 26usize..50, mouth in 0.3..0.9f64, hole in 0.1..0.2f64, noise in 0.0..0.03f64) {
        let mut found: Vec<(LoopKind, bool)> = loops_of(&jitter(&lantern(n, mouth, hole), noise / n as f64, 3))
            .iter()
            .map(|l| (l.kind, l.confidence > 0.7))
            .collect();
        found.sort_unstable_by_key(|f| f.0 == LoopKind::Opening);
        prop_assert_eq!(found, [(LoopKind::Hole, true), (LoopKind::Opening, true), (LoopKind::Opening, true)]);
    }

    #[test]
    fn a_smooth_hole_in_a_simple_sheet_is_a_hole(n in 12usize..60, hole in 0.1..0.6f64) {
        let loops = loops_of(&ring(n, hole));
        let hole = loops.iter().find(|l| l.turning < 0.0).expect("a hole");
        prop_assert_eq!(hole.kind, LoopKind::Hole, "{:?}", hole.evidence);
    }

    #[test]
    fn a_small_smooth_hole_is_a_hole(n in 30usize..60, noise in 0.0..0.02f64) {
        let pinhole = 0.02;
        let soup = jitter(&lantern(n, pinhole, -1.0), noise * pinhole / n as f64, 5);
        let kinds: Vec<LoopKind> = loops_of(&soup).iter().map(|l| l.kind).collect();
        prop_assert_eq!(kinds, [LoopKind::Hole, LoopKind::Hole]);
    }
}

#[test]
fn a_window_with_straight_sides_is_a_hole() {
    let window = |u: f64, v: f64| (u - 0.5).abs() > 0.4 || (v - 0.5).abs() > 0.15;
    let loops = loops_of(&tube(60, window));
    let rim = loops.iter().find(|l| l.turning < -PI).expect("a hole");
    assert_eq!(rim.kind, LoopKind::Hole, "{:?}", rim.evidence);
}

#[test]
fn the_weights_make_the_confidence() {
    for l in loops_of(&lantern(24, 0.5, 0.15)) {
        let odds = PRIOR + l.evidence.iter().map(|e| e.weight).sum::<f64>();
        let odds = odds.clamp(-SUREST, SUREST);
        let opening = 1.0 / (1.0 + (-odds).exp());
        let expected = if l.kind == LoopKind::Opening {
            opening
        } else {
            1.0 - opening
        };
        assert!((l.confidence - expected).abs() < 1e-12);
        assert!(l.evidence.iter().all(|e| !e.reason().is_empty()));
    }
}

#[test]
fn the_diameter_is_the_largest_width() {
    let loops = loops_of(&ring(40, 0.25));
    let mut widths: Vec<f64> = loops.iter().map(|l| l.diameter).collect();
    widths.sort_unstable_by(f64::total_cmp);
    assert!(
        (widths[0] - 0.5).abs() < 0.01 && (widths[1] - 2.0).abs() < 0.01,
        "{widths:?}"
    );
}
