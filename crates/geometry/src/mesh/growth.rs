//! How a region is cut out of a mesh: faces within reach, less what hangs loose, plus what is enclosed.

use super::TriMesh;
use super::geodesic::geodesic_distance_within;
use super::loops::{BoundaryLoop, LoopKind, walk};
use super::region::Region;
use super::topology::{NONE, Topology, corner_fans, previous};

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

    /// The faces across the edges of a face.
    fn beside(&self, face: u32) -> impl Iterator<Item = u32> + '_ {
        let twins = &self.topology.twin[3 * face as usize..3 * face as usize + 3];
        twins.iter().filter(|&&t| t != NONE).map(|t| t / 3)
    }

    /// Keeps only what hangs together with the faces at the rim.
    fn drop_islands(&self, inside: &mut [bool]) {
        let mut keep = vec![false; inside.len()];
        let mut open: Vec<u32> = self.rim.half_edges.iter().map(|h| h / 3).collect();
        open.retain(|&f| inside[f as usize]);
        while let Some(f) = open.pop() {
            if !std::mem::replace(&mut keep[f as usize], true) {
                open.extend(self.beside(f).filter(|&g| inside[g as usize]));
            }
        }
        inside.copy_from_slice(&keep);
    }

    /// Takes in pieces of the rest of the component that the region surrounds: no deeper than `limit` and bounded by the region and
    /// holes alone.
    fn fill_pockets(&self, inside: &mut [bool], limit: f64) {
        let mut seen: Vec<bool> = inside.to_vec();
        // A piece is given up at its first face that leads away; what is left of it is given up from there, too.
        let mut away = vec![false; inside.len()];
        for f in 0..inside.len() as u32 {
            let at_border = !seen[f as usize] && self.beside(f).any(|g| inside[g as usize]);
            if !at_border {
                continue;
            }
            let (mut piece, mut next, mut lost) = (vec![f], 0, false);
            seen[f as usize] = true;
            while next < piece.len() && !lost {
                let g = piece[next];
                next += 1;
                lost = away[g as usize] || self.leads_away(g, limit);
                for n in self.beside(g) {
                    lost |= away[n as usize];
                    if !std::mem::replace(&mut seen[n as usize], true) {
                        piece.push(n);
                    }
                }
            }
            for &g in &piece {
                inside[g as usize] = !lost;
                away[g as usize] = lost;
            }
        }
    }

    /// Whether a piece of the rest that contains this face stays outside whatever surrounds it.
    fn leads_away(&self, face: u32, limit: f64) -> bool {
        let face = face as usize;
        self.depth(face) > limit || (3 * face..3 * face + 3).any(|h| self.is_open(h))
    }

    /// Whether a half-edge lies on a loop of the whole mesh that is not a hole.
    fn is_open(&self, half_edge: usize) -> bool {
        self.loops
            .get(self.loop_of[half_edge] as usize)
            .is_some_and(|l| l.kind != LoopKind::Hole)
    }

    /// Takes out, at vertices where the region touches itself in a point, all fans but the largest; true when it took any.
    fn trim_bow_ties(&self, inside: &mut [bool]) -> bool {
        let across = |h: u32| match self.topology.twin[h as usize] {
            t if t != NONE && inside[t as usize / 3] => t,
            _ => NONE,
        };
        // Every open fan has one half-edge of the region's boundary that leaves its vertex.
        let mut leaving = vec![0u8; self.mesh.positions.len()];
        let mut ties = Vec::new();
        for h in 0..3 * inside.len() as u32 {
            if inside[h as usize / 3] && across(h) == NONE {
                let v = self.topology.from(h);
                let count = &mut leaving[v as usize];
                *count = count.saturating_add(1);
                if *count == 2 {
                    ties.push(v);
                }
            }
        }
        ties.sort_unstable();
        let mut taken: Vec<u32> = Vec::new();
        for v in ties {
            let mut fans: Vec<Vec<u32>> = Vec::new();
            for &h in self.topology.leaving(v) {
                let starts = inside[h as usize / 3] && across(h) == NONE;
                if starts {
                    let round = |&e: &u32| Some(across(previous(e))).filter(|&t| t != NONE);
                    let mut fan: Vec<u32> = std::iter::successors(Some(h), round)
                        .map(|e| e / 3)
                        .collect();
                    fan.sort_unstable();
                    fans.push(fan);
                }
            }
            // By its smallest face, so that the choice among equals depends on the mesh alone.
            fans.sort_unstable_by_key(|fan| fan.first().copied());
            let weight = |fan: &Vec<u32>| {
                let touching = fan.iter().any(|&f| self.touching[f as usize]);
                (touching, fan.len())
            };
            let largest = fans.iter().map(weight).max();
            let kept = fans.iter().position(|fan| Some(weight(fan)) == largest);
            for (k, fan) in fans.iter().enumerate() {
                if Some(k) != kept {
                    taken.extend(fan.iter().filter(|&&f| !self.touching[f as usize]));
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
