//! How far the new cloth may be from the cloth that was there: a standard deviation for every vertex of a patch.
//!
//! Where the network fills a hole, its deviations are those of the network's error model ([`darn_net::ErrorModel`]). Where a smooth surface does, they
//! grow with the depth and with how far a plate is off about cloth that the scan shows. In between both count as much as they are used. A hole without a
//! chart has none: nothing was measured there. Anchors and gestures change no deviation: they are the user's word.

use darn_contract::v1;
use darn_geometry::grid::{self, NormalGrid, distances_to};
use darn_geometry::patch::Patch;
use darn_net::{ErrorModel, WITHIN_90};

use crate::fill_hole::PatchDraft;
use crate::hole::{Hole, UneditedCloth};

/// Standard deviation of a smooth fill for each cell of depth, as a share of the plate's error about the cloth around the hole. Measured on 95 of 800
/// held-out sheets, those on which the plate is off by less than 0.12 cells: 90 % of the errors were below 0.13, 0.5, 1.1, 1.8 and 2.5 times
/// the plate's error at depths of 1, 3, 5, 7.5 and 11 cells.
const SMOOTH_PER_CELL: f64 = 0.14;
/// Largest intervals of the grades from `very_high` down, as shares of the hole's width; wider ones are `very_low`. An interval is the distance within
/// which the true cloth lies at nine of ten vertices.
const GRADES: [f64; 4] = [0.01, 0.025, 0.05, 0.1];
/// Share of the grid's side up to which evaluation covers holes.
const EVALUATED_EXTENT: f64 = 0.85;

/// What a fill is made of, for its deviations.
pub struct FillEvidence<'a> {
    /// The grid that the network was given.
    pub grid: &'a NormalGrid,
    /// How its answers lie apart, per cell, network's units.
    pub spread: &'a [f32],
    /// Share of the network's movement in the fill; the rest is a smooth surface.
    pub network_share: f64,
    /// How far a plate is off about the cloth around the hole, network's units; `None` where that was not tested.
    pub plate_error: Option<f64>,
}

impl FillEvidence<'_> {
    /// The standard deviation of every cell, network's units.
    pub fn deviations(&self, errors: &ErrorModel) -> Vec<f64> {
        let network = errors.deviations(self.grid, self.spread);
        if self.network_share >= 1.0 {
            return network;
        }
        let known: Vec<bool> = self.grid.known.iter().map(|known| *known > 0.5).collect();
        let smooth = smooth_deviations(&known, self.plate_error.unwrap_or(0.0));
        let share = self.network_share;
        let each = network.iter().zip(smooth);
        each.map(|(network, smooth)| (share * network).hypot((1.0 - share) * smooth))
            .collect()
    }
}

/// The standard deviation of every cell of a smooth fill, network's units; 0 where the cell is known.
pub fn smooth_deviations(known: &[bool], plate_error: f64) -> Vec<f64> {
    let depths = distances_to(known).into_iter();
    depths
        .map(|depth| SMOOTH_PER_CELL * f64::from(depth) * plate_error)
        .collect()
}

impl PatchDraft<'_> {
    /// The standard deviation of every vertex of the patch, scene units; empty where it is not known.
    pub fn deviations(&self) -> Vec<f32> {
        let known = self.hole.charted().zip(self.unedited.as_ref());
        known.map_or_else(Vec::new, |(hole, unedited)| {
            hole.vertex_deviations(unedited, &self.patch)
        })
    }
}

impl Hole {
    /// The standard deviation of every vertex of a patch, scene units; 0 on the rim, which is the scan's. Empty where it is not known.
    pub fn vertex_deviations(&self, unedited: &UneditedCloth, patch: &Patch) -> Vec<f32> {
        let Some(cells) = &unedited.deviations else {
            return Vec::new();
        };
        let at = |p| grid::interpolate(cells, self.chart.frame.uv(p)) * self.normal.scale;
        let new = patch.flat.iter().skip(patch.rim.len());
        let rim = std::iter::repeat_n(0.0, patch.rim.len());
        rim.chain(new.map(|p| at(*p) as f32)).collect()
    }

    /// A note where the hole is larger than evaluation covers.
    pub fn extent_note(&self) -> Option<String> {
        let extent = self.extent() / self.chart.frame.side;
        (extent > EVALUATED_EXTENT).then(|| {
            format!(
                "the hole takes {:.0} % of the side of its chart; confidence was measured on holes of up to {:.0} %",
                100.0 * extent,
                100.0 * EVALUATED_EXTENT
            )
        })
    }
}

/// What a report says of the deviations of a patch's new vertices; `width` is the hole's, in the same unit. `None` without any.
pub fn report(new: &[f32], width: f64) -> Option<v1::Confidence> {
    let mut sorted: Vec<f64> = new.iter().map(|deviation| f64::from(*deviation)).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = |share: f64| sorted[(share * last as f64).round() as usize];
    let count = sorted.len() as f64;
    // The number of vertices up to each grade's largest interval.
    let up_to = |limit: f64| sorted.partition_point(|x| WITHIN_90 * x <= limit * width) as f64;
    let [very_high, high, medium, low] = GRADES.map(|limit| up_to(limit) / count);
    Some(v1::Confidence {
        median: at(0.5),
        p90: at(0.9),
        very_high,
        high: high - very_high,
        medium: medium - high,
        low: low - medium,
        very_low: 1.0 - low,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inpainter::Inpainter;
    use crate::prepared_hole::PreparedHole;
    use crate::testing::{mender, scan_of};
    use crate::welded_scan::WeldedScan;
    use darn_budget::Budget;
    use darn_geometry::mesh::loops::LoopKind;
    use darn_geometry::mesh::shapes::holed_sheet;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn grades_are_shares_of_all_vertices(
            new in prop::collection::vec(0.0..2.0f32, 1..200), width in 0.1..10.0f64,
        ) {
            let said = report(&new, width).unwrap();
            let grades = [said.very_high, said.high, said.medium, said.low, said.very_low];
            prop_assert!((grades.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            prop_assert!(grades.iter().all(|share| *share >= -1e-12));
            prop_assert!(said.median <= said.p90);
        }
    }

    #[test]
    fn an_interval_within_a_hundredth_of_the_hole_is_of_very_high_confidence() {
        let of = |deviation: f64| report(&[deviation as f32], 1.0).unwrap();
        assert_eq!(of(0.0099 / WITHIN_90).very_high, 1.0);
        assert_eq!(of(0.0101 / WITHIN_90).high, 1.0);
        assert_eq!(of(0.2).very_low, 1.0);
        assert_eq!(report(&[], 1.0), None);
    }

    #[test]
    fn the_rim_is_certain_and_the_middle_is_least_so() {
        let welded = WeldedScan::of(&scan_of(&holed_sheet(24, 0.15)), Budget::unlimited()).unwrap();
        let rim = welded.loops.iter().find(|l| l.kind == LoopKind::Hole);
        let prepared = PreparedHole::new(&welded, rim.unwrap().id.0, mender().into()).unwrap();
        let PreparedHole::Charted(hole) = prepared else {
            panic!("flat cloth has a chart");
        };
        let inpainter = Inpainter::choose(&mender().networks, None, None).unwrap();
        let unedited = hole.unedited(&inpainter, mender().into()).unwrap();
        let cells = smooth_deviations(&hole.grid.known, 0.01);
        for (k, deviation) in cells.iter().enumerate() {
            assert!(!hole.grid.known[k] || *deviation == 0.0);
            assert!(!hole.cells.contains(k) || *deviation > 0.0);
        }
        let vertices = hole.vertex_deviations(&unedited, &unedited.patch);
        assert_eq!(vertices.len(), unedited.patch.positions.len());
        assert!(
            vertices[..unedited.patch.rim.len()]
                .iter()
                .all(|d| *d == 0.0)
        );
        assert!(vertices.iter().all(|d| d.is_finite() && *d >= 0.0));
    }
}
