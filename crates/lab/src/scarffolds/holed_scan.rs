//! A sheet as a scanner would deliver it: an irregular triangle mesh with a hole, and the cloth that was cut out. For the example scan, the
//! tests and the evaluation; the network is not trained on these.

use rand::Rng;
use spade::{DelaunayTriangulation, Point2, Triangulation as _};

use super::sheet::SimulatedSheet;
use super::spline::SheetSpline;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};

/// The shape of a hole on the unit square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HoleShape {
    /// A disk.
    Circle {
        /// Its centre.
        centre: Vec2,
        /// Its radius.
        radius: f64,
    },
    /// A star-shaped blob with a ragged edge, drawn from the generator.
    Blob {
        /// Its centre.
        centre: Vec2,
        /// Its mean radius.
        radius: f64,
    },
    /// A long tear: an ellipse of half axes `length` and `width` along `angle`, radians.
    Slit {
        /// Its centre.
        centre: Vec2,
        /// Half its length.
        length: f64,
        /// Half its width.
        width: f64,
        /// Direction of its length.
        angle: f64,
    },
}

/// A mesh with a hole, and the cloth that was in the hole.
#[derive(Debug, Clone, PartialEq)]
pub struct HoledScan {
    /// The remaining cloth.
    pub mesh: TriMesh,
    /// Rest coordinates of its vertices in the unit square.
    pub rest: Vec<Vec2>,
    /// The cloth that was cut out.
    pub lost: TriMesh,
}

/// Meshes a sheet with about `side`² jittered vertices and cuts the hole out. `rng` draws the vertices and the ragged edge.
pub fn holed_scan(
    sheet: &SimulatedSheet,
    side: usize,
    hole: &HoleShape,
    rng: &mut impl Rng,
) -> HoledScan {
    let spline = SheetSpline::new(sheet);
    let (rest, faces) = irregular(side, rng);
    let positions: Vec<Vec3> = rest
        .iter()
        .map(|p| spline.at([p.x as f32, p.y as f32]).cast())
        .collect();
    let ragged: [[f64; 2]; 6] =
        std::array::from_fn(|_| [rng.random_range(-0.3..0.3), rng.random_range(-0.3..0.3)]);
    let gone = |f: &[u32; 3]| {
        let centre = f.iter().map(|v| rest[*v as usize]).sum::<Vec2>() / 3.0;
        in_hole(hole, &ragged, centre)
    };
    let (lost, kept): (Vec<[u32; 3]>, Vec<[u32; 3]>) = faces.into_iter().partition(gone);
    let (mesh, used) = compact(&positions, &kept);
    let (lost, _) = compact(&positions, &lost);
    HoledScan {
        mesh,
        rest: used.into_iter().map(|v| rest[v as usize]).collect(),
        lost,
    }
}

/// Jittered lattice points and evenly spaced border points of the unit square, Delaunay-triangulated.
fn irregular(side: usize, rng: &mut impl Rng) -> (Vec<Vec2>, Vec<[u32; 3]>) {
    let n = side as f64;
    let mut points: Vec<Vec2> = (0..side)
        .flat_map(|k| {
            let t = k as f64 / n;
            [
                Vec2::new(t, 0.0),
                Vec2::new(1.0, t),
                Vec2::new(1.0 - t, 1.0),
                Vec2::new(0.0, 1.0 - t),
            ]
        })
        .collect();
    for k in 0..side * side {
        let mut along = |c: usize| (c as f64 + 0.5 + rng.random_range(-0.4..0.4)) / n;
        points.push(Vec2::new(along(k % side), along(k / side)));
    }
    let mut triangulation = DelaunayTriangulation::<Point2<f64>>::new();
    for p in &points {
        // Points that are finite and within the unit square are never refused.
        let _ = triangulation.insert(Point2::new(p.x, p.y));
    }
    let at: Vec<Vec2> = triangulation
        .vertices()
        .map(|v| Vec2::new(v.position().x, v.position().y))
        .collect();
    let faces = triangulation
        .inner_faces()
        .map(|f| f.vertices().map(|v| v.fix().index() as u32))
        .collect();
    (at, faces)
}

/// Whether a point of the unit square lies in the hole; `ragged` holds the cosine and sine amplitudes of a blob's edge.
fn in_hole(hole: &HoleShape, ragged: &[[f64; 2]; 6], p: Vec2) -> bool {
    match *hole {
        HoleShape::Circle { centre, radius } => (p - centre).norm() < radius,
        HoleShape::Blob { centre, radius } => {
            let d = p - centre;
            let angle = d.y.atan2(d.x);
            let waves = ragged.iter().zip(1..).map(|([a, b], k)| {
                (a * (angle * f64::from(k)).cos() + b * (angle * f64::from(k)).sin()) / f64::from(k)
            });
            d.norm() < radius * (1.0 + waves.sum::<f64>()).max(0.3)
        }
        HoleShape::Slit {
            centre,
            length,
            width,
            angle,
        } => {
            let (d, (s, c)) = (p - centre, angle.sin_cos());
            ((c * d.x + s * d.y) / length).powi(2) + ((c * d.y - s * d.x) / width).powi(2) < 1.0
        }
    }
}

/// The mesh of some faces with the vertices they use, and the old indices of these vertices.
fn compact(positions: &[Vec3], faces: &[[u32; 3]]) -> (TriMesh, Vec<u32>) {
    let mut place = vec![u32::MAX; positions.len()];
    let mut used = Vec::new();
    for v in faces.iter().flatten() {
        if place[*v as usize] == u32::MAX {
            place[*v as usize] = used.len() as u32;
            used.push(*v);
        }
    }
    let faces = faces.iter().map(|f| f.map(|v| place[v as usize])).collect();
    (
        TriMesh {
            positions: used.iter().map(|v| positions[*v as usize]).collect(),
            faces,
        },
        used,
    )
}
