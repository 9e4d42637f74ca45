//! The camera: its position and axes, and the projection from the scene to the picture.

use super::face::DrawableFace;
use super::options::{CameraDirection, Framing, PictureOptions, PixelSize};
use darn_geometry::mesh::{TriMesh, Vec3};
use nalgebra::Matrix3;

/// Half the vertical field of view, radians: a mild perspective.
const HALF_FOV: f64 = 0.21;
/// How much of the picture's half side the mesh may fill.
const MARGIN: f64 = 0.93;
/// [`CameraDirection::Auto`] is turned from the cloth's normal by these angles, degrees: about +y, and upwards.
const AZIMUTH_OFFSET: f64 = 24.0;
const ELEVATION_OFFSET: f64 = 12.0;
/// The highest elevation of [`CameraDirection::Auto`], degrees.
const MAX_ELEVATION: f64 = 55.0;

/// A perspective camera.
#[derive(Debug, Clone)]
pub(super) struct Camera {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Focal length: pixels per unit of x/z.
    pub focal: f64,
    centre: [f64; 2],
    near: f64,
}

impl Camera {
    /// The camera of a picture of `size`.
    pub fn new(
        mesh: &TriMesh,
        faces: &[DrawableFace],
        options: &PictureOptions,
        size: PixelSize,
    ) -> Self {
        let (near_cloth, points) = subject(mesh, faces, options.framing);
        let backward = match options.direction {
            CameraDirection::Auto => oblique(broad_side(mesh, &near_cloth)),
            CameraDirection::Angles { azimuth, elevation } => from_angles(azimuth, elevation),
        };
        let (right, up) = upright(backward);
        let (width, height) = (size.width as f64, size.height as f64);
        let focal = 0.5 * width.min(height * 4.0 / 3.0) * 0.75 / HALF_FOV.tan();
        let mut camera = Self {
            eye: Vec3::zeros(),
            right,
            up,
            forward: -backward,
            focal,
            centre: [0.5 * width, 0.5 * height],
            near: 0.0,
        };
        camera.fit(&points, size);
        camera
    }

    /// Moves the eye so that all `points` just fit.
    fn fit(&mut self, points: &[Vec3], size: PixelSize) {
        let reach = [size.width, size.height].map(|s| MARGIN * 0.5 * s as f64 / self.focal);
        let mut target = middle(points);
        let mut distance: f64 = 1.0;
        let mut depth: f64 = 1.0;
        // Centring the projected points converges quickly: three rounds are within a pixel.
        for _ in 0..3 {
            let seen: Vec<Vec3> = points
                .iter()
                .map(|p| self.direction_in_axes(p - target))
                .collect();
            distance = seen
                .iter()
                .map(|p| (p.x.abs() / reach[0]).max(p.y.abs() / reach[1]) - p.z)
                .fold(0.0, f64::max);
            depth = seen.iter().map(|p| p.z.abs()).fold(0.0, f64::max);
            distance = distance.max(depth * 1.5).max(f64::MIN_POSITIVE.sqrt());
            let on_screen = |axis: usize| seen.iter().map(move |p| p[axis] / (p.z + distance));
            let shift = |axis: usize| {
                let low = on_screen(axis).fold(f64::INFINITY, f64::min);
                let high = on_screen(axis).fold(f64::NEG_INFINITY, f64::max);
                if low.is_finite() && high.is_finite() {
                    0.5 * (low + high) * distance
                } else {
                    0.0
                }
            };
            target += self.right * shift(0) + self.up * shift(1);
        }
        self.eye = target - self.forward * distance;
        // Cloth in front of the framed part would hide it, so it is cut off.
        self.near = (0.9 * distance - 1.5 * depth).max(1e-3 * distance);
    }

    /// A direction of the scene in camera axes: x right, y up, z into the picture.
    pub fn direction_in_axes(&self, d: Vec3) -> Vec3 {
        Vec3::new(d.dot(&self.right), d.dot(&self.up), d.dot(&self.forward))
    }

    /// A point of the scene in camera axes, the eye at the origin.
    pub fn point_in_axes(&self, p: &Vec3) -> Vec3 {
        self.direction_in_axes(p - self.eye)
    }

    /// A point in camera axes as pixel x (right), pixel y (down) and depth; `None` if it is too near or behind the
    /// camera.
    pub fn project(&self, seen: &Vec3) -> Option<Vec3> {
        let scale = self.focal / seen.z;
        let point = Vec3::new(
            self.centre[0] + seen.x * scale,
            self.centre[1] - seen.y * scale,
            seen.z,
        );
        (seen.z > self.near && point.iter().all(|c| c.is_finite())).then_some(point)
    }

    /// The point in camera axes at a pixel position and depth; the inverse of [`Camera::project`].
    pub fn unproject(&self, pixel: [f64; 2], depth: f64) -> Vec3 {
        let scale = depth / self.focal;
        Vec3::new(
            (pixel[0] - self.centre[0]) * scale,
            (self.centre[1] - pixel[1]) * scale,
            depth,
        )
    }
}

/// The faces that determine the direction, and the points that must be in the picture.
fn subject(
    mesh: &TriMesh,
    faces: &[DrawableFace],
    framing: Framing,
) -> (Vec<DrawableFace>, Vec<Vec3>) {
    let at = |v: usize| mesh.positions.get(v).copied().unwrap_or_default();
    match framing {
        Framing::Whole => (
            faces.to_vec(),
            faces.iter().flat_map(|f| f.vertices).map(at).collect(),
        ),
        Framing::Focus { centre, radius } => {
            let inside = |f: &&DrawableFace| {
                f.vertices
                    .iter()
                    .any(|&v| (at(v) - centre).norm() <= radius)
            };
            let corners = (0..8).map(|k| {
                let sign = |bit: usize| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
                centre + Vec3::new(sign(0), sign(1), sign(2)) * (radius / 3f64.sqrt())
            });
            (
                faces.iter().filter(inside).copied().collect(),
                corners.collect(),
            )
        }
    }
}

/// The middle of the bounding box; the origin for no points.
fn middle(points: &[Vec3]) -> Vec3 {
    let low = points.iter().copied().reduce(|a, b| a.inf(&b));
    let high = points.iter().copied().reduce(|a, b| a.sup(&b));
    low.zip(high)
        .map_or_else(Vec3::zeros, |(l, h)| l * 0.5 + h * 0.5)
}

/// The direction in which the cloth shows most of itself: the axis of least variance, on the side of the mean normal.
fn broad_side(mesh: &TriMesh, faces: &[DrawableFace]) -> Vec3 {
    let corners = |f: &DrawableFace| {
        f.vertices
            .map(|v| mesh.positions.get(v).copied().unwrap_or_default())
    };
    let mut weight = 0.0;
    let mut mean = Vec3::zeros();
    let mut normal = Vec3::zeros();
    for [a, b, c] in faces.iter().map(corners) {
        let twice = (b - a).cross(&(c - a));
        normal += twice;
        weight += twice.norm();
        mean += (a + b + c) * (twice.norm() / 3.0);
    }
    if !(weight > 0.0 && weight.is_finite()) {
        return Vec3::z();
    }
    mean /= weight;
    let mut spread = Matrix3::zeros();
    for [a, b, c] in faces.iter().map(corners) {
        let d = (a + b + c) / 3.0 - mean;
        spread += d * d.transpose() * ((b - a).cross(&(c - a)).norm() / weight);
    }
    if !spread.iter().all(|x| x.is_finite()) {
        return Vec3::z();
    }
    let eigen = spread.symmetric_eigen();
    let axis: Vec3 = eigen
        .eigenvectors
        .column(eigen.eigenvalues.imin())
        .into_owned();
    // A closed or crumpled surface has no useful mean normal; its front is then the side that faces up and +z.
    let facing = if normal.norm() > 0.05 * weight {
        normal
    } else {
        Vec3::new(0.2, 0.5, 1.0)
    };
    if axis.dot(&facing) < 0.0 { -axis } else { axis }
}

/// A direction turned a little to the side and upwards, and never from below: as a person looks at cloth on a table or
/// a curtain.
fn oblique(direction: Vec3) -> Vec3 {
    // Cloth has two sides: take the one seen from above.
    let direction = if direction.y < -0.5 {
        -direction
    } else {
        direction
    };
    let elevation = direction.y.clamp(-1.0, 1.0).asin().to_degrees();
    // Seen from straight above the azimuth is arbitrary: take the front.
    let azimuth = if elevation > 75.0 {
        0.0
    } else {
        direction.x.atan2(direction.z).to_degrees()
    };
    from_angles(
        azimuth + AZIMUTH_OFFSET,
        (elevation + ELEVATION_OFFSET).clamp(ELEVATION_OFFSET, MAX_ELEVATION),
    )
}

fn from_angles(azimuth: f64, elevation: f64) -> Vec3 {
    let (a, e) = (azimuth.to_radians(), elevation.to_radians());
    let direction = Vec3::new(a.sin() * e.cos(), e.sin(), a.cos() * e.cos());
    if direction.iter().all(|c| c.is_finite()) {
        direction
    } else {
        Vec3::z()
    }
}

/// The right and up axes of a camera that looks against `backward`: +y is up, or −z when it looks along y.
fn upright(backward: Vec3) -> (Vec3, Vec3) {
    let skyward = if backward.y.abs() > 0.98 {
        -Vec3::z() * backward.y.signum()
    } else {
        Vec3::y()
    };
    let right = skyward.cross(&backward).normalize();
    (right, backward.cross(&right))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::face::drawable_faces;

    const PIXELS: PixelSize = PixelSize {
        width: 400,
        height: 300,
    };

    #[test]
    fn all_framed_points_are_inside_the_picture() {
        let positions: Vec<Vec3> = (0..60)
            .map(|k| {
                Vec3::new(
                    (k * 7 % 13) as f64,
                    (k * 5 % 11) as f64,
                    (k * 3 % 7) as f64 * 0.5,
                )
            })
            .collect();
        let mesh = TriMesh {
            faces: (0..20).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
            positions,
        };
        let faces = drawable_faces(&mesh);
        for direction in [
            CameraDirection::Auto,
            CameraDirection::Angles {
                azimuth: 130.0,
                elevation: 70.0,
            },
            CameraDirection::Angles {
                azimuth: 0.0,
                elevation: -90.0,
            },
        ] {
            let camera = Camera::new(
                &mesh,
                &faces,
                &PictureOptions {
                    direction,
                    ..PictureOptions::default()
                },
                PIXELS,
            );
            for p in &mesh.positions {
                let seen = camera
                    .project(&camera.point_in_axes(p))
                    .expect("in front of the camera");
                assert!(
                    (0.0..=400.0).contains(&seen.x) && (0.0..=300.0).contains(&seen.y),
                    "{seen}"
                );
            }
        }
    }

    #[test]
    fn unprojecting_inverts_projecting() {
        let mesh = TriMesh {
            positions: vec![Vec3::zeros(), Vec3::x(), Vec3::y()],
            faces: vec![[0, 1, 2]],
        };
        let camera = Camera::new(
            &mesh,
            &drawable_faces(&mesh),
            &PictureOptions::default(),
            PIXELS,
        );
        let seen = camera.point_in_axes(&Vec3::new(0.3, 0.2, 0.1));
        let on_screen = camera.project(&seen).expect("in front of the camera");
        assert!((camera.unproject([on_screen.x, on_screen.y], on_screen.z) - seen).norm() < 1e-9);
    }
}
