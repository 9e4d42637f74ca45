//! How much of the network's folds is kept: as much as they are right about the cloth around the hole.
//!
//! The network continues folds. On smooth cloth that does not lie flat it sees folds where there are none, and a plate is closer to the truth. So the
//! hole is widened by a few cells, and the network is asked for cloth that the scan shows. The share of its movement from the plate that fits the
//! truth there best tells what the movement is worth in the hole. The same test chooses between two smooth surfaces.

use crate::error::MendError;
use crate::hole::Hole;
use crate::inpainter::Inpainter;
use darn_budget::Budget;
use darn_geometry::grid::{CELLS, NormalGrid, SIDE, cell_index};
use darn_geometry::mesh::Vec3;
use darn_geometry::smooth::{Smooth, smooth};
use darn_net::Averaging;

/// Cells by which the hole is widened.
const WIDER: usize = 4;
/// The fitting share up to which nothing of the network's movement is kept. Measured: it is below 0.15 on 13 of 16 smooth sheets that do not lie flat
/// (the others, two with the start of a fold and a hip, 0.9 to 2.0), and 0.49 to 1.29 on 29 of 30 draped ones.
const WORTHLESS: f64 = 0.2;
/// The fitting share from which on all of it is kept.
const WORTH_ALL: f64 = 0.6;
/// Cells that a plate may be off around a hole (root mean square) where no network is needed. On 30 draped sheets it was off by 0.145 at least.
const SMOOTH: f64 = 0.06;
/// Cells by which two fair surfaces may differ (root mean square) without it mattering which is taken.
const ALIKE: f64 = 0.02;
/// Side of a cell, network's units.
const CELL: f64 = 1.0 / SIDE as f64;
/// Nanoseconds of work of a plate.
const PLATE_WORK: u64 = 4_000_000;
/// Nanoseconds of work of a pass of the network.
const PASS_WORK: u64 = 5_000_000;
/// Nanoseconds of work of the fair fills.
const FAIR_WORK: u64 = 15_000_000;

/// A hole widened by cells that the scan shows: what a method says about them can be compared with the truth. Lengths are in the network's units.
pub struct WidenedHole<'a> {
    hole: &'a Hole,
    /// The scan's position at every cell; meaningless where it is not known.
    scanned: Vec<Vec3>,
    /// The cells that the hole was widened by, ascending.
    tested: Vec<usize>,
    /// Whether a cell is known and not tested.
    known: Vec<bool>,
    /// The plate over the widened hole; `None` where too few cells are known.
    plate: Option<Vec<Vec3>>,
}

impl<'a> WidenedHole<'a> {
    /// Widens a hole and lays a plate over it.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn new(hole: &'a Hole, budget: &Budget) -> Result<WidenedHole<'a>, MendError> {
        budget.spend(PLATE_WORK)?;
        let tested = around(hole);
        let mut known = hole.grid.known.clone();
        tested.iter().for_each(|k| known[*k] = false);
        let in_network = |p: &Vec3| (p - hole.normal.centre) / hole.normal.scale;
        let mut widened = WidenedHole {
            hole,
            scanned: hole.grid.positions.iter().map(in_network).collect(),
            tested,
            known,
            plate: None,
        };
        widened.plate = widened.filled(&widened.known, Smooth::TautPlate);
        Ok(widened)
    }

    /// Whether the plate is so right about the tested cells that no network is needed.
    pub fn is_smooth(&self) -> bool {
        self.plate_error().is_some_and(|off| off <= SMOOTH * CELL)
    }

    /// How far the plate is off about the tested cells: root mean square, network's units. `None` where nothing can be tested.
    pub fn plate_error(&self) -> Option<f64> {
        let plate = self.plate.as_ref()?;
        let off = self.tested.iter().map(|k| plate[*k] - self.scanned[*k]);
        let square: f64 = off.map(|off| off.norm_squared()).sum();
        (!self.tested.is_empty()).then(|| (square / self.tested.len() as f64).sqrt())
    }

    /// The share, 0 to 1, of the network's movement from the plate that is worth keeping in the hole; 1 where that cannot be found out.
    ///
    /// # Errors
    /// A failure of the network; `Exhausted`.
    pub fn network_share(&self, inpainter: &Inpainter, budget: &Budget) -> Result<f32, MendError> {
        let (Some(plate), Some(base)) = (&self.plate, &self.hole.base) else {
            return Ok(1.0);
        };
        budget.spend(PASS_WORK)?;
        // Beyond the cloth nothing depends on how far the hole was widened.
        let plate_or_base = |k: usize| match self.hole.grid.known[k] || self.hole.cells.contains(k)
        {
            true => plate[k].cast::<f32>().into(),
            false => base[k],
        };
        let position = |k: usize| match self.known[k] {
            true => self.scanned[k].cast::<f32>().into(),
            false => [0.0; 3],
        };
        let widened = NormalGrid {
            positions: (0..CELLS).map(position).collect(),
            known: self.known.iter().map(|k| f32::from(u8::from(*k))).collect(),
            base: Some((0..CELLS).map(plate_or_base).collect()),
        };
        let answers = inpainter.fill(std::slice::from_ref(&widened), Averaging::Once)?;
        let share = answers.first().and_then(|answer| {
            let answer = |k: usize| Vec3::from(answer.positions[k].map(f64::from));
            self.fitting_share(|k| plate[k], answer)
        });
        Ok(share.map_or(1.0, kept) as f32)
    }

    /// A fair fill of the grid, for cloth whose folds the network does not know: a thin plate, and as much of a surface of minimum variation as is right
    /// about the tested cells; noise at the rim misleads the latter. `None` when too few cells are known.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn fair_fill(&self, budget: &Budget) -> Result<Option<Vec<[f32; 3]>>, MendError> {
        budget.spend(FAIR_WORK)?;
        let both = |known: &[bool]| {
            let (thin, least) = rayon::join(
                || self.filled(known, Smooth::ThinPlate),
                || self.filled(known, Smooth::MinimumVariation),
            );
            thin.zip(least)
        };
        let Some((thin, least)) = both(&self.hole.grid.known) else {
            return Ok(None);
        };
        let cells = self.hole.cells.indices();
        let square: f64 = (cells.iter().map(|k| (least[*k] - thin[*k]).norm_squared())).sum();
        let share = if square <= (ALIKE * CELL).powi(2) * cells.len() as f64 {
            0.0
        } else {
            let tested = both(&self.known);
            let share =
                tested.and_then(|(thin, least)| self.fitting_share(|k| thin[k], |k| least[k]));
            share.unwrap_or(0.0).clamp(0.0, 1.0)
        };
        let fair = |k: usize| match (self.hole.cells.contains(k), &self.hole.base) {
            (false, Some(base)) => base[k],
            _ => thin[k].lerp(&least[k], share).cast::<f32>().into(),
        };
        Ok(Some((0..CELLS).map(fair).collect()))
    }

    /// The grid with its hole filled so that an energy is least, where the other cells that are not `known` are part of the hole. Beyond the cloth it
    /// stays unknown: that keeps the system small.
    fn filled(&self, known: &[bool], energy: Smooth) -> Option<Vec<Vec3>> {
        let grid = &self.hole.grid;
        let open: Vec<bool> = (0..CELLS)
            .map(|k| self.hole.cells.contains(k) || (grid.known[k] && !known[k]))
            .collect();
        smooth(&self.scanned, known, &open, energy, self.hole.step)
    }

    /// The share of a movement of cells that brings the tested ones nearest to the scan (least squares); `None` when nothing moves.
    fn fitting_share(
        &self,
        from: impl Fn(usize) -> Vec3,
        to: impl Fn(usize) -> Vec3,
    ) -> Option<f64> {
        let (mut along, mut square) = (0.0, 0.0);
        for &k in &self.tested {
            let movement = to(k) - from(k);
            let wanted = self.scanned[k] - from(k);
            along += movement.dot(&wanted);
            square += movement.norm_squared();
        }
        (square > 0.0).then(|| along / square)
    }
}

/// The share of the network's movement to keep in the hole for the share that fits best around it.
fn kept(fitting: f64) -> f64 {
    ((fitting - WORTHLESS) / (WORTH_ALL - WORTHLESS)).clamp(0.0, 1.0)
}

/// The known cells next to a hole, ascending.
fn around(hole: &Hole) -> Vec<usize> {
    let mut near = vec![false; CELLS];
    let line = |at: usize| at.saturating_sub(WIDER)..SIDE.min(at + WIDER + 1);
    for k in hole.cells.indices() {
        for j in line(k / SIDE) {
            line(k % SIDE).for_each(|i| near[cell_index(i, j)] = true);
        }
    }
    (0..CELLS)
        .filter(|k| near[*k] && hole.grid.known[*k])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_much_of_the_network_is_kept_as_is_right() {
        for (fitting, share) in [(-1.5, 0.0), (0.2, 0.0), (0.4, 0.5), (0.6, 1.0), (1.1, 1.0)] {
            assert!((kept(fitting) - share).abs() < 1e-12);
        }
    }
}
