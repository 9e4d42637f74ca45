//! Which triangles reach into a ball, or into a prism over a polygon.

use darn_budget::{Budget, Exhausted, Steps};

use super::{TriMesh, Vec2, Vec3};
use crate::polygon::{crosses, inside};

/// Nanoseconds of work a face that is looked at.
const FACE_WORK: u64 = 12;
/// Nanoseconds of work a corner of the polygon for a face near it.
const CORNER_WORK: u64 = 12;

/// The faces, ascending, of which a point lies less than `radius` from `center` (scene units). O(faces).
///
/// # Errors
/// `Exhausted`.
pub fn faces_in_ball(
    mesh: &TriMesh,
    center: Vec3,
    radius: f64,
    budget: &Budget,
) -> Result<Vec<u32>, Exhausted> {
    let mut steps = Steps::of(budget);
    let mut found = Vec::new();
    for (f, face) in (0u32..).zip(&mesh.faces) {
        steps.take(FACE_WORK)?;
        let corners = face.map(|v| mesh.positions[v as usize] - center);
        let apart = (0..3).any(|k| {
            let along = corners.map(|p| p[k]);
            along.iter().all(|x| *x > radius) || along.iter().all(|x| *x < -radius)
        });
        if !apart && distance_to_origin(&corners) < radius {
            found.push(f);
        }
    }
    Ok(found)
}

/// Distance of a triangle from the point `center`, scene units.
pub fn distance(triangle: &[Vec3; 3], center: &Vec3) -> f64 {
    distance_to_origin(&triangle.map(|p| p - center))
}

/// Distance of the origin from a triangle: from its plane where it lies over the triangle, else from its sides.
fn distance_to_origin(corners: &[Vec3; 3]) -> f64 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    let area2 = normal.norm_squared();
    let sides = [(a, b), (b, c), (c, a)];
    let over = area2 > 0.0 && sides.iter().all(|(p, q)| p.cross(q).dot(&normal) >= 0.0);
    if over {
        return a.dot(&normal).abs() / area2.sqrt();
    }
    let to_side = |(p, q): (&Vec3, &Vec3)| {
        let along = q - p;
        let square = along.norm_squared();
        let t = if square > 0.0 {
            (-p.dot(&along) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (p + along * t).norm()
    };
    sides.into_iter().map(to_side).fold(f64::INFINITY, f64::min)
}

/// A prism over a polygon, along the polygon's mean normal.
#[derive(Debug, Clone)]
pub struct Prism {
    origin: Vec3,
    /// Two directions of the mean plane, then the normal.
    axes: [Vec3; 3],
    /// The corners in the mean plane.
    base: Vec<Vec2>,
    low: Vec2,
    high: Vec2,
    depth: f64,
}

impl Prism {
    /// The prism that reaches `depth` (scene units) to either side of the mean plane of a closed polygon: the plane
    /// through the mean of its corners, perpendicular to its vector area. `None` for a polygon without vector area.
    pub fn new(polygon: &[Vec3], depth: f64) -> Option<Prism> {
        let origin = polygon.iter().sum::<Vec3>() / polygon.len() as f64;
        let following = polygon.iter().cycle().skip(1);
        let area: Vec3 = (polygon.iter().zip(following))
            .map(|(a, b)| (a - origin).cross(&(b - origin)))
            .sum();
        let normal = area.try_normalize(0.0)?;
        let first = Vec3::ith(normal.iamin(), 1.0);
        let u = (first - normal * normal.dot(&first)).try_normalize(0.0)?;
        let axes = [u, normal.cross(&u), normal];
        let base: Vec<Vec2> = (polygon.iter())
            .map(|p| Vec2::new((p - origin).dot(&axes[0]), (p - origin).dot(&axes[1])))
            .collect();
        let low = base.iter().fold(Vec2::repeat(f64::MAX), |m, p| m.inf(p));
        let high = base.iter().fold(Vec2::repeat(f64::MIN), |m, p| m.sup(p));
        Some(Prism {
            origin,
            axes,
            base,
            low,
            high,
            depth,
        })
    }

    /// The faces, ascending, that reach into the prism (even–odd rule where the polygon crosses itself). O(faces ×
    /// corners) at most.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn faces(&self, mesh: &TriMesh, budget: &Budget) -> Result<Vec<u32>, Exhausted> {
        let mut steps = Steps::of(budget);
        let mut found = Vec::new();
        for (f, face) in (0u32..).zip(&mesh.faces) {
            steps.take(FACE_WORK)?;
            let corners = face.map(|v| self.local(mesh.positions[v as usize]));
            if self.is_apart(&corners) {
                continue;
            }
            steps.take(CORNER_WORK * self.base.len() as u64)?;
            if self.overlaps(&self.within_depth(&corners)) {
                found.push(f);
            }
        }
        Ok(found)
    }

    /// Signed distance of a point from the mean plane, scene units.
    pub fn height(&self, p: Vec3) -> f64 {
        self.local(p).z
    }

    /// A point in the prism's axes, its height last.
    fn local(&self, p: Vec3) -> Vec3 {
        let p = p - self.origin;
        Vec3::from(self.axes.map(|axis| p.dot(&axis)))
    }

    /// Whether a box shows that a triangle does not reach into the prism.
    fn is_apart(&self, corners: &[Vec3; 3]) -> bool {
        let low = [self.low.x, self.low.y, -self.depth];
        let high = [self.high.x, self.high.y, self.depth];
        (0..3).any(|k| {
            corners.iter().all(|p| p[k] > high[k]) || corners.iter().all(|p| p[k] < low[k])
        })
    }

    /// The part of a triangle that lies within the depth, seen along the normal: a convex polygon, maybe empty.
    fn within_depth(&self, corners: &[Vec3; 3]) -> Vec<Vec2> {
        let mut part = corners.to_vec();
        for side in [1.0, -1.0] {
            let excess = |p: &Vec3| side * p.z - self.depth;
            let mut kept = Vec::with_capacity(part.len() + 1);
            for (p, q) in part.iter().zip(part.iter().cycle().skip(1)) {
                let (from, to) = (excess(p), excess(q));
                if from <= 0.0 {
                    kept.push(*p);
                }
                if (from <= 0.0) != (to <= 0.0) {
                    kept.push(p + (q - p) * (from / (from - to)));
                }
            }
            part = kept;
        }
        part.iter().map(|p| p.xy()).collect()
    }

    /// Whether a convex polygon and the base have a point in common.
    fn overlaps(&self, part: &[Vec2]) -> bool {
        let Some(first) = part.first() else {
            return false;
        };
        let sides = |of: &[Vec2]| -> Vec<[Vec2; 2]> {
            let following = of.iter().cycle().skip(1);
            of.iter().zip(following).map(|(a, b)| [*a, *b]).collect()
        };
        let (own, base) = (sides(part), sides(&self.base));
        inside(&self.base, *first)
            || self
                .base
                .first()
                .is_some_and(|corner| inside(part, *corner))
            || own.iter().any(|a| base.iter().any(|b| crosses(a, b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::sheet;
    use proptest::prelude::*;

    fn flat(n: usize) -> TriMesh {
        sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.0))
    }

    /// Points of a triangle, close together.
    fn points(triangle: [Vec3; 3]) -> impl Iterator<Item = Vec3> {
        let [a, b, c] = triangle;
        let n = 40;
        (0..=n).flat_map(move |i| {
            (0..=n - i).map(move |j| {
                let (s, t) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                a + (b - a) * s + (c - a) * t
            })
        })
    }

    proptest! {
        #[test]
        fn a_triangle_is_as_far_as_its_nearest_point(corners in prop::array::uniform9(-1.0..1.0f64)) {
            let triangle = [0, 3, 6].map(|k| Vec3::new(corners[k], corners[k + 1], corners[k + 2]));
            let least = points(triangle).map(|p| p.norm()).fold(f64::INFINITY, f64::min);
            let exact = distance(&triangle, &Vec3::zeros());
            prop_assert!(exact <= least + 1e-12 && exact > least - 0.08, "{exact} {least}");
        }

        #[test]
        fn a_face_is_in_the_prism_when_one_of_its_points_is(
            polygon in prop::collection::vec(prop::array::uniform2(0.1..0.9f64), 3..7),
            tilt in -1.0..1.0f64,
            depth in 0.01..0.3f64,
        ) {
            let lifted = |u: f64, v: f64| Vec3::new(u, v, tilt * (u - 0.5) + 0.02 * (9.0 * v).sin());
            let mesh = sheet(10, |_, _| true, lifted);
            let corners: Vec<Vec3> = polygon.iter().map(|[u, v]| lifted(*u, *v)).collect();
            let Some(prism) = Prism::new(&corners, depth) else { return Ok(()); };
            let found = prism.faces(&mesh, Budget::unlimited()).unwrap();
            for f in 0..mesh.faces.len() {
                let within = |p: Vec3| { let p = prism.local(p); p.z.abs() < depth && inside(&prism.base, p.xy()) };
                if points(mesh.triangle(f)).any(within) {
                    prop_assert!(found.contains(&(f as u32)), "face {} is missing", f);
                }
            }
        }
    }

    #[test]
    fn a_ball_and_a_prism_take_what_they_touch_and_no_more() {
        let mesh = flat(20);
        let middle = Vec3::new(0.5, 0.5, 0.0);
        let near = |f: &u32, reach: f64| {
            let points = mesh.triangle(*f as usize);
            points.iter().all(|p| (p - middle).norm() < reach)
        };
        let ball = faces_in_ball(&mesh, middle, 0.1, Budget::unlimited()).unwrap();
        assert!(ball.len() > 20 && ball.iter().all(|f| near(f, 0.1 + 0.08)));
        let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let corners = square.map(|[x, y]| middle + 0.11 * Vec3::new(x, y, 0.0));
        let prism = Prism::new(&corners, 0.1).unwrap();
        // Squares 7 to 12 of 20 in each direction; at two of the corners the diagonal keeps one triangle off.
        let faces = prism.faces(&mesh, Budget::unlimited()).unwrap();
        assert_eq!(faces.len(), 2 * 6 * 6 - 2);
        // Another layer, beyond the depth, is not touched.
        let above: Vec<Vec3> = corners.iter().map(|p| p + Vec3::z() * 0.2).collect();
        let prism = Prism::new(&above, 0.1).unwrap();
        assert!(prism.faces(&mesh, Budget::unlimited()).unwrap().is_empty());
        assert!(Prism::new(&[middle; 4], 0.1).is_none());
    }
}
