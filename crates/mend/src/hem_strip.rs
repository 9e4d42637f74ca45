//! A line of new hem, and the strip of helper triangles that lies along its outer side, joined to the hem at both ends.

use std::collections::BTreeSet;

use crate::welded_scan::WeldedScan;
use darn_geometry::mesh::loops::BoundaryLoop;
use darn_geometry::mesh::{TriMesh, Vec3};

/// Edges of the hem on each side of a stretch that the strip lies along: it must be joined to the cloth by edges, and
/// shows the fill where the hem goes.
const OVERLAP: usize = 4;
/// Edges of the hem on each side that its direction is taken from.
const HEM: usize = 8;
/// Rows of the strip, each as wide as an edge of the hem.
const ROWS: usize = 3;
/// Most points of a new line of hem.
const MOST_POINTS: usize = 4096;

/// The vertices of loops that strips lie along.
#[derive(Default)]
pub struct HemVertices(BTreeSet<(u32, usize)>);

impl HemVertices {
    /// Whether a strip lies along a loop's vertex.
    pub fn has(&self, rim: &BoundaryLoop, vertex: usize) -> bool {
        self.0.contains(&(rim.id.0, vertex))
    }
}

/// The direction of a hem along its loop.
#[derive(Clone, Copy)]
pub enum Way {
    /// As the loop runs.
    On,
    /// Against it.
    Back,
}

/// A hem that goes on from the end of a stretch, away from it.
pub struct HemEnd<'a> {
    /// Its loop.
    pub rim: &'a BoundaryLoop,
    /// The end of the stretch, an index into the loop's vertices.
    pub vertex: usize,
    /// Where the hem goes from there.
    pub way: Way,
    /// Its edges, up to the next stretch.
    pub edges: usize,
}

impl HemEnd<'_> {
    /// The loop's vertex after this many edges of the hem.
    fn vertex(&self, edges: usize) -> usize {
        let n = self.rim.vertices.len();
        match self.way {
            Way::On => (self.vertex + edges) % n,
            Way::Back => (self.vertex + n - edges % n) % n,
        }
    }

    /// The place after this many edges of the hem, scene space.
    pub fn place(&self, whole: &WeldedScan, edges: usize) -> Vec3 {
        whole.rim_position(self.rim, self.vertex(edges))
    }

    /// How many edges its direction is taken from.
    fn shown(&self) -> usize {
        HEM.min(self.edges.saturating_sub(1) / 2).max(1)
    }

    /// How many edges the strip lies along.
    fn overlap(&self, used: &HemVertices) -> usize {
        let most = OVERLAP.min(self.edges.saturating_sub(1) / 2);
        let free = |k: &usize| !used.has(self.rim, self.vertex(*k));
        (1..=most).take_while(free).count()
    }

    /// Its direction at the end of the stretch, away from the stretch.
    fn direction(&self, whole: &WeldedScan) -> Vec3 {
        unit(self.place(whole, self.shown()) - self.place(whole, 0))
    }

    /// The mean direction out of the cloth.
    fn outward(&self, whole: &WeldedScan) -> Vec3 {
        let edges = (0..self.shown()).map(|k| match self.way {
            Way::On => self.vertex(k),
            Way::Back => self.vertex(k + 1),
        });
        unit(edges.map(|k| whole.outward(self.rim, k)).sum())
    }

    /// The sum of the lengths of the edges that it is seen by.
    fn length(&self, whole: &WeldedScan) -> f64 {
        let edges = (0..self.shown()).map(|k| self.place(whole, k + 1) - self.place(whole, k));
        edges.map(|edge| edge.norm()).sum()
    }
}

/// A line of new hem from one hem to another.
pub struct NewHem<'a> {
    /// Where it starts.
    pub before: HemEnd<'a>,
    /// Where it ends.
    pub after: HemEnd<'a>,
    /// Points that it goes through; without them it continues both hems.
    pub along: &'a [Vec3],
}

impl NewHem<'_> {
    /// Adds the strip to a surface, marks the vertices of the loops that it uses, and returns the line, both ends included; or why there
    /// is no place for it.
    pub fn add_strip(
        &self,
        whole: &WeldedScan,
        used: &mut HemVertices,
        surface: &mut TriMesh,
    ) -> Result<Vec<Vec3>, String> {
        let ends = [&self.before, &self.after];
        let [before, after] = ends.map(|end| end.overlap(used));
        if before == 0 || after == 0 {
            return Err("too little of the hem is left beside the stretch".to_owned());
        }
        let shown: usize = ends.iter().map(|end| end.shown()).sum();
        let length: f64 = ends.iter().map(|end| end.length(whole)).sum();
        let edge = length / shown as f64;
        let line = self.line(whole, edge);
        let [out_before, out_after] = ends.map(|end| end.outward(whole));
        // The strip's inner side.
        let inner: Vec<Vec3> = ((1..=before).rev().map(|k| self.before.place(whole, k)))
            .chain(line.iter().copied())
            .chain((1..=after).map(|k| self.after.place(whole, k)))
            .collect();
        for (end, edges) in ends.iter().zip([before, after]) {
            let vertices = (0..=edges).map(|k| (end.rim.id.0, end.vertex(k)));
            used.0.extend(vertices);
        }
        let base = surface.positions.len() as u32;
        let count = inner.len();
        for row in 0..=ROWS {
            for (k, p) in inner.iter().enumerate() {
                let share = k as f64 / (count - 1) as f64;
                let tangent = inner[(k + 1).min(count - 1)] - inner[k.saturating_sub(1)];
                let out = out_before.lerp(&out_after, share);
                let tangent = unit(tangent);
                let out = unit(out - tangent * out.dot(&tangent));
                surface.positions.push(p + out * (edge * row as f64));
            }
        }
        let vertex = |row: usize, k: usize| base + (row * count + k) as u32;
        for row in 0..ROWS {
            for k in 0..count - 1 {
                let (a, b) = (vertex(row, k), vertex(row, k + 1));
                let (c, d) = (vertex(row + 1, k), vertex(row + 1, k + 1));
                surface.faces.extend([[b, a, c], [b, c, d]]);
            }
        }
        Ok(line)
    }

    /// The line in edges of about this length: through the given points, or, without them, the cubic curve that continues the hem on
    /// both sides.
    fn line(&self, whole: &WeldedScan, edge: f64) -> Vec<Vec3> {
        let (from, to) = (self.before.place(whole, 0), self.after.place(whole, 0));
        let mut line = vec![from];
        if self.along.is_empty() {
            let chord = (to - from).norm();
            let curve = Hermite {
                from,
                to,
                leaving: self.before.direction(whole) * -chord,
                arriving: self.after.direction(whole) * chord,
            };
            let points: Vec<Vec3> = (0..=64).map(|k| curve.at(f64::from(k) / 64.0)).collect();
            let length: f64 = points.windows(2).map(|e| (e[1] - e[0]).norm()).sum();
            let count = pieces(length, edge);
            line.extend((1..=count).map(|k| curve.at(k as f64 / count as f64)));
        } else {
            let mut start = from;
            for end in self.along.iter().copied().chain([to]) {
                let count = pieces((end - start).norm(), edge);
                let point = |k: usize| start.lerp(&end, k as f64 / count as f64);
                line.extend((1..=count).map(point));
                start = end;
                if line.len() > MOST_POINTS {
                    break;
                }
            }
        }
        line.dedup();
        // The ends are the scan's own vertices, bit for bit.
        if let Some(last) = line.last_mut() {
            *last = to;
        }
        line
    }
}

/// A cubic curve by its ends and its derivatives there.
struct Hermite {
    from: Vec3,
    to: Vec3,
    leaving: Vec3,
    arriving: Vec3,
}

impl Hermite {
    fn at(&self, t: f64) -> Vec3 {
        let (t2, t3) = (t * t, t * t * t);
        self.from * (2.0 * t3 - 3.0 * t2 + 1.0)
            + self.leaving * (t3 - 2.0 * t2 + t)
            + self.to * (3.0 * t2 - 2.0 * t3)
            + self.arriving * (t3 - t2)
    }
}

/// Edges of about this length that a line of another length is divided into.
fn pieces(length: f64, edge: f64) -> usize {
    let count = (length / edge).round();
    if count.is_finite() {
        (count as usize).clamp(1, MOST_POINTS)
    } else {
        1
    }
}

fn unit(v: Vec3) -> Vec3 {
    v.try_normalize(f64::MIN_POSITIVE)
        .unwrap_or_else(Vec3::zeros)
}
