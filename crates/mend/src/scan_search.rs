//! Anchor searches on the prepared holes of a scan.

use crate::context::HoleContext;
use crate::error::MendError;
use crate::mender::Call;
use crate::prepared_hole::PreparedHole;
use crate::scan_holes::ScanHoles;
use darn_contract::port::MapSpan;
use darn_contract::{FieldError, Search, v1};

impl ScanHoles {
    /// Searches where on a hole's grid a point in space belongs.
    ///
    /// # Errors
    /// At `/hole` and `/start` when they do not fit; a failure of the network; `Exhausted`.
    pub fn search(&self, search: &Search, call: Call) -> Result<v1::AnchorFound, MendError> {
        self.searched(search, call)?.search(search)
    }

    /// Some cells of the map of a search: see [`HoleContext::map_piece`].
    ///
    /// # Errors
    /// As [`ScanHoles::search`].
    pub fn map_piece(
        &self,
        search: &Search,
        span: MapSpan,
        call: Call,
    ) -> Result<v1::MapPiece, MendError> {
        self.searched(search, call)?.map_piece(search, span)
    }

    /// The hole that a search is about.
    fn searched<'a>(
        &'a self,
        search: &Search,
        call: Call<'a>,
    ) -> Result<HoleContext<'a>, MendError> {
        let id = searched_hole(search, self.holes.iter().map(PreparedHole::id))?;
        let Some(hole) = self.hole(id) else {
            let detail = format!("hole {id} was not chosen when the scan was opened");
            let wrong = FieldError::new("/hole", detail);
            return Err(MendError::Constraints(vec![wrong]));
        };
        let hole = match hole {
            PreparedHole::Charted(hole) => hole,
            PreparedHole::Fair(hole) => {
                return Err(MendError::Constraints(vec![hole.no_chart("/hole")]));
            }
        };
        let inpainter = self.inpainter(call.mender)?;
        HoleContext::new(hole, &inpainter, call)
    }
}

/// The hole that a search names, or the only one of `ids`.
pub fn searched_hole(
    search: &Search,
    mut ids: impl Iterator<Item = u32>,
) -> Result<u32, MendError> {
    match (search.hole, ids.next(), ids.count()) {
        (Some(id), ..) | (None, Some(id), 0) => Ok(id),
        (None, _, more) => {
            let detail = format!("the scan has {} holes; say which one is meant", more + 1);
            let wrong = FieldError::new("/hole", detail);
            Err(MendError::Constraints(vec![wrong]))
        }
    }
}
