//! Tangents of the patch, which its normal map needs.

use crate::frame::doubled_area;
use crate::input::PatchChart;

/// glTF's `TANGENT` at every vertex of a patch: the direction of the chart's +x in space, at right angles to the normal, and the handedness (+1 where the
/// faces are counter-clockwise in the chart).
///
/// `positions` and `normals` are per vertex of the patch, in one space. Vertices without a face of any area get a direction at right angles to their normal.
pub fn tangents(patch: &PatchChart, positions: &[[f64; 3]], normals: &[[f64; 3]]) -> Vec<[f32; 4]> {
    let mut sums = vec![([0.0f64; 3], 0.0f64); patch.flat.len()];
    for face in &patch.faces {
        let corners = face.map(|v| v as usize);
        if corners
            .iter()
            .any(|v| *v >= sums.len() || *v >= positions.len())
        {
            continue;
        }
        let [a, b, c] = corners.map(|v| patch.flat[v]);
        let area = doubled_area([a, b, c]);
        let [p, q, r] = corners.map(|v| positions[v]);
        // ∂P/∂x, times the area without its sign, so that large faces count more.
        let (up, down) = (c[1] - a[1], b[1] - a[1]);
        let slope = |k: usize| ((q[k] - p[k]) * up - (r[k] - p[k]) * down) * area.signum();
        for v in corners {
            (0..3).for_each(|k| sums[v].0[k] += slope(k));
            sums[v].1 += area;
        }
    }
    let normal = |v: usize| normals.get(v).copied().unwrap_or([0.0, 0.0, 1.0]);
    (sums.iter().enumerate())
        .map(|(v, (sum, area))| {
            let [x, y, z] = across(*sum, normal(v)).unwrap_or_else(|| any_across(normal(v)));
            [
                x as f32,
                y as f32,
                z as f32,
                if *area < 0.0 { -1.0 } else { 1.0 },
            ]
        })
        .collect()
}

/// The unit vector of a direction's part at right angles to a normal.
fn across(direction: [f64; 3], normal: [f64; 3]) -> Option<[f64; 3]> {
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let along = dot(direction, normal) / dot(normal, normal).max(f64::MIN_POSITIVE);
    let rest: [f64; 3] = std::array::from_fn(|k| direction[k] - along * normal[k]);
    let length = dot(rest, rest).sqrt();
    (length > 1e-12 * dot(direction, direction).sqrt() && length.is_finite() && length > 0.0)
        .then(|| rest.map(|x| x / length))
}

fn any_across(normal: [f64; 3]) -> [f64; 3] {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    axes.into_iter()
        .find_map(|axis| across(axis, normal))
        .unwrap_or(axes[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of the chart stood upright in space: +x goes along (0, 1, 0), +y along (0, 0, 1).
    #[test]
    fn tangents_go_along_the_charts_x() {
        let flat = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]];
        let positions: Vec<[f64; 3]> = flat.iter().map(|p| [5.0, p[0], p[1]]).collect();
        let normals = vec![[1.0, 0.0, 0.1]; 4];
        let patch = PatchChart {
            flat: flat.clone(),
            faces: vec![[0, 1, 2], [0, 2, 3]],
        };
        for tangent in tangents(&patch, &positions, &normals) {
            assert_eq!(tangent, [0.0, 1.0, 0.0, 1.0]);
        }
        // Seen from behind, the chart is mirrored.
        let mirrored = PatchChart {
            flat: flat.iter().map(|p| [-p[0], p[1]]).collect(),
            faces: patch.faces,
        };
        for tangent in tangents(&mirrored, &positions, &normals) {
            assert_eq!(tangent, [0.0, -1.0, 0.0, -1.0]);
        }
    }

    #[test]
    fn vertices_without_faces_have_a_tangent_too() {
        let patch = PatchChart {
            flat: vec![[0.0; 2]; 3],
            faces: vec![[0, 1, 2]],
        };
        for normal in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] {
            for [x, y, z, _] in tangents(&patch, &[[0.0; 3]; 3], &[normal; 3]) {
                assert!(((x * x + y * y + z * z) - 1.0).abs() < 1e-6);
            }
        }
    }
}
