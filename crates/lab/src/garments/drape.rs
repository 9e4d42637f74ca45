//! Drapes a sewn garment: the body grows inside the flat garment, takes its pose, and the cloth comes to rest.

use super::body::PosedCapsule;
use super::cloth::{Cloth, RestShape, Step};
use super::pattern::{Pattern, Ring};
use super::sewing::Sewn;
use crate::scarffolds::lattice::Vec3f;
use std::collections::BTreeMap;
use std::f32::consts::TAU;

/// Length of a step, seconds.
const STEP: f32 = 1.0e-3;
/// Steps in which the body grows, weightless.
const GROW: usize = 300;
/// Steps in which the body moves into its pose.
const POSE: usize = 400;
/// Steps in which the cloth comes to rest.
const SETTLE: usize = 600;
/// Rounds that remove the last stretch.
const RELAX: usize = 40;
/// Least distance of two layers, in spacings.
const THICKNESS: f64 = 0.95;

/// A garment at rest.
pub(super) struct Draped {
    /// Metres, z up.
    pub(super) positions: Vec<Vec3f>,
    /// Root mean square of (length ÷ rest length − 1) over the edges.
    pub(super) strain: f64,
}

/// A held vertex and the way it goes.
struct Held {
    vertex: u32,
    from: Vec3f,
    to: Vec3f,
}

/// Drapes a garment.
pub(super) fn drape(pattern: &Pattern, sewn: &Sewn) -> Draped {
    let thickness = (THICKNESS * pattern.spacing) as f32;
    let positions: Vec<Vec3f> = (sewn.laid.iter().zip(&sewn.layer))
        .map(|(p, layer)| Vec3f::new(p.x as f32, 0.5 * thickness * *layer as f32, p.y as f32))
        .collect();
    let held: Vec<Held> = (pattern.rings.iter())
        .flat_map(|ring| held(ring, sewn, &positions))
        .collect();
    let vertices: Vec<u32> = held.iter().map(|h| h.vertex).collect();
    let mut cloth = Cloth::new(
        positions,
        rest_shape(sewn),
        &vertices,
        pattern.fabric,
        thickness,
    );
    let share = |k: usize, from: usize, steps: usize| {
        (k.saturating_sub(from) as f32 / steps as f32).min(1.0)
    };
    let body = |k: usize| -> Vec<PosedCapsule> {
        let (grown, moved) = (share(k, 0, GROW), share(k, GROW, POSE));
        pattern.body.iter().map(|c| c.at(grown, moved)).collect()
    };
    for k in 0..GROW + POSE + SETTLE {
        let moved = share(k, 0, GROW + POSE);
        for h in &held {
            cloth.hold(h.vertex, h.from.lerp(&h.to, moved));
        }
        let settling = share(k, GROW + POSE, SETTLE);
        cloth.step(&Step {
            time: STEP,
            damping: 2.0 + 8.0 * settling,
            weight: share(k, GROW, POSE / 2),
            body: &body(k),
        });
    }
    cloth.relax(RELAX, STEP, &body(GROW + POSE));
    Draped {
        strain: cloth.strain(),
        positions: cloth.now,
    }
}

fn rest_shape(sewn: &Sewn) -> RestShape {
    let lengths: Vec<[f64; 3]> = (sewn.drawn.iter())
        .map(|d| std::array::from_fn(|k| (d.corners[(k + 1) % 3] - d.corners[k]).norm()))
        .collect();
    let height: Vec<f64> = sewn.laid.iter().map(|p| p.y).collect();
    RestShape::new(&sewn.faces, &lengths, &height)
}

/// The vertices of a ring's opening, spread along its ellipse by their distance along the opening.
fn held(ring: &Ring, sewn: &Sewn, positions: &[Vec3f]) -> Vec<Held> {
    let cycle = cycle(sewn, ring);
    let along = Vec3f::from(ring.along);
    let end = |v: &u32| positions[*v as usize].dot(&along);
    let Some(first) = (0..cycle.len()).max_by(|a, b| end(&cycle[*a]).total_cmp(&end(&cycle[*b])))
    else {
        return Vec::new();
    };
    let at = |k: usize| cycle[(first + k) % cycle.len()] as usize;
    let n = cycle.len();
    // Distances in the flat lay: the start's layers are as good as flat.
    let step = |k: usize| (positions[at(k + 1)] - positions[at(k)]).norm();
    let length: f32 = (0..n).map(step).sum();
    let forward = sewn.layer[at(1)] < 0.0;
    let mut gone = 0.0;
    (0..n)
        .map(|k| {
            let angle = TAU * gone / length.max(1e-9);
            gone += step(k);
            let (s, c) = angle.sin_cos();
            let front = Vec3f::from(ring.front) * if forward { s } else { -s };
            Held {
                vertex: at(k) as u32,
                from: positions[at(k)],
                to: Vec3f::from(ring.centre) + along * c + front,
            }
        })
        .collect()
}

/// The boundary loop along an opening, in the order of its edges.
fn cycle(sewn: &Sewn, ring: &Ring) -> Vec<u32> {
    let own = &sewn.openings[ring.opening];
    let mut next: BTreeMap<(u32, u32), ()> = BTreeMap::new();
    for f in &sewn.faces {
        for k in 0..3 {
            next.insert((f[k], f[(k + 1) % 3]), ());
        }
    }
    let open: BTreeMap<u32, u32> = (next.keys())
        .filter(|(a, b)| !next.contains_key(&(*b, *a)) && own.binary_search(a).is_ok())
        .copied()
        .collect();
    let Some(start) = own.first().copied() else {
        return Vec::new();
    };
    let mut cycle = vec![start];
    let mut v = start;
    while let Some(w) = open.get(&v).copied() {
        if w == start || cycle.len() > own.len() {
            break;
        }
        cycle.push(w);
        v = w;
    }
    cycle
}
