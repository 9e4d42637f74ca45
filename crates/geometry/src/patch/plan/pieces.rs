//! The triangles of a hole in the plane of the chart. A rim that touches itself bounds several pieces, each
//! triangulated alone.
//!
//! Welding keeps surfaces that meet in one point apart, so the rim has several vertices at that point, one for each
//! surface. Triangulated as one polygon, the hole would get triangles without area between these vertices, and two
//! edges that are the same edge on the scan.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use darn_budget::{Budget, Exhausted};

use crate::mesh::bounds::Bounds;
use crate::mesh::{TriMesh, Vec2, Vec3};
use crate::patch::triangulate::{self, Outline, Triangulation};
use crate::patch::{PatchError, untangle};
use crate::polygon::inside;

/// Nanoseconds of work a point in a triangulation.
const POINT_WORK: u64 = 500;

/// The distinct points of a rim and the edges between them. The index of a point is that of the first rim vertex there.
pub(super) struct RimPoints {
    /// The point of every vertex along the rim.
    line: Vec<u32>,
    /// Edges between points, on the scan and on triangulated pieces; the lower end comes first.
    joined: HashSet<(u32, u32)>,
}

impl RimPoints {
    /// The points of a rim whose vertices lie at `rim` on the scan; `near` holds all faces of the scan that meet their
    /// box, and perhaps others.
    pub fn new(rim: &[Vec3], scan: &TriMesh, near: impl Iterator<Item = usize>) -> RimPoints {
        let (line, first) = points_of(rim);
        let bounds = Bounds::of(rim);
        let point = |v: u32| {
            let p = &scan.positions[v as usize];
            // Spares a look-up for most of the scan.
            let inside = bounds.is_some_and(|bounds| bounds.contains(p));
            inside.then(|| first.get(&bits(p)).copied()).flatten()
        };
        let joined = near
            .map(|face| scan.faces[face].map(point))
            .flat_map(|[a, b, c]| [(a, b), (b, c), (c, a)])
            .filter_map(|(a, b)| Some(edge(a?, b?)))
            .collect();
        RimPoints { line, joined }
    }

    /// Splits the chords of a piece between points that the scan or another piece joins already, then records the
    /// piece's own edges.
    ///
    /// # Errors
    /// `Exhausted`.
    fn split_taken_chords(
        &mut self,
        part: &mut Triangulation,
        (outline, piece): (&Outline, &[usize]),
        budget: &Budget,
    ) -> Result<(), Exhausted> {
        let ends = |a: u32, b: u32| {
            let [a, b] = [a, b].map(|corner| self.line[piece[corner as usize]]);
            edge(a, b)
        };
        part.split_chords(outline, budget, |a, b| self.joined.contains(&ends(a, b)))?;
        let between = |(a, b): &(u32, u32)| (*a.max(b) as usize) < piece.len();
        let own: Vec<(u32, u32)> = (part.faces.iter())
            .flat_map(sides)
            .filter(between)
            .map(|(a, b)| ends(a, b))
            .collect();
        self.joined.extend(own);
        Ok(())
    }
}

/// The point of every vertex along a rim that lies at `rim`: the index of the first vertex there; and that index by
/// position.
fn points_of(rim: &[Vec3]) -> (Vec<u32>, HashMap<[u64; 3], u32>) {
    let mut first = HashMap::new();
    let line = (0u32..)
        .zip(rim)
        .map(|(k, p)| *first.entry(bits(p)).or_insert(k))
        .collect();
    (line, first)
}

/// The pieces that a rim bounds where it touches itself, each as the rim's vertices around it; one piece otherwise.
pub(in crate::patch) fn rim_pieces(rim: &[Vec3]) -> Vec<Vec<usize>> {
    simple_pieces(&points_of(rim).0)
}

/// The key of a position; −0 equals 0, as in welding.
fn bits(p: &Vec3) -> [u64; 3] {
    [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())
}

fn sides(face: &[u32; 3]) -> [(u32, u32); 3] {
    [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])]
}

fn edge(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// What a triangulation should be like, and what it may cost.
pub(super) struct Asked<'a> {
    /// Length of its edges, about, scene units.
    pub spacing: f64,
    /// Most inner points, about.
    pub max_points: usize,
    /// How many of the last rim vertices lie around each island in the hole, clockwise.
    pub islands: Vec<usize>,
    /// What it may cost.
    pub budget: &'a Budget<'a>,
}

/// Triangulates the hole of a rim whose vertices lie at `rim` in the plane, counter-clockwise, then those around islands;
/// they become the first points.
///
/// Pieces share no vertices: at a common point each has its own.
///
/// # Errors
/// `RimCrosses` when a piece overlaps itself or no piece has an area; `Exhausted`.
pub(super) fn triangulate_pieces(
    rim: Vec<Vec2>,
    mut rim_points: RimPoints,
    asked: &Asked,
) -> Result<Triangulation, PatchError> {
    let Asked {
        spacing,
        max_points,
        ref islands,
        budget,
    } = *asked;
    let mut whole = Triangulation {
        points: with_common_points(rim, &rim_points.line),
        faces: Vec::new(),
    };
    let own = whole.points.len() - islands.iter().sum::<usize>();
    let piece = |corners: Vec<usize>| -> Result<Piece, PatchError> {
        let polygon: Vec<Vec2> = corners.iter().map(|k| whole.points[*k]).collect();
        Ok(Piece {
            polygon: untangle::untangle(&polygon, budget)?.ok_or(PatchError::RimCrosses)?,
            corners,
            islands: Vec::new(),
        })
    };
    let pieces = simple_pieces(&rim_points.line[..own]).into_iter();
    let mut pieces: Vec<Piece> = pieces.map(piece).collect::<Result<_, _>>()?;
    if pieces.is_empty() {
        return Err(PatchError::RimCrosses);
    }
    let mut first = own;
    for count in islands {
        let island = first..first + count;
        first = island.end;
        let at = whole.points[island.start];
        let around = pieces.iter_mut().find(|p| inside(&p.polygon, at));
        around.ok_or(PatchError::RimCrosses)?.islands.push(island);
    }
    let pieces: Vec<(Outline, Vec<usize>)> = (pieces.into_iter())
        .map(|p| p.outline(&whole.points))
        .collect();
    let whole_area: f64 = pieces.iter().map(|(outline, _)| outline.area()).sum();
    for (outline, corners) in &pieces {
        let max_points = (max_points as f64 * (outline.area() / whole_area)) as usize;
        budget.spend(POINT_WORK * (corners.len() + max_points) as u64)?;
        let mut part = triangulate::triangulate(outline, spacing, max_points)?;
        rim_points.split_taken_chords(&mut part, (outline, corners), budget)?;
        append(&mut whole, &part, corners);
    }
    Ok(whole)
}

/// A piece of a hole.
struct Piece {
    /// Its polygon, without crossings.
    polygon: Vec<Vec2>,
    /// Per corner of the polygon its rim vertex.
    corners: Vec<usize>,
    /// The islands in it, as stretches of rim vertices.
    islands: Vec<Range<usize>>,
}

impl Piece {
    /// Its outline with its islands, and the rim vertices of the outline's corners.
    fn outline(self, points: &[Vec2]) -> (Outline, Vec<usize>) {
        let Piece {
            mut polygon,
            mut corners,
            islands,
        } = self;
        let counts: Vec<usize> = islands.iter().map(Range::len).collect();
        for island in islands {
            polygon.extend_from_slice(&points[island.clone()]);
            corners.extend(island);
        }
        (Outline::new(polygon, &counts), corners)
    }
}

/// The rim in the plane with all vertices of one point at their mean: the chart may have laid them apart.
fn with_common_points(mut points: Vec<Vec2>, line: &[u32]) -> Vec<Vec2> {
    let mut sums = vec![(Vec2::zeros(), 0u32); points.len()];
    for (p, point) in points.iter().zip(line) {
        let (sum, count) = &mut sums[*point as usize];
        *sum += p;
        *count += 1;
    }
    for (p, point) in points.iter_mut().zip(line) {
        // A vertex alone at its point keeps its exact coordinates.
        if let (sum, count @ 2..) = sums[*point as usize] {
            *p = sum / f64::from(count);
        }
    }
    points
}

/// Cuts a closed line of points wherever it returns to one, so that no piece visits a point twice. Gives the vertices
/// of each piece in order; pieces of two vertices are dropped.
fn simple_pieces(line: &[u32]) -> Vec<Vec<usize>> {
    let mut pieces = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    // Per point: its index in `open`.
    let mut met: Vec<Option<usize>> = vec![None; line.len()];
    for (k, point) in line.iter().enumerate() {
        if let Some(from) = met[*point as usize] {
            let piece = open.split_off(from);
            piece.iter().for_each(|j| met[line[*j] as usize] = None);
            pieces.push(piece);
        }
        met[*point as usize] = Some(open.len());
        open.push(k);
    }
    pieces.push(open);
    pieces.retain(|piece| piece.len() > 2);
    pieces
}

/// Appends the triangles of a piece; `piece` holds the indices of its corners in `whole`.
fn append(whole: &mut Triangulation, part: &Triangulation, piece: &[usize]) {
    let (corners, inner) = part.points.split_at(piece.len());
    for (k, p) in piece.iter().zip(corners) {
        whole.points[*k] = *p;
    }
    let base = whole.points.len();
    whole.points.extend_from_slice(inner);
    let vertex = |v: u32| match piece.get(v as usize) {
        Some(corner) => *corner as u32,
        None => (base + v as usize - piece.len()) as u32,
    };
    whole.faces.extend(part.faces.iter().map(|f| f.map(vertex)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The steps of a closed line.
    fn steps(points: &[u32]) -> Vec<(u32, u32)> {
        let next = points.iter().cycle().skip(1);
        points.iter().zip(next).map(|(a, b)| (*a, *b)).collect()
    }

    proptest! {
        #[test]
        fn pieces_are_simple_and_use_every_step_of_the_line_once(raw in prop::collection::vec(0u32..12, 1..40)) {
            let line: Vec<u32> = raw.iter().map(|p| p % raw.len() as u32).collect();
            let mut left = steps(&line);
            for piece in simple_pieces(&line) {
                let points: Vec<u32> = piece.iter().map(|k| line[*k]).collect();
                prop_assert!(points.len() > 2);
                prop_assert_eq!(points.iter().collect::<HashSet<_>>().len(), points.len());
                for step in steps(&points) {
                    let at = left.iter().position(|other| *other == step);
                    prop_assert!(at.is_some(), "{:?} is used twice or not in the line", step);
                    if let Some(at) = at {
                        left.swap_remove(at);
                    }
                }
            }
            for (a, b) in &left {
                prop_assert!(left.contains(&(*b, *a)), "a dropped step has its reverse");
            }
        }
    }

    #[test]
    fn a_line_that_touches_nothing_is_one_piece() {
        assert_eq!(simple_pieces(&[0, 1, 2, 3]), [[0, 1, 2, 3]]);
    }
}
