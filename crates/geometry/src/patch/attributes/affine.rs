//! An affine map from the chart to the attributes of one texture island.

use nalgebra::{DMatrix, Matrix3};

use super::{Columns, RimAttributes};
use crate::flatten::Chart;
use crate::mesh::Vec2;
use crate::mesh::region::Region;
use crate::patch::Patch;

/// One island's affine map of the chart at every patch vertex.
pub(super) fn values(
    label: u32,
    patch: &Patch,
    region: &Region,
    chart: &Chart,
    around: &RimAttributes,
) -> Vec<Vec<f64>> {
    let columns = around.columns;
    let mut samples: Vec<(u32, Vec2)> = Vec::new();
    let faces = region.mesh.faces.iter().zip(&around.corners);
    for ((face, corners), island) in faces.zip(&around.islands) {
        if let Some(corners) = corners.filter(|_| *island == Some(label)) {
            let flat = face.map(|v| chart.flat[v as usize]);
            samples.extend(corners.into_iter().zip(flat));
        }
    }
    samples.sort_by_key(|(scan, _)| *scan);
    samples.dedup_by_key(|(scan, _)| *scan);
    let fit = affine_fit(&samples, columns, patch);
    let at = |p: &Vec2| -> Vec<f64> {
        (0..columns.width)
            .map(|c| fit[(0, c)] + fit[(1, c)] * p.x + fit[(2, c)] * p.y)
            .collect()
    };
    patch.flat.iter().map(&at).collect()
}

/// Least-squares affine map from the chart to the columns, [3, width]: rows constant, x, y. Samples near the hole have
/// the largest weights.
fn affine_fit(samples: &[(u32, Vec2)], columns: &Columns, patch: &Patch) -> DMatrix<f64> {
    let rim = patch.rim.len() as f64;
    let centre = patch.flat.iter().take(patch.rim.len()).sum::<Vec2>() / rim;
    let size = patch
        .flat
        .iter()
        .take(patch.rim.len())
        .map(|p| (p - centre).norm_squared())
        .sum::<f64>()
        / rim;
    let mut normal = Matrix3::zeros();
    let mut rhs = nalgebra::Matrix3xX::zeros(columns.width);
    for (scan, p) in samples {
        let d = (p - centre) / size.sqrt().max(f64::MIN_POSITIVE);
        let weight = (-d.norm_squared()).exp() + 1e-6;
        let row = nalgebra::Vector3::new(1.0, d.x, d.y);
        normal += row * row.transpose() * weight;
        for (c, value) in (columns.values)(*scan).iter().enumerate() {
            (0..3).for_each(|r| rhs[(r, c)] += weight * row[r] * value);
        }
    }
    // A small ridge term: samples on one line leave one slope open, which becomes zero.
    normal += Matrix3::from_diagonal(&nalgebra::Vector3::new(0.0, 1e-9, 1e-9))
        * normal.trace().max(f64::MIN_POSITIVE);
    let solution = normal.try_inverse().map_or_else(
        || DMatrix::zeros(3, columns.width),
        |inverse| DMatrix::from_fn(3, columns.width, |r, c| (inverse * rhs.column(c))[r]),
    );
    // From centred, scaled coordinates back to the chart's.
    let scale = size.sqrt().max(f64::MIN_POSITIVE);
    DMatrix::from_fn(3, columns.width, |r, c| match r {
        0 => solution[(0, c)] - (solution[(1, c)] * centre.x + solution[(2, c)] * centre.y) / scale,
        _ => solution[(r, c)] / scale,
    })
}
