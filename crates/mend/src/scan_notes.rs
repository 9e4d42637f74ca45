//! What a report says about a scan as a whole: notes for a person, and what was set aside, by kind.

use darn_contract::{excerpt, v1};
use darn_geometry::mesh::index::{FaceId, VertexId};
use darn_geometry::mesh::layers::FEWEST_FACES;
use darn_gltf_scan::{NamedPlace, Scan};

use crate::welded_scan::WeldedScan;

/// Names that a note gives before it says how many more there are.
const MAX_NAMED: usize = 5;

/// What a person should know about a scan as a whole.
pub fn notes(welded: &WeldedScan, scan: &Scan) -> Vec<String> {
    let mut notes = welded.cuts.notes.clone();
    let unjoined = welded.topology.non_manifold.len();
    if unjoined > 0 {
        notes.push(format!(
            "{unjoined} triangle side(s) lie on edges where they continue no other triangle: more than two meet there, or two that \
             cannot face the same way; the cloth was taken to end there"
        ));
    }
    let touching = touching(welded);
    if touching > 0 {
        notes.push(format!(
            "boundary loops touch themselves or each other at {touching} point(s); where a hole touches the outer boundary \
             it is part of it and stays open"
        ));
    }
    let scraps = scraps(welded);
    if scraps > 0 {
        notes.push(format!(
            "{scraps} loose scrap(s) of fewer than {FEWEST_FACES} triangles lie apart from the cloth; they were left as they are"
        ));
    }
    let skins = welded.second_skins.iter().flatten().count();
    if skins > 0 {
        notes.push(format!(
            "{skins} hole(s) belong to a second skin that lies on the cloth; the patches of the first skin close them and their own rims stay open"
        ));
    }
    if scan.parts.iter().any(|p| p.shared) {
        notes.push(
            "a mesh is drawn by several nodes; a patch on it shows at each of them".to_owned(),
        );
    }
    if scan.posed_by_morph_targets() {
        notes.push(
            "morph targets move the scan by default; it was mended as it lies without them, and the new cloth does not move with them"
                .to_owned(),
        );
    }
    let scenes = scan.other_scenes();
    if !scenes.is_empty() {
        notes.push(format!(
            "the file has other scenes with meshes of their own ({}); only the default scene was looked at",
            listed("scene", &scenes)
        ));
    }
    let levels = scan.other_levels();
    if !levels.is_empty() {
        notes.push(format!(
            "the file has other levels of detail (MSFT_lod of {}); only the first level was looked at",
            listed("node", &levels)
        ));
    }
    let misstated = scan.misstated_streams;
    if misstated > 0 {
        notes.push(format!(
            "{misstated} Draco stream(s) hold another number of vertices or triangles than the accessors over them state; the streams were read"
        ));
    }
    let trailing = scan.trailing_bytes();
    if trailing > 0 {
        notes.push(format!(
            "{trailing} byte(s) follow the end that the file declares; they are kept after the end of the mended file"
        ));
    }
    notes
}

/// What was not taken as the file has it, by kind.
pub fn set_aside(welded: &WeldedScan, scan: &Scan) -> Vec<v1::SetAside> {
    let own = welded.surface.set_aside;
    let second_skins = welded.second_skins.iter().flatten().count();
    let counts = [
        ("degenerate_face", own.degenerate_faces),
        ("duplicate_face", own.duplicate_faces),
        ("fin", own.fins),
        ("flipped_face", own.flipped_faces),
        ("t_junction", own.t_junctions),
        ("near_seam_vertex", own.near_seam_vertices),
        ("vertex_not_finite", scan.not_finite),
        ("second_skin_hole", second_skins),
    ];
    counts
        .into_iter()
        .filter(|(_, count)| *count > 0)
        .map(|(kind, count)| v1::SetAside {
            kind: kind.to_owned(),
            count: count as u32,
        })
        .collect()
}

/// The first places of a list by index and name, and how many more there are.
fn listed(what: &str, places: &[NamedPlace]) -> String {
    let names = places.iter().map(|place| match place.name {
        Some(name) => format!("{what} {} {:?}", place.index, excerpt(name)),
        None => format!("{what} {}", place.index),
    });
    first_of(names, MAX_NAMED)
}

/// The first of some names, `most` at most, and how many more there are.
pub fn first_of(names: impl ExactSizeIterator<Item = String>, most: usize) -> String {
    let more = names.len().saturating_sub(most);
    let first: Vec<String> = names.take(most).collect();
    match more {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

/// Number of components of few faces beside others of more.
fn scraps(welded: &WeldedScan) -> usize {
    let topology = &welded.topology;
    if topology.components < 2 {
        return 0;
    }
    let mut faces = vec![0usize; topology.components];
    for face in (0..welded.surface.mesh.faces.len() as u32).map(FaceId) {
        faces[topology.component(face) as usize] += 1;
    }
    let scraps = faces.iter().filter(|faces| **faces < FEWEST_FACES).count();
    if scraps < faces.len() { scraps } else { 0 }
}

/// Number of points in which boundary loops touch (bow-ties).
fn touching(welded: &WeldedScan) -> usize {
    let place = |v: &VertexId| welded.surface.mesh.positions[v.index()];
    let ends = welded.loops.iter().flat_map(|l| &l.vertices).map(place);
    let mut places: Vec<[u64; 3]> = ends.map(|p| [p.x, p.y, p.z].map(f64::to_bits)).collect();
    places.sort_unstable();
    let mut shared: Vec<[u64; 3]> = (places.windows(2))
        .filter(|w| w[0] == w[1])
        .map(|w| w[0])
        .collect();
    shared.dedup();
    shared.len()
}
