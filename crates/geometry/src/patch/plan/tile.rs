//! The triangles of a hole in the plane of the chart. A rim that touches itself bounds several pieces, each triangulated by itself.
//!
//! Welding keeps the sheets apart that meet in such a point, so that there the rim has vertices of its own for each of them: several in
//! one place. Triangulated as one polygon it would get triangles between them, which have no area, and edges from both, which are one.

use std::collections::{HashMap, HashSet};

use crate::mesh::{TriMesh, Vec2, Vec3};
use crate::patch::triangulate::{self, Triangulation};
use crate::patch::{PatchError, untangle};

/// Which vertices of a rim lie in one place, and which places the scan joins. A place is named by the first vertex that lies there.
pub(super) struct Places {
    /// Of every vertex along the rim.
    line: Vec<u32>,
    /// Ends of the scan's edges between places, the lower first.
    joined: HashSet<(u32, u32)>,
}

impl Places {
    /// The places of a rim whose vertices lie at `rim` on the scan.
    pub fn of(rim: &[Vec3], scan: &TriMesh) -> Places {
        let mut first = HashMap::new();
        let line: Vec<u32> = (0u32..)
            .zip(rim)
            .map(|(k, p)| *first.entry(bits(p)).or_insert(k))
            .collect();
        let low = rim.iter().fold(Vec3::repeat(f64::MAX), |m, p| m.inf(p));
        let high = rim.iter().fold(Vec3::repeat(f64::MIN), |m, p| m.sup(p));
        // Most of a scan is beside the rim's box and need not be looked up.
        let beside = |p: &Vec3| (0..3).any(|k| p[k] < low[k] || p[k] > high[k]);
        let place = |p: &Vec3| (!beside(p)).then(|| first.get(&bits(p)).copied()).flatten();
        let of: Vec<Option<u32>> = scan.positions.iter().map(place).collect();
        let joined = (scan.faces.iter())
            .flat_map(sides)
            .filter_map(|(a, b)| Some(edge(of[a as usize]?, of[b as usize]?)))
            .collect();
        Places { line, joined }
    }

    /// Splits a piece's edges between places that are joined already, by the scan or by another piece; its own join them from now on.
    fn split_taken_chords(&mut self, part: &mut Triangulation, piece: &[usize]) {
        let ends = |a: u32, b: u32| {
            let [a, b] = [a, b].map(|corner| self.line[piece[corner as usize]]);
            edge(a, b)
        };
        part.split_chords(piece.len(), |a, b| self.joined.contains(&ends(a, b)));
        let between = |(a, b): &(u32, u32)| (*a.max(b) as usize) < piece.len();
        let own: Vec<(u32, u32)> = (part.faces.iter())
            .flat_map(sides)
            .filter(between)
            .map(|(a, b)| ends(a, b))
            .collect();
        self.joined.extend(own);
    }
}

/// A position to look up; −0 is 0, as welding has it.
fn bits(p: &Vec3) -> [u64; 3] {
    [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())
}

fn sides(face: &[u32; 3]) -> [(u32, u32); 3] {
    [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])]
}

fn edge(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// Triangulates the hole of a rim whose vertices lie at `rim` in the plane, counter-clockwise: they are the first points. Edges are about
/// `spacing` long, inner points at most about `most`. Pieces share no points; each has its own vertex of a place that it shares.
///
/// # Errors
/// `RimCrosses` when a piece crosses or touches itself otherwise, or nothing has an area.
pub(super) fn tile(
    rim: Vec<Vec2>,
    mut places: Places,
    spacing: f64,
    most: usize,
) -> Result<Triangulation, PatchError> {
    let mut tiled = Triangulation {
        points: drawn_together(rim, &places.line),
        faces: Vec::new(),
    };
    let pieces = simple_pieces(&places.line);
    let polygon = |piece: &Vec<usize>| -> Option<Vec<Vec2>> {
        let corners: Vec<Vec2> = piece.iter().map(|k| tiled.points[*k]).collect();
        untangle::untangled(&corners)
    };
    let polygons: Option<Vec<Vec<Vec2>>> = pieces.iter().map(polygon).collect();
    let polygons = polygons
        .filter(|all| !all.is_empty())
        .ok_or(PatchError::RimCrosses)?;
    let area = |polygon: &Vec<Vec2>| triangulate::signed_area(polygon);
    let whole: f64 = polygons.iter().map(area).sum();
    for (piece, polygon) in pieces.iter().zip(&polygons) {
        let most = (most as f64 * (area(polygon) / whole)) as usize;
        let mut part = triangulate::triangulate(polygon, spacing, most)?;
        places.split_taken_chords(&mut part, piece);
        append(&mut tiled, &part, piece);
    }
    Ok(tiled)
}

/// The points of a line in the plane, those of one place in their middle: the chart of what surrounds a hole need not close there.
fn drawn_together(mut points: Vec<Vec2>, line: &[u32]) -> Vec<Vec2> {
    let mut sums = vec![(Vec2::zeros(), 0u32); points.len()];
    for (p, place) in points.iter().zip(line) {
        let (sum, count) = &mut sums[*place as usize];
        *sum += p;
        *count += 1;
    }
    for (p, place) in points.iter_mut().zip(line) {
        // A vertex alone in its place keeps every bit.
        if let (sum, count @ 2..) = sums[*place as usize] {
            *p = sum / f64::from(count);
        }
    }
    points
}

/// Cuts a closed line of places wherever it comes back to one, so that no piece comes to a place twice. Of each its vertices, in their
/// order; there and back is no piece.
fn simple_pieces(line: &[u32]) -> Vec<Vec<usize>> {
    let mut pieces = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    // Where each place is among the open ones.
    let mut met: Vec<Option<usize>> = vec![None; line.len()];
    for (k, place) in line.iter().enumerate() {
        if let Some(from) = met[*place as usize] {
            let piece = open.split_off(from);
            piece.iter().for_each(|j| met[line[*j] as usize] = None);
            pieces.push(piece);
        }
        met[*place as usize] = Some(open.len());
        open.push(k);
    }
    pieces.push(open);
    pieces.retain(|piece| piece.len() > 2);
    pieces
}

/// Adds the triangles of a piece, whose corners are the points that `piece` names.
fn append(tiled: &mut Triangulation, part: &Triangulation, piece: &[usize]) {
    let (corners, inner) = part.points.split_at(piece.len());
    for (k, p) in piece.iter().zip(corners) {
        tiled.points[*k] = *p;
    }
    let base = tiled.points.len();
    tiled.points.extend_from_slice(inner);
    let name = |v: u32| match piece.get(v as usize) {
        Some(corner) => *corner as u32,
        None => (base + v as usize - piece.len()) as u32,
    };
    tiled.faces.extend(part.faces.iter().map(|f| f.map(name)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The steps of a closed line.
    fn steps(places: &[u32]) -> Vec<(u32, u32)> {
        let next = places.iter().cycle().skip(1);
        places.iter().zip(next).map(|(a, b)| (*a, *b)).collect()
    }

    proptest! {
        #[test]
        fn pieces_are_simple_and_take_the_steps_of_the_line(raw in prop::collection::vec(0u32..12, 1..40)) {
            let line: Vec<u32> = raw.iter().map(|p| p % raw.len() as u32).collect();
            let mut left = steps(&line);
            for piece in simple_pieces(&line) {
                let places: Vec<u32> = piece.iter().map(|k| line[*k]).collect();
                prop_assert!(places.len() > 2);
                prop_assert_eq!(places.iter().collect::<HashSet<_>>().len(), places.len());
                for step in steps(&places) {
                    let at = left.iter().position(|other| *other == step);
                    prop_assert!(at.is_some(), "{:?} is taken", step);
                    if let Some(at) = at {
                        left.swap_remove(at);
                    }
                }
            }
            for (a, b) in &left {
                prop_assert!(left.contains(&(*b, *a)), "left out, but not there and back");
            }
        }
    }

    #[test]
    fn a_line_that_touches_nothing_is_one_piece() {
        assert_eq!(simple_pieces(&[0, 1, 2, 3]), [[0, 1, 2, 3]]);
    }
}
