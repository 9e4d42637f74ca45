//! Fair patches against surfaces with a known answer.

use std::f64::consts::{PI, TAU};

use darn_budget::Budget;

use super::*;
use crate::flatten::{FlattenLimits, flatten};
use crate::mesh::index::LoopId;
use crate::mesh::loops::{BoundaryLoop, boundary_loops};
use crate::mesh::region::{BoundedMesh, collar, region_around_hole};
use crate::mesh::shapes::{sheet, tube};
use crate::mesh::topology::Topology;
use crate::mesh::weld::weld;
use crate::patch::{PatchOptions, plan};

/// The fair patch of the loop that `chosen` likes best, largest first.
fn patched(soup: &TriMesh, chosen: impl Fn(&BoundaryLoop) -> f64) -> Patch {
    let mesh = weld(soup).mesh;
    let topology = Topology::new(&mesh);
    let loops = boundary_loops(&mesh, &topology);
    let whole = BoundedMesh {
        mesh: &mesh,
        topology: &topology,
        loops: &loops,
    };
    let best = |a: &&BoundaryLoop, b: &&BoundaryLoop| chosen(a).total_cmp(&chosen(b));
    let rim: LoopId = loops.iter().max_by(best).expect("a loop").id;
    let region = collar(&whole, rim, 0.0, Budget::unlimited()).expect("a collar");
    let fair =
        FairPatch::new(&region, Fairness::Curved, &PatchOptions::default()).expect("a patch");
    let fair = fair.clear_of(
        &Layers::default(),
        0.0,
        Untangling::Always,
        Budget::unlimited(),
    );
    let patch = fair.expect("no limits").patch;
    for (v, p) in patch.rim.iter().zip(&patch.positions) {
        assert_eq!(*p, region.mesh.positions[*v as usize]);
    }
    let inner = patch.positions.len() - patch.rim.len();
    assert_eq!(patch.faces.len(), patch.rim.len() - 2 + 2 * inner, "a disk");
    patch
}

/// A grid of squares over longitude and latitude of the unit sphere, from the south pole's ring up to the angle `cap`
/// (radians) from the north pole.
fn open_sphere(n: usize, cap: f64) -> TriMesh {
    sheet(
        n,
        |_, _| true,
        |u, v| {
            let (longitude, polar) = (
                if u == 1.0 { 0.0 } else { TAU * u },
                PI - 0.05 - v * (PI - 0.05 - cap),
            );
            Vec3::new(
                longitude.cos() * polar.sin(),
                longitude.sin() * polar.sin(),
                polar.cos(),
            )
        },
    )
}

/// The largest distance of the patch's vertices from a surface, given as the distance of a point from it.
fn off(patch: &Patch, distance: impl Fn(&Vec3) -> f64) -> f64 {
    patch
        .positions
        .iter()
        .map(|p| distance(p).abs())
        .fold(0.0, f64::max)
}

#[test]
fn a_cap_of_a_sphere_comes_back() {
    for cap in [0.3, 0.8, 1.2] {
        let patch = patched(&open_sphere(48, cap), |l| l.centroid.z);
        let off = off(&patch, |p| p.norm() - 1.0);
        assert!(off < 0.01, "{cap}: {off}");
        assert_eq!(patch.crossings, 0);
    }
}

#[test]
fn the_side_of_a_tube_comes_back_round() {
    // Fifteen to ninety per cent of the circumference.
    for share in [0.15, 0.35, 0.6, 0.9] {
        let keep = |u: f64, v: f64| (u - 0.5).abs() > 0.5 * share || (v - 0.5).abs() > 0.15;
        let patch = patched(&tube(48, keep), |l| -l.turning);
        let off = off(&patch, |p| p.xy().norm() - 1.0);
        assert!(off < 0.02, "{share}: {off}");
        assert_eq!(patch.crossings, 0);
    }
}

#[test]
fn a_hole_in_a_saddle_comes_back() {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
    let height = |x: f64, y: f64| 0.8 * ((x - 0.5).powi(2) - (y - 0.5).powi(2));
    let saddle = sheet(40, keep, |u, v| Vec3::new(u, v, height(u, v)));
    let patch = patched(&saddle, |l| -l.turning);
    let off = off(&patch, |p| p.z - height(p.x, p.y));
    assert!(off < 0.002, "{off}");
}

#[test]
fn a_flat_hole_is_closed_flat() {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2 || (u > 0.45 && v > 0.45);
    let flat = sheet(40, keep, |u, v| Vec3::new(u, v, 0.0));
    let patch = patched(&flat, |l| -l.turning);
    assert!(off(&patch, |p| p.z) < 1e-9);
    let upwards = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|v| patch.positions[v as usize]);
        (b - a).cross(&(c - a)).z > 0.0
    };
    assert!(patch.faces.iter().all(upwards));
}

#[test]
fn the_end_of_a_tube_is_capped_smoothly() {
    let patch = patched(&tube(40, |_, v| v < 0.5), |l| l.centroid.z);
    assert!(
        patch
            .positions
            .iter()
            .all(|p| p.xy().norm() < 1.05 && p.z > 1.95 && p.z < 3.5)
    );
    let top = patch.positions.iter().map(|p| p.z).fold(0.0, f64::max);
    assert!(top > 2.2, "{top}");
    assert_eq!(patch.crossings, 0);
}

/// The layout of the largest loop's patch with the cloth that is not farther from it than `reach`.
fn laid_out(soup: &TriMesh, reach: f64) -> Option<FairLayout> {
    let mesh = weld(soup).mesh;
    let topology = Topology::new(&mesh);
    let loops = boundary_loops(&mesh, &topology);
    let whole = BoundedMesh {
        mesh: &mesh,
        topology: &topology,
        loops: &loops,
    };
    let chosen = |l: &&BoundaryLoop| l.centroid.z;
    let best = loops.iter().max_by(|a, b| chosen(a).total_cmp(&chosen(b)));
    let rim = best.expect("a loop").id;
    let never = Budget::unlimited();
    let narrow = collar(&whole, rim, 0.0, never).expect("a collar");
    let patch = FairPatch::new(&narrow, Fairness::Curved, &PatchOptions::default());
    let patch = patch.expect("a patch").patch;
    let region = collar(&whole, rim, reach, never).expect("a collar");
    let layout = FairLayout::of(&patch, &region, 1.0, &FlattenLimits::default(), never);
    let layout = layout.expect("no limits")?;
    assert_eq!(layout.region.flat.len(), region.mesh.positions.len());
    assert_eq!(layout.patch.len(), patch.positions.len());
    let rim = region
        .rim
        .iter()
        .rev()
        .map(|v| layout.region.flat[*v as usize]);
    assert!(rim.eq(layout.patch[..patch.rim.len()].iter().copied()));
    for face in &patch.faces {
        let [a, b, c] = face.map(|v| layout.patch[v as usize]);
        assert!((b - a).perp(&(c - a)) > 0.0, "a face is turned over");
    }
    Some(layout)
}

#[test]
fn the_cap_of_a_sphere_is_laid_flat_with_the_cloth_around_it_as_far_as_that_goes() {
    let gentle = laid_out(&open_sphere(48, 0.5), 0.3).expect("a layout");
    assert!(
        (1.0..1.1).contains(&gentle.region.stretch_mean),
        "{}",
        gentle.region.stretch_mean
    );
    let half = laid_out(&open_sphere(48, 1.0), 0.4).expect("a layout");
    assert!(half.region.stretch_mean > gentle.region.stretch_mean);
    // All of the sphere but its other end cannot be laid flat.
    assert!(laid_out(&open_sphere(48, 0.5), 2.5).is_none());
}

#[test]
fn a_plain_surface_is_flatter_than_the_cloth_around_it() {
    for cap in [0.3, 0.8, 1.2] {
        let mesh = weld(&open_sphere(48, cap)).mesh;
        let topology = Topology::new(&mesh);
        let loops = boundary_loops(&mesh, &topology);
        let whole = BoundedMesh {
            mesh: &mesh,
            topology: &topology,
            loops: &loops,
        };
        let top = (loops.iter()).max_by(|a, b| a.centroid.z.total_cmp(&b.centroid.z));
        let never = Budget::unlimited();
        let region = collar(&whole, top.expect("a loop").id, 0.0, never).expect("a collar");
        let plain = FairPatch::new(&region, Fairness::Plain, &PatchOptions::default());
        let plain =
            plain
                .expect("a patch")
                .clear_of(&Layers::default(), 0.0, Untangling::Always, never);
        let patch = plain.expect("no limits").patch;
        assert_eq!(patch.crossings, 0);
        let heights = patch.positions.iter().map(|p| p.z);
        let highest = heights.fold(f64::NEG_INFINITY, f64::max);
        assert!((cap.cos()..1.02).contains(&highest), "{cap}: {highest}");
    }
}

#[test]
fn sides_of_a_slit_that_cross_in_the_chart_are_kept_apart() {
    let options = PatchOptions::default();
    let (limits, never) = (FlattenLimits::default(), Budget::unlimited());
    // A slit one square wide, in a flat sheet and in a saddle.
    for (bend, crosses) in [(0.0, false), (6.0, true)] {
        let keep = |u: f64, v: f64| (u - 0.5).abs() > 0.36 || (v - 0.5).abs() > 0.01;
        let place =
            |u: f64, v: f64| Vec3::new(u, v, bend * ((u - 0.5).powi(2) - (v - 0.5).powi(2)));
        let region = region_around_hole(&weld(&sheet(61, keep, place)).mesh, f64::INFINITY);
        let chart = flatten(&region, &limits, never).expect("a chart");
        assert_eq!(plan(&region, &chart, &options).is_err(), crosses);
        let fair = FairPatch::new(&region, Fairness::Plain, &options);
        let patch = fair.expect("a patch").patch;
        let apart = FairLayout::of(&patch, &region, 0.02, &limits, never);
        let apart = apart.expect("no limits").expect("a layout").region;
        assert!(plan(&region, &apart, &options).is_ok());
        assert_eq!(apart.flipped, 0);
        assert!(apart.stretch_mean - chart.stretch_mean < 0.1);
        if !crosses {
            let off = |k: usize| {
                (apart.flat[k] - apart.flat[0]).norm() - (chart.flat[k] - chart.flat[0]).norm()
            };
            assert!((0..chart.flat.len()).all(|k| off(k).abs() < 1e-3));
        }
    }
}
