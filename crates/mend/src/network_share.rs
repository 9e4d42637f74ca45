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
/// The fitting share up to which nothing of the network's movement is kept. Measured: on smooth sheets that do not lie flat the shares lie between −2 and 0.4,
/// on draped ones between 0.5 and 1.2.
const WORTHLESS: f64 = 0.2;
/// The fitting share from which on all of it is kept.
const WORTH_ALL: f64 = 0.6;
/// Nanoseconds of work of a plate and a pass of the network.
const SHARE_WORK: u64 = 10_000_000;
/// Nanoseconds of work of four fills of the grid.
const FAIR_WORK: u64 = 20_000_000;

/// A hole widened by cells that the scan shows: what a method says about them can be compared with the truth.
pub struct WidenedHole<'a> {
    hole: &'a Hole,
    scan: NormalGrid,
    /// The cells that the hole was widened by, ascending.
    tested: Vec<usize>,
    /// Whether a cell is known and not tested.
    known: Vec<bool>,
}

impl<'a> WidenedHole<'a> {
    /// Widens a hole.
    pub fn new(hole: &'a Hole) -> WidenedHole<'a> {
        let tested = around(hole);
        let mut known = hole.grid.known.clone();
        tested.iter().for_each(|k| known[*k] = false);
        WidenedHole {
            hole,
            scan: hole.normal_grid(),
            tested,
            known,
        }
    }

    /// The share, 0 to 1, of the network's movement from the plate that is worth keeping in the hole; 1 where that cannot be found out.
    ///
    /// # Errors
    /// A failure of the network; `Exhausted`.
    pub fn network_share(&self, inpainter: &Inpainter, budget: &Budget) -> Result<f32, MendError> {
        budget.spend(SHARE_WORK)?;
        let Some(plate) = darn_net::plate(&self.scan.positions, &self.known) else {
            return Ok(1.0);
        };
        let position = |k: usize| match self.known[k] {
            true => self.scan.positions[k],
            false => [0.0; 3],
        };
        let widened = NormalGrid {
            positions: (0..CELLS).map(position).collect(),
            known: self.known.iter().map(|k| f32::from(u8::from(*k))).collect(),
            base: Some(plate.clone()),
        };
        let answers = inpainter.fill(std::slice::from_ref(&widened), Averaging::Once)?;
        let share = answers.first().and_then(|answer| {
            self.fitting_share(
                |k| Vec3::from(plate[k].map(f64::from)),
                |k| Vec3::from(answer[k].map(f64::from)),
            )
        });
        Ok(share.map_or(1.0, kept) as f32)
    }

    /// A fair fill of the grid in the network's units, for cloth whose folds the network does not know: a thin plate, and as much of a surface of
    /// minimum variation as is right about the tested cells. Noise at the rim misleads the latter. `None` when too few cells are known.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn fair_fill(&self, budget: &Budget) -> Result<Option<Vec<[f32; 3]>>, MendError> {
        budget.spend(FAIR_WORK)?;
        let fill = |known: &[bool], energy: Smooth| {
            let open: Vec<bool> = known.iter().map(|k| !k).collect();
            smooth(&self.hole.grid.positions, known, &open, energy)
        };
        let both = |known: &[bool]| {
            let (thin, least) = rayon::join(
                || fill(known, Smooth::ThinPlate),
                || fill(known, Smooth::MinimumVariation),
            );
            thin.zip(least)
        };
        let (tested, filled) = rayon::join(|| both(&self.known), || both(&self.hole.grid.known));
        let Some((thin, least)) = filled else {
            return Ok(None);
        };
        let to_network = |p: &Vec3| Vec3::from(self.hole.normal.to_network(p).map(f64::from));
        let share = tested.and_then(|(thin, least)| {
            self.fitting_share(|k| to_network(&thin[k]), |k| to_network(&least[k]))
        });
        let share = share.unwrap_or(0.0).clamp(0.0, 1.0);
        let each = thin.iter().zip(&least);
        let mixed = each.map(|(thin, least)| self.hole.normal.to_network(&thin.lerp(least, share)));
        Ok(Some(mixed.collect()))
    }

    /// The share of a movement of cells that brings the tested ones nearest to the scan (least squares); `None` when nothing moves. Network's units.
    fn fitting_share(
        &self,
        from: impl Fn(usize) -> Vec3,
        to: impl Fn(usize) -> Vec3,
    ) -> Option<f64> {
        let (mut along, mut square) = (0.0, 0.0);
        for &k in &self.tested {
            let movement = to(k) - from(k);
            let wanted = Vec3::from(self.scan.positions[k].map(f64::from)) - from(k);
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
