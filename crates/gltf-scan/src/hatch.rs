//! The hatch of marked patches: stripes that a viewer draws over a patch, whatever texture coordinates the scan has.
//!
//! A patch has a set of texture coordinates for it beside the scan's: the stripes are as far apart on every part of a patch,
//! and as many on a small patch as on a large one.

use darn_geometry::mesh::Vec3;
use nalgebra::Matrix3;

/// Stripes of orange and black, 16 × 16 pixels, half of them each: colours that stay apart for every kind of colour vision
/// (Okabe and Ito 2008), one of them light and one dark.
pub(super) const PNG: &[u8] = include_bytes!("hatch.png");

/// Pairs of stripes across a patch.
const PAIRS: f64 = 8.0;
/// Most sets of texture coordinates that viewers read (three.js: four).
pub(super) const MOST_SETS: usize = 4;

/// Texture coordinates of the hatch at the points of a patch. The stripes run across the diagonal of the patch's two main
/// directions: such a direction lies in the cloth, so that it has stripes everywhere it is about flat.
pub(super) fn coordinates(points: &[[f32; 3]]) -> Vec<[f32; 2]> {
    let at = |p: &[f32; 3]| Vec3::from(p.map(f64::from));
    let middle = points.iter().map(at).sum::<Vec3>() / points.len().max(1) as f64;
    let mut spread = Matrix3::zeros();
    for point in points {
        let from = at(point) - middle;
        spread += from * from.transpose();
    }
    let eigen = spread.symmetric_eigen();
    let mut axes: Vec<(f64, Vec3)> = (eigen.eigenvalues.iter().copied())
        .zip(
            eigen
                .eigenvectors
                .column_iter()
                .map(|axis| towards_positive(axis.into())),
        )
        .collect();
    axes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let [(_, first), (_, second), ..] = axes[..] else {
        return vec![[0.0; 2]; points.len()];
    };
    let [across, along] = [first + second, first - second].map(|axis| axis.normalize());
    let places = points.iter().map(|p| {
        let from = at(p) - middle;
        [from.dot(&across), from.dot(&along)]
    });
    let places: Vec<[f64; 2]> = places.collect();
    let furthest = places.iter().map(|[u, _]| u.abs()).fold(0.0, f64::max);
    let period = 2.0 * furthest / PAIRS;
    let scale = if period > 0.0 { 1.0 / period } else { 0.0 };
    let unit = |x: f64| {
        if (x * scale).is_finite() {
            (x * scale) as f32
        } else {
            0.0
        }
    };
    places.iter().map(|place| place.map(unit)).collect()
}

/// An axis with its largest component positive: of the two signs that decompositions give, always the same.
fn towards_positive(axis: Vec3) -> Vec3 {
    let largest = axis
        .iter()
        .copied()
        .fold(0.0, |m: f64, x| if x.abs() > m.abs() { x } else { m });
    if largest < 0.0 { -axis } else { axis }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a waved square with side 3 in the plane of two directions.
    fn square(u: Vec3, v: Vec3) -> Vec<[f32; 3]> {
        let all = (0..20).flat_map(|j| (0..20).map(move |i| (f64::from(i), f64::from(j))));
        all.map(|(i, j)| (3.0 / 19.0) * (i * u + j * v) + 0.05 * i.sin() * u.cross(&v))
            .map(|p| [p.x as f32, p.y as f32, p.z as f32])
            .collect()
    }

    #[test]
    fn cloth_in_any_direction_has_the_same_number_of_stripes() {
        let tilted = Vec3::new(1.0, 1.0, 0.0).normalize();
        for (u, v) in [
            (Vec3::x(), Vec3::y()),
            (Vec3::y(), Vec3::z()),
            (tilted, Vec3::z()),
            (Vec3::new(1.0, -1.0, 0.0).normalize(), Vec3::z()),
        ] {
            for size in [1.0, 1e-4, 1e6] {
                let points = square(u, v);
                let points: Vec<_> = points.iter().map(|p| p.map(|x| x * size)).collect();
                let found = coordinates(&points);
                let us = || found.iter().map(|[u, _]| f64::from(*u));
                let wide = us().fold(f64::MIN, f64::max) - us().fold(f64::MAX, f64::min);
                assert!(wide > 0.8 * PAIRS && wide < 1.01 * PAIRS, "{wide}");
            }
        }
    }

    #[test]
    fn points_in_one_place_have_finite_coordinates() {
        for points in [
            vec![[1.0; 3]; 3],
            vec![[f32::MAX; 3], [f32::MIN; 3], [0.0; 3]],
            vec![],
        ] {
            let found = coordinates(&points);
            assert_eq!(found.len(), points.len());
            assert!(found.iter().flatten().all(|x| x.is_finite()));
        }
    }
}
