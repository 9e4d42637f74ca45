//! Flat panels: outlines of straight and curved runs, each sewn or open, and their triangulation.

use darn_geometry::mesh::Vec2;
use darn_geometry::polygon::inside;
use rand::Rng;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};
use std::collections::HashSet;

/// Height of the bow of a straight run, ÷ its length.
const BOW: f64 = 1.0e-4;
/// Segments in which a curved run is measured before it is divided.
const FINE: usize = 64;
/// An inner vertex keeps this distance from the outline, in spacings.
const MARGIN: f64 = 0.7;
/// Rounds in which inner edges between two vertices of the outline are divided; two or three suffice.
const ROUNDS: usize = 8;

/// What a run of an outline becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RunUse {
    /// Sewn to the other run of this seam.
    Seam(u16),
    /// Part of the opening of this index in the pattern's list.
    Open(usize),
}

/// One run of an outline, from its first point to the first point of the next run.
#[derive(Debug, Clone)]
pub(super) struct Run {
    points: Vec<Vec2>,
    pub(super) becomes: RunUse,
}

/// A closed outline, counter-clockwise.
#[derive(Debug, Clone)]
pub(super) struct Outline {
    at: Vec2,
    pub(super) runs: Vec<Run>,
}

/// Which layer of the garment a panel belongs to while all panels lie flat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    /// Towards −y; its outside is the face seen in the drawing.
    Front,
    /// Towards +y; drawn as seen through the front panel.
    Back,
}

/// A flat piece of cloth and where it lies before it is draped.
#[derive(Debug, Clone)]
pub(super) struct Panel {
    pub(super) outline: Outline,
    pub(super) side: Side,
    /// Position of the drawing's origin in the flat lay, (x, z).
    pub(super) origin: Vec2,
    /// Angle by which the drawing is turned in the flat lay, radians.
    pub(super) turned: f64,
}

/// A triangulated panel.
#[derive(Debug, Clone)]
pub(super) struct PanelMesh {
    /// Positions in the drawing; those of the outline come first, in order.
    pub(super) points: Vec<Vec2>,
    /// Counter-clockwise in the drawing.
    pub(super) faces: Vec<[u32; 3]>,
    /// Per run of the outline the index of its first vertex.
    pub(super) starts: Vec<usize>,
    /// Vertices on the outline.
    pub(super) border: usize,
}

impl Run {
    /// Its length, metres.
    pub(super) fn length(&self) -> f64 {
        self.points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
    }

    /// The point after a share of its length.
    fn at(&self, share: f64) -> Vec2 {
        let mut left = share * self.length();
        for w in self.points.windows(2) {
            let step = (w[1] - w[0]).norm();
            if left <= step && step > 0.0 {
                return w[0] + (w[1] - w[0]) * (left / step);
            }
            left -= step;
        }
        self.points[self.points.len() - 1]
    }
}

impl Outline {
    /// An outline that starts at a point.
    pub(super) fn from(x: f64, y: f64) -> Self {
        Self {
            at: Vec2::new(x, y),
            runs: Vec::new(),
        }
    }

    /// A straight run, but for a bow inwards of [`BOW`] of its length: a triangle along it would have no area.
    pub(super) fn line(self, to: [f64; 2], becomes: RunUse) -> Self {
        let way = Vec2::from(to) - self.at;
        let middle = self.at + way * 0.5 + Vec2::new(-way.y, way.x) * (2.0 * BOW);
        self.curve(middle.into(), to, becomes)
    }

    /// A run along a quadratic Bézier curve.
    pub(super) fn curve(mut self, control: [f64; 2], to: [f64; 2], becomes: RunUse) -> Self {
        let (from, control, to) = (self.at, Vec2::from(control), Vec2::from(to));
        let point = |k: usize| {
            let t = k as f64 / FINE as f64;
            let (a, b) = (from.lerp(&control, t), control.lerp(&to, t));
            a.lerp(&b, t)
        };
        self.at = to;
        self.runs.push(Run {
            points: (0..=FINE).map(point).collect(),
            becomes,
        });
        self
    }
}

impl Outline {
    /// Its area, square metres.
    pub(super) fn area(&self) -> f64 {
        let points: Vec<Vec2> = self.runs.iter().flat_map(|r| r.points.clone()).collect();
        shoelace(&points).abs()
    }
}

/// Signed area of a polygon, positive when counter-clockwise.
pub(super) fn shoelace(polygon: &[Vec2]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| 0.5 * a.perp(b)).sum()
}

impl Panel {
    /// Where a point of the drawing lies in the flat lay, (x, z).
    pub(super) fn laid(&self, p: Vec2) -> Vec2 {
        let (s, c) = self.turned.sin_cos();
        self.origin + Vec2::new(c * p.x - s * p.y, s * p.x + c * p.y)
    }

    /// Triangulates the panel with irregular inner vertices `spacing` apart. `divisions` holds the segments of every run.
    pub(super) fn triangulate(
        &self,
        divisions: &[usize],
        spacing: f64,
        rng: &mut impl Rng,
    ) -> Result<PanelMesh, String> {
        let mut points = Vec::new();
        let mut starts = Vec::new();
        for (run, n) in self.outline.runs.iter().zip(divisions) {
            starts.push(points.len());
            points.extend((0..*n).map(|k| run.at(k as f64 / *n as f64)));
        }
        let border = points.len();
        let outline = points.clone();
        points.extend(inner_points(&outline, spacing, rng));
        for _ in 0..ROUNDS {
            let faces = delaunay(&points, border)?;
            let across = chords(&faces, border);
            if across.is_empty() {
                return Ok(PanelMesh {
                    points,
                    faces,
                    starts,
                    border,
                });
            }
            let middle = |(a, b): (u32, u32)| (points[a as usize] + points[b as usize]) * 0.5;
            let added: Vec<Vec2> = across.into_iter().map(middle).collect();
            points.extend(added);
        }
        Err("it is too narrow for its spacing".into())
    }
}

/// Jittered points of a hexagonal lattice that keep off the outline.
fn inner_points(outline: &[Vec2], spacing: f64, rng: &mut impl Rng) -> Vec<Vec2> {
    let first = outline.first().copied().unwrap_or_default();
    let low = outline.iter().fold(first, |low, p| low.inf(p));
    let high = outline.iter().fold(first, |high, p| high.sup(p));
    let rise = spacing * 0.75f64.sqrt();
    let rows = ((high.y - low.y) / rise).ceil() as usize;
    let columns = ((high.x - low.x) / spacing).ceil() as usize + 1;
    let mut found = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let mut jitter = || rng.random_range(-0.25..0.25);
            let shift = 0.5 * (j % 2) as f64;
            let p = low
                + Vec2::new(
                    (i as f64 - shift + jitter()) * spacing,
                    (j as f64 + 0.5 + jitter()) * rise,
                );
            let keeps_off = |q: &Vec2| (p - q).norm() >= MARGIN * spacing;
            if inside(outline, p) && outline.iter().all(keeps_off) {
                found.push(p);
            }
        }
    }
    found
}

/// The faces within the outline, which is the first `border` points.
fn delaunay(points: &[Vec2], border: usize) -> Result<Vec<[u32; 3]>, String> {
    let mut triangulation = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles = Vec::new();
    for p in points {
        let handle = triangulation.insert(Point2::new(p.x, p.y));
        handles.push(handle.map_err(|e| e.to_string())?);
    }
    if handles.iter().enumerate().any(|(k, h)| h.index() != k) {
        return Err("two of its vertices coincide".into());
    }
    for k in 0..border {
        let (a, b) = (handles[k], handles[(k + 1) % border]);
        if !triangulation.can_add_constraint(a, b) {
            return Err("its outline crosses itself".into());
        }
        triangulation.add_constraint(a, b);
    }
    let outline = &points[..border];
    let corners = triangulation
        .inner_faces()
        .map(|f| f.vertices().map(|v| v.fix().index() as u32));
    let within = |f: &[u32; 3]| {
        let centre = f.iter().map(|v| points[*v as usize]).sum::<Vec2>() / 3.0;
        inside(outline, centre)
    };
    Ok(corners.filter(within).collect())
}

/// Inner edges between two vertices of the outline: sewn to another panel with the same edge, they would have four faces.
fn chords(faces: &[[u32; 3]], border: usize) -> Vec<(u32, u32)> {
    let n = border as u32;
    let mut seen = HashSet::new();
    let mut found = Vec::new();
    for f in faces {
        for k in 0..3 {
            let (a, b) = (f[k].min(f[(k + 1) % 3]), f[k].max(f[(k + 1) % 3]));
            let follow = b - a == 1 || (a == 0 && b == n - 1);
            if b < n && !follow && seen.insert((a, b)) {
                found.push((a, b));
            }
        }
    }
    found
}
