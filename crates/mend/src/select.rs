//! Which loops a request means, and which anchors and gestures belong to which.

use std::collections::BTreeMap;

use super::MendError;
use super::cloth::{Cloth, kind};
use darn_contract::{Anchor, Constraints, Edit, FieldError, HoleSelector, v1};
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::mesh::nearest::distance_to_loop;
use darn_gltf_scan::Scan;

/// What to fill and what not.
pub struct Selection {
    /// The loops to fill, in order of id.
    pub chosen: Vec<Chosen>,
    /// All others, in order of id.
    pub skipped: Vec<v1::Skipped>,
}

/// A loop to fill.
#[derive(Default)]
pub struct Chosen {
    /// Its id, which is its place among the cloth's loops.
    pub id: u32,
    /// Its anchors, each with its place in the request.
    pub anchors: Vec<(usize, Anchor)>,
    /// Its gestures, each with its place in the request.
    pub edits: Vec<(usize, Edit)>,
}

impl Chosen {
    fn loop_of(id: u32) -> Chosen {
        Chosen {
            id,
            ..Chosen::default()
        }
    }
}

/// Matches a request to the loops of a scan.
///
/// # Errors
/// `NoHoles` when nobody chose and there is none; `Constraints` for every selector, anchor or gesture that matches no loop that may be filled; `NonManifold` when an asked-for rim is no closed line.
pub fn select(
    scan: &Scan,
    cloth: &Cloth,
    constraints: &Constraints,
) -> Result<Selection, MendError> {
    let mut wrong = Vec::new();
    let mut chosen: BTreeMap<u32, Chosen> = BTreeMap::new();
    if constraints.holes.is_empty() {
        let fillable = (cloth.loops.iter()).filter(|l| reason_to_skip(scan, cloth, l).is_none());
        chosen.extend(fillable.map(|l| (l.id.0, Chosen::loop_of(l.id.0))));
    }
    for (i, selector) in constraints.holes.iter().enumerate() {
        match find(scan, cloth, selector) {
            Ok(id) => drop(chosen.entry(id).or_insert_with(|| Chosen::loop_of(id))),
            Err(detail) => wrong.push(FieldError::new(format!("/holes/{i}"), detail)),
        }
    }
    for (i, anchor) in constraints.anchors.iter().enumerate() {
        match owner(&mut chosen, anchor.hole) {
            Ok(hole) => hole.anchors.push((i, *anchor)),
            Err(detail) => wrong.push(FieldError::new(format!("/anchors/{i}/hole"), detail)),
        }
    }
    for (i, edit) in constraints.edits.iter().enumerate() {
        match owner(&mut chosen, edit.hole) {
            Ok(hole) => hole.edits.push((i, *edit)),
            Err(detail) => wrong.push(FieldError::new(format!("/edits/{i}/hole"), detail)),
        }
    }
    if !wrong.is_empty() {
        return Err(MendError::Constraints(wrong));
    }
    if let Some(hole) = chosen
        .keys()
        .copied()
        .find(|id| cloth.loops[*id as usize].non_manifold)
    {
        return Err(MendError::NonManifold { hole });
    }
    let skipped: Vec<v1::Skipped> = (cloth.loops.iter())
        .filter(|l| !chosen.contains_key(&l.id.0))
        .map(|l| skipped(scan, cloth, l))
        .collect();
    if chosen.is_empty() {
        return Err(MendError::NoHoles { skipped });
    }
    Ok(Selection {
        chosen: chosen.into_values().collect(),
        skipped,
    })
}

fn find(scan: &Scan, cloth: &Cloth, selector: &HoleSelector) -> Result<u32, String> {
    match selector {
        HoleSelector::Id(id) => {
            let rim = cloth.loops.get(*id as usize).ok_or_else(|| {
                format!(
                    "there is no loop {id}; the scan has {} boundary loop(s), numbered from 0",
                    cloth.loops.len()
                )
            })?;
            fillable(scan, cloth, rim)
        }
        HoleSelector::Near(point) => {
            let point = Vec3::from(*point);
            let holes = cloth.loops.iter().filter(|l| l.kind == LoopKind::Hole);
            let near = holes.map(|l| (distance_to_loop(&cloth.welded.mesh, l, &point), l));
            let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0));
            let (_, rim) = nearest.ok_or_else(|| "the scan has no hole".to_owned())?;
            fillable(scan, cloth, rim)
        }
    }
}

/// The id of a loop that may be filled when it is asked for.
fn fillable(scan: &Scan, cloth: &Cloth, rim: &BoundaryLoop) -> Result<u32, String> {
    match reason_to_skip(scan, cloth, rim) {
        // An error of its own says so, with its own code.
        Some(("non_manifold", _)) | None => Ok(rim.id.0),
        Some((_, reason)) => Err(format!("loop {} is never filled: it is {reason}", rim.id)),
    }
}

/// The hole that an anchor or gesture belongs to: the one it names, or the only one.
fn owner(chosen: &mut BTreeMap<u32, Chosen>, named: Option<u32>) -> Result<&mut Chosen, String> {
    let count = chosen.len();
    match named {
        Some(id) => {
            (chosen.get_mut(&id)).ok_or_else(|| format!("hole {id} is not among the holes to fill"))
        }
        None if count == 1 => {
            (chosen.values_mut().next()).ok_or_else(|| "there is no hole to fill".to_owned())
        }
        None => Err(format!(
            "{count} holes are to be filled; say which one it belongs to"
        )),
    }
}

/// Why a loop is left as it is unless, or even if, somebody asks for it: a stable word and a phrase; `None` for a hole.
fn reason_to_skip(
    scan: &Scan,
    cloth: &Cloth,
    rim: &BoundaryLoop,
) -> Option<(&'static str, &'static str)> {
    match rim.kind {
        LoopKind::Outer => Some(("outer_boundary", "the cloth's own edge, the outer boundary")),
        LoopKind::TubeEnd => Some(("tube_end", "the end of a tube, such as a sleeve")),
        LoopKind::Hole if rim.non_manifold => Some((
            "non_manifold",
            "a hole whose rim runs through edges shared by more than two triangles",
        )),
        LoopKind::Hole if !cloth.on_first_instance(scan, rim) => Some((
            "same_mesh",
            "a hole of a mesh that another node draws, too; the patch there shows here as well",
        )),
        LoopKind::Hole => None,
    }
}

fn skipped(scan: &Scan, cloth: &Cloth, rim: &BoundaryLoop) -> v1::Skipped {
    let not_selected = ("not_selected", "a hole that the request did not choose");
    let (code, reason) = reason_to_skip(scan, cloth, rim).unwrap_or(not_selected);
    v1::Skipped {
        id: rim.id.0,
        kind: kind(rim.kind) as i32,
        code: code.to_owned(),
        reason: reason.to_owned(),
    }
}
