//! How cloth is lit: smooth normals, a key, a fill and a rim light fixed to the camera, tones in linear light.

use super::Drawable;
use darn_geometry::mesh::{TriMesh, Vec3};

/// Linear light, red green blue, 1 is white.
pub(super) type Light = [f32; 3];

/// Ink of boundary loops.
pub(super) const RIM_INK: Light = [0.012, 0.014, 0.02];
/// Ink of the wireframe.
pub(super) const WIRE_INK: Light = [0.03, 0.035, 0.05];

/// Vertex normals, angle weighted (Thürmer and Wüthrich 1998), so that they do not depend on how the cloth is triangulated.
/// One per vertex of the mesh, unit length; zero where no face gives a direction.
pub(super) fn vertex_normals(mesh: &TriMesh, faces: &[Drawable]) -> Vec<Vec3> {
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

/// The vector at unit length; zero when it has none.
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
pub(super) enum Side {
    Front,
    Back,
}

/// Light that reaches the eye from cloth of colour `base`.
///
/// `normal` and `to_eye` are unit, in camera axes (x right, y up, z into the picture); the normal faces the eye.
pub(super) fn lit(base: Light, normal: [f32; 3], to_eye: [f32; 3], side: Side) -> Light {
    const KEY: [f32; 3] = [-0.62, 0.58, -0.53];
    const FILL: [f32; 3] = [0.76, 0.05, -0.65];
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    // A wrapped cosine keeps folds that turn from the key from going flat.
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
    let shade = if side == Side::Front { 1.0 } else { 0.78 };
    std::array::from_fn(|c| {
        let diffuse = 1.02 * key * colours[0][c]
            + 0.17 * fill * colours[1][c]
            + (0.06 + 0.12 * sky) * colours[2][c];
        shade * (base[c] * diffuse + 0.10 * sheen * (0.35 + key) + 0.045 * gloss)
    })
}

/// The background behind a row: `height` from 0 (top) to 1 (bottom).
pub(super) fn background(height: f32) -> Light {
    const TOP: Light = [0.90, 0.91, 0.92];
    const BOTTOM: Light = [0.66, 0.665, 0.67];
    std::array::from_fn(|c| TOP[c] + (BOTTOM[c] - TOP[c]) * height)
}

/// `over` laid on `under` with coverage `alpha`.
pub(super) fn mixed(under: Light, over: Light, alpha: f32) -> Light {
    std::array::from_fn(|c| under[c] + (over[c] - under[c]) * alpha)
}

/// An sRGB byte triple in linear light.
pub(super) fn from_srgb(colour: [u8; 3]) -> Light {
    colour.map(|c| {
        let c = f32::from(c) / 255.0;
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    })
}

/// Linear light as sRGB bytes.
pub(super) fn to_srgb(light: Light) -> [u8; 3] {
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

    #[test]
    fn srgb_survives_the_way_there_and_back() {
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
        let normal = |mesh: &TriMesh| vertex_normals(mesh, &super::super::drawable(mesh))[0];
        assert!((normal(&once) - normal(&split)).norm() < 1e-12);
    }
}
