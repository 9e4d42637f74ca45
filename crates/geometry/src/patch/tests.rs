//! Properties of whole patches.

use std::sync::Arc;

use super::*;
use crate::flatten::{FlattenLimits, UvSquare, flatten};
use crate::mesh::blocks::FaceBlocks;
use crate::mesh::intersect::intersections_with;
use crate::mesh::layers::Layers;
use crate::mesh::loops::boundary_loops;
use crate::mesh::region::region_around_hole;
use crate::mesh::shapes::{jitter, sheet};
use crate::mesh::topology::Topology;
use crate::mesh::weld::{SetAside, weld};

/// A wavy sheet with a round hole, its chart scaled by `slack` (1 for none), and a grid of zeros.
///
/// Without slack the patch is taut along its straight lines, and no pull can be met.
fn wavy(slack: f64) -> (Region, Chart, Vec<Vec3>) {
    let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
    let wave = |u: f64, v: f64| Vec3::new(u, v, 0.06 * (10.0 * u).sin());
    let mesh = weld(&sheet(36, keep, wave)).mesh;
    let region = region_around_hole(&mesh, f64::INFINITY);
    let mut chart = flatten(&region, &FlattenLimits::default(), Budget::unlimited()).unwrap();
    chart.flat.iter_mut().for_each(|p| *p *= slack);
    chart.frame = UvSquare::tightest(&chart.flat);
    (region, chart, vec![Vec3::zeros(); crate::grid::CELLS])
}

/// The patch without pulls, its plan, and the inner vertex farthest from the rim.
fn unpulled(region: &Region, chart: &Chart, filled: &[Vec3]) -> (PatchPlan, Patch, usize) {
    let options = PatchOptions::default();
    let plan = plan(region, chart, &options).unwrap();
    let patch = plan.patch(chart, filled, &[], &options).unwrap();
    let rim = patch.rim.len();
    let clear = |v: usize| {
        let away = (0..rim).map(|r| (patch.flat[r] - patch.flat[v]).norm());
        away.fold(f64::INFINITY, f64::min)
    };
    let middle = (rim..patch.flat.len())
        .max_by(|a, b| clear(*a).total_cmp(&clear(*b)))
        .unwrap();
    (plan, patch, middle)
}

/// A pull on the middle of the patch.
struct Pulled {
    patch: Patch,
    unpulled: Patch,
    target: Vec3,
    /// Distance from the pulled point to its target.
    off: f64,
}

/// Pulls the middle of a patch by `by` and checks the rim and the stretch.
fn pulled(slack: f64, by: Vec3, firmness: Firmness) -> Pulled {
    let (region, chart, filled) = wavy(slack);
    let (plan, free, middle) = unpulled(&region, &chart, &filled);
    let pull = Pull {
        at: free.flat[middle],
        to: free.positions[middle] + by,
        firmness,
    };
    let patch = plan
        .patch(&chart, &filled, &[pull], &PatchOptions::default())
        .unwrap();
    let rim = patch.rim.len();
    assert_eq!(
        patch.positions[..rim],
        free.positions[..rim],
        "the rim does not move"
    );
    let off = (patch.at(pull.at) - pull.to).norm();
    let stretch = quality::measure(&patch, &region).stretch_max;
    let usual = quality::measure(&free, &region).stretch_max;
    assert!(
        stretch <= (1.05 * usual).max(1.25) + 1e-9,
        "{stretch} {usual}"
    );
    Pulled {
        patch,
        unpulled: free,
        target: pull.to,
        off,
    }
}

#[test]
fn build_gives_the_same_patch_as_a_plan() {
    let (region, chart, filled) = wavy(1.0);
    let (plan, patch, _) = unpulled(&region, &chart, &filled);
    assert_eq!(
        build(&region, &chart, &filled, &PatchOptions::default()).unwrap(),
        patch
    );
    assert!(plan.bytes() > 0);
}

#[test]
fn a_pull_within_reach_is_met() {
    for firmness in [Firmness::Soft, Firmness::Hard] {
        let Pulled { off, .. } = pulled(1.05, Vec3::new(0.0, 0.0, -0.02), firmness);
        // Half a cell of a grid over the whole sheet.
        assert!(off < 0.5 / 64.0, "{off} {firmness:?}");
    }
}

#[test]
fn no_vertex_follows_a_pull_far_beyond_reach() {
    let pulled = pulled(1.0, Vec3::new(4.0, 1.0, 3.0), Firmness::Hard);
    assert!(pulled.off > 4.0);
    let away = |p: &Vec3| (p - pulled.target).norm();
    assert!(pulled.patch.positions.iter().all(|p| away(p) > 4.0));
}

#[test]
fn a_pull_to_where_its_point_lies_changes_almost_nothing() {
    let Pulled {
        patch, unpulled, ..
    } = pulled(1.0, Vec3::zeros(), Firmness::Soft);
    let squares = patch
        .positions
        .iter()
        .zip(&unpulled.positions)
        .map(|(a, b)| (a - b).norm_squared());
    assert!((squares.sum::<f64>() / patch.positions.len() as f64).sqrt() < 0.1 / 64.0);
}

#[test]
fn a_pull_beside_the_hole_or_at_its_rim_does_nothing() {
    let (region, chart, filled) = wavy(1.0);
    let (plan, free, _) = unpulled(&region, &chart, &filled);
    let beside = (chart.frame.point(Vec2::new(0.02, 0.02)), Firmness::Hard);
    let at_rim = (free.flat[0], Firmness::Soft);
    for (at, firmness) in [beside, at_rim] {
        let to = Vec3::zeros();
        let pull = Pull { at, to, firmness };
        assert_eq!(
            plan.patch(&chart, &filled, &[pull], &PatchOptions::default())
                .unwrap(),
            free
        );
    }
}

/// A pull moves a disk, not one triangle: the vertices near the pulled point move most of the way, too.
#[test]
fn a_pull_raises_no_spike() {
    let (region, chart, filled) = wavy(1.05);
    let (plan, free, middle) = unpulled(&region, &chart, &filled);
    let to = free.positions[middle] + Vec3::new(0.0, 0.0, 0.02);
    let pull = Pull {
        at: free.flat[middle],
        to,
        firmness: Firmness::Soft,
    };
    let patch = plan
        .patch(&chart, &filled, &[pull], &PatchOptions::default())
        .unwrap();
    let moved = |v: usize| (patch.positions[v] - free.positions[v]).norm();
    let near = (0..free.flat.len())
        .filter(|v| (free.flat[*v] - free.flat[middle]).norm() < 1.5 * chart.frame.side / 64.0);
    assert!(near.clone().count() > 4);
    for v in near {
        assert!(moved(v) > 0.6 * moved(middle), "{}", moved(v));
    }
}

#[test]
fn a_patch_meets_a_moved_rim_and_avoids_a_layer_there() {
    let (region, chart, filled) = wavy(1.0);
    let (plain, free, middle) = unpulled(&region, &chart, &filled);
    let up = Vec3::new(0.0, 0.0, 0.05);
    let mut noisy = region.clone();
    noisy.mesh = jitter(&region.mesh, 0.002, 1);
    noisy.mesh.positions.iter_mut().for_each(|p| *p += up);
    // The layer lies below the patch, except for a bump through it, and above where the patch would lie without the
    // shift.
    let centre = free.positions[middle] + up;
    let bumpy = |u: f64, v: f64| {
        let (x, y) = (0.16 * (u - 0.5), 0.16 * (v - 0.5));
        let bump = (-0.5 * (x * x + y * y) / 0.03f64.powi(2)).exp();
        centre + Vec3::new(x, y, 0.028 * bump - 0.02)
    };
    let layer = sheet(16, |_, _| true, bumpy);
    let layer = Arc::unwrap_or_clone(weld(&layer).mesh);
    let cuts = |patch: &Patch| {
        let mut all = quality::joined(patch, &noisy);
        let own: Vec<u32> = (region.mesh.faces.len() as u32..all.faces.len() as u32).collect();
        let base = all.positions.len() as u32;
        all.positions.extend_from_slice(&layer.positions);
        all.faces
            .extend(layer.faces.iter().map(|f| f.map(|v| base + v)));
        intersections_with(&all, &own).len()
    };
    let moved = plain.with_region_at(&noisy.mesh.positions).unwrap();
    let patch = |plan: &PatchPlan| {
        plan.patch(&chart, &filled, &[], &PatchOptions::default())
            .unwrap()
    };
    let through = patch(&moved);
    assert!(cuts(&through) > 0, "the plan does not contain the layer");
    let layers = Layers {
        other: vec![None; layer.faces.len()],
        mesh: layer.clone(),
    };
    let beside = moved.beside(&layers, 0.1, Budget::unlimited()).unwrap();
    let beside = patch(&beside);
    let wanted = (beside.rim.iter()).map(|v| noisy.mesh.positions[*v as usize]);
    for (own, wanted) in beside.positions.iter().zip(wanted) {
        assert!((own - wanted).norm() < 1e-12);
    }
    assert!(beside.collisions > 0);
    assert_eq!((beside.crossings, cuts(&beside)), (0, 0));
}

/// Two square holes that touch in a corner have one rim. Its two vertices there coincide on the scan, but not in the
/// denoised region.
#[test]
fn a_rim_that_touches_itself_is_closed_on_the_scan() {
    let square = |x: f64| (18.0 * x) as usize;
    let in_hole = |u: f64, v: f64| {
        let holes = [4usize..9, 9..14];
        (holes.iter()).any(|hole| hole.contains(&square(u)) && hole.contains(&square(v)))
    };
    let wave = |u: f64, v: f64| Vec3::new(u, v, 0.05 * (9.0 * u).sin() * (5.0 * v).cos());
    let scan = weld(&sheet(18, |u, v| !in_hole(u, v), wave)).mesh;
    let region = region_around_hole(&scan, f64::INFINITY);
    let mut seen = region.clone();
    let apart = (seen.mesh.positions.iter_mut()).enumerate();
    apart.for_each(|(v, p)| p.z += 1e-3 * (v as f64).sin());
    let chart = flatten(&seen, &FlattenLimits::default(), Budget::unlimited()).unwrap();
    let options = PatchOptions::default();
    let blocks = FaceBlocks::new(&scan);
    let mesh = PatchMesh::in_scan(&scan, &blocks, &seen, &chart, &options).unwrap();
    let plan = mesh.plan(&seen, &chart, None, &options).unwrap();
    let plan = plan.with_region_at(&region.mesh.positions).unwrap();
    let filled = vec![Vec3::zeros(); crate::grid::CELLS];
    let patch = plan.patch(&chart, &filled, &[], &options).unwrap();

    let whole = weld(&quality::joined(&patch, &region));
    assert_eq!(
        whole.set_aside,
        SetAside::default(),
        "a triangle has no area"
    );
    let topology = Topology::new(&whole.mesh);
    assert!(topology.non_manifold.is_empty());
    assert_eq!(boundary_loops(&whole.mesh, &topology).len(), 1);
    let inner = patch.positions.len() - patch.rim.len();
    assert_eq!(whole.mesh.positions.len(), scan.positions.len() + inner - 1);
}
