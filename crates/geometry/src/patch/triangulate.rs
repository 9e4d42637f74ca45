//! Triangles for a polygon in the plane: points of a triangular lattice inside, then a constrained Delaunay
//! triangulation (crate spade) with the polygon's edges.

use darn_budget::{Budget, Exhausted};
use rstar::RTree;
use rstar::primitives::Line;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation as _};

use super::PatchError;
use crate::mesh::Vec2;

/// Lattice points nearer to the polygon than this, in lattice spacings, are left out: they would make slivers.
const CLEARANCE: f64 = 0.62;

/// Most lattice spacings across a polygon: a thin area inside a wide ragged polygon must not make millions of empty
/// rows.
const FINEST: f64 = 4000.0;

/// Nanoseconds of work a face in a split.
const FACE_WORK: u64 = 50;

/// A triangulated polygon.
#[derive(Debug, Clone, PartialEq)]
pub struct Triangulation {
    /// The polygon's corners in their order, then the inner points; scene units.
    pub points: Vec<Vec2>,
    /// Counter-clockwise triangles; every polygon edge belongs to exactly one.
    pub faces: Vec<[u32; 3]>,
}

/// A polygon with islands in it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outline {
    /// Corners of the counter-clockwise polygon, then those of each island, clockwise; scene units.
    corners: Vec<Vec2>,
    /// Per corner the next one of its loop.
    next: Vec<usize>,
    /// Islands.
    islands: usize,
}

impl Outline {
    /// A polygon; `islands` holds the number of its last corners that bound each island, in order.
    pub fn new(corners: Vec<Vec2>, islands: &[usize]) -> Outline {
        let mut next: Vec<usize> = (1..=corners.len()).collect();
        let mut end = corners.len();
        for count in islands.iter().rev() {
            let first = end.saturating_sub(*count);
            if let Some(last) = next[..end].last_mut() {
                *last = first;
            }
            end = first;
        }
        if let Some(last) = next[..end].last_mut() {
            *last = 0;
        }
        Outline {
            corners,
            next,
            islands: islands.len(),
        }
    }

    /// Its edges.
    fn edges(&self) -> impl Iterator<Item = (&Vec2, &Vec2)> {
        let next = self.next.iter().map(|n| &self.corners[*n]);
        self.corners.iter().zip(next)
    }

    /// Its area without the islands'; the chart's units squared.
    pub fn area(&self) -> f64 {
        0.5 * self.edges().map(|(a, b)| a.perp(b)).sum::<f64>()
    }
}

impl From<&[Vec2]> for Outline {
    /// Without islands.
    fn from(polygon: &[Vec2]) -> Outline {
        Outline::new(polygon.to_vec(), &[])
    }
}

/// Triangulates a simple counter-clockwise polygon without its islands, with inner edges of length about `spacing`, or longer so that there
/// are at most about `max_points` inner points.
///
/// # Errors
/// `RimCrosses` when the polygon crosses or touches itself or an island.
pub(super) fn triangulate(
    outline: &Outline,
    spacing: f64,
    max_points: usize,
) -> Result<Triangulation, PatchError> {
    let polygon = &outline.corners;
    let area = outline.area();
    if area.is_nan() || area <= 0.0 {
        return Err(PatchError::RimCrosses);
    }
    // A triangular lattice of spacing h has one point per h²·√3/2.
    let extent = (polygon.iter())
        .map(|p| (p - polygon[0]).amax())
        .fold(0.0, f64::max);
    let spacing = spacing.max(extent / FINEST);
    let spacing = spacing.max((area / max_points.max(1) as f64 / 0.75f64.sqrt()).sqrt());
    let mut points = polygon.clone();
    points.extend(lattice(outline, spacing));
    let faces = constrained_delaunay(&points, outline)?;
    Ok(Triangulation { points, faces })
}

impl Triangulation {
    /// Splits in the middle every inner edge between two of the polygon's `corners` that `taken` names.
    ///
    /// Two corners of a rim can be joined by an edge of the scan already. A second edge between them, of the patch,
    /// would be the same edge with four triangles.
    ///
    /// # Errors
    /// `Exhausted`: every split looks at all faces.
    pub(super) fn split_chords(
        &mut self,
        outline: &Outline,
        budget: &Budget,
        taken: impl Fn(u32, u32) -> bool,
    ) -> Result<(), Exhausted> {
        let Outline { corners, next, .. } = outline;
        let corners = corners.len();
        let apart =
            |a: u32, b: u32| next[a as usize] != b as usize && next[b as usize] != a as usize;
        let chord = |faces: &[[u32; 3]]| {
            faces
                .iter()
                .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])])
                .find(|(a, b)| (*a.max(b) as usize) < corners && apart(*a, *b) && taken(*a, *b))
        };
        while let Some((a, b)) = chord(&self.faces) {
            budget.spend(FACE_WORK * self.faces.len() as u64)?;
            let middle = self.points.len() as u32;
            self.points
                .push((self.points[a as usize] + self.points[b as usize]) * 0.5);
            let split = std::mem::take(&mut self.faces)
                .into_iter()
                .flat_map(|f| halves(f, (a, b), middle));
            self.faces = split.collect();
        }
        Ok(())
    }
}

/// The two halves of a face that has the edge, in either direction; the face itself where it has not.
fn halves(face: [u32; 3], edge: (u32, u32), middle: u32) -> Vec<[u32; 3]> {
    let on = (0..3).find(|k| {
        let (a, b) = (face[*k], face[(k + 1) % 3]);
        (a, b) == edge || (b, a) == edge
    });
    match on {
        None => vec![face],
        Some(k) => {
            let (a, b, c) = (face[k], face[(k + 1) % 3], face[(k + 2) % 3]);
            vec![[a, middle, c], [middle, b, c]]
        }
    }
}

/// The pairs of corners of an outline that a Delaunay triangulation of its inside joins across it, as indices, the lower
/// one first; empty when it crosses or touches itself.
pub(crate) fn across(outline: &Outline) -> Vec<(usize, usize)> {
    let faces = constrained_delaunay(&outline.corners, outline).unwrap_or_default();
    let sides = faces
        .iter()
        .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])]);
    let sides = sides.map(|(a, b)| (a as usize, b as usize));
    let apart = |(a, b): &(usize, usize)| outline.next[*a] != *b && outline.next[*b] != *a;
    // Every inner edge comes once in either direction.
    sides
        .filter(|side| side.0 < side.1 && apart(side))
        .collect()
}

/// Signed area of a polygon (shoelace formula), in its units squared; positive when counter-clockwise.
pub fn signed_area(polygon: &[Vec2]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    0.5 * polygon
        .iter()
        .zip(next)
        .map(|(a, b)| a.perp(b))
        .sum::<f64>()
}

/// Points of a triangular lattice inside the polygon, at a distance from its edges.
fn lattice(outline: &Outline, spacing: f64) -> Vec<Vec2> {
    let polygon = &outline.corners;
    let tree = RTree::bulk_load(
        (outline.edges())
            .map(|(a, b)| Line::new([a.x, a.y], [b.x, b.y]))
            .collect(),
    );
    let low = polygon.iter().fold(polygon[0], |m, p| m.inf(p));
    let high = polygon.iter().fold(polygon[0], |m, p| m.sup(p));
    let rise = spacing * 0.75f64.sqrt();
    let clear = (CLEARANCE * spacing).powi(2);
    let mut points = Vec::new();
    for row in 0..=((high.y - low.y) / rise) as usize {
        let y = low.y + (row as f64 + 0.5) * rise;
        let shift = if row % 2 == 0 { 0.25 } else { 0.75 };
        for span in scan_line(outline, y).chunks_exact(2) {
            let first = ((span[0] - low.x) / spacing - shift).ceil();
            let last = ((span[1] - low.x) / spacing - shift).floor();
            for column in first as i64..=last as i64 {
                let p = Vec2::new(low.x + (column as f64 + shift) * spacing, y);
                let free = tree.nearest_neighbor(&[p.x, p.y]).is_none_or(|line| {
                    use rstar::PointDistance;
                    line.distance_2(&[p.x, p.y]) > clear
                });
                if free {
                    points.push(p);
                }
            }
        }
    }
    points
}

/// The x coordinates where a horizontal line enters and leaves the polygon, ascending.
fn scan_line(outline: &Outline, y: f64) -> Vec<f64> {
    let mut xs: Vec<f64> = (outline.edges())
        .filter(|(a, b)| (a.y <= y) != (b.y <= y))
        .map(|(a, b)| a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x))
        .collect();
    xs.sort_by(f64::total_cmp);
    xs
}

/// A point with its index.
#[derive(Clone, Copy)]
struct IndexedPoint {
    at: Point2<f64>,
    index: u32,
}

impl HasPosition for IndexedPoint {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// Delaunay triangles inside the outline of the first points.
fn constrained_delaunay(points: &[Vec2], outline: &Outline) -> Result<Vec<[u32; 3]>, PatchError> {
    let next = &outline.next;
    let rim = next.len();
    let vertices = (0u32..)
        .zip(points)
        .map(|(index, p)| IndexedPoint {
            at: Point2::new(p.x, p.y),
            index,
        })
        .collect();
    let edges = (0..rim).map(|k| [k, next[k]]).collect();
    let mut crossed = false;
    let cdt = ConstrainedDelaunayTriangulation::<IndexedPoint>::try_bulk_load_cdt(
        vertices,
        edges,
        |_| crossed = true,
    )
    .map_err(|_| PatchError::RimCrosses)?;
    if crossed || cdt.num_vertices() != points.len() || cdt.num_constraints() != rim {
        return Err(PatchError::RimCrosses);
    }

    // Flood fill from the inner sides of the polygon's edges, which bound it.
    let mut inside = vec![false; cdt.num_all_faces()];
    let mut open: Vec<_> = cdt
        .directed_edges()
        .filter(|e| {
            let (from, to) = (e.from().data().index as usize, e.to().data().index as usize);
            e.is_constraint_edge() && next.get(from) == Some(&to)
        })
        .filter_map(|e| e.face().as_inner())
        .collect();
    let mut faces = Vec::new();
    while let Some(face) = open.pop() {
        if std::mem::replace(&mut inside[face.fix().index()], true) {
            continue;
        }
        faces.push(face.vertices().map(|v| v.data().index));
        let across = face
            .adjacent_edges()
            .into_iter()
            .filter(|e| !e.is_constraint_edge());
        open.extend(across.filter_map(|e| e.rev().face().as_inner()));
    }
    // The triangle count of a polygon with islands and inner points follows from Euler's formula; any other count means
    // that the fill leaked or missed a piece.
    if faces.len() + 2 != rim + 2 * (points.len() - rim) + 2 * outline.islands {
        return Err(PatchError::RimCrosses);
    }
    // Start every triangle at its lowest corner and sort them, so that the order depends on the points alone.
    for face in &mut faces {
        let lowest = (0..3).min_by_key(|k| face[*k]).unwrap_or(0);
        face.rotate_left(lowest);
    }
    faces.sort_unstable();
    Ok(faces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn star(radii: &[f64]) -> Vec<Vec2> {
        let turn = std::f64::consts::TAU / radii.len() as f64;
        radii
            .iter()
            .enumerate()
            .map(|(k, r)| Vec2::new((turn * k as f64).cos(), (turn * k as f64).sin()) * *r)
            .collect()
    }

    proptest! {
        #[test]
        fn triangles_cover_any_star_polygon_once(radii in prop::collection::vec(0.5..2.0f64, 5..60), spacing in 0.05..0.6f64) {
            let polygon = star(&radii);
            let triangulation = triangulate(&Outline::from(&polygon[..]), spacing, 5_000).unwrap();
            let mut sum = 0.0;
            for face in &triangulation.faces {
                let corners = face.map(|v| triangulation.points[v as usize]);
                let area = signed_area(&corners);
                prop_assert!(area > 0.0);
                sum += area;
            }
            prop_assert!((sum - signed_area(&polygon)).abs() < 1e-9);
            prop_assert_eq!(&triangulation.points[..polygon.len()], &polygon[..]);
        }
    }

    proptest! {
        #[test]
        fn islands_are_left_out(
            radii in prop::collection::vec(1.0..2.0f64, 8..40), spacing in 0.05..0.6f64,
            islands in prop::collection::vec(prop::collection::vec(0.1..0.3f64, 3..12), 1..3),
        ) {
            let mut corners = star(&radii);
            let rim = corners.len();
            for (radii, x) in islands.iter().zip([-0.4, 0.4]) {
                corners.extend(star(radii).into_iter().rev().map(|p| p + Vec2::new(x, 0.0)));
            }
            let counts: Vec<usize> = islands.iter().map(Vec::len).collect();
            let outline = Outline::new(corners.clone(), &counts);
            let triangulation = triangulate(&outline, spacing, 5_000).unwrap();
            let areas = (triangulation.faces.iter()).map(|f| signed_area(&f.map(|v| triangulation.points[v as usize])));
            let islands: f64 = outline.area() - signed_area(&corners[..rim]);
            prop_assert!(islands < 0.0);
            prop_assert!((areas.sum::<f64>() - outline.area()).abs() < 1e-9);
            let edges = triangulation.faces.iter().flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])]);
            let edges: std::collections::HashSet<(u32, u32)> = edges.collect();
            for (from, to) in outline.next.iter().enumerate() {
                prop_assert!(edges.contains(&(from as u32, *to as u32)));
            }
        }
    }

    #[test]
    fn a_figure_of_eight_is_an_error() {
        let eight = [
            (0.0, 0.0),
            (1.0, 1.0),
            (2.0, 0.0),
            (2.0, 1.5),
            (1.0, 0.5),
            (0.0, 1.5),
        ];
        let eight: Vec<Vec2> = eight.iter().map(|p| Vec2::new(p.0, p.1)).collect();
        assert!(matches!(
            triangulate(&Outline::from(&eight[..]), 0.1, 1000),
            Err(PatchError::RimCrosses)
        ));
    }

    #[test]
    fn a_taken_chord_is_split_and_the_area_stays() {
        let polygon = star(&[1.0; 8]);
        let outline = Outline::from(&polygon[..]);
        let mut triangulation = triangulate(&outline, 10.0, 100).unwrap();
        let joined = |t: &Triangulation, a: u32, b: u32| {
            t.faces.iter().any(|f| f.contains(&a) && f.contains(&b))
        };
        let pairs = (0..8)
            .flat_map(|a| (a + 2..8).map(move |b| (a, b)))
            .filter(|(a, b)| (a, b) != (&0, &7));
        let (a, b) = pairs
            .clone()
            .find(|(a, b)| joined(&triangulation, *a, *b))
            .unwrap();
        triangulation
            .split_chords(&outline, Budget::unlimited(), |x, y| {
                (x.min(y), x.max(y)) == (a, b)
            })
            .unwrap();
        assert!(!joined(&triangulation, a, b));
        assert_eq!(triangulation.faces.len(), 8);
        let area: f64 = triangulation
            .faces
            .iter()
            .map(|f| signed_area(&f.map(|v| triangulation.points[v as usize])))
            .sum();
        assert!((area - signed_area(&polygon)).abs() < 1e-12);
    }

    #[test]
    fn the_number_of_points_is_bounded() {
        let triangulation = triangulate(&Outline::from(&star(&[1.0; 30])[..]), 1e-6, 500).unwrap();
        assert!(triangulation.points.len() < 600);
    }
}
