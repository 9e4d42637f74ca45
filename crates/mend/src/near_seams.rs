//! Where a rim passes a seam that only nearly meets, the patch takes the scan's vertices of each side.

use std::collections::BTreeMap;

use crate::welded_scan::SourceFace;
use darn_geometry::mesh::region::Region;
use darn_geometry::patch::Patch;
use darn_geometry::patch::attributes::{AttributedPatch, Corner};
use darn_gltf_scan::Scan;

/// A region, and per region face the scan's face that it was made of.
#[derive(Clone, Copy)]
pub struct RegionSources<'a> {
    /// The region.
    pub region: &'a Region,
    /// The scan's faces.
    pub sources: &'a [Option<SourceFace>],
}

/// Gives every face of a patch with an edge on the rim the two vertices that the scan's face beyond the edge has, where
/// those lie elsewhere than the vertices it has now: a vertex of a welded scan may stand for several that nearly meet.
pub fn meet_both_sides(
    dressed: &mut AttributedPatch,
    patch: &Patch,
    around: RegionSources,
    scan: &Scan,
) {
    let ends = scan_ends(patch, around);
    let count = patch.rim.len();
    let place = |v: u32| {
        let at = scan.surface.positions.get(v as usize);
        at.map(|p| [p.x, p.y, p.z].map(f64::to_bits))
    };
    let mut copies = BTreeMap::new();
    for (face, vertices) in dressed.faces.iter_mut().zip(&patch.faces) {
        for k in 0..3 {
            let (from, to) = (vertices[k] as usize, vertices[(k + 1) % 3] as usize);
            if from >= count || to != (from + 1) % count {
                continue;
            }
            let Some(ends) = ends[from] else {
                continue;
            };
            for (slot, wanted) in [(k, ends[0]), ((k + 1) % 3, ends[1])] {
                let own = face[slot];
                let Corner { vertex, values, .. } = &dressed.corners[own as usize];
                let (vertex, values) = (*vertex, values.clone());
                let has = dressed.corners[own as usize].scan.and_then(place);
                if has == place(wanted) {
                    continue;
                }
                face[slot] = *copies.entry((own, wanted)).or_insert_with(|| {
                    dressed.corners.push(Corner {
                        vertex,
                        scan: Some(wanted),
                        values,
                    });
                    dressed.corners.len() as u32 - 1
                });
            }
        }
    }
}

/// Per rim edge, from rim vertex k to k + 1, the scan's vertices at its ends in the face beyond it.
fn scan_ends(patch: &Patch, around: RegionSources) -> Vec<Option<[u32; 2]>> {
    let count = patch.rim.len();
    // The scan's face at a rim edge has the edge in the opposite direction.
    let wanted: BTreeMap<(u32, u32), usize> = (0..count)
        .map(|k| ((patch.rim[(k + 1) % count], patch.rim[k]), k))
        .collect();
    let mut ends = vec![None; count];
    let faces = around.region.mesh.faces.iter().zip(around.sources);
    for (face, source) in faces {
        let Some(source) = source else {
            continue;
        };
        for k in 0..3 {
            let next = (k + 1) % 3;
            if let Some(&edge) = wanted.get(&(face[k], face[next])) {
                ends[edge] = Some([source.corners[next], source.corners[k]]);
            }
        }
    }
    ends
}
