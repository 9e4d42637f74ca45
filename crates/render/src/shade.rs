//! Shading: smooth normals; a key light, a fill light and a sky light, fixed to the camera. Colours are linear, not
//! sRGB.

use super::face::DrawableFace;
use darn_geometry::mesh::{TriMesh, Vec3};

/// Linear red, green and blue; 1 is white.
pub(super) type LinearRgb = [f32; 3];

/// Base colour of cloth as it was scanned (sRGB).
pub const CLOTH: [u8; 3] = [142, 160, 186];
/// Base colour of reconstructed cloth (sRGB): warm, so that it is easily told from scanned cloth.
pub const MENDED: [u8; 3] = [226, 146, 88];

/// Colour of boundary edges.
pub(super) const RIM_INK: LinearRgb = [0.012, 0.014, 0.02];
/// Colour of the wireframe.
pub(super) const WIRE_INK: LinearRgb = [0.03, 0.035, 0.05];

/// Vertex normals, `[vertices]`, weighted by angle (Thürmer and Wüthrich 1998), so that they do not depend on the
/// triangulation. Unit length, or zero where no face gives a direction.
pub(super) fn vertex_normals(mesh: &TriMesh, faces: &[DrawableFace]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::zeros(); mesh.positions.len()];
    for face in faces {
        let corners = face
            .vertices
            .map(|v| mesh.positions.get(v).copied().unwrap_or_default());
        let normal = unit((corners[1] - corners[0]).cross(&(corners[2] - corners[0])));
        for k in 0..3 {
            let to_next = unit(corners[(k + 1) % 3] - corners[k]);
            let to_last = unit(corners[(k + 2) % 3] - corners[k]);
            let angle = to_next.dot(&to_last).clamp(-1.0, 1.0).acos();
            if let Some(sum) = normals.get_mut(face.vertices[k]) {
                *sum += normal * angle;
            }
        }
    }
    normals.into_iter().map(unit).collect()
}

/// The vector scaled to unit length; zero if its length is zero or not finite.
pub(super) fn unit(v: Vec3) -> Vec3 {
    let length = v.norm();
    if length > 0.0 && length.is_finite() {
        v / length
    } else {
        Vec3::zeros()
    }
}

/// Which side of a face the camera sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FaceSide {
    Front,
    Back,
}

/// The light from cloth of colour `base` to the eye.
///
/// `normal` and `to_eye` are unit, in camera axes (x right, y up, z into the picture); the normal faces the eye.
pub(super) fn lit(
    base: LinearRgb,
    normal: [f32; 3],
    to_eye: [f32; 3],
    side: FaceSide,
) -> LinearRgb {
    const KEY: [f32; 3] = [-0.62, 0.58, -0.53];
    const FILL: [f32; 3] = [0.76, 0.05, -0.65];
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    // A wrapped cosine shades folds that turn away from the light; a plain one is 0 there.
    let wrapped = |cos: f32, wrap: f32| ((cos + wrap) / (1.0 + wrap)).max(0.0);
    let key = wrapped(dot(normal, KEY), 0.12).powf(1.4);
    let fill = wrapped(dot(normal, FILL), 0.25);
    let sky = 0.5 + 0.5 * normal[1];
    let facing = dot(normal, to_eye).clamp(0.0, 1.0);
    let sheen = (1.0 - facing).powi(3);
    let half = [KEY[0] + to_eye[0], KEY[1] + to_eye[1], KEY[2] + to_eye[2]];
    let length = dot(half, half).sqrt().max(1e-6);
    let gloss = (dot(normal, half) / length).max(0.0).powi(24);
    let colours = [[1.0, 0.97, 0.92], [0.80, 0.88, 1.0], [0.92, 0.96, 1.0]];
    let shade = if side == FaceSide::Front { 1.0 } else { 0.78 };
    std::array::from_fn(|c| {
        let diffuse = 1.02 * key * colours[0][c]
            + 0.17 * fill * colours[1][c]
            + (0.06 + 0.12 * sky) * colours[2][c];
        shade * (base[c] * diffuse + 0.10 * sheen * (0.35 + key) + 0.045 * gloss)
    })
}

/// The background of a row: `height` is 0 at the top, 1 at the bottom.
pub(super) fn background(height: f32) -> LinearRgb {
    const TOP: LinearRgb = [0.90, 0.91, 0.92];
    const BOTTOM: LinearRgb = [0.66, 0.665, 0.67];
    std::array::from_fn(|c| TOP[c] + (BOTTOM[c] - TOP[c]) * height)
}

/// `over` drawn on `under` with coverage `alpha`.
pub(super) fn mixed(under: LinearRgb, over: LinearRgb, alpha: f32) -> LinearRgb {
    std::array::from_fn(|c| under[c] + (over[c] - under[c]) * alpha)
}

/// An sRGB colour as linear.
pub fn from_srgb(colour: [u8; 3]) -> [f32; 3] {
    colour.map(|c| {
        let c = f32::from(c) / 255.0;
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    })
}

/// A linear colour as sRGB.
pub(super) fn to_srgb(light: LinearRgb) -> [u8; 3] {
    light.map(|l| {
        let l = l.clamp(0.0, 1.0);
        let c = if l <= 0.003_130_8 {
            12.92 * l
        } else {
            1.055 * l.powf(1.0 / 2.4) - 0.055
        };
        (c * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::face::drawable_faces;

    #[test]
    fn srgb_round_trips() {
        for c in 0..=255u8 {
            assert_eq!(to_srgb(from_srgb([c, 255 - c, c / 2])), [c, 255 - c, c / 2]);
        }
    }

    #[test]
    fn normals_do_not_depend_on_the_triangulation() {
        let corner = vec![
            Vec3::zeros(),
            Vec3::x(),
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::y(),
            Vec3::z(),
        ];
        let once = TriMesh {
            positions: corner.clone(),
            faces: vec![[0, 1, 3], [0, 3, 4], [0, 4, 1]],
        };
        let split = TriMesh {
            positions: corner,
            faces: vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]],
        };
        let normal = |mesh: &TriMesh| vertex_normals(mesh, &drawable_faces(mesh))[0];
        assert!((normal(&once) - normal(&split)).norm() < 1e-12);
    }
}
