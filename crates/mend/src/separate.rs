//! Pushes the patches of one scan apart where they come near each other: each hole is filled without regard to the
//! others.

use std::collections::HashSet;

use darn_budget::{Budget, Exhausted};

use crate::fill_hole::PatchDraft;
use darn_geometry::mesh::{TriMesh, Vec3};

/// Pushes every patch away from those before it where their boxes meet. The drafts are in order of id, so that the
/// result does not depend on threads.
///
/// # Errors
/// `Exhausted`.
pub fn separate(drafts: &mut [PatchDraft], budget: &Budget) -> Result<(), Exhausted> {
    for own in 1..drafts.len() {
        budget.spend(DRAFT_WORK * own as u64)?;
        let (before, rest) = drafts.split_at_mut(own);
        let own = &mut rest[0];
        let others = near(own, before);
        if !others.faces.is_empty() {
            own.hole.separate(&mut own.patch, &others, budget)?;
        }
    }
    Ok(())
}

/// Nanoseconds of work another patch, whose box is computed and compared.
const DRAFT_WORK: u64 = 1000;

/// The triangles of other patches whose box meets the box of a patch. Triangles with a vertex on the patch's own rim
/// touch it there and are left out.
fn near(own: &PatchDraft, others: &[PatchDraft]) -> TriMesh {
    let (low, high) = bounds(&own.patch.positions);
    let on_rim: HashSet<u32> = rim(own).collect();
    let mut near = TriMesh::default();
    for other in others {
        let patch = &other.patch;
        let (least, most) = bounds(&patch.positions);
        if (0..3).any(|k| most[k] < low[k] || least[k] > high[k]) {
            continue;
        }
        let shared: Vec<bool> = rim(other).map(|v| on_rim.contains(&v)).collect();
        let touches = |face: &&[u32; 3]| {
            let on_rim = |v: &u32| shared.get(*v as usize) == Some(&true);
            face.iter().any(on_rim)
        };
        let base = near.positions.len() as u32;
        near.positions.extend_from_slice(&patch.positions);
        let faces = patch.faces.iter().filter(|face| !touches(face));
        near.faces.extend(faces.map(|f| f.map(|v| base + v)));
    }
    near
}

/// The rim's vertices as vertices of the welded scan.
fn rim<'a>(draft: &'a PatchDraft) -> impl Iterator<Item = u32> + 'a {
    let region = draft.hole.region();
    draft
        .patch
        .rim
        .iter()
        .map(|v| region.vertices[*v as usize].0)
}

/// The least and the largest coordinates.
fn bounds(positions: &[Vec3]) -> (Vec3, Vec3) {
    let low = positions
        .iter()
        .fold(Vec3::repeat(f64::MAX), |m, p| m.inf(p));
    let high = positions
        .iter()
        .fold(Vec3::repeat(f64::MIN), |m, p| m.sup(p));
    (low, high)
}
