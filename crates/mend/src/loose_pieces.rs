//! Notes on loose pieces of the scan that lie in a hole, or float over or under it. The cloth around the hole says nothing of them; they are kept.

use darn_budget::{Budget, Exhausted, Steps};
use rstar::primitives::GeomWithData;
use rstar::{PointDistance as _, RTree};

use crate::prepared_hole::HoleRef;
use crate::scan_notes::first_of;
use crate::welded_scan::WeldedScan;
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::patch::Patch;

/// A loose piece lies in the hole when all of its border is nearer to the patch than this many edges of the hole's rim.
const IN_THE_HOLE: f64 = 1.5;
/// One floats over or under the hole when it is smaller than the hole and all of its border is nearer to the patch than this share of the hole's diameter,
/// and at more than half of its border's vertices the patch is nearest within the rim.
const AFLOAT: f64 = 0.5;
/// Most loose pieces that a note names.
const MAX_NAMED: usize = 20;
/// Nanoseconds of work a search for the nearest vertex of a patch.
const NEAREST_WORK: u64 = 300;

/// Where a loose piece lies.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    /// Where the patch is.
    InTheHole,
    /// Over or under it.
    Afloat,
    /// Elsewhere.
    Elsewhere,
}

/// What a report says of the loose pieces at a hole.
///
/// # Errors
/// `Exhausted`: every other piece is looked at for every hole.
pub fn notes(
    hole: HoleRef,
    patch: &Patch,
    welded: &WeldedScan,
    budget: &Budget,
) -> Result<Vec<String>, Exhausted> {
    let rim = &welded.loops[hole.id() as usize];
    let islands = hole.charted().map_or(&[][..], |hole| &hole.islands);
    let is_loose = |l: &&BoundaryLoop| {
        l.kind == LoopKind::Outer
            && l.component != rim.component
            && !l.vertices.is_empty()
            && !islands.contains(&l.id)
    };
    let mut others = welded.loops.iter().filter(is_loose).peekable();
    if others.peek().is_none() {
        return Ok(Vec::new());
    }
    let near = NearPatch::new(rim, patch);
    let mut steps = Steps::of(budget);
    let (mut inside, mut afloat) = (Vec::new(), Vec::new());
    for piece in others {
        match near.place_of(piece, welded, &mut steps)? {
            Place::InTheHole => inside.push(piece),
            Place::Afloat => afloat.push(piece),
            Place::Elsewhere => {}
        }
    }
    let mut notes = Vec::new();
    if !inside.is_empty() {
        notes.push(format!(
            "loose piece(s) of the scan lie in the hole (their borders: loop {}); they were kept, and the new cloth covers their place, too",
            named(&inside)
        ));
    }
    if !afloat.is_empty() {
        notes.push(format!(
            "loose piece(s) of the scan float over or under the hole (their borders: loop {}); they were left as they are, and the new cloth does not meet them",
            named(&afloat)
        ));
    }
    Ok(notes)
}

/// A patch, to tell what lies near it.
struct NearPatch {
    /// Its vertices, each with whether it is within the rim.
    vertices: RTree<GeomWithData<[f64; 3], bool>>,
    /// Largest distance of what lies in the hole, scene units.
    in_the_hole: f64,
    /// Largest distance of what floats over or under it, scene units.
    afloat: f64,
    /// The hole's diameter, scene units.
    diameter: f64,
}

impl NearPatch {
    fn new(rim: &BoundaryLoop, patch: &Patch) -> NearPatch {
        let vertices = patch.positions.iter().enumerate();
        let vertices = vertices.map(|(k, p)| GeomWithData::new((*p).into(), k >= patch.rim.len()));
        NearPatch {
            vertices: RTree::bulk_load(vertices.collect()),
            in_the_hole: IN_THE_HOLE * rim.length / rim.vertices.len().max(1) as f64,
            afloat: AFLOAT * rim.diameter,
            diameter: rim.diameter,
        }
    }

    /// Where a loose piece lies.
    ///
    /// # Errors
    /// `Exhausted`.
    fn place_of(
        &self,
        piece: &BoundaryLoop,
        welded: &WeldedScan,
        steps: &mut Steps,
    ) -> Result<Place, Exhausted> {
        let (mut inside, mut within) = (true, 0usize);
        for v in &piece.vertices {
            steps.take(NEAREST_WORK)?;
            let place = <[f64; 3]>::from(welded.surface.mesh.positions[v.index()]);
            let Some(nearest) = self.vertices.nearest_neighbor(&place) else {
                return Ok(Place::Elsewhere);
            };
            let distance = nearest.distance_2(&place).sqrt();
            inside &= distance <= self.in_the_hole;
            if distance > self.in_the_hole.max(self.afloat) {
                return Ok(Place::Elsewhere);
            }
            within += usize::from(nearest.data);
        }
        Ok(if inside {
            Place::InTheHole
        } else if piece.diameter < self.diameter && 2 * within > piece.vertices.len() {
            Place::Afloat
        } else {
            Place::Elsewhere
        })
    }
}

/// The ids of the first of some loops, and how many more there are.
fn named(pieces: &[&BoundaryLoop]) -> String {
    first_of(pieces.iter().map(|l| l.id.to_string()), MAX_NAMED)
}
