//! A scan with its holes prepared: what a single call makes and throws away, and a session keeps. Both mend through here.

use std::time::Instant;

use rayon::prelude::*;

use super::beside;
use super::cloth::Cloth;
use super::hole::{self, Filled, Made};
use super::inpainter::Inpainter;
use super::prepared::Prepared;
use super::select::{Chosen, Selection, select};
use super::{Call, MendError, NetworkMender, VERSION, dress, milliseconds, search};
use darn_contract::port::Mended;
use darn_contract::{Constraints, FieldError, Search, v1};
use darn_gltf_scan::{PatchPrimitive, Scan};

/// A scan's cloth with the holes that a request chose, ready to be filled.
pub struct Opened {
    /// The cloth.
    pub cloth: Cloth,
    /// The holes, in order of id.
    pub holes: Vec<Prepared>,
    /// Milliseconds of preparing them.
    pub prepare_ms: f64,
    /// What the request chose; its anchors and edits are not kept.
    asked: Constraints,
}

/// The patches of a request.
pub struct Patched<'a> {
    /// Each hole and its patch, in order of id.
    pub holes: Vec<(&'a Prepared, Made)>,
    /// Every loop left as it was.
    pub skipped: Vec<v1::Skipped>,
    /// What imagined the cloth.
    pub inpainter: Inpainter<'a>,
    /// Milliseconds of filling them, without preparing them.
    pub fill_ms: f64,
}

impl Opened {
    /// Finds the holes asked for and prepares them.
    ///
    /// # Errors
    /// When a constraint does not fit the scan, when there is no hole, or one that cannot be laid flat.
    pub fn new(scan: &Scan, asked: &Constraints, call: Call) -> Result<Opened, MendError> {
        Self::of(Cloth::of(scan), scan, asked, call)
    }

    fn of(cloth: Cloth, scan: &Scan, asked: &Constraints, call: Call) -> Result<Opened, MendError> {
        let selection = select(scan, &cloth, asked)?;
        let (found, limit) = (selection.chosen.len(), call.mender.limits.holes);
        if found > limit {
            return Err(MendError::TooManyHoles { found, limit });
        }
        chosen_inpainter(asked, call.mender)?;
        let started = Instant::now();
        let prepare = |c: &Chosen| {
            call.go_on()?;
            Prepared::new(&cloth, c.id, &call.mender.limits)
        };
        // In two steps: of several errors the first hole's is told, whichever was found first.
        let holes: Vec<Result<Prepared, MendError>> =
            selection.chosen.par_iter().map(prepare).collect();
        Ok(Opened {
            holes: holes.into_iter().collect::<Result<_, _>>()?,
            cloth,
            prepare_ms: milliseconds(started),
            asked: Constraints {
                anchors: Vec::new(),
                edits: Vec::new(),
                ..asked.clone()
            },
        })
    }

    /// Prepares the one hole that a search is about.
    ///
    /// # Errors
    /// As [`Opened::new`]; and when the scan has several holes and the search does not say which.
    pub fn for_search(scan: &Scan, search: &Search, call: Call) -> Result<Opened, MendError> {
        let asked = Constraints {
            holes: search
                .hole
                .map(darn_contract::HoleSelector::Id)
                .into_iter()
                .collect(),
            ..Constraints::default()
        };
        let cloth = Cloth::of(scan);
        let about_hole = |error| match error {
            MendError::Constraints(fields) => {
                let at_hole = |f: FieldError| FieldError::new("/hole", f.detail);
                MendError::Constraints(fields.into_iter().map(at_hole).collect())
            }
            other => other,
        };
        let selection = select(scan, &cloth, &asked).map_err(about_hole)?;
        let ids = selection.chosen.iter().map(|c| c.id);
        the_one(search.hole, ids)?;
        Self::of(cloth, scan, &asked, call)
    }

    /// What imagines the cloth where a later request does not say.
    ///
    /// # Errors
    /// When the mender has no such network.
    pub fn inpainter<'a>(&self, mender: &'a NetworkMender) -> Result<Inpainter<'a>, MendError> {
        chosen_inpainter(&self.asked, mender)
    }

    /// Fills the holes. `constraints` may leave out what was chosen when the scan was opened.
    ///
    /// # Errors
    /// When a constraint does not fit, among them a hole that was not opened, or a hole cannot be filled.
    pub fn patched<'a>(
        &'a self,
        scan: &Scan,
        constraints: &Constraints,
        call: Call<'a>,
    ) -> Result<Patched<'a>, MendError> {
        let constraints = self.completed(constraints);
        let Selection { chosen, skipped } = select(scan, &self.cloth, &constraints)?;
        let inpainter = chosen_inpainter(&constraints, call.mender)?;
        let started = Instant::now();
        let filled = chosen.par_iter().map(|chosen| {
            call.go_on()?;
            let prepared = self.hole(chosen.id).ok_or_else(|| {
                let opened: Vec<String> = self.holes.iter().map(|h| h.id.to_string()).collect();
                let detail = format!(
                    "hole {} was not chosen when the scan was opened; there are: {}",
                    chosen.id,
                    opened.join(", ")
                );
                MendError::Constraints(vec![FieldError::new("/holes", detail)])
            })?;
            hole::fill(prepared, chosen, &inpainter, &call.mender.limits)
        });
        let filled: Vec<Result<_, MendError>> = filled.collect();
        let mut filled: Vec<Filled> = filled.into_iter().collect::<Result<_, _>>()?;
        beside::apart(&mut filled);
        let filled = filled.into_par_iter();
        let holes: Vec<Result<_, MendError>> = filled
            .map(|filled| Ok((filled.prepared, hole::described(filled, &self.cloth)?)))
            .collect();
        Ok(Patched {
            holes: holes.into_iter().collect::<Result<_, _>>()?,
            skipped,
            inpainter,
            fill_ms: milliseconds(started),
        })
    }

    /// Fills the holes and appends the patches to the scan.
    ///
    /// # Errors
    /// As [`Opened::patched`], and when the patches cannot be written.
    pub fn mended(
        &self,
        scan: &Scan,
        constraints: &Constraints,
        call: Call,
    ) -> Result<Mended, MendError> {
        let patched = self.patched(scan, constraints, call)?;
        let started = Instant::now();
        let additions = self.additions(scan, &patched)?;
        let dressed_ms = milliseconds(started);
        let started = Instant::now();
        let bytes = scan.write(&additions)?;
        let mut report = self.report(scan, patched);
        if let Some(timings) = &mut report.timings {
            timings.write = milliseconds(started);
            timings.total += dressed_ms + timings.write;
        }
        Ok(Mended { bytes, report })
    }

    /// The patches in the scan's own terms.
    ///
    /// # Errors
    /// None today; see [`dress::addition`].
    pub fn additions(
        &self,
        scan: &Scan,
        patched: &Patched,
    ) -> Result<Vec<PatchPrimitive>, MendError> {
        let each = patched.holes.par_iter().map(|(prepared, made)| {
            dress::addition(
                (scan, &self.cloth),
                prepared,
                made,
                patched.inpainter.card(),
            )
        });
        each.collect()
    }

    /// What was done.
    pub fn report(&self, scan: &Scan, patched: Patched) -> v1::Report {
        let mut notes = self.cloth.notes(scan);
        notes.extend(patched.inpainter.note.clone());
        let holes_ms = self.prepare_ms + patched.fill_ms;
        let found = self.cloth.timings;
        v1::Report {
            version: VERSION.to_owned(),
            weights: Some(patched.inpainter.weights()),
            holes: patched
                .holes
                .into_iter()
                .map(|(_, made)| made.report)
                .collect(),
            skipped: patched.skipped,
            timings: Some(v1::ScanTimings {
                holes: holes_ms,
                total: found.weld + found.loops + holes_ms,
                ..found
            }),
            notes,
        }
    }

    /// Searches where on a hole's grid a point in space belongs.
    ///
    /// # Errors
    /// At `/hole` and `/start` when they do not fit, and whatever the network fails with.
    pub fn search(&self, search: &Search, call: Call) -> Result<v1::AnchorFound, MendError> {
        let id = the_one(search.hole, self.holes.iter().map(|h| h.id))?;
        let Some(prepared) = self.hole(id) else {
            let detail = format!("hole {id} was not chosen when the scan was opened");
            return Err(MendError::Constraints(vec![FieldError::new(
                "/hole", detail,
            )]));
        };
        let inpainter = self.inpainter(call.mender)?;
        let unedited = prepared.unedited(&inpainter, &call.mender.limits)?;
        search::find(prepared, &unedited, &inpainter, (search, call))
    }

    fn hole(&self, id: u32) -> Option<&Prepared> {
        self.holes.iter().find(|h| h.id == id)
    }

    /// What the opening chose, where the later request says nothing.
    fn completed(&self, later: &Constraints) -> Constraints {
        let mut whole = later.clone();
        if whole.holes.is_empty() {
            whole.holes.clone_from(&self.asked.holes);
        }
        whole.weights = whole.weights.or_else(|| self.asked.weights.clone());
        whole.up = whole.up.or(self.asked.up);
        whole
    }
}

fn chosen_inpainter<'a>(
    constraints: &Constraints,
    mender: &'a NetworkMender,
) -> Result<Inpainter<'a>, MendError> {
    Inpainter::chosen(
        &mender.networks,
        constraints.weights.as_deref(),
        constraints.up,
    )
    .map_err(|wrong| MendError::Constraints(vec![wrong]))
}

/// The hole asked for, or the only one there is.
fn the_one(asked: Option<u32>, mut there: impl Iterator<Item = u32>) -> Result<u32, MendError> {
    match (asked, there.next(), there.count()) {
        (Some(id), ..) | (None, Some(id), 0) => Ok(id),
        (None, _, more) => {
            let detail = format!("the scan has {} holes; say which one is meant", more + 1);
            Err(MendError::Constraints(vec![FieldError::new(
                "/hole", detail,
            )]))
        }
    }
}
