//! All holes of a scan that a request chose: prepared once, filled for this request and for later ones. A single call
//! drops them, a session keeps them.

use std::collections::BTreeSet;
use std::time::Instant;

use rayon::prelude::*;

use crate::VERSION;
use crate::addition::PatchSource;
use crate::border;
use crate::context::{HoleContext, Pace};
use crate::cut::CutScan;
use crate::error::MendError;
use crate::fill_hole::PatchDraft;
use crate::hole_report::FilledHole;
use crate::hole_share::HoleShares;
use crate::inpainter::Inpainter;
use crate::mender::{Call, NetworkMender};
use crate::prepared_hole::PreparedHole;
use crate::scan_additions::{PatchChoices, ScanAdditions};
use crate::scan_notes;
use crate::scan_search::searched_hole;
use crate::select::{HoleRequest, Selection};
use crate::separate::separate;
use crate::sorted::{Sorted, sorted};
use crate::texture::{ColouredPatch, Colouring};
use crate::timings::milliseconds;
use crate::welded_scan::WeldedScan;
use darn_budget::Budget;
use darn_contract::port::Mended;
use darn_contract::{Constraints, FieldError, HoleSelector, Search, TextureChoice, v1};
use darn_gltf_scan::Scan;

/// A scan's holes, prepared.
pub struct ScanHoles {
    /// The scan without what the request cuts out; `None` when it cuts nothing out.
    cut: Option<Scan>,
    /// The scan's surface, without what the request cuts out.
    pub welded: WeldedScan,
    /// The holes, in order of id.
    pub holes: Vec<PreparedHole>,
    /// Milliseconds of preparing them.
    pub prepare_ms: f64,
    /// What the request selected.
    selection: Selection,
    /// The weights that the request names.
    weights: Option<String>,
    /// The up direction that the request gives.
    up: Option<[f64; 3]>,
    /// Which of the plausible fills the request asks for.
    alternative: u8,
}

/// The holes of a scan, filled for one request.
pub struct FilledScan<'a> {
    /// The filled holes, in order of id.
    pub holes: Vec<FilledHole<'a>>,
    /// Every loop that was left.
    pub skipped: Vec<v1::Skipped>,
    /// What filled them.
    pub inpainter: Inpainter<'a>,
    /// Milliseconds of filling them, without preparing them.
    pub fill_ms: f64,
}

/// What fills holes, and how.
#[derive(Clone, Copy)]
struct Filler<'i, 'a> {
    inpainter: &'i Inpainter<'a>,
    pace: Pace,
}

/// The patches of a request, and how long they took.
pub struct ColouredPatches {
    /// In order of id.
    pub patches: Vec<ColouredPatch>,
    /// Milliseconds of continuing the scan's attributes.
    pub dressed_ms: f64,
    /// Milliseconds of their textures.
    pub texture_ms: f64,
}

impl ScanHoles {
    /// Finds the holes that a request asks for and prepares them.
    ///
    /// # Errors
    /// A constraint that does not fit the scan, no hole at all, too many holes, a hole that cannot be laid flat;
    /// `Exhausted`.
    pub fn open(
        scan: &Scan,
        constraints: &Constraints,
        call: Call,
    ) -> Result<ScanHoles, MendError> {
        call.budget.begin("welding", 0);
        let whole = WeldedScan::of(scan, call.budget)?;
        let (cut, welded) = match CutScan::of(scan, &whole, constraints, call.budget)? {
            Some(CutScan { scan, welded }) => (Some(scan), welded),
            None => (None, whole),
        };
        let seen = cut.as_ref().unwrap_or(scan);
        let welded = border::closed(seen, welded, constraints, call.budget)?;
        let selection = Selection::of(seen, &welded, constraints, call.budget)?;
        let holes = Self::prepare(welded, selection, constraints, call)?;
        Ok(ScanHoles { cut, ..holes })
    }

    /// The scan without what the request cut out, if it cuts anything out. Frees everything else.
    fn into_cut(self) -> Option<Scan> {
        self.cut
    }

    /// The scan without what the request cut out.
    pub fn seen<'a>(&'a self, scan: &'a Scan) -> &'a Scan {
        self.cut.as_ref().unwrap_or(scan)
    }

    /// Bytes of memory that it holds, estimated; without its holes.
    pub fn bytes(&self) -> usize {
        self.welded.bytes() + self.cut.as_ref().map_or(0, Scan::bytes_held)
    }

    /// Prepares the one hole that a search is about.
    ///
    /// # Errors
    /// As [`ScanHoles::open`], at `/hole`; and when the scan has several holes of which the search names none.
    pub fn open_for_search(
        scan: &Scan,
        search: &Search,
        call: Call,
    ) -> Result<ScanHoles, MendError> {
        let constraints = Constraints {
            holes: search.hole.map(HoleSelector::Id).into_iter().collect(),
            // A search needs the hole's chart, however its patch comes out.
            accept_doubtful: true,
            ..Constraints::default()
        };
        let welded = WeldedScan::of(scan, call.budget)?;
        let at_hole = |error| match error {
            MendError::Constraints(fields) => {
                let at_hole = |f: FieldError| FieldError::new("/hole", f.detail);
                MendError::Constraints(fields.into_iter().map(at_hole).collect())
            }
            other => other,
        };
        let selection = Selection::of(scan, &welded, &constraints, call.budget).map_err(at_hole)?;
        searched_hole(search, selection.requests.iter().map(|r| r.id))?;
        Self::prepare(welded, selection, &constraints, call)
    }

    fn prepare(
        welded: WeldedScan,
        selection: Selection,
        constraints: &Constraints,
        call: Call,
    ) -> Result<ScanHoles, MendError> {
        let (found, limit) = (selection.requests.len(), call.mender.limits.holes);
        if found > limit {
            return Err(MendError::TooManyHoles { found, limit });
        }
        // Weights that are not loaded are refused before the holes are prepared.
        let weights = constraints.weights.as_deref();
        let inpainter = Inpainter::choose(&call.mender.networks, weights, constraints.up)?;
        let started = Instant::now();
        let stage = call.budget.begin("flattening", found);
        let shares = HoleShares::of(&selection.requests, call);
        let prepare = |request: &HoleRequest| {
            call.budget.check()?;
            let hole = shares.within(request, |call| {
                let hole = PreparedHole::new(&welded, request.id, call)?;
                match selection.accept_doubtful || request.is_edited() {
                    true => Ok(hole),
                    false => hole.or_fair(&welded, &inpainter, call),
                }
            })?;
            stage.one_done();
            Ok(hole)
        };
        let holes: Vec<Result<PreparedHole, MendError>> =
            selection.requests.par_iter().map(prepare).collect();
        let Sorted { filled, failed } = sorted(&selection.requests, holes, &welded)?;
        let selection = selection.without(failed);
        Ok(ScanHoles {
            cut: None,
            holes: filled,
            welded,
            prepare_ms: milliseconds(started),
            selection,
            weights: constraints.weights.clone(),
            up: constraints.up,
            alternative: constraints.alternative.unwrap_or(0),
        })
    }

    /// Fills the holes with the constraints of the request that they were opened with.
    ///
    /// # Errors
    /// A constraint that does not fit, a hole that cannot be filled; `Exhausted`.
    pub fn filled<'a>(&'a self, call: Call<'a>) -> Result<FilledScan<'a>, MendError> {
        let inpainter = self.inpainter(call.mender)?;
        self.filled_as(&self.selection, inpainter, call)
    }

    /// Fills the holes with the constraints of a later request. Hole selectors, weights and up are those of the first
    /// request where the later one leaves them out.
    ///
    /// # Errors
    /// As [`ScanHoles::filled`]; and `Constraints` for a hole that was not opened.
    pub fn filled_with<'a>(
        &'a self,
        scan: &Scan,
        later: &Constraints,
        call: Call<'a>,
    ) -> Result<FilledScan<'a>, MendError> {
        let (selection, inpainter) = self.chosen(scan, later, call)?;
        self.filled_as(&selection, inpainter, call)
    }

    /// The patches of some holes, with the constraints of a later request, before they are measured. What is doubted is not left here.
    ///
    /// # Errors
    /// As [`ScanHoles::filled_with`].
    pub fn drafts_of<'a>(
        &'a self,
        scan: &Scan,
        later: &Constraints,
        holes: &BTreeSet<u32>,
        call: Call<'a>,
    ) -> Result<Vec<PatchDraft<'a>>, MendError> {
        let (selection, inpainter) = self.chosen(scan, later, call)?;
        let requests = selection.requests.iter();
        let requests: Vec<&HoleRequest> = requests.filter(|it| holes.contains(&it.id)).collect();
        let filler = Filler {
            inpainter: &inpainter,
            pace: Pace::Dragged,
        };
        let drafts = requests
            .par_iter()
            .map(|request| self.draft(request, filler, call));
        let mut drafts: Vec<PatchDraft> = drafts.collect::<Result<_, _>>()?;
        separate(&mut drafts, call.budget)?;
        Ok(drafts)
    }

    /// What a later request selects, and what fills it.
    fn chosen<'a>(
        &'a self,
        scan: &Scan,
        later: &Constraints,
        call: Call<'a>,
    ) -> Result<(Selection, Inpainter<'a>), MendError> {
        let late: Vec<FieldError> = (later.holes.iter().enumerate())
            .filter_map(|(i, selector)| {
                let member = match selector {
                    HoleSelector::Cut(_) => "cut",
                    HoleSelector::Border(_) => "border",
                    _ => return None,
                };
                let detail = "said when the scan is opened; open it anew for another choice";
                Some(FieldError::new(format!("/holes/{i}/{member}"), detail))
            })
            .collect();
        if !late.is_empty() {
            return Err(MendError::Constraints(late));
        }
        let scan = self.seen(scan);
        let selection = match later.holes.is_empty() {
            true => self.selection.with_constraints(later)?,
            false => Selection::of(scan, &self.welded, later, call.budget)?,
        };
        let weights = later.weights.as_deref().or(self.weights.as_deref());
        let up = later.up.or(self.up);
        let inpainter = Inpainter::choose(&call.mender.networks, weights, up)?
            .with_alternative(later.alternative.unwrap_or(self.alternative));
        Ok((selection, inpainter))
    }

    /// Fills one hole as a request asks.
    fn draft<'a>(
        &'a self,
        request: &HoleRequest,
        filler: Filler<'_, 'a>,
        call: Call<'a>,
    ) -> Result<PatchDraft<'a>, MendError> {
        call.budget.check()?;
        match self.opened(request.id)? {
            PreparedHole::Charted(hole) => {
                let context = HoleContext::new(hole, filler.inpainter, call)?;
                let pace = filler.pace;
                HoleContext { pace, ..context }.fill(request)
            }
            PreparedHole::Fair(hole) => hole.fill(request),
        }
    }

    fn filled_as<'a>(
        &'a self,
        selection: &Selection,
        inpainter: Inpainter<'a>,
        call: Call<'a>,
    ) -> Result<FilledScan<'a>, MendError> {
        let started = Instant::now();
        let stage = call.budget.begin("filling", selection.requests.len());
        let filler = Filler {
            inpainter: &inpainter,
            pace: Pace::Anew,
        };
        let shares = HoleShares::of(&selection.requests, call);
        let drafts = selection.requests.par_iter().map(|request| {
            if let PreparedHole::Charted(hole) = self.opened(request.id)? {
                shares.within(request, |call| hole.unedited(&inpainter, call))?;
            }
            let draft = self.draft(request, filler, call)?;
            stage.one_done();
            match draft.reasons_to_leave(&self.welded) {
                doubts if doubts.is_empty() || selection.accept_doubtful => Ok(draft),
                doubts => Err(draft.left(doubts)),
            }
        });
        let drafts: Vec<Result<PatchDraft, MendError>> = drafts.collect();
        let Sorted {
            filled: mut drafts,
            failed,
        } = sorted(&selection.requests, drafts, &self.welded)?;
        let skipped = selection.clone().without(failed).skipped;
        separate(&mut drafts, call.budget)?;
        let holes: Vec<Result<_, MendError>> = (drafts.into_par_iter())
            .map(|draft| draft.measured(&self.welded, call.budget))
            .collect();
        Ok(FilledScan {
            holes: holes.into_iter().collect::<Result<_, _>>()?,
            skipped,
            inpainter,
            fill_ms: milliseconds(started),
        })
    }

    /// The scan with the patches of the filled holes, coloured and stored as asked for, and the report.
    ///
    /// # Errors
    /// When the patches cannot be written; `Exhausted`.
    pub fn mended(
        &self,
        scan: &Scan,
        filled: FilledScan,
        choices: PatchChoices,
        call: Call,
    ) -> Result<Mended, MendError> {
        let additions = self.additions(scan, filled, choices.texture, call)?;
        additions.written(scan, self.seen(scan), choices.buffer, call)
    }

    /// The same, for holes that nothing else is asked of: their memory is free when the answer is written.
    ///
    /// # Errors
    /// As [`ScanHoles::filled`] and [`ScanHoles::mended`].
    pub fn mended_once(
        self,
        scan: &Scan,
        choices: PatchChoices,
        call: Call,
    ) -> Result<Mended, MendError> {
        let additions = self.additions(scan, self.filled(call)?, choices.texture, call)?;
        let cut = self.into_cut();
        let seen = cut.as_ref().unwrap_or(scan);
        additions.written(scan, seen, choices.buffer, call)
    }

    /// What the filled holes add to the scan, coloured as asked for, and the report.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn additions(
        &self,
        scan: &Scan,
        mut filled: FilledScan,
        texture: Option<TextureChoice>,
        call: Call,
    ) -> Result<ScanAdditions, MendError> {
        let ColouredPatches {
            patches,
            dressed_ms,
            texture_ms,
        } = self.coloured(scan, &filled, texture, call)?;
        let mut primitives = Vec::with_capacity(patches.len());
        for (hole, patch) in filled.holes.iter_mut().zip(patches) {
            primitives.push(patch.primitive);
            hole.report.texture = Some(patch.report);
            hole.report.notes.extend(patch.note);
            if let Some(timings) = &mut hole.report.timings {
                timings.texture = patch.texture_ms;
            }
        }
        let mut report = self.report(scan, filled);
        if let Some(timings) = &mut report.timings {
            timings.texture = texture_ms;
            timings.total += dressed_ms + texture_ms;
        }
        Ok(ScanAdditions { primitives, report })
    }

    /// The patches in the scan's terms, coloured as asked for.
    ///
    /// # Errors
    /// `Exhausted`.
    fn coloured(
        &self,
        scan: &Scan,
        filled: &FilledScan,
        texture: Option<TextureChoice>,
        call: Call,
    ) -> Result<ColouredPatches, MendError> {
        let started = Instant::now();
        let source = self.patch_source(scan, filled, call.budget);
        let dressed = (filled.holes.par_iter())
            .map(|hole| Ok(source.dressed(hole)?))
            .collect::<Result<Vec<_>, MendError>>()?;
        let dressed_ms = milliseconds(started);
        let started = Instant::now();
        call.budget.begin("texturing", 0);
        let colouring = Colouring {
            source,
            choice: texture,
            settings: call.mender.limits.texture,
            scan_limits: &call.mender.scan_limits,
        };
        Ok(ColouredPatches {
            patches: colouring.coloured(&filled.holes, dressed)?,
            dressed_ms,
            texture_ms: milliseconds(started),
        })
    }

    /// Where the patches get their attributes from.
    pub fn patch_source<'a>(
        &'a self,
        scan: &'a Scan,
        filled: &'a FilledScan<'a>,
        budget: &'a Budget<'a>,
    ) -> PatchSource<'a> {
        PatchSource {
            scan: self.seen(scan),
            welded: &self.welded,
            card: filled.inpainter.card(),
            budget,
        }
    }

    /// The report of the whole scan.
    pub fn report(&self, scan: &Scan, filled: FilledScan) -> v1::Report {
        let mut notes = scan_notes::notes(&self.welded, self.seen(scan));
        notes.extend(filled.inpainter.note.clone());
        let holes_ms = self.prepare_ms + filled.fill_ms;
        let timings = self.welded.timings;
        v1::Report {
            // Of what is not written there are none, and a session that shows patches has no time for them.
            input: None,
            output: None,
            version: VERSION.to_owned(),
            weights: Some(filled.inpainter.weights()),
            holes: filled.holes.into_iter().map(|h| h.report).collect(),
            skipped: filled.skipped,
            timings: Some(v1::ScanTimings {
                holes: holes_ms,
                total: timings.weld + timings.loops + holes_ms,
                ..timings
            }),
            notes,
            set_aside: scan_notes::set_aside(&self.welded, scan),
        }
    }

    /// What fills the holes unless a later request says otherwise.
    pub fn inpainter<'a>(&self, mender: &'a NetworkMender) -> Result<Inpainter<'a>, MendError> {
        let chosen = Inpainter::choose(&mender.networks, self.weights.as_deref(), self.up)?;
        Ok(chosen.with_alternative(self.alternative))
    }

    /// A prepared hole.
    pub fn hole(&self, id: u32) -> Option<&PreparedHole> {
        self.holes.iter().find(|h| h.id() == id)
    }

    fn opened(&self, id: u32) -> Result<&PreparedHole, MendError> {
        self.hole(id).ok_or_else(|| {
            let opened: Vec<String> = self.holes.iter().map(|h| h.id().to_string()).collect();
            let detail = format!(
                "hole {id} was not chosen when the scan was opened; there are: {}",
                opened.join(", ")
            );
            MendError::Constraints(vec![FieldError::new("/holes", detail)])
        })
    }
}
