//! Polygons in the plane, given by their corners in order.

use crate::mesh::Vec2;

/// Whether a point lies in a polygon (even–odd rule).
pub fn inside(polygon: &[Vec2], p: Vec2) -> bool {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crossed = edges.filter(|(a, b)| {
        (a.y <= p.y) != (b.y <= p.y) && a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x) > p.x
    });
    crossed.count() % 2 == 1
}

/// Whether two segments have a point in common. Segments on one line are not looked at.
pub fn crosses(a: &[Vec2; 2], b: &[Vec2; 2]) -> bool {
    let side = |[p, q]: &[Vec2; 2], x: &Vec2| (q - p).perp(&(x - p));
    let opposite = |line, ends: &[Vec2; 2]| side(line, &ends[0]) * side(line, &ends[1]) <= 0.0;
    let parallel = (a[1] - a[0]).perp(&(b[1] - b[0])) == 0.0;
    !parallel && opposite(a, b) && opposite(b, a)
}

/// Larger side of a polygon's box; `-∞` for a polygon without corners.
pub fn extent(polygon: &[Vec2]) -> f64 {
    let low = polygon.iter().fold(Vec2::repeat(f64::MAX), |m, p| m.inf(p));
    let high = polygon.iter().fold(Vec2::repeat(f64::MIN), |m, p| m.sup(p));
    (high - low).max()
}

/// The corners of the convex hull of points, counter-clockwise (Andrew's monotone chain), the first once more at the end;
/// points that are not finite are kept.
pub fn convex_hull(points: &[Vec2]) -> Vec<Vec2> {
    let mut sorted = points.to_vec();
    sorted.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut hull: Vec<Vec2> = Vec::new();
    let mut chain = |points: &mut dyn Iterator<Item = &Vec2>| {
        let first = hull.len();
        for p in points {
            while let [.., a, b] = hull[first..]
                && (b - a).perp(&(p - b)) <= 0.0
            {
                hull.pop();
            }
            hull.push(*p);
        }
    };
    chain(&mut sorted.iter());
    chain(&mut sorted.iter().rev());
    hull
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_point_of_a_box_with_a_notch_is_inside_unless_it_lies_in_the_notch(x in -1.0..4.0f64, y in -1.0..3.0f64) {
            let corners = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
            let polygon = corners.map(Vec2::from);
            let in_box = (0.0..3.0).contains(&x) && (0.0..2.0).contains(&y);
            let in_notch = (1.0..2.0).contains(&x) && y >= 1.0;
            prop_assert_eq!(inside(&polygon, Vec2::new(x, y)), in_box && !in_notch);
            prop_assert_eq!(extent(&polygon), 3.0);
        }
    }
}
