//! Holes in garments: a disk along the cloth, round or ragged, of a share of the circumference at its place.
//!
//! Distances are those of the flat panels, across seams too; an edge's length counts more along the garment than around it where a hole
//! would otherwise reach an opening. The cut is clean: what remains is one piece, and the lost cloth is a disk.

use super::garment::Garment;
use super::panel::shoelace;
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap, HashSet};

/// Places tried for a hole, by each shape.
const PLACES: usize = 40;
/// Height ÷ width of the shapes tried, one after the other.
const SHAPES: [f64; 4] = [1.0, 0.7, 0.45, 0.3];
/// A hole keeps this many rings of vertices away from every opening.
const MARGIN: usize = 4;
/// Diameter of a moth hole, in edges.
const MOTH: f64 = 6.0;
/// A hole's area is at most this many times that of a flat disk with its rim.
const POUCH: f64 = 1.3;
/// What paths along edges are longer than straight ones.
const DETOUR: f64 = 1.04;

/// What a hole is asked to be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HoleWish {
    /// Its width ÷ the circumference at its place; `None` for a moth hole of six edges.
    pub share: Option<f64>,
    /// Whether its edge is ragged.
    pub ragged: bool,
}

/// A garment with a hole.
#[derive(Debug, Clone)]
pub struct CutGarment {
    /// What remains; the vertices that it uses, in the garment's order.
    pub mesh: TriMesh,
    /// The cloth that was in the hole.
    pub lost: TriMesh,
    /// What was asked for.
    pub wish: HoleWish,
    /// Height ÷ width of the hole in the panels.
    pub shape: f64,
    /// Mean of the rim's vertices.
    pub centroid: Vec3,
}

/// Cuts a hole; `None` where no place has room for it.
pub fn cut(garment: &Garment, wish: HoleWish, rng: &mut ChaCha8Rng) -> Option<CutGarment> {
    let topology = Topology::new(&garment.mesh);
    let kept_off = near_openings(garment, &topology);
    for shape in SHAPES {
        let paths = Paths::new(garment, shape);
        for _ in 0..PLACES {
            let face = rng.random_range(0..garment.mesh.faces.len());
            let width = match wish.share {
                Some(share) => share * girth(garment, face),
                None => MOTH * paths.usual,
            };
            let ragged = Ragged::new(wish.ragged, width, rng);
            let distance = paths.from(face, 0.8 * width * DETOUR);
            let reach = 0.5 * width * DETOUR;
            let inside = |f: &[u32; 3]| {
                let mean: f64 = f.iter().map(|v| distance[*v as usize]).sum::<f64>() / 3.0;
                let at: Vec3 = f.iter().map(|v| garment.mesh.positions[*v as usize]).sum();
                mean < reach * ragged.at(&(at / 3.0))
            };
            let lost: Vec<bool> = garment.mesh.faces.iter().map(inside).collect();
            if let Some(found) = clean(garment, &topology, lost, face, &kept_off) {
                return Some(parted(garment, &found, wish, shape));
            }
        }
    }
    None
}

/// Circumference of the tube around a face: twice the width of its panel there.
fn girth(garment: &Garment, face: usize) -> f64 {
    let drawn = &garment.sewn.drawn[face];
    let centre = drawn.corners.iter().sum::<Vec2>() / 3.0;
    let outline = &garment.sewn.outlines[drawn.panel];
    let next = outline.iter().cycle().skip(1);
    let crossing = |(a, b): (&Vec2, &Vec2)| {
        ((a.y > centre.y) != (b.y > centre.y))
            .then(|| a.x + (b.x - a.x) * (centre.y - a.y) / (b.y - a.y))
    };
    let all: Vec<f64> = outline.iter().zip(next).filter_map(crossing).collect();
    let (mut left, mut right) = (f64::NEG_INFINITY, f64::INFINITY);
    for x in all {
        if x <= centre.x {
            left = left.max(x);
        } else {
            right = right.min(x);
        }
    }
    2.0 * (right - left)
}

/// Whether each vertex lies within [`MARGIN`] edges of an opening.
fn near_openings(garment: &Garment, topology: &Topology) -> Vec<bool> {
    let mut near = topology.boundary_vertices();
    for _ in 0..MARGIN {
        let before = near.clone();
        for f in &garment.mesh.faces {
            if f.iter().any(|v| before[*v as usize]) {
                f.iter().for_each(|v| near[*v as usize] = true);
            }
        }
    }
    near
}

/// Makes the lost faces a disk that contains `face`, without bow-ties and islands; `None` where that is not possible.
fn clean(
    garment: &Garment,
    topology: &Topology,
    mut lost: Vec<bool>,
    face: usize,
    kept_off: &[bool],
) -> Option<Vec<bool>> {
    let faces = &garment.mesh.faces;
    if !lost[face] {
        return None;
    }
    let pieces = |of: bool, lost: &[bool]| pieces(garment, topology, &|f| lost[f] == of);
    let own = pieces(true, &lost);
    lost.iter_mut()
        .zip(&own)
        .for_each(|(l, piece)| *l &= *piece == own[face]);
    for _ in 0..8 {
        let kept = pieces(false, &lost);
        let mut sizes: BTreeMap<u32, usize> = BTreeMap::new();
        for piece in kept.iter().filter(|p| **p != NONE) {
            *sizes.entry(*piece).or_default() += 1;
        }
        let main = *sizes.iter().max_by_key(|(_, n)| **n)?.0;
        for (l, piece) in lost.iter_mut().zip(&kept) {
            *l |= *piece != NONE && *piece != main;
        }
        let tied = bow_ties(garment, topology, &lost);
        if tied.is_empty() {
            let off = |f: &[u32; 3]| f.iter().any(|v| kept_off[*v as usize]);
            let near = faces.iter().zip(&lost).any(|(f, l)| *l && off(f));
            let disk = is_disk(&garment.mesh, &lost) && !is_pouch(&garment.mesh, topology, &lost);
            return (!near && disk).then_some(lost);
        }
        // Everything around such a vertex goes.
        for (l, f) in lost.iter_mut().zip(faces) {
            *l |= f.iter().any(|v| tied.contains(v));
        }
    }
    None
}

const NONE: u32 = u32::MAX;

/// Per face the number of its piece among the faces that are `asked`; `NONE` for the others.
fn pieces(garment: &Garment, topology: &Topology, asked: &dyn Fn(usize) -> bool) -> Vec<u32> {
    let faces = &garment.mesh.faces;
    let mut piece = vec![NONE; faces.len()];
    let mut count = 0;
    for start in 0..faces.len() {
        if piece[start] != NONE || !asked(start) {
            continue;
        }
        piece[start] = count;
        let mut open = vec![start];
        while let Some(f) = open.pop() {
            for h in darn_geometry::mesh::index::FaceId(f as u32).half_edges() {
                if let Some(other) = topology.twin(h).map(|t| t.face().index())
                    && piece[other] == NONE
                    && asked(other)
                {
                    piece[other] = count;
                    open.push(other);
                }
            }
        }
        count += 1;
    }
    piece
}

/// Vertices around which kept and lost faces alternate more than once.
fn bow_ties(garment: &Garment, topology: &Topology, lost: &[bool]) -> HashSet<u32> {
    let mut changes: BTreeMap<u32, u32> = BTreeMap::new();
    for f in (0..garment.mesh.faces.len()).filter(|f| lost[*f]) {
        for h in darn_geometry::mesh::index::FaceId(f as u32).half_edges() {
            let kept = topology.twin(h).is_none_or(|t| !lost[t.face().index()]);
            if kept {
                *changes.entry(topology.origin(h).0).or_default() += 1;
            }
        }
    }
    let tied = changes.into_iter().filter(|(_, n)| *n > 1);
    tied.map(|(v, _)| v).collect()
}

/// Whether the lost faces are a disk, by their Euler characteristic; they are one piece.
fn is_disk(mesh: &TriMesh, lost: &[bool]) -> bool {
    let own: Vec<&[u32; 3]> = (mesh.faces.iter().zip(lost))
        .filter_map(|(f, l)| l.then_some(f))
        .collect();
    let vertices: HashSet<u32> = own.iter().flat_map(|f| **f).collect();
    let edges: HashSet<(u32, u32)> = (own.iter())
        .flat_map(|f| (0..3).map(|k| (f[k].min(f[(k + 1) % 3]), f[k].max(f[(k + 1) % 3]))))
        .collect();
    vertices.len() + own.len() == edges.len() + 1
}

/// Whether the lost faces are larger than flat cloth within their rim can be, such as the whole end of a finger: no rim tells of it.
fn is_pouch(mesh: &TriMesh, topology: &Topology, lost: &[bool]) -> bool {
    let (mut area, mut length) = (0.0, 0.0);
    for f in (0..mesh.faces.len()).filter(|f| lost[*f]) {
        let [a, b, c] = mesh.triangle(f);
        area += 0.5 * (b - a).cross(&(c - a)).norm();
        for h in darn_geometry::mesh::index::FaceId(f as u32).half_edges() {
            if topology.twin(h).is_none_or(|t| !lost[t.face().index()]) {
                let [a, b] =
                    [topology.origin(h), topology.target(h)].map(|v| mesh.positions[v.index()]);
                length += (a - b).norm();
            }
        }
    }
    area > POUCH * length * length / (4.0 * std::f64::consts::PI)
}

fn parted(garment: &Garment, lost: &[bool], wish: HoleWish, shape: f64) -> CutGarment {
    let mesh = &garment.mesh;
    let side = |of: bool| -> Vec<[u32; 3]> {
        let own = mesh.faces.iter().zip(lost).filter(|(_, l)| **l == of);
        own.map(|(f, _)| *f).collect()
    };
    let (kept, gone) = (side(false), side(true));
    let kept_vertices: HashSet<u32> = kept.iter().flatten().copied().collect();
    let mut rim: Vec<u32> = gone.iter().flatten().copied().collect();
    rim.sort_unstable();
    rim.dedup();
    rim.retain(|v| kept_vertices.contains(v));
    let sum: Vec3 = rim.iter().map(|v| mesh.positions[*v as usize]).sum();
    CutGarment {
        mesh: mesh.part(kept),
        lost: mesh.part(gone),
        wish,
        shape,
        centroid: sum / rim.len().max(1) as f64,
    }
}

/// A factor of the radius that varies in space: 1 for a round hole.
struct Ragged(Vec<(Vec3, f64, f64)>);

impl Ragged {
    fn new(ragged: bool, width: f64, rng: &mut ChaCha8Rng) -> Self {
        let wave = |k: usize| {
            let dir = Vec3::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let length = width / (1.5 + k as f64);
            let turn = std::f64::consts::TAU / length;
            let phase = rng.random_range(0.0..std::f64::consts::TAU);
            (dir.normalize() * turn, phase, 0.13 / (1.0 + 0.3 * k as f64))
        };
        Self(if ragged {
            (0..5).map(wave).collect()
        } else {
            Vec::new()
        })
    }

    fn at(&self, p: &Vec3) -> f64 {
        let waves = self
            .0
            .iter()
            .map(|(k, phase, size)| size * (k.dot(p) + phase).sin());
        1.0 + waves.sum::<f64>()
    }
}

/// Links between vertices and their lengths in the panels: the edges, and the straight ways across two faces of one panel.
struct Paths {
    links: Vec<Vec<(u32, f64)>>,
    /// Mean length of an edge.
    usual: f64,
    faces: Vec<[u32; 3]>,
}

impl Paths {
    /// Lengths with everything along the garment ÷ `shape`.
    fn new(garment: &Garment, shape: f64) -> Self {
        let mesh = &garment.mesh;
        let mut links = vec![Vec::new(); mesh.positions.len()];
        let length = |d: Vec2| d.x.hypot(d.y / shape);
        let (mut sum, mut count) = (0.0, 0.0);
        let mut across: BTreeMap<(u32, u32), (u32, usize, Vec2)> = BTreeMap::new();
        for (f, drawn) in mesh.faces.iter().zip(&garment.sewn.drawn) {
            for k in 0..3 {
                let (a, b, c) = (f[k], f[(k + 1) % 3], f[(k + 2) % 3]);
                let d = drawn.corners[(k + 1) % 3] - drawn.corners[k];
                links[a as usize].push((b, length(d)));
                links[b as usize].push((a, length(d)));
                sum += d.norm();
                count += 1.0;
                let corner = drawn.corners[(k + 2) % 3];
                let key = (a.min(b), a.max(b));
                let Some((other, panel, at)) = across.insert(key, (c, drawn.panel, corner)) else {
                    continue;
                };
                // The way between the two far corners is straight only in one panel, through the edge between them.
                let (p, q) = (drawn.corners[k], drawn.corners[(k + 1) % 3]);
                let sides = [p, q].map(|x| shoelace(&[corner, at, x]) > 0.0);
                if panel == drawn.panel && sides[0] != sides[1] {
                    links[c as usize].push((other, length(corner - at)));
                    links[other as usize].push((c, length(corner - at)));
                }
            }
        }
        Self {
            links,
            usual: sum / f64::max(count, 1.0),
            faces: mesh.faces.clone(),
        }
    }

    /// Lengths of the shortest ways from the middle of a face, up to `most`; infinite beyond.
    fn from(&self, face: usize, most: f64) -> Vec<f64> {
        let mut distance = vec![f64::INFINITY; self.links.len()];
        let mut open = BinaryHeap::new();
        for v in self.faces[face] {
            distance[v as usize] = 0.5 * self.usual;
            open.push(Reached(0.5 * self.usual, v));
        }
        while let Some(Reached(d, v)) = open.pop() {
            if d > distance[v as usize] || d > most {
                continue;
            }
            for &(w, length) in &self.links[v as usize] {
                if d + length < distance[w as usize] {
                    distance[w as usize] = d + length;
                    open.push(Reached(d + length, w));
                }
            }
        }
        distance
    }
}

/// A vertex and the length of a way to it; the shortest is the greatest, so that a heap gives it first.
#[derive(PartialEq)]
struct Reached(f64, u32);

impl Eq for Reached {}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
