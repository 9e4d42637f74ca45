//! Cloth that shows one part of an image twice, on both sides of a line.
//!
//! Left and right of many garments lie mirrored on each other in their image. What is missing on one side of the line may be there on the other, so the
//! cloth's mirror image is a second page to copy from.

use darn_budget::{Budget, Exhausted};

use crate::frame::{Frame, doubled_area};
use crate::input::Cloth;

/// Nanoseconds of work for a face that is read, and for one that is compared.
const FACE_WORK: u64 = 60;
const COMPARED_WORK: u64 = 6;
/// Faces that are looked at.
const SAMPLES: usize = 160;
/// Share of them that must have a partner by the same reflection.
const LEAST_SHARE: f64 = 0.15;
/// Differences of the angle, in radians, and of places, as a share of the cloth's size, up to which two reflections are the same.
const SAME_ANGLE: f64 = 0.06;
const SAME_PLACE: f64 = 0.03;

/// p ↦ line + reflected (p − line): `angle` is twice that of the line of reflection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reflection {
    angle: f64,
    shift: [f64; 2],
}

impl Reflection {
    pub(crate) fn of(&self, p: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.angle.sin_cos();
        [
            cos * p[0] + sin * p[1] + self.shift[0],
            sin * p[0] - cos * p[1] + self.shift[1],
        ]
    }

    /// How far a point is from the line, with a sign that tells the sides.
    pub(crate) fn side(&self, p: [f64; 2]) -> f64 {
        let other = self.of(p);
        let (sin, cos) = (0.5 * self.angle).sin_cos();
        0.5 * (cos * (p[1] - other[1]) - sin * (p[0] - other[0]))
    }
}

/// Texels that a side of a frame may gain, as a share of it.
const MOST_GAIN: f64 = 0.5;

/// Texels that a side may gain.
fn most_gain(size: usize, max_side: usize) -> usize {
    ((MOST_GAIN * size as f64) as usize).min(max_side.saturating_sub(size))
}

/// Texels that a frame has at most once it is [`widened`].
pub(crate) fn most_texels(frame: &Frame, max_side: usize) -> usize {
    let [width, height] = [frame.width, frame.height].map(|x| x + most_gain(x, max_side));
    width * height
}

/// Whether some faces show their images mirrored and others do not.
pub(crate) fn shows_both_sides(cloth: &Cloth) -> bool {
    let mut areas = (0..cloth.faces.len()).filter_map(|k| Some(face(cloth, k)?.area > 0.0));
    let first = areas.next();
    areas.any(|side| Some(side) != first)
}

/// The frame, wide enough for its own mirror image where `max_side` and [`MOST_GAIN`] allow it: what a texel on one side of the line copies, the mirror image of
/// that texel must find mirrored.
pub(crate) fn widened(frame: &Frame, reflection: &Reflection, max_side: usize) -> Frame {
    let corners = [
        [0, 0],
        [frame.width, 0],
        [0, frame.height],
        [frame.width, frame.height],
    ];
    let corners = corners.map(|[column, row]| {
        let p = [
            frame.origin[0] + column as f64 * frame.step,
            frame.origin[1] - row as f64 * frame.step,
        ];
        frame.texels(reflection.of(p))
    });
    let gains = [0, 1].map(|k: usize| {
        let size = [frame.width, frame.height][k];
        let most = most_gain(size, max_side);
        let low = corners.iter().map(|c| c[k]).fold(0.0, f64::min);
        let high = corners.iter().map(|c| c[k]).fold(size as f64, f64::max);
        let before = ((-low).ceil() as usize).min(most);
        [before, ((high.ceil() as usize) - size).min(most - before)]
    });
    frame.widened([gains[0][0], gains[1][0], gains[0][1], gains[1][1]])
}

/// A face with its places in the first image of its material.
struct Face {
    flat: [[f64; 2]; 3],
    at: [[f64; 2]; 3],
    /// Twice the area in the image; the sign tells mirrored faces.
    area: f64,
    material: u32,
}

/// The reflection that brings most faces to others with the same places in the image; `None` when the cloth shows nothing twice.
pub(crate) fn reflection(
    cloth: &Cloth,
    size: f64,
    budget: &Budget,
) -> Result<Option<Reflection>, Exhausted> {
    budget.spend(FACE_WORK * cloth.faces.len() as u64)?;
    let faces: Vec<Face> = (0..cloth.faces.len())
        .filter_map(|k| face(cloth, k))
        .collect();
    let mirrored = faces.iter().filter(|f| f.area > 0.0).count();
    if mirrored == 0 || mirrored == faces.len() {
        return Ok(None);
    }
    let step = (faces.len() / SAMPLES).max(1);
    let sampled = || faces.iter().step_by(step);
    let mut found: Vec<Reflection> = Vec::new();
    for face in sampled() {
        budget.spend(COMPARED_WORK * faces.len() as u64)?;
        let place = centroid(face.at);
        let other = |o: &&Face| {
            o.area * face.area < 0.0 && o.material == face.material && holds(o.at, place)
        };
        let other = faces.iter().find(other);
        found.extend(other.and_then(|other| between(face, other)));
    }
    let same = |a: &Reflection, b: &Reflection| {
        let turn = (a.angle - b.angle)
            .sin()
            .abs()
            .max(1.0 - (a.angle - b.angle).cos());
        let away = (a.shift[0] - b.shift[0]).hypot(a.shift[1] - b.shift[1]);
        turn < SAME_ANGLE && away < SAME_PLACE * size
    };
    let supporters = |r: &Reflection| found.iter().filter(|o| same(r, o)).count();
    let Some(best) = found.iter().rev().max_by_key(|r| supporters(r)) else {
        return Ok(None);
    };
    let all: Vec<&Reflection> = found.iter().filter(|o| same(best, o)).collect();
    if (all.len() as f64) < LEAST_SHARE * sampled().count() as f64 {
        return Ok(None);
    }
    let count = all.len() as f64;
    let mean = |of: &dyn Fn(&Reflection) -> f64| all.iter().map(|r| of(r)).sum::<f64>() / count;
    let (sin, cos) = (mean(&|r| r.angle.sin()), mean(&|r| r.angle.cos()));
    let shift = [mean(&|r| r.shift[0]), mean(&|r| r.shift[1])];
    Ok(Some(Reflection {
        angle: sin.atan2(cos),
        shift,
    }))
}

fn face(cloth: &Cloth, index: usize) -> Option<Face> {
    let material = cloth.material_of[index];
    let source = cloth.materials[material as usize]
        .iter()
        .find(|s| s.image.is_some())?;
    let at = cloth.texcoords[source.texcoords][index].map(|t| t.map(f64::from));
    let flat = cloth.faces[index].map(|v| cloth.flat[v as usize]);
    let area = doubled_area(at) * doubled_area(flat).signum();
    (area != 0.0 && area.is_finite()).then_some(Face {
        flat,
        at,
        area,
        material,
    })
}

fn centroid([a, b, c]: [[f64; 2]; 3]) -> [f64; 2] {
    [0, 1].map(|k: usize| (a[k] + b[k] + c[k]) / 3.0)
}

fn weights(triangle: [[f64; 2]; 3], p: [f64; 2]) -> [f64; 3] {
    let area = doubled_area(triangle);
    let [a, b, c] = triangle;
    [[p, b, c], [a, p, c], [a, b, p]].map(|t| doubled_area(t) / area)
}

fn holds(triangle: [[f64; 2]; 3], p: [f64; 2]) -> bool {
    weights(triangle, p).iter().all(|w| *w >= 0.0)
}

/// The reflection from a face to another one that lies at the same place of the image.
fn between(face: &Face, other: &Face) -> Option<Reflection> {
    let over = |p: [f64; 2]| {
        let w = weights(other.at, p);
        [0, 1].map(|k: usize| (0..3).map(|i| w[i] * other.flat[i][k]).sum::<f64>())
    };
    let to = face.at.map(over);
    let (u, v) = (edge(face.flat, 1), edge(face.flat, 2));
    let (a, b) = (edge(to, 1), edge(to, 2));
    let det = u[0] * v[1] - u[1] * v[0];
    // The columns of the linear map from the face to its image.
    let x = [0, 1].map(|k: usize| (a[k] * v[1] - b[k] * u[1]) / det);
    let y = [0, 1].map(|k: usize| (b[k] * u[0] - a[k] * v[0]) / det);
    let (cos, sin) = (0.5 * (x[0] - y[1]), 0.5 * (x[1] + y[0]));
    let scale = cos.hypot(sin);
    let rest = (0.5 * (x[0] + y[1])).hypot(0.5 * (x[1] - y[0]));
    if !((0.85..1.18).contains(&scale) && rest < 0.15) {
        return None;
    }
    let turned = Reflection {
        angle: sin.atan2(cos),
        shift: [0.0; 2],
    };
    let (from, to) = (turned.of(centroid(face.flat)), centroid(to));
    Some(Reflection {
        shift: [to[0] - from[0], to[1] - from[1]],
        ..turned
    })
}

fn edge(triangle: [[f64; 2]; 3], k: usize) -> [f64; 2] {
    [
        triangle[k][0] - triangle[0][0],
        triangle[k][1] - triangle[0][1],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testset::{Fabric, Layout, TestScan};

    #[test]
    fn a_folded_map_has_the_fold_as_its_line_and_others_have_none() {
        let scan = TestScan::new(Fabric::Plain, Layout::Mirrored, 64);
        let budget = Budget::unlimited();
        let found = reflection(&scan.cloth(), 128.0, budget).unwrap().unwrap();
        // The fold is two squares of 3.2 texels right of the middle.
        let [x, y] = found.of([10.0, 20.0]);
        assert!((x - 2.8).abs() < 0.05 && (y - 20.0).abs() < 0.05, "{x} {y}");
        for layout in [Layout::OneMap, Layout::Atlas] {
            let scan = TestScan::new(Fabric::Plain, layout, 64);
            let found = reflection(&scan.cloth(), 128.0, budget).unwrap();
            assert_eq!(found, None);
        }
    }
}
