//! The network's answer to a hole whose cloth is to move at some cells.

use super::MendError;
use super::inpainter::Inpainter;
use super::prepared::{Prepared, Unedited};
use darn_geometry::grid::NormalGrid;
use darn_geometry::mesh::Vec3;
use darn_net::Averaging;

/// How the network is asked for edited cloth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Response {
    /// Its answer to the grid with the moved cells marked known is the cloth.
    Plain,
    /// The unedited cloth, plus the difference between its answers to the moved cells and to the same cells where they are: marking a
    /// cell known changes the answer a little by itself, and that is no wish of the user's.
    #[default]
    Difference,
}

/// Every cell's position, scene space, when some cells of the hole are to move by `moves` from the unedited cloth.
///
/// A moved cell is given to the network at its unedited position plus its move and marked known; that is soft, as the network may stay
/// away from it.
pub fn moved(
    (prepared, unedited): (&Prepared, &Unedited),
    moves: &[(usize, Vec3)],
    inpainter: &Inpainter,
    response: Response,
) -> Result<Vec<Vec3>, MendError> {
    if moves.is_empty() {
        return Ok(unedited.filled.clone());
    }
    let still = prepared.normal_grid();
    let given = |share: f64| -> NormalGrid {
        let mut grid = still.clone();
        for (cell, by) in moves {
            let at = unedited.predicted[*cell] + by * share;
            grid.positions[*cell] = prepared.normal.to_network(&at);
            grid.known[*cell] = 1.0;
        }
        grid
    };
    let imagined = match response {
        Response::Plain => {
            let answers = inpainter.fill(&[given(1.0)], Averaging::Flips)?;
            prepared.in_scene(answers.first().map_or(&[], Vec::as_slice))
        }
        Response::Difference => {
            let answers = inpainter.fill(&[given(1.0), given(0.0)], Averaging::HalfTurn)?;
            let mut answers = answers.iter().map(|a| prepared.in_scene(a));
            let (moved, held) = (answers.next(), answers.next());
            let each = unedited.predicted.iter();
            match moved.zip(held) {
                Some((moved, held)) => (each.zip(moved.iter().zip(&held)))
                    .map(|(p, (moved, held))| p + (moved - held))
                    .collect(),
                None => each.copied().collect(),
            }
        }
    };
    Ok(prepared.filled(&imagined))
}
