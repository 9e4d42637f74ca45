//! A hole with everything that filling it needs; `anchor_search`, `constraints`, `moved_fill` and `fill_hole` give it
//! their methods.

use std::sync::Arc;

use crate::error::MendError;
use crate::hole::{Hole, UneditedCloth};
use crate::inpainter::Inpainter;
use crate::mender::Call;

/// A hole, its cloth without constraints, and what fills it.
pub struct HoleContext<'a> {
    /// The hole.
    pub hole: &'a Hole,
    /// Its cloth without constraints.
    pub unedited: Arc<UneditedCloth>,
    /// The network.
    pub inpainter: Inpainter<'a>,
    /// The limits and options, and what filling it may cost.
    pub call: Call<'a>,
    /// Whether each patch starts from the one before.
    pub pace: Pace,
}

/// How a hole is filled when something pulls at it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// From the start: the same request gives the same bits.
    Anew,
    /// From the last patch, for one of many that a drag shows.
    Dragged,
}

impl<'a> HoleContext<'a> {
    /// The context of a hole; fills the hole without constraints unless this inpainter did so before.
    ///
    /// # Errors
    /// A failure of the network, or a hole that cannot be meshed.
    pub fn new(
        hole: &'a Hole,
        inpainter: &Inpainter<'a>,
        call: Call<'a>,
    ) -> Result<HoleContext<'a>, MendError> {
        Ok(HoleContext {
            hole,
            unedited: hole.unedited(inpainter, call)?,
            inpainter: inpainter.clone(),
            call,
            pace: Pace::Anew,
        })
    }
}
