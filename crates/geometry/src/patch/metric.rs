//! The lengths that the cloth in a hole should have: a metric on the chart.
//!
//! Where the cloth around a hole lies flat, the chart has its lengths. Where it does not, every chart of it is strained, and cloth that goes on in the
//! hole is strained there, too. The logarithm of the strain around the hole is continued into the hole by a plate, which meets the values and slopes
//! at the rim: by Gauss–Bonnet the hole then holds the curvature that the rim's turning asks for.

use nalgebra::Matrix2;

use super::deformation::{StrainTriangle, of_symmetric};
use crate::flatten::{Chart, cell_faces};
use crate::grid::{self, CELLS, SIDE, cell_index};
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};

/// Standard deviation of the blur that takes the mesh's noise off, cells.
const BLUR: f64 = 2.0;
/// Cells on each side of one that the blur looks at.
const BLUR_REACH: usize = 6;

/// A metric on the chart of a hole.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchMetric(Vec<Vec3>);

/// The logarithm of the stretch from a chart to the cloth, per cell of the grid and blurred: the symmetric matrix \[\[x, z\], \[z, y\]\] in the plane
/// of the chart; zero in cells that no face covers.
pub fn log_stretch(region: &Region, chart: &Chart) -> Vec<Vec3> {
    let mesh = &region.mesh;
    let of_face = |face: usize| {
        let triangle = StrainTriangle::new(&mesh.faces[face], &chart.flat);
        let s = triangle.log_stretch(&mesh.positions);
        Vec3::new(s[(0, 0)], s[(1, 1)], s[(0, 1)])
    };
    let faces = cell_faces(mesh, chart).into_iter();
    blurred(&faces.map(|face| face.map(of_face)).collect::<Vec<_>>())
}

impl PatchMetric {
    /// The metric of a [`log_stretch`] that was continued into the cells without faces; one value per cell.
    pub fn of_log_stretch(cells: Vec<Vec3>) -> PatchMetric {
        PatchMetric(cells)
    }

    /// The stretch from the chart to the cloth at a uv, a symmetric matrix in the plane of the chart.
    pub fn stretch(&self, uv: Vec2) -> Matrix2<f64> {
        let s = grid::evaluate(&self.0, uv);
        of_symmetric(Matrix2::new(s.x, s.z, s.z, s.y), f64::exp)
    }
}

/// A sum of weighted values.
#[derive(Clone, Copy, Default)]
struct Sum {
    value: Vec3,
    weight: f64,
}

/// Gaussian mean over the cells that have a value; zero in those without.
fn blurred(cells: &[Option<Vec3>]) -> Vec<Vec3> {
    let kernel: Vec<f64> = (0..=BLUR_REACH)
        .map(|d| (-0.5 * (d as f64 / BLUR).powi(2)).exp())
        .collect();
    let line = |at: usize| at.saturating_sub(BLUR_REACH)..SIDE.min(at + BLUR_REACH + 1);
    let add = |sum: &mut Sum, other: Sum, away: usize| {
        sum.value += other.value * kernel[away];
        sum.weight += other.weight * kernel[away];
    };
    let given = |cell: &Option<Vec3>| {
        let weight = if cell.is_some() { 1.0 } else { 0.0 };
        let value = cell.unwrap_or_default();
        Sum { value, weight }
    };
    let given: Vec<Sum> = cells.iter().map(given).collect();
    let mut rows = vec![Sum::default(); CELLS];
    for (k, sum) in rows.iter_mut().enumerate() {
        let (i, j) = (k % SIDE, k / SIDE);
        line(i).for_each(|from| add(sum, given[cell_index(from, j)], from.abs_diff(i)));
    }
    let mean = |k: usize| {
        let (i, j) = (k % SIDE, k / SIDE);
        let mut sum = Sum::default();
        line(j).for_each(|from| add(&mut sum, rows[cell_index(i, from)], from.abs_diff(j)));
        sum.value / sum.weight
    };
    let each = cells.iter().enumerate();
    each.map(|(k, cell)| cell.map_or_else(Vec3::zeros, |_| mean(k)))
        .collect()
}

#[cfg(test)]
mod tests {
    use darn_budget::Budget;

    use super::*;
    use crate::flatten::{FlattenLimits, flatten, raster};
    use crate::mesh::region::region_around_hole;
    use crate::mesh::shapes::sheet;
    use crate::mesh::weld::weld;
    use crate::smooth::{Smooth, smooth};

    /// The metric in the middle of a round hole of radius 0.2 in a sheet of 40² squares.
    fn in_the_middle(place: impl Fn(f64, f64) -> Vec3) -> Matrix2<f64> {
        let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
        let mesh = weld(&sheet(40, keep, place)).mesh;
        let region = region_around_hole(&mesh, 0.2);
        let chart = flatten(&region, &FlattenLimits::default(), Budget::unlimited()).unwrap();
        let known = raster(&region.mesh, &chart).known;
        let open: Vec<bool> = known.iter().map(|k| !k).collect();
        let filled = smooth(
            &log_stretch(&region, &chart),
            &known,
            &open,
            Smooth::TautPlate,
            1,
        );
        let centre: Vec2 = region.rim.iter().map(|v| chart.uv(*v)).sum();
        let centre = centre / region.rim.len() as f64;
        PatchMetric::of_log_stretch(filled.unwrap()).stretch(centre)
    }

    #[test]
    fn flat_and_rolled_cloth_have_the_lengths_of_the_chart() {
        let flat = in_the_middle(|u, v| Vec3::new(u, v, 0.0));
        assert!((flat - Matrix2::identity()).norm() < 1e-6, "{flat}");
        let rolled =
            in_the_middle(|u, v| Vec3::new((3.0 * u).sin() / 3.0, v, (3.0 * u).cos() / 3.0));
        assert!((rolled - Matrix2::identity()).norm() < 2e-3, "{rolled}");
    }

    #[test]
    fn a_hole_in_a_dome_holds_more_cloth_than_its_chart_and_one_in_a_saddle_less() {
        let bent = |by: f64| {
            move |u: f64, v: f64| {
                let (x, y) = (u - 0.5, v - 0.5);
                Vec3::new(x, y, 0.8 * (x * x + by * y * y))
            }
        };
        let [dome, saddle] = [1.0, -1.0].map(|by| in_the_middle(bent(by)).determinant());
        assert!(dome > 1.01, "{dome}");
        assert!(saddle < 0.99, "{saddle}");
    }
}
