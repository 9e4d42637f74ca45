//! Other components near a hole, such as the body under a garment or a bag in front of it: the cloth around the hole shows on
//! which side of them it lies, and the patch keeps to that side.

use std::collections::{BTreeMap, HashMap, HashSet};

use darn_budget::{Budget, Exhausted, Steps};
use rstar::{AABB, PointDistance, RTree, RTreeObject};

use crate::mesh::Vec3;
use crate::mesh::layers::Layers;
use crate::mesh::nearest::nearest_on_triangle;

/// Fewer vertices than these do not show a side.
const FEW: usize = 8;
/// Share of the vertices near a component that must lie on one side of it.
const ONE_SIDED: f64 = 0.95;
/// A vertex shows a side when its offset from a triangle is along the triangle's normal: the least cosine between them.
const FACING: f64 = 0.5;
/// The cosine from which on a point is straight above a triangle.
const STRAIGHT: f64 = 1.0 - 1e-9;
/// A point is on an edge when it is this near to it, in lengths of the edge.
const ON_EDGE: f64 = 1e-6;
/// Largest distance that the patch keeps, in its mean edges.
const MOST: f64 = 0.5;
/// Nanoseconds of work a search for the nearest triangle.
const NEAREST_WORK: u64 = 1500;

/// The surfaces of other components whose side is known.
#[derive(Debug, Clone, Default)]
pub(super) struct Sides {
    triangles: RTree<Side>,
    /// A point farther than this from all of them may be anywhere, scene units.
    reach: f64,
}

/// A triangle of another component.
#[derive(Debug, Clone)]
struct Side {
    corners: [Vec3; 3],
    /// Unit normal, towards the side of the cloth.
    normal: Vec3,
    /// Whether the edges from corner 0 to 1, 1 to 2 and 2 to 0 are on the component's border.
    edge_on_border: [bool; 3],
    /// Whether the corners are.
    corner_on_border: [bool; 3],
    /// Least distance that the cloth keeps from it, scene units.
    distance: f64,
    component: u32,
}

impl Side {
    /// The distance of a point along the normal, scene units; `None` where the triangle does not face the point, or the point
    /// lies beyond the component's border: there it is on no side.
    fn height(&self, point: &Vec3) -> Option<f64> {
        let nearest = nearest_on_triangle(point, &self.corners);
        let offset = point - nearest;
        let height = offset.dot(&self.normal);
        if height.abs() >= STRAIGHT * offset.norm() {
            return Some(height);
        }
        let beyond_border = (0..3).any(|k| {
            let (from, to) = (self.corners[k], self.corners[(k + 1) % 3]);
            let (along, away) = (to - from, nearest - from);
            let at_corner = away.norm() <= ON_EDGE * along.norm();
            let on_edge = away.cross(&along).norm() <= ON_EDGE * along.norm_squared();
            (self.corner_on_border[k] && at_corner) || (self.edge_on_border[k] && on_edge)
        });
        let faces = height.abs() >= FACING * offset.norm();
        (faces && !beyond_border).then_some(height)
    }
}

impl RTreeObject for Side {
    type Envelope = AABB<[f64; 3]>;

    fn envelope(&self) -> Self::Envelope {
        let [a, b, c] = self.corners;
        AABB::from_corners(a.inf(&b).inf(&c).into(), a.sup(&b).sup(&c).into())
    }
}

impl PointDistance for Side {
    fn distance_2(&self, point: &[f64; 3]) -> f64 {
        let point = Vec3::from(*point);
        (point - nearest_on_triangle(&point, &self.corners)).norm_squared()
    }
}

impl Sides {
    /// The components among the layers on one side of which the cloth lies that is at these places. The patch will have
    /// edges of `edge`; components farther than `reach` show nothing. Scene units.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn shown_by(
        cloth: &[Vec3],
        layers: &Layers,
        edge: f64,
        reach: f64,
        budget: &Budget,
    ) -> Result<Sides, Exhausted> {
        let all = triangles(layers);
        if all.size() == 0 {
            return Ok(Sides::default());
        }
        let mut heights: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
        let mut steps = Steps::of(budget);
        for point in cloth {
            steps.take(NEAREST_WORK)?;
            if let Some(side) = nearest(&all, point, reach)
                && let Some(height) = side.height(point)
            {
                heights.entry(side.component).or_default().push(height);
            }
        }
        let known: BTreeMap<u32, f64> = (heights.into_iter())
            .filter_map(|(component, heights)| Some((component, least_height(heights)?)))
            .collect();
        let kept = all.iter().filter_map(|side| {
            let least = known.get(&side.component)?;
            Some(Side {
                normal: side.normal * least.signum(),
                distance: least.abs().min(MOST * edge),
                ..side.clone()
            })
        });
        Ok(Sides {
            triangles: RTree::bulk_load(kept.collect()),
            reach,
        })
    }

    /// Whether no side is known.
    pub fn is_empty(&self) -> bool {
        self.triangles.size() == 0
    }

    /// How a point must move to be on the cloth's side, scene units; `None` when it is, or when all surfaces are far.
    pub fn push(&self, point: &Vec3) -> Option<Vec3> {
        let side = nearest(&self.triangles, point, self.reach)?;
        let missing = side.distance - side.height(point)?;
        (missing > 0.0).then(|| side.normal * missing)
    }

    /// Nanoseconds of work of so many pushes.
    pub fn work(points: usize) -> u64 {
        NEAREST_WORK * points as u64
    }

    /// Bytes of memory held, about.
    pub fn bytes(&self) -> usize {
        2 * size_of::<Side>() * self.triangles.size()
    }
}

/// The triangles of other components, each facing as in its mesh. Triangles without area face nothing.
fn triangles(layers: &Layers) -> RTree<Side> {
    let Layers { mesh, other } = layers;
    let mut uses: HashMap<[u32; 2], u32> = HashMap::new();
    let edge = |a: u32, b: u32| [a.min(b), a.max(b)];
    let edges = |face: &[u32; 3]| [0, 1, 2].map(|k| edge(face[k], face[(k + 1) % 3]));
    for edge in mesh.faces.iter().flat_map(edges) {
        *uses.entry(edge).or_default() += 1;
    }
    let ends: HashSet<u32> = (uses.iter())
        .filter(|(_, uses)| **uses == 1)
        .flat_map(|(edge, _)| *edge)
        .collect();
    let each = other.iter().enumerate().filter_map(|(face, component)| {
        let component = (*component)?;
        let corners = mesh.triangle(face);
        let normal = normal_of(&corners)?;
        Some(Side {
            corners,
            normal,
            edge_on_border: edges(&mesh.faces[face]).map(|edge| uses[&edge] == 1),
            corner_on_border: mesh.faces[face].map(|v| ends.contains(&v)),
            distance: 0.0,
            component,
        })
    });
    RTree::bulk_load(each.collect())
}

fn normal_of([a, b, c]: &[Vec3; 3]) -> Option<Vec3> {
    let normal = (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE)?;
    normal.iter().all(|x| x.is_finite()).then_some(normal)
}

/// The triangle nearest to a point, within `reach` of it.
fn nearest<'a>(triangles: &'a RTree<Side>, point: &Vec3, reach: f64) -> Option<&'a Side> {
    let place: [f64; 3] = (*point).into();
    let near = triangles.nearest_neighbor(&place)?;
    (near.distance_2(&place) <= reach * reach).then_some(near)
}

/// The least height of cloth that lies on one side, with the sign of the side; `None` when it lies on both or too few
/// heights are known. Outliers are left out.
fn least_height(mut heights: Vec<f64>) -> Option<f64> {
    if heights.len() < FEW {
        return None;
    }
    heights.sort_by(f64::total_cmp);
    let few = ((1.0 - ONE_SIDED) * heights.len() as f64) as usize;
    let (low, high) = (heights[few], heights[heights.len() - 1 - few]);
    if low > 0.0 {
        Some(low)
    } else if high < 0.0 {
        Some(high)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::sheet;

    /// A body's upper side at height 0, as component 1.
    fn body() -> Layers {
        let mesh = sheet(12, |_, _| true, |u, v| Vec3::new(u, v, 0.0));
        let other = vec![Some(1); mesh.faces.len()];
        Layers { mesh, other }
    }

    /// What cloth at these heights shows of the body below it.
    fn shown(height: impl Fn(f64, f64) -> f64) -> Sides {
        let cloth = sheet(10, |_, _| true, |u, v| Vec3::new(u, v, height(u, v)));
        Sides::shown_by(&cloth.positions, &body(), 0.1, 0.3, Budget::unlimited())
            .expect("no limits")
    }

    #[test]
    fn cloth_above_a_body_shows_its_side_and_distance_whichever_way_the_body_faces() {
        for (side, distance) in [(1.0, 0.03), (-1.0, 0.03), (1.0, 0.2)] {
            let sides = shown(|_, _| side * distance);
            let kept = distance.min(0.5 * 0.1);
            let inside = Vec3::new(0.5, 0.5, -side * 0.02);
            let push = sides.push(&inside).expect("it is on the wrong side");
            assert!((push - Vec3::z() * side * (kept + 0.02)).norm() < 1e-12);
            let above = Vec3::new(0.5, 0.5, side * (kept + 1e-6));
            assert_eq!(sides.push(&above), None);
            let far = Vec3::new(0.5, 0.5, -side * 0.31);
            assert_eq!(sides.push(&far), None, "beyond its reach");
        }
    }

    #[test]
    fn cloth_on_both_sides_of_a_surface_beside_it_or_far_from_it_shows_nothing() {
        assert!(shown(|u, _| 0.1 * (u - 0.5)).is_empty());
        assert!(shown(|_, _| 0.4).is_empty());
        for height in [0.001, 0.1] {
            let beside = sheet(10, |_, _| true, |u, v| Vec3::new(u + 1.01, v, height));
            let sides = Sides::shown_by(&beside.positions, &body(), 0.1, 0.3, Budget::unlimited());
            assert!(sides.expect("no limits").is_empty());
        }
    }
}
