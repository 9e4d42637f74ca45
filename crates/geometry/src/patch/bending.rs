//! What bending costs: the discrete Laplacian of positions at every vertex whose fan of triangles is closed.

use super::cloth::Sheet;

/// One bending term of the energy: weight · ‖Σ cᵥ xᵥ − target‖².
pub(super) struct Bend {
    /// The vertex whose bend it is.
    pub vertex: u32,
    pub terms: Vec<(u32, f64)>,
    pub weight: f64,
}

/// Triangles at rest flatter than this (doubled area ÷ longest edge squared) spoil the Laplacians of their corners.
const FLATTEST: f64 = 1e-3;

/// Discrete Laplacians (cotangent weights at rest, area-normalised) of the vertices whose fan is closed, as rows of weight area.
///
/// The cloth's own bends around the hole go on through its rim, because the rim's rows reach over it.
pub(super) fn bends(sheet: &Sheet, areas: &[f64]) -> Vec<Bend> {
    let count = sheet.rest.len();
    let (mut area, mut angle, mut terms) =
        (vec![0.0; count], vec![0.0; count], vec![Vec::new(); count]);
    for (face, own) in sheet.faces.iter().zip(areas) {
        for k in 0..3 {
            let corners = [face[k], face[(k + 1) % 3], face[(k + 2) % 3]];
            let [a, b, c] = corners.map(|v| v as usize);
            let (from_c, to_b) = (sheet.rest[a] - sheet.rest[c], sheet.rest[b] - sheet.rest[c]);
            let half = 0.25 * from_c.dot(&to_b) / own;
            terms[a].extend([(corners[1], half), (corners[0], -half)]);
            terms[b].extend([(corners[0], half), (corners[1], -half)]);
            area[a] += own / 3.0;
            let (to_b, to_c) = (sheet.rest[b] - sheet.rest[a], sheet.rest[c] - sheet.rest[a]);
            let longest = to_b.norm_squared().max(to_c.norm_squared());
            // Where untangling the rim has turned a triangle of the scan over, there is no telling what unbent means.
            let sound = to_b.perp(&to_c) > FLATTEST * longest;
            angle[a] += if sound {
                to_b.perp(&to_c).atan2(to_b.dot(&to_c))
            } else {
                f64::NAN
            };
        }
    }
    let closed = |v: &usize| (angle[*v] - std::f64::consts::TAU).abs() < 1e-6;
    (0..count)
        .filter(closed)
        .map(|v| {
            let mut terms = merged(std::mem::take(&mut terms[v]));
            terms.iter_mut().for_each(|(_, c)| *c /= area[v]);
            Bend {
                vertex: v as u32,
                terms,
                weight: area[v],
            }
        })
        .collect()
}

/// Terms with their coefficients summed per vertex, in order of vertex.
fn merged(mut terms: Vec<(u32, f64)>) -> Vec<(u32, f64)> {
    terms.sort_by_key(|(v, _)| *v);
    terms.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    terms
}
