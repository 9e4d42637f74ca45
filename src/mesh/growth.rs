//! How a region is cut out of a mesh: faces within reach, less what hangs loose, plus what is enclosed.

use super::TriMesh;
use super::geodesic::geodesic_distance_within;
use super::loops::{BoundaryLoop, LoopKind, walk};
use super::region::Region;
use super::topology::{NONE, Sets, Topology, corner_fans, next};

/// The smallest reach tried, in mean edge lengths of the rim's faces.
const NARROWEST: f64 = 3.0;
/// A pocket whose depth exceeds this many reaches stays outside.
const POCKET: f64 = 1.5;

/// What stays the same while the reach shrinks.
pub(super) struct Growth<'a> {
    mesh: &'a TriMesh,
    topology: &'a Topology,
    loops: &'a [BoundaryLoop],
    rim: &'a BoundaryLoop,
    /// Per vertex its distance from the rim, infinite beyond the deepest pocket.
    pub(super) distance: Vec<f64>,
    /// Per half-edge the loop it lies on, [`NONE`] inside.
    loop_of: Vec<u32>,
    /// Per face whether it touches the rim; such faces always belong.
    touching: Vec<bool>,
    /// The smallest reach to try.
    pub(super) narrowest: f64,
}

impl<'a> Growth<'a> {
    /// Measures the cloth round `rim` as far as regions of up to `reach` need it.
    pub(super) fn new(
        mesh: &'a TriMesh,
        topology: &'a Topology,
        loops: &'a [BoundaryLoop],
        rim: &'a BoundaryLoop,
        reach: f64,
    ) -> Self {
        let mut loop_of = vec![NONE; topology.twin.len()];
        for (index, l) in loops.iter().enumerate() {
            for &h in &l.half_edges {
                loop_of[h as usize] = index as u32;
            }
        }
        let mut touching = vec![false; mesh.faces.len()];
        for f in rim.vertices.iter().flat_map(|&v| topology.faces_at(v)) {
            touching[f as usize] = true;
        }
        let (mut length, mut count) = (0.0, 0.0);
        for f in (0..mesh.faces.len()).filter(|&f| touching[f]) {
            let [a, b, c] = mesh.triangle(f);
            length += (b - a).norm() + (c - b).norm() + (a - c).norm();
            count += 3.0;
        }
        let narrowest = NARROWEST * length / f64::max(count, 1.0);
        let limit = POCKET * reach.max(narrowest);
        let distance = geodesic_distance_within(mesh, topology, &rim.vertices, limit);
        Self {
            mesh,
            topology,
            loops,
            rim,
            distance,
            loop_of,
            touching,
            narrowest,
        }
    }

    /// The region of one reach, or its handles and outer loops when it is no disk.
    pub(super) fn cut(&self, reach: f64) -> Result<Region, (usize, usize)> {
        let mut inside: Vec<bool> = (0..self.mesh.faces.len())
            .map(|f| self.touching[f] || self.depth(f) <= reach)
            .collect();
        // Each round can only settle what the one before stirred up; what is left after eight is split in `piece`.
        for _ in 0..8 {
            self.drop_islands(&mut inside);
            self.fill_pockets(&mut inside, POCKET * reach);
            if !self.trim_bow_ties(&mut inside) {
                break;
            }
        }
        self.drop_islands(&mut inside);
        self.piece(&inside, reach)
    }

    /// Distance of the farthest corner of a face from the rim.
    fn depth(&self, face: usize) -> f64 {
        self.mesh.faces[face]
            .iter()
            .map(|&v| self.distance[v as usize])
            .fold(0.0, f64::max)
    }

    /// Groups the faces with `inside[f] == side` into edge-connected pieces: their smallest face stands for them.
    fn pieces(&self, inside: &[bool], side: Side) -> Sets {
        let mut sets = Sets::new(inside.len());
        for h in self
            .topology
            .edges()
            .filter(|&h| self.topology.twin[h as usize] != NONE)
        {
            let (f, g) = (h / 3, self.topology.twin[h as usize] / 3);
            if side.has(inside[f as usize]) && side.has(inside[g as usize]) {
                sets.join(f, g);
            }
        }
        sets
    }

    /// Keeps only the pieces that contain a face at the rim.
    fn drop_islands(&self, inside: &mut [bool]) {
        let mut pieces = self.pieces(inside, Side::Inside);
        let mut keep = vec![false; inside.len()];
        for &h in &self.rim.half_edges {
            keep[pieces.find(h / 3) as usize] = true;
        }
        for (f, inside) in inside.iter_mut().enumerate() {
            *inside = *inside && keep[pieces.find(f as u32) as usize];
        }
    }

    /// Takes in pieces of the rest of the component that the region surrounds: no deeper than `limit` and bounded by the region and
    /// holes alone.
    fn fill_pockets(&self, inside: &mut [bool], limit: f64) {
        let mut pieces = self.pieces(inside, Side::Outside);
        let mut open = vec![false; inside.len()];
        for f in (0..inside.len()).filter(|&f| !inside[f]) {
            let deep = self.depth(f) > limit;
            let edge = (3 * f..3 * f + 3).any(|h| self.is_open(h));
            open[pieces.find(f as u32) as usize] |= deep || edge;
        }
        for f in 0..inside.len() {
            inside[f] = inside[f] || !open[pieces.find(f as u32) as usize];
        }
    }

    /// Whether a half-edge lies on a loop of the whole mesh that is not a hole.
    fn is_open(&self, half_edge: usize) -> bool {
        self.loops
            .get(self.loop_of[half_edge] as usize)
            .is_some_and(|l| l.kind != LoopKind::Hole)
    }

    /// Takes out, at vertices where the region touches itself in a point, all fans but the largest; true when it took any.
    fn trim_bow_ties(&self, inside: &mut [bool]) -> bool {
        let mut fans = Sets::new(3 * inside.len());
        for (h, &t) in self
            .topology
            .twin
            .iter()
            .enumerate()
            .filter(|&(_, &t)| t != NONE)
        {
            if inside[h / 3] && inside[t as usize / 3] {
                fans.join(h as u32, next(t));
            }
        }
        let mut taken = Vec::new();
        for v in 0..self.mesh.positions.len() as u32 {
            let mut corners: Vec<(u32, u32)> = self
                .topology
                .leaving(v)
                .iter()
                .filter(|&&h| inside[h as usize / 3])
                .map(|&h| (fans.find(h), h / 3))
                .collect();
            corners.sort_unstable();
            let fan_count = corners.chunk_by(|a, b| a.0 == b.0).count();
            if fan_count < 2 {
                continue;
            }
            let weight =
                |fan: &[(u32, u32)]| (fan.iter().any(|c| self.touching[c.1 as usize]), fan.len());
            let largest = corners.chunk_by(|a, b| a.0 == b.0).map(weight).max();
            let mut kept = false;
            for fan in corners.chunk_by(|a, b| a.0 == b.0) {
                if !kept && Some(weight(fan)) == largest {
                    kept = true;
                } else {
                    taken.extend(
                        fan.iter()
                            .map(|c| c.1)
                            .filter(|&f| !self.touching[f as usize]),
                    );
                }
            }
        }
        for &f in &taken {
            inside[f as usize] = false;
        }
        !taken.is_empty()
    }

    /// The faces inside as a mesh of its own, if it is a disk once its holes are closed.
    fn piece(&self, inside: &[bool], reach: f64) -> Result<Region, (usize, usize)> {
        let faces: Vec<u32> = (0..inside.len() as u32)
            .filter(|&f| inside[f as usize])
            .collect();
        let mut local = vec![NONE; inside.len()];
        for (l, &f) in faces.iter().enumerate() {
            local[f as usize] = l as u32;
        }
        let twin: Vec<u32> = faces
            .iter()
            .flat_map(|&f| 3 * f..3 * f + 3)
            .map(|h| match self.topology.twin[h as usize] {
                NONE => NONE,
                t if inside[t as usize / 3] => 3 * local[t as usize / 3] + t % 3,
                _ => NONE,
            })
            .collect();
        let (fan, count) = corner_fans(&twin);
        let origin = |l: u32| fan[l as usize];
        let whole = |l: u32| 3 * faces[l as usize / 3] + l % 3;
        let (mut rim, mut holes, mut rest) = (Vec::new(), Vec::new(), Vec::new());
        for cycle in walk(&twin, origin) {
            let first = cycle
                .first()
                .map_or(NONE, |&l| self.loop_of[whole(l) as usize]);
            let uncut = cycle
                .iter()
                .all(|&l| self.loop_of[whole(l) as usize] == first);
            let vertices: Vec<u32> = cycle.iter().map(|&l| origin(l)).collect();
            match self.loops.get(first as usize).filter(|_| uncut) {
                Some(l) if l.id == self.rim.id => {
                    let start = self.rim.half_edges.first();
                    let turn = cycle
                        .iter()
                        .position(|&l| Some(&whole(l)) == start)
                        .unwrap_or(0);
                    rim = vertices;
                    rim.rotate_left(turn);
                }
                Some(l) if l.kind == LoopKind::Hole => holes.push(vertices),
                _ => rest.push(vertices),
            }
        }
        // χ = V − E + F = 2 − 2g − (loops); every edge has two half-edges or one and a boundary.
        let boundary = twin.iter().filter(|&&t| t == NONE).count();
        let loop_count = holes.len() + rest.len() + usize::from(!rim.is_empty());
        let euler = count as i64 - (twin.len() + boundary) as i64 / 2 + faces.len() as i64;
        let handles = ((2 - loop_count as i64 - euler) / 2).max(0) as usize;
        let outer_count = rest.len();
        let outer = match rest.pop() {
            Some(outer) if rest.is_empty() && handles == 0 && !rim.is_empty() => outer,
            _ => return Err((handles, outer_count)),
        };
        let mut vertices = vec![0; count];
        for (l, &v) in fan.iter().enumerate() {
            vertices[v as usize] = self.topology.from(whole(l as u32));
        }
        let positions = vertices
            .iter()
            .map(|&v| self.mesh.positions[v as usize])
            .collect();
        let (triangles, _) = fan.as_chunks::<3>();
        Ok(Region {
            mesh: TriMesh {
                positions,
                faces: triangles.to_vec(),
            },
            vertices,
            faces,
            rim,
            holes,
            outer,
            reach,
        })
    }
}

/// Which faces are meant.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Inside,
    Outside,
}

impl Side {
    fn has(self, inside: bool) -> bool {
        inside == (self == Side::Inside)
    }
}
