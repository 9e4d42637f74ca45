//! The bending terms of the strain energy: the discrete Laplacian of the positions at every vertex with a closed fan of
//! triangles.

use super::rest::RestMesh;

/// One bending term of the energy: weight · ‖Σ cᵥ xᵥ − target‖².
pub(super) struct BendingTerm {
    /// The vertex that the Laplacian belongs to.
    pub vertex: u32,
    /// Vertices and their coefficients cᵥ.
    pub terms: Vec<(u32, f64)>,
    /// Weight of the term.
    pub weight: f64,
}

/// A corner of a rest triangle counts as degenerate when its doubled area ÷ squared longer side is not above this; such
/// a corner has no usable Laplacian.
const FLATTEST: f64 = 1e-3;

/// Discrete Laplacians (cotangent weights at rest, divided by the vertex area) of all vertices with a closed fan; each
/// weight is the vertex area. `areas` holds the area of every face.
///
/// The rows of rim vertices include scan vertices beyond the rim, so the scan's curvature continues into the patch.
pub(super) fn bending_terms(rest: &RestMesh, areas: &[f64]) -> Vec<BendingTerm> {
    let count = rest.points.len();
    let (mut area, mut angle, mut terms) =
        (vec![0.0; count], vec![0.0; count], vec![Vec::new(); count]);
    for (face, own) in rest.faces.iter().zip(areas) {
        for k in 0..3 {
            let corners = [face[k], face[(k + 1) % 3], face[(k + 2) % 3]];
            let [a, b, c] = corners.map(|v| v as usize);
            let (from_c, to_b) = (
                rest.points[a] - rest.points[c],
                rest.points[b] - rest.points[c],
            );
            let half = 0.25 * from_c.dot(&to_b) / own;
            terms[a].extend([(corners[1], half), (corners[0], -half)]);
            terms[b].extend([(corners[0], half), (corners[1], -half)]);
            area[a] += own / 3.0;
            let (to_b, to_c) = (
                rest.points[b] - rest.points[a],
                rest.points[c] - rest.points[a],
            );
            let longest = to_b.norm_squared().max(to_c.norm_squared());
            // Untangling the rim can turn a scan triangle over; its corners then have no meaningful rest curvature.
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
            BendingTerm {
                vertex: v as u32,
                terms,
                weight: area[v],
            }
        })
        .collect()
}

/// Terms with one summed coefficient per vertex, ascending by vertex.
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
