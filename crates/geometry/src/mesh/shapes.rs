//! Simple surfaces with known geometry, and changes to meshes with known effects: for tests, benchmarks and examples.
//!
//! Lengths are scene units. Shapes are triangle soups as a file might hold them: [`weld`](super::weld::weld) them
//! first. Everything random is determined by its seed.

use std::collections::{HashMap, HashSet};
use std::f64::consts::TAU;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{TriMesh, Vec3};

/// An `n` × `n` grid of squares, two triangles each, over (u, v) in [0, 1]²; `place` gives the position of a grid
/// point, in scene units.
///
/// Squares for whose middle `keep` is false are left out; their vertices stay, used or not. Vertex `j * (n + 1) + i`
/// is the grid point (i / n, j / n).
pub fn sheet(
    n: usize,
    keep: impl Fn(f64, f64) -> bool,
    place: impl Fn(f64, f64) -> Vec3,
) -> TriMesh {
    let at = |i: usize| i as f64 / n as f64;
    let positions = (0..(n + 1) * (n + 1))
        .map(|v| place(at(v % (n + 1)), at(v / (n + 1))))
        .collect();
    let mut faces = Vec::new();
    for (i, j) in (0..n * n).map(|q| (q % n, q / n)) {
        let half = 0.5 / n as f64;
        if keep(at(i) + half, at(j) + half) {
            let a = (j * (n + 1) + i) as u32;
            let (b, c) = (a + 1, a + n as u32 + 1);
            faces.extend([[a, b, c], [b, c + 1, c]]);
        }
    }
    TriMesh { positions, faces }
}

/// A flat square of side 1 in the plane z = 0 with a round hole of radius `hole` in its middle; `n` squares a side.
pub fn holed_sheet(n: usize, hole: f64) -> TriMesh {
    sheet(
        n,
        |u, v| (u - 0.5).hypot(v - 0.5) > hole,
        |u, v| Vec3::new(u, v, 0.0),
    )
}

/// A tube of radius 1 and length 4 along z, `n` rectangles around and along; those for which `keep(angle / 2π, height
/// / 4)` is false are left out.
///
/// The two columns of vertices at the seam have equal positions, so welding closes it.
pub fn tube(n: usize, keep: impl Fn(f64, f64) -> bool) -> TriMesh {
    sheet(n, keep, |u, v| {
        let angle = if u == 1.0 { 0.0 } else { u * TAU };
        Vec3::new(angle.cos(), angle.sin(), 4.0 * v)
    })
}

/// A flat sheet, `n` squares a side, with a square tongue that was torn from its middle but for one side: a third of
/// the sheet wide, parted from it by a gap of a square, and turned up by `angle` (radians) from its hinge.
///
/// `n` should be at least 9. The hinge is the line v = `tongue_hinge(n)`.
pub fn tongue(n: usize, angle: f64) -> TriMesh {
    let (first, last) = (n / 3, n - n / 3);
    let square = |x: f64| (x * n as f64) as usize;
    let gap = |u: f64, v: f64| {
        let (i, j) = (square(u), square(v));
        let beside = i == first - 1 || i == last;
        let above = j == last && (first - 1..=last).contains(&i);
        above || (beside && (first..last).contains(&j))
    };
    let at = |k: usize| k as f64 / n as f64;
    let tongue = move |u: f64, v: f64| {
        let inside = u > at(first) - 1e-9 && u < at(last) + 1e-9;
        inside && v > at(first) && v < at(last) + 1e-9
    };
    let place = |u: f64, v: f64| {
        let along = if tongue(u, v) {
            v - tongue_hinge(n)
        } else {
            0.0
        };
        Vec3::new(u, v - along + along * angle.cos(), along * angle.sin())
    };
    sheet(n, |u, v| !gap(u, v), place)
}

/// Where the hinge of a [`tongue`] lies, v.
pub fn tongue_hinge(n: usize) -> f64 {
    (n / 3) as f64 / n as f64
}

/// A sheet, `n` squares a side, with a round hole of radius a fifth in its middle, into which a flap reaches: a strip of this `width` and `length`
/// that was torn from what is gone but for a hinge at the hole's edge, and turned up by `angle` (radians) there.
///
/// Where its hinge lies, u, and the sheet. `lift` is how high the sheet lies at a place.
pub fn flap(
    n: usize,
    [width, length]: [f64; 2],
    angle: f64,
    lift: impl Fn(f64, f64) -> f64,
) -> (f64, TriMesh) {
    let within = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) < 0.2;
    let hinge = 0.5 + (0.04 - 0.25 * width * width).sqrt() - 1.5 / n as f64;
    let strip = move |u: f64, v: f64| (v - 0.5).abs() < 0.5 * width && u > hinge - length;
    let place = |u: f64, v: f64| {
        let along = hinge - u;
        if within(u, v)
            && along > 0.0
            && (v - 0.5).abs() < 0.5 * width + 1.0 / n as f64
            && u > 0.5 - 0.15
        {
            return Vec3::new(
                hinge - along * angle.cos(),
                v,
                lift(hinge, v) + along * angle.sin(),
            );
        }
        Vec3::new(u, v, lift(u, v))
    };
    (hinge, sheet(n, |u, v| !within(u, v) || strip(u, v), place))
}

/// A sheet, `n` squares a side, with a three-cornered tear in its middle: two slits of `leg` that meet at a right angle, and the corner between them,
/// which is turned up by `angle` (radians) about the line through their ends. `lift` is how high the sheet lies at a place.
pub fn three_cornered_tear(
    n: usize,
    leg: f64,
    angle: f64,
    lift: impl Fn(f64, f64) -> f64,
) -> TriMesh {
    let (middle, long) = (n / 2, (leg * n as f64).round() as usize);
    let mut mesh = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
    let place = |v: u32| (v as usize % (n + 1), v as usize / (n + 1));
    let corner = middle as f64 / n as f64;
    let beyond = |p: &Vec3| 2.0 * corner + long as f64 / n as f64 - p.x - p.y;
    let on_slits = |v: u32| {
        let (i, j) = place(v);
        let along = |k: usize| (middle..middle + long).contains(&k);
        (i == middle && along(j)) || (j == middle && along(i))
    };
    let whole = mesh.positions.len();
    let mut torn: HashMap<u32, u32> = HashMap::new();
    for face in &mut mesh.faces {
        let inside = face.iter().all(|v| {
            let (i, j) = place(*v);
            i >= middle && j >= middle
        });
        for v in face.iter_mut().filter(|_| inside) {
            if on_slits(*v) {
                let next = (whole + torn.len()) as u32;
                *v = *torn.entry(*v).or_insert(next);
            }
        }
    }
    let mut copies: Vec<(u32, u32)> = torn.into_iter().map(|(from, to)| (to, from)).collect();
    copies.sort_unstable();
    let copied = copies
        .iter()
        .map(|(_, from)| mesh.positions[*from as usize]);
    let copied: Vec<Vec3> = copied.collect();
    mesh.positions.extend(copied);
    for (v, p) in mesh.positions.iter_mut().enumerate() {
        let inside = v >= whole || (v % (n + 1) > middle && v / (n + 1) > middle);
        let far = beyond(p) / 2f64.sqrt();
        if inside && far > 1e-9 {
            // The corner lies towards −u and −v of the hinge.
            let towards = Vec3::new(-0.5f64.sqrt(), -0.5f64.sqrt(), 0.0);
            let hinge = *p - towards * far;
            *p = hinge + towards * (far * angle.cos());
            p.z = lift(hinge.x, hinge.y) + far * angle.sin();
        } else {
            p.z = lift(p.x, p.y);
        }
    }
    mesh
}

/// A flat sheet, `n` squares a side, with a slit along the middle two fifths of the line v = ½ whose upper lip is drawn
/// over the lower one by up to `overlap`, and lies above it by a fifth of that.
pub fn overlapping_slit(n: usize, overlap: f64) -> TriMesh {
    let middle = n / 2;
    let whole = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
    let mut mesh = whole.clone();
    let in_slit = |v: u32| {
        let (i, j) = (v as usize % (n + 1), v as usize / (n + 1));
        let share = (i as f64 / n as f64 - 0.3) / 0.4;
        (j == middle && share > 1e-9 && share < 1.0 - 1e-9).then_some(share)
    };
    let mut upper = HashMap::new();
    for face in &mut mesh.faces {
        let above = face.iter().any(|v| *v as usize / (n + 1) > middle);
        for v in face.iter_mut().filter(|_| above) {
            if in_slit(*v).is_some() {
                *v = *upper.entry(*v).or_insert_with(|| {
                    mesh.positions.push(whole.positions[*v as usize]);
                    mesh.positions.len() as u32 - 1
                });
            }
        }
    }
    // The upper half follows its lip, less and less.
    for (v, p) in mesh.positions.iter_mut().enumerate() {
        // The upper lip's vertices come last.
        if v / (n + 1) > middle {
            let share = ((p.x - 0.3) / 0.4).clamp(0.0, 1.0);
            let pull = overlap * (share * TAU / 2.0).sin().powi(2) * (1.0 - 2.0 * (p.y - 0.5));
            *p += Vec3::new(0.0, -pull, 0.2 * pull);
        }
    }
    mesh
}

/// The mesh with spikes at its boundary: at half of the boundary edges whose ends are `frayed`, a triangle with its
/// tip about `length` (scene units) beyond the edge, up to a third of that aside and above or below the cloth.
pub fn fray(mesh: &TriMesh, frayed: impl Fn(&Vec3) -> bool, length: f64, seed: u64) -> TriMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let sides = |[a, b, c]: [u32; 3]| [(a, b, c), (b, c, a), (c, a, b)];
    let inner: HashSet<(u32, u32)> = (mesh.faces.iter())
        .flat_map(|f| sides(*f))
        .map(|(a, b, _)| (a, b))
        .collect();
    let mut spiked = mesh.clone();
    for (a, b, c) in mesh.faces.iter().flat_map(|f| sides(*f)) {
        let [p, q, r] = [a, b, c].map(|v| mesh.positions[v as usize]);
        if inner.contains(&(b, a)) || !frayed(&p) || !frayed(&q) || rng.random_bool(0.5) {
            continue;
        }
        let middle = 0.5 * (p + q);
        let edge = (q - p).normalize();
        let out = (middle - r) - edge * edge.dot(&(middle - r));
        let up = edge.cross(&out).normalize();
        let aside = |rng: &mut ChaCha8Rng| rng.random_range(-0.33..=0.33);
        let tip = out.normalize() + edge * aside(&mut rng) + up * aside(&mut rng);
        spiked.faces.push([b, a, spiked.positions.len() as u32]);
        spiked
            .positions
            .push(middle + tip * length * rng.random_range(0.8..=1.2));
    }
    spiked
}

/// The mesh with every coordinate shifted at random by up to `amount`, scene units; equal positions are shifted
/// equally.
pub fn jitter(mesh: &TriMesh, amount: f64, seed: u64) -> TriMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut shifts: HashMap<[u64; 3], Vec3> = HashMap::new();
    let positions = mesh.positions.iter().map(|p| {
        let key = [p.x, p.y, p.z].map(f64::to_bits);
        p + *shifts
            .entry(key)
            .or_insert_with(|| Vec3::from_fn(|_, _| rng.random_range(-amount..=amount)))
    });
    TriMesh {
        positions: positions.collect(),
        faces: mesh.faces.clone(),
    }
}

/// The same triangles with the vertices in a random order.
pub fn shuffle(mesh: &TriMesh, seed: u64) -> TriMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut order: Vec<usize> = (0..mesh.positions.len()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    let mut to = vec![0; order.len()];
    for (new, &old) in order.iter().enumerate() {
        to[old] = new as u32;
    }
    TriMesh {
        positions: order.iter().map(|&old| mesh.positions[old]).collect(),
        faces: mesh
            .faces
            .iter()
            .map(|f| f.map(|v| to[v as usize]))
            .collect(),
    }
}

/// The same triangles, each with three vertices of its own.
pub fn explode(mesh: &TriMesh) -> TriMesh {
    TriMesh {
        positions: mesh
            .faces
            .iter()
            .flatten()
            .map(|&v| mesh.positions[v as usize])
            .collect(),
        faces: (0..mesh.faces.len() as u32)
            .map(|f| [3 * f, 3 * f + 1, 3 * f + 2])
            .collect(),
    }
}

/// Both meshes as one: the faces and vertices of `b` follow those of `a`.
pub fn concat(a: &TriMesh, b: &TriMesh) -> TriMesh {
    let shift = a.positions.len() as u32;
    TriMesh {
        positions: a.positions.iter().chain(&b.positions).copied().collect(),
        faces: a
            .faces
            .iter()
            .copied()
            .chain(b.faces.iter().map(|f| f.map(|v| v + shift)))
            .collect(),
    }
}
