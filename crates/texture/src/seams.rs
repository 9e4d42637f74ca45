//! Where the cloth's images are cut: texels there show something of what lies beside the island in the image.

use std::collections::BTreeMap;

use darn_budget::{Budget, Exhausted};

use crate::frame::Frame;
use crate::input::Cloth;

/// Nanoseconds of work for a face, and for a texel beside a cut.
const FACE_WORK: u64 = 400;
const TEXEL_WORK: u64 = 6;
/// Texels beside a cut that are not copied.
const REACH: f64 = 1.5;
/// Share of the cloth's texels that may be lost; cloth that is cut into smaller pieces is copied as it is.
const MOST_LOST: f64 = 0.4;

/// Takes the texels beside cuts out of the known ones.
pub(crate) fn leave_cuts(
    cloth: &Cloth,
    frame: &Frame,
    known: &mut [bool],
    budget: &Budget,
) -> Result<(), Exhausted> {
    budget.spend(FACE_WORK * cloth.faces.len() as u64)?;
    let mut kept = known.to_vec();
    for edge in cuts(cloth) {
        let [a, b] = edge.map(|v| frame.texels(cloth.flat[v as usize]));
        let side = |k: usize, size: usize| {
            let low = (a[k].min(b[k]) - REACH).floor().max(0.0) as usize;
            let high = (a[k].max(b[k]) + REACH).ceil().max(0.0) as usize;
            low..high.min(size)
        };
        let (rows, columns) = (side(1, frame.height), side(0, frame.width));
        budget.spend(TEXEL_WORK * (rows.len() * columns.len()) as u64)?;
        for y in rows {
            for x in columns.clone() {
                if distance([x as f64 + 0.5, y as f64 + 0.5], a, b) < REACH {
                    kept[y * frame.width + x] = false;
                }
            }
        }
    }
    let count = |mask: &[bool]| mask.iter().filter(|k| **k).count() as f64;
    if count(&kept) >= (1.0 - MOST_LOST) * count(known) {
        known.copy_from_slice(&kept);
    }
    Ok(())
}

/// Edges between faces that read different places of an image, or different images.
fn cuts(cloth: &Cloth) -> Vec<[u32; 2]> {
    let mut first: BTreeMap<[u32; 2], (usize, usize)> = BTreeMap::new();
    let mut cuts = Vec::new();
    for (f, face) in cloth.faces.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            let edge = [a.min(b), a.max(b)];
            match first.get(&edge) {
                None => drop(first.insert(edge, (f, k))),
                Some(other) if is_cut(cloth, *other, (f, k)) => cuts.push(edge),
                Some(_) => {}
            }
        }
    }
    cuts
}

/// Whether two faces are apart in an image along the edge from corner `k` of each to the next; they go along it in opposite directions.
fn is_cut(cloth: &Cloth, (f, k): (usize, usize), (g, l): (usize, usize)) -> bool {
    let ends = |corner: usize| [corner, (corner + 1) % 3];
    let same = cloth.faces[f][k] == cloth.faces[g][l];
    let [from, to] = ends(k);
    let [other_from, other_to] = match same {
        true => ends(l),
        false => [(l + 1) % 3, l],
    };
    cloth.material_of[f] != cloth.material_of[g]
        || cloth
            .texcoords
            .iter()
            .any(|set| set[f][from] != set[g][other_from] || set[f][to] != set[g][other_to])
}

fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (d, e) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = d[0] * d[0] + d[1] * d[1];
    let at = match length > 0.0 {
        true => ((d[0] * e[0] + d[1] * e[1]) / length).clamp(0.0, 1.0),
        false => 0.0,
    };
    (e[0] - at * d[0]).hypot(e[1] - at * d[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_edges_where_the_image_is_cut_are_left() {
        // A strip of four squares, each of two triangles; the image is cut between the second and the third.
        let flat: Vec<[f64; 2]> = (0..10)
            .map(|k| [f64::from(k / 2) * 20.0, -20.0 * f64::from(k % 2)])
            .collect();
        let faces: Vec<[u32; 3]> = (0..4)
            .flat_map(|q| {
                [
                    [2 * q, 2 * q + 1, 2 * q + 2],
                    [2 * q + 1, 2 * q + 3, 2 * q + 2],
                ]
            })
            .collect();
        let place = |face: usize, v: u32| {
            let moved = if face < 4 { 0.0 } else { 0.3 };
            let p = flat[v as usize].map(|x| (x / 200.0) as f32);
            [p[0] + moved, p[1]]
        };
        let set = (faces.iter().enumerate()).map(|(f, face)| face.map(|v| place(f, v)));
        let cloth = Cloth {
            texcoords: vec![set.collect()],
            material_of: vec![0; faces.len()],
            faces,
            flat: flat.clone(),
            ..Cloth::default()
        };
        let frame = Frame {
            origin: [0.0, 0.0],
            step: 1.0,
            width: 80,
            height: 20,
        };
        let mut known = vec![true; 80 * 20];
        leave_cuts(&cloth, &frame, &mut known, Budget::unlimited()).unwrap();
        for x in 0..80 {
            let near = (39..41).contains(&x);
            assert_eq!(known[10 * 80 + x], !near, "{x}");
        }
    }
}
