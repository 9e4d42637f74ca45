//! Triangles between the vertices of a closed line in space: of all triangulations without inner vertices about the one
//! that bends least.

use std::f64::consts::FRAC_PI_2;

use darn_budget::{Budget, Exhausted};

use crate::mesh::Vec3;

/// Longest line that is triangulated at once; of a longer one every n-th vertex, and the pieces between them after that.
const AT_ONCE: usize = 160;
/// Nanoseconds of work a triangle that is tried.
const TRIANGLE_WORK: u64 = 60;
/// Most that a bend at an edge may weigh against its angle's square: slivers have hardly any area.
const STEEPEST: f64 = 10.0;
/// Weight of a triangle without area.
const NO_AREA: f64 = 1e3;

/// A closed line in space with the surface that ends there.
pub(super) struct SpanRim {
    /// Its vertices in order, scene space.
    pub points: Vec<Vec3>,
    /// Per edge, from vertex k to k + 1: unit normal of the surface beside it, zero where it is unknown. The surface
    /// and the triangles have the edge in opposite directions.
    pub normals: Vec<Vec3>,
}

/// Triangles that close a line, each in the line's order, as indices into it.
///
/// Dynamic programming over all sections of the line (after Barequet and Sharir 1995, Liepa 2003). What it makes small
/// is the discrete bending energy Σ θ² |e|² / A over the edges, those of the line included: θ is the angle between the
/// normals on both sides, A the area beside the edge. It does not depend on the scale. O(n³) up to 160 vertices, then
/// O(n).
///
/// # Errors
/// `Exhausted`.
pub(super) fn span(rim: &SpanRim, budget: &Budget) -> Result<Vec<[u32; 3]>, Exhausted> {
    let count = rim.points.len();
    let chosen: Vec<usize> = (0..count.min(AT_ONCE))
        .map(|k| k * count / count.min(AT_ONCE))
        .collect();
    let mut faces = triangulated(rim, &chosen, Vec3::zeros(), budget)?;
    let coarse = faces.len();
    for (k, from) in chosen.iter().enumerate() {
        let to = chosen.get(k + 1).copied().unwrap_or(count);
        if to - from < 2 {
            continue;
        }
        // The section's last edge closes it; on its other side lies a coarse triangle.
        let section: Vec<usize> = (*from..=to).map(|v| v % count).collect();
        let ends = [*from as u32, (to % count) as u32];
        let beside = faces[..coarse]
            .iter()
            .find(|f| (0..3).any(|c| [f[c], f[(c + 1) % 3]] == ends));
        let normal = beside.map_or(Vec3::zeros(), |f| {
            let [a, b, c] = f.map(|v| rim.points[v as usize]);
            unit((b - a).cross(&(c - a)))
        });
        faces.extend(triangulated(rim, &section, normal, budget)?);
    }
    Ok(faces)
}

/// The best triangles of a section of the line.
#[derive(Clone, Copy)]
struct Best {
    weight: f64,
    /// The third corner of the triangle at the section's chord.
    apex: usize,
    /// That triangle's normal with the length of its area; zero for a single edge.
    normal: Vec3,
}

/// Triangulates the closed line of the `chosen` vertices; `closing` is the unit normal beyond the edge from the last
/// to the first, zero where it is that of the line.
fn triangulated(
    rim: &SpanRim,
    chosen: &[usize],
    closing: Vec3,
    budget: &Budget,
) -> Result<Vec<[u32; 3]>, Exhausted> {
    let count = chosen.len();
    if count < 3 {
        return Ok(Vec::new());
    }
    budget.spend(TRIANGLE_WORK * (count * count * count / 6) as u64)?;
    let point = |k: usize| rim.points[chosen[k]];
    // The normal beyond the edge that starts at a chosen vertex: the mean over the edges up to the next one.
    let beyond = |k: usize| {
        let from = chosen[k];
        let to = if k + 1 < count {
            chosen[k + 1]
        } else {
            chosen[0]
        };
        let length = (to + rim.points.len() - from) % rim.points.len();
        let each = (0..length).map(|step| rim.normals[(from + step) % rim.normals.len()]);
        unit(each.sum())
    };
    let last = if closing == Vec3::zeros() {
        beyond(count - 1)
    } else {
        closing
    };
    let edges: Vec<Vec3> = (0..count - 1).map(beyond).collect();
    let at = |i: usize, k: usize| i * count + k;
    let nothing = Best {
        weight: 0.0,
        apex: usize::MAX,
        normal: Vec3::zeros(),
    };
    let mut best = vec![nothing; count * count];
    for width in 2..count {
        for i in 0..count - width {
            let k = i + width;
            let mut found = Best {
                weight: f64::INFINITY,
                ..nothing
            };
            for m in i + 1..k {
                let normal = 0.5 * (point(m) - point(i)).cross(&(point(k) - point(i)));
                let mut weight = best[at(i, m)].weight + best[at(m, k)].weight;
                if weight >= found.weight {
                    continue;
                }
                for (a, b) in [(i, m), (m, k)] {
                    let other = match b - a {
                        1 => edges[a] * normal.norm(),
                        _ => best[at(a, b)].normal,
                    };
                    weight += bend(&normal, &other, (point(b) - point(a)).norm_squared());
                }
                if i == 0 && k == count - 1 {
                    let other = last * normal.norm();
                    weight += bend(&normal, &other, (point(k) - point(i)).norm_squared());
                }
                if weight < found.weight || found.apex == usize::MAX {
                    found = Best {
                        weight,
                        apex: m,
                        normal,
                    };
                }
            }
            best[at(i, k)] = found;
        }
    }
    let mut faces = Vec::with_capacity(count - 2);
    let mut open = vec![(0, count - 1)];
    while let Some((i, k)) = open.pop() {
        if k - i < 2 {
            continue;
        }
        let m = best[at(i, k)].apex;
        faces.push([i, m, k].map(|v| chosen[v] as u32));
        open.extend([(i, m), (m, k)]);
    }
    Ok(faces)
}

/// The bending energy at an edge of this squared length between two triangles; normals have the length of the areas.
fn bend(a: &Vec3, b: &Vec3, squared: f64) -> f64 {
    let area = a.norm() + b.norm();
    if area <= 1e-12 * squared {
        return NO_AREA;
    }
    if b.norm() == 0.0 {
        return 0.0;
    }
    let angle = match a.norm() > 1e-9 * squared {
        true => a.cross(b).norm().atan2(a.dot(b)),
        false => FRAC_PI_2,
    };
    angle * angle * (squared / area).min(STEEPEST)
}

fn unit(v: Vec3) -> Vec3 {
    v.try_normalize(0.0).unwrap_or_else(Vec3::zeros)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;

    fn flat_rim(points: Vec<Vec3>) -> SpanRim {
        let normals = vec![Vec3::z(); points.len()];
        SpanRim { points, normals }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn triangles_cover_any_flat_star_once(radii in prop::collection::vec(0.5..2.0f64, 5..400)) {
            let turn = TAU / radii.len() as f64;
            let at = |k: usize| Vec3::new((turn * k as f64).cos(), (turn * k as f64).sin(), 0.0) * radii[k];
            let points: Vec<Vec3> = (0..radii.len()).map(at).collect();
            let next = points.iter().cycle().skip(1);
            let area: f64 = points.iter().zip(next).map(|(a, b)| 0.5 * a.cross(b).z).sum();
            let faces = span(&flat_rim(points.clone()), Budget::unlimited()).unwrap();
            prop_assert_eq!(faces.len(), points.len() - 2);
            let of = |f: &[u32; 3]| {
                let [a, b, c] = f.map(|v| points[v as usize]);
                0.5 * (b - a).cross(&(c - a)).z
            };
            let covered: f64 = faces.iter().map(of).sum();
            prop_assert!((covered - area).abs() < 1e-9);
            // Up to the length that is triangulated at once nothing folds over.
            if points.len() <= AT_ONCE {
                prop_assert!(faces.iter().all(|f| of(f) > -1e-12));
            }
        }
    }
}
