//! Matches a request to the loops of a scan: which loops it fills, and which anchors and gestures belong to which of
//! them.

use std::collections::{BTreeMap, BTreeSet};

use crate::bites::Bite;
use crate::border::all_bites;
use crate::error::MendError;
use crate::nearest_loop::NearestLoop;
use crate::welded_scan::{WeldedScan, kind};
use darn_budget::Budget;
use darn_contract::{Anchor, Constraints, Edit, FieldError, Fill, HoleSelector, error_chain, v1};
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::mesh::openings::Evidence;
use darn_gltf_scan::Scan;

/// Which loops are filled with which constraints, and which are left.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// The holes to fill, in order of id.
    pub requests: Vec<HoleRequest>,
    /// All other loops, in order of id.
    pub skipped: Vec<v1::Skipped>,
    /// Whether patches that are no plausible cloth are applied.
    pub accept_doubtful: bool,
}

/// A hole to fill, and its part of the constraints.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HoleRequest {
    /// The loop's id, which is its index among the scan's loops.
    pub id: u32,
    /// Whether the request names the hole: then it is refused when the hole cannot be filled.
    pub named: bool,
    /// Its anchors.
    pub anchors: Vec<Entry<Anchor>>,
    /// Its gestures, in order.
    pub edits: Vec<Entry<Edit>>,
}

/// An entry of one of the request's lists.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry<T> {
    /// Its index in the request, for error pointers and notes.
    pub index: usize,
    /// What the request says.
    pub value: T,
}

impl HoleRequest {
    /// Whether the request says something about this hole in particular.
    pub fn is_particular(&self) -> bool {
        self.named || self.is_edited()
    }

    /// Whether anchors or gestures move its cloth.
    pub fn is_edited(&self) -> bool {
        !self.anchors.is_empty() || !self.edits.is_empty()
    }
}

impl Selection {
    /// Matches a request to the loops of a scan.
    ///
    /// # Errors
    /// `Constraints` for every selector, exception, anchor or gesture that matches no loop to fill; `NonManifold` when
    /// the rim of a named hole is no closed line; `NoHoles` when nothing is named and there is nothing to fill;
    /// `Exhausted`.
    pub fn of(
        scan: &Scan,
        welded: &WeldedScan,
        constraints: &Constraints,
        budget: &Budget,
    ) -> Result<Selection, MendError> {
        let mut near = NearestLoop::of(welded, budget);
        let mut wrong = Vec::new();
        let mut requests = Requests::default();
        let except = exceptions(welded, constraints, &mut wrong);
        let mut skipped = Vec::new();
        for rim in &welded.loops {
            match reason_to_skip(scan, welded, constraints, &except, rim) {
                Some(reason) => skipped.push(reason.entry(rim)),
                None => {
                    requests.add(rim.id.0);
                }
            }
        }
        for (i, selector) in constraints.holes.iter().enumerate() {
            let rim = match selector {
                HoleSelector::Cut(_) | HoleSelector::Border(_) => {
                    for id in welded.cuts.of_entry(i) {
                        requests.add(*id).named = true;
                    }
                    continue;
                }
                HoleSelector::Id(id) => welded.loop_with_id(*id),
                HoleSelector::Near(point) => near.to(&Vec3::from(*point))?,
            };
            match rim.and_then(|rim| nameable(scan, welded, &except, rim)) {
                Ok(id) => requests.add(id).named = true,
                Err(detail) => wrong.push(FieldError::new(format!("/holes/{i}"), detail)),
            }
        }
        wrong.extend(requests.assign(constraints));
        if !wrong.is_empty() {
            return Err(MendError::Constraints(wrong));
        }
        let mut named = requests.0.values().filter(|r| r.is_particular());
        if let Some(hole) = named.find(|r| welded.loops[r.id as usize].non_manifold) {
            return Err(MendError::NonManifold { hole: hole.id });
        }
        skipped.retain(|s| !requests.0.contains_key(&s.id));
        if requests.0.is_empty() {
            let skipped = with_bites(skipped, &all_bites(welded, budget)?);
            return Err(MendError::NoHoles { skipped });
        }
        Ok(Selection {
            requests: requests.0.into_values().collect(),
            skipped,
            accept_doubtful: constraints.accept_doubtful,
        })
    }

    /// The same holes with the anchors and edits of another request, whose hole selectors are not looked at.
    ///
    /// # Errors
    /// `Constraints` for every anchor or gesture that belongs to none of the holes.
    pub fn with_constraints(&self, constraints: &Constraints) -> Result<Selection, MendError> {
        let mut requests = Requests::default();
        for request in &self.requests {
            requests.add(request.id).named = request.named;
        }
        let wrong = requests.assign(constraints);
        if !wrong.is_empty() {
            return Err(MendError::Constraints(wrong));
        }
        Ok(Selection {
            requests: requests.0.into_values().collect(),
            ..self.clone()
        })
    }

    /// The selection without holes that could not be filled, which join the skipped ones.
    pub fn without(mut self, failed: Vec<v1::Skipped>) -> Selection {
        let ids: BTreeSet<u32> = failed.iter().map(|s| s.id).collect();
        self.requests.retain(|r| !ids.contains(&r.id));
        self.skipped.extend(failed);
        self.skipped.sort_by_key(|s| s.id);
        self
    }
}

/// The holes to fill, by id.
#[derive(Default)]
struct Requests(BTreeMap<u32, HoleRequest>);

impl Requests {
    fn add(&mut self, id: u32) -> &mut HoleRequest {
        self.0.entry(id).or_insert_with(|| HoleRequest {
            id,
            ..HoleRequest::default()
        })
    }

    /// Gives every anchor and gesture to its hole; an error for each that has none.
    fn assign(&mut self, constraints: &Constraints) -> Vec<FieldError> {
        let mut wrong = Vec::new();
        for (index, value) in constraints.anchors.iter().copied().enumerate() {
            match self.owner(value.hole) {
                Ok(hole) => hole.anchors.push(Entry { index, value }),
                Err(detail) => {
                    wrong.push(FieldError::new(format!("/anchors/{index}/hole"), detail));
                }
            }
        }
        for (index, value) in constraints.edits.iter().copied().enumerate() {
            match self.owner(value.hole) {
                Ok(hole) => hole.edits.push(Entry { index, value }),
                Err(detail) => {
                    wrong.push(FieldError::new(format!("/edits/{index}/hole"), detail));
                }
            }
        }
        wrong
    }

    /// The hole that an anchor or gesture belongs to: the one it names, or the only one.
    fn owner(&mut self, named: Option<u32>) -> Result<&mut HoleRequest, String> {
        let count = self.0.len();
        match named {
            Some(id) => (self.0.get_mut(&id))
                .ok_or_else(|| format!("hole {id} is not among the holes to fill")),
            None if count == 1 => {
                (self.0.values_mut().next()).ok_or_else(|| "there is no hole to fill".to_owned())
            }
            None => Err(format!(
                "{count} holes are to be filled; say which one it belongs to"
            )),
        }
    }
}

/// The ids of the loops to leave; an error for each that does not exist.
fn exceptions(
    welded: &WeldedScan,
    constraints: &Constraints,
    wrong: &mut Vec<FieldError>,
) -> BTreeSet<u32> {
    for (i, id) in constraints.except.iter().enumerate() {
        if let Err(detail) = welded.loop_with_id(*id) {
            wrong.push(FieldError::new(format!("/except/{i}"), detail));
        }
    }
    constraints.except.iter().copied().collect()
}

/// The id of a named loop, whatever its kind; or why it may not be filled.
fn nameable(
    scan: &Scan,
    welded: &WeldedScan,
    except: &BTreeSet<u32>,
    rim: &BoundaryLoop,
) -> Result<u32, String> {
    if except.contains(&rim.id.0) {
        return Err(format!("loop {} is also among `except`", rim.id));
    }
    if rim.vertices.is_empty() {
        return Err(format!("loop {} is {CUT_AWAY}", rim.id));
    }
    if !welded.on_first_instance(scan, rim) {
        return Err(format!(
            "loop {} is never filled: it is {SAME_MESH}",
            rim.id
        ));
    }
    Ok(rim.id.0)
}

const SAME_MESH: &str =
    "a hole of a mesh that another node draws, too; the patch there shows here as well";

const CUT_AWAY: &str =
    "no loop any more: its cloth was cut out, or a cut joined it to another loop";

/// Why a loop is left as it is.
struct SkipReason {
    /// A stable word for programs.
    code: &'static str,
    /// What the loop is, for a person.
    phrase: String,
}

impl SkipReason {
    fn new(code: &'static str, phrase: impl Into<String>) -> Option<SkipReason> {
        let phrase = phrase.into();
        Some(SkipReason { code, phrase })
    }

    /// The entry of a loop that is left for this reason.
    fn entry(self, rim: &BoundaryLoop) -> v1::Skipped {
        v1::Skipped {
            id: rim.id.0,
            kind: kind(rim.kind) as i32,
            code: self.code.to_owned(),
            reason: self.phrase,
            ..v1::Skipped::default()
        }
    }
}

/// The entries of loops that are left, with what could be mended at their edges.
fn with_bites(mut skipped: Vec<v1::Skipped>, bites: &[(&BoundaryLoop, Bite)]) -> Vec<v1::Skipped> {
    for entry in &mut skipped {
        let count = bites.iter().filter(|(rim, _)| rim.id.0 == entry.id).count();
        if count > 0 {
            entry.reason.push_str(&format!(
                "; {count} bite(s), rip(s) or torn corner(s) in it are mended by `\"border\": \"auto\"`"
            ));
        }
    }
    skipped
}

/// Why a loop is left as it is when no selector names it; `None` for one that the request fills.
fn reason_to_skip(
    scan: &Scan,
    welded: &WeldedScan,
    constraints: &Constraints,
    except: &BTreeSet<u32>,
    rim: &BoundaryLoop,
) -> Option<SkipReason> {
    let fill = match constraints.fill {
        None if constraints.holes.is_empty() => Some(Fill::Holes),
        fill => fill,
    };
    if rim.vertices.is_empty() {
        return SkipReason::new("cut_away", CUT_AWAY);
    }
    let is_torn = rim.evidence.iter().any(Evidence::is_torn_rim);
    match (rim.kind, fill) {
        (LoopKind::Outer, _) => {
            let phrase = "the cloth's own edge, the outer boundary; name it to fill it";
            return SkipReason::new("outer_boundary", phrase);
        }
        (LoopKind::TubeEnd, Some(Fill::Holes) | None) => {
            let phrase = if is_torn {
                "the end of a tube, such as a sleeve, but torn where the piece's other edges are finished; if it is a hole, name it to fill it"
            } else {
                "the end of a tube, such as a sleeve; name it to fill it"
            };
            return SkipReason::new("tube_end", phrase);
        }
        (LoopKind::Opening, Some(Fill::Holes) | None) => {
            let phrase = if is_torn {
                "an opening, such as a neck, but torn where the piece's other edges are finished; if it is a hole, name it to fill it"
            } else {
                "an opening, such as a neck; name it to fill it"
            };
            return SkipReason::new("opening", phrase);
        }
        _ => {}
    }
    if rim.non_manifold {
        let phrase = "a hole whose rim runs through edges shared by more than two triangles";
        return SkipReason::new("non_manifold", phrase);
    }
    if !welded.on_first_instance(scan, rim) {
        return SkipReason::new("same_mesh", SAME_MESH);
    }
    if welded.is_second_skin(rim) {
        let phrase = "a hole of a second skin that lies on the cloth; the patch of the hole beneath shows there as well";
        return SkipReason::new("second_skin", phrase);
    }
    if except.contains(&rim.id.0) {
        return SkipReason::new("excepted", "a loop that `except` leaves");
    }
    match (rim.kind, fill) {
        (_, None) | (LoopKind::Hole, Some(Fill::Openings)) => {
            return SkipReason::new("not_selected", "a hole that the request did not choose");
        }
        _ => {}
    }
    let (diameter, range) = (rim.diameter, constraints.diameters);
    if let Some(max) = range.max.filter(|max| diameter > *max) {
        let phrase = format!("{diameter:.6} wide, above maxDiameter, {max}");
        return SkipReason::new("too_large", phrase);
    }
    if let Some(min) = range.min.filter(|min| diameter < *min) {
        let phrase = format!("{diameter:.6} wide, below minDiameter, {min}");
        return SkipReason::new("too_small", phrase);
    }
    None
}

/// The entry of a loop that could not be filled.
pub fn skipped_for(error: &MendError, rim: &BoundaryLoop) -> v1::Skipped {
    let patch = match error {
        MendError::NoPlausibleFill { patch, .. } => Some(v1::PatchReport::clone(patch)),
        _ => None,
    };
    v1::Skipped {
        id: rim.id.0,
        kind: kind(rim.kind) as i32,
        code: error.code().word.to_owned(),
        reason: error_chain(error),
        patch,
        ..v1::Skipped::default()
    }
}

#[cfg(test)]
#[path = "select_tests.rs"]
mod tests;
