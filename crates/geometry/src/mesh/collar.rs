//! The turning a boundary loop is judged by, measured where noise and folds do not reach.

use super::curvature::angle_defect;
use super::loops::turning;
use super::topology::{NONE, Topology, previous};
use super::{TriMesh, Vec3};

/// How often positions are averaged before the turning of a rough edge is measured.
const SMOOTHING: usize = 4;
/// The first and the last ring of vertices along a loop whose curves its turning is averaged over.
const COLLAR: (usize, usize) = (2, 3);
/// Radians of angle defect in the first ring below which the bare edge is believed.
const CALM: f64 = 1.0;

/// Per loop the turning to judge it by; see [`boundary_loops`](super::loops::boundary_loops). A vertex as many rings from two loops counts for neither.
pub(super) fn collar_turnings(
    mesh: &TriMesh,
    topology: &Topology,
    cycles: &[Vec<u32>],
) -> Vec<f64> {
    let edge: Vec<(u32, u32)> = (0u32..)
        .zip(cycles)
        .flat_map(|(l, cycle)| cycle.iter().map(move |&h| (topology.from(h), l)))
        .collect();
    let mut roughness = vec![0.0; cycles.len()];
    for &(v, l) in rings(topology, &edge, 1).iter().skip(1).flatten() {
        if let Some(sum) = roughness.get_mut(l as usize) {
            *sum += angle_defect(mesh, topology, v).abs();
        }
    }
    let calm = |l: usize| roughness[l] < CALM;
    let smooth = if (0..cycles.len()).all(calm) {
        Vec::new()
    } else {
        smooth_turnings(mesh, topology, cycles, &edge)
    };
    (0..cycles.len())
        .map(|l| match smooth.get(l) {
            Some(&turning) if !calm(l) => turning,
            _ => turning(mesh, topology, &cycles[l]),
        })
        .collect()
}

/// Per loop the mean turning of the curves behind it, on smoothed cloth; `edge` holds all boundary vertices and their loops.
fn smooth_turnings(
    mesh: &TriMesh,
    topology: &Topology,
    cycles: &[Vec<u32>],
    edge: &[(u32, u32)],
) -> Vec<f64> {
    let (first, last) = COLLAR;
    // What is smoothed SMOOTHING times is right as many rings from the last one that moves, and angles need one ring more.
    let rings = rings(topology, edge, SMOOTHING + last);
    let near: Vec<u32> = rings.iter().flatten().map(|claim| claim.0).collect();
    let smooth = smoothed(mesh, topology, &near);
    let mut collar: Vec<f64> = cycles
        .iter()
        .map(|c| turning(&smooth, topology, c))
        .collect();
    for (depth, ring) in rings.iter().enumerate().skip(1).take(last) {
        // The share of the curves that this ring lies on or in front of.
        let weight = (last + 1 - depth.max(first)) as f64 / (last + 1 - first) as f64;
        for &(v, l) in ring {
            if let Some(turning) = collar.get_mut(l as usize) {
                *turning += weight * angle_defect(&smooth, topology, v);
            }
        }
    }
    collar
}

/// The vertices 0, 1, … `last` rings from the `edge`, each ascending and with the loop it is nearest to, [`NONE`] when two are as near.
fn rings(topology: &Topology, edge: &[(u32, u32)], last: usize) -> Vec<Vec<(u32, u32)>> {
    let mut seen = vec![false; topology.vertices()];
    let mut rings = vec![edge.to_vec()];
    edge.iter().for_each(|claim| seen[claim.0 as usize] = true);
    for depth in 0..last {
        let mut claims: Vec<(u32, u32)> = Vec::new();
        for &(v, l) in &rings[depth] {
            let around = topology.leaving(v).iter();
            let around = around.flat_map(|&h| [topology.to(h), topology.from(previous(h))]);
            claims.extend(around.filter(|&n| !seen[n as usize]).map(|n| (n, l)));
        }
        claims.sort_unstable();
        claims.dedup();
        let ring: Vec<(u32, u32)> = claims
            .chunk_by(|a, b| a.0 == b.0)
            .map(|group| (group[0].0, if group.len() == 1 { group[0].1 } else { NONE }))
            .collect();
        ring.iter().for_each(|claim| seen[claim.0 as usize] = true);
        rings.push(ring);
    }
    rings
}

/// The mesh with the vertices `near` the boundary averaged [`SMOOTHING`] times with their neighbours: boundary vertices along the
/// boundary only, so that loops stay loops.
fn smoothed(mesh: &TriMesh, topology: &Topology, near: &[u32]) -> TriMesh {
    // The neighbours of every vertex in one list, each up to the end named for it.
    let (mut averaged, mut ends) = (Vec::new(), Vec::with_capacity(near.len()));
    for &v in near {
        let start = averaged.len();
        for &h in topology.leaving(v) {
            let back = previous(h);
            let open = |h: u32| topology.twin[h as usize] == NONE;
            averaged.extend(open(h).then(|| topology.to(h)));
            averaged.extend(open(back).then(|| topology.from(back)));
        }
        if averaged.len() == start {
            averaged.extend(topology.neighbours(v));
        }
        ends.push(averaged.len());
    }
    let mut out = mesh.clone();
    let mut moved = Vec::with_capacity(near.len());
    for _ in 0..SMOOTHING {
        let mut start = 0;
        for (&v, &end) in near.iter().zip(&ends) {
            let ring = &averaged[start..end];
            let sum: Vec3 = ring.iter().map(|&n| out.positions[n as usize]).sum();
            moved.push((out.positions[v as usize] + sum / ring.len() as f64) * 0.5);
            start = end;
        }
        for (&v, p) in near.iter().zip(moved.drain(..)) {
            out.positions[v as usize] = p;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use proptest::prelude::*;

    use super::*;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::shapes::{shaken, sheet};
    use crate::mesh::weld::weld;

    fn kinds(soup: &TriMesh) -> Vec<LoopKind> {
        let mesh = weld(soup).mesh;
        let loops = boundary_loops(&mesh, &Topology::new(&mesh));
        loops.iter().map(|l| l.kind).collect()
    }

    /// A square of 1.4 with a round hole, turned by `angle` (so that its edges are stairs) and folded along y.
    fn folded(angle: f64, fold: impl Fn(f64) -> f64) -> TriMesh {
        let (sin, cos) = angle.sin_cos();
        let keep = move |u: f64, v: f64| {
            let (x, y) = (u - 0.5, v - 0.5);
            let (a, b) = (cos * x - sin * y, sin * x + cos * y);
            a.hypot(b) > 0.14 && a.abs().max(b.abs()) < 0.35
        };
        sheet(70, keep, |u, v| {
            Vec3::new(1.4 * u, 1.4 * v, fold(1.4 * u - 0.7))
        })
    }

    /// One loop around the middle is a hole, and what is not it is an outer boundary.
    fn one_hole(soup: &TriMesh) -> bool {
        let found = kinds(soup);
        let holes = found.iter().filter(|&&k| k == LoopKind::Hole).count();
        let outer = found.iter().filter(|&&k| k == LoopKind::Outer).count();
        holes == 1 && outer == found.len() - 1
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn folds_do_not_change_what_a_loop_is(
            angle in 0.0..PI,
            depth in 0.0..0.3f64,
            k in 5.0..50.0f64,
            phase in 0.0..TAU,
            noise in prop_oneof![Just(0.0), 0.0..0.1f64],
            seed: u64,
        ) {
            let soup = folded(angle, |x| depth * (k * x + phase).sin());
            prop_assert!(one_hole(&shaken(&soup, 0.02 * noise, seed)));
        }
    }

    #[test]
    fn a_sharply_folded_sheet_is_no_hole() {
        for (depth, k) in [(0.08, 40.0), (0.12, 40.0), (0.25, 40.0), (0.3, 50.0)] {
            let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
            let soup = sheet(60, keep, |u, v| Vec3::new(u, v, depth * f64::sin(k * u)));
            for noise in [0.0, 0.1, 0.3] {
                let found = kinds(&shaken(&soup, noise / 60.0, 7));
                assert_eq!(found, [LoopKind::Outer, LoopKind::Hole], "{depth} {k}");
            }
        }
    }

    #[test]
    fn the_mouth_of_a_small_hole_in_a_coarse_ball_is_a_hole() {
        let mut ball = sheet(
            12,
            |_, _| true,
            |u, v| {
                let (long, lat) = (if u == 1.0 { 0.0 } else { TAU * u }, PI * v);
                Vec3::new(
                    lat.sin() * long.cos(),
                    lat.sin() * long.sin(),
                    if v == 1.0 { -1.0 } else { lat.cos() },
                )
            },
        );
        ball.faces.drain(150..152);
        let found = kinds(&ball);
        assert!(found.contains(&LoopKind::Hole), "{found:?}");
    }
}
