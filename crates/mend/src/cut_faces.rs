//! Which triangles of a scan a cut takes.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use crate::cut::{Place, place};
use crate::welded_scan::WeldedScan;
use darn_budget::{Budget, Exhausted, Steps};
use darn_contract::Cut;
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::cut::{Prism, distance, faces_in_ball};
use darn_geometry::mesh::index::FaceId;
use darn_geometry::mesh::loops::LoopKind;
use darn_gltf_scan::Scan;

/// Two layers are skins of one cloth when they are no farther apart than this share of an edge.
const SKIN: f64 = 0.05;
/// Nanoseconds of work a face in finding those at a loop.
const FACE_WORK: u64 = 60;
/// Nanoseconds of work a face in finding the pieces that a cut reaches.
const PIECE_WORK: u64 = 400;
/// Nanoseconds of work a face for a point whose layer is looked for.
const NEAREST_WORK: u64 = 15;

/// The faces of a scan's surface that a cut takes, not empty; or the member of the cut that does not fit and why.
pub fn chosen(
    scan: &Scan,
    whole: &WeldedScan,
    cut: &Cut,
    budget: &Budget,
) -> Result<Result<Vec<u32>, (String, String)>, Exhausted> {
    let surface = &scan.surface;
    let layer = Layer {
        scan,
        whole,
        budget,
    };
    let (faces, nothing) = match cut {
        Cut::Ball { center, radius } => {
            let center = Vec3::from(*center);
            let faces = faces_in_ball(surface, center, *radius, budget)?;
            let nothing = || {
                let each =
                    (0..surface.faces.len()).map(|f| distance(&surface.triangle(f), &center));
                let nearest = each.fold(f64::INFINITY, f64::min);
                format!(
                    "takes nothing: the nearest triangle is {nearest:.4} from its centre, and the radius is {radius}"
                )
            };
            let nothing = if faces.is_empty() {
                nothing()
            } else {
                String::new()
            };
            (layer.of(faces, &[center])?, nothing)
        }
        Cut::Prism { polygon, depth } => {
            let corners: Vec<Vec3> = polygon.iter().map(|p| Vec3::from(*p)).collect();
            let Some(prism) = Prism::new(&corners, *depth) else {
                let detail = "the polygon has no normal".to_owned();
                return Ok(Err(("/polygon".to_owned(), detail)));
            };
            let nothing = format!(
                "takes nothing: no triangle lies under the polygon within {depth} of its mean plane"
            );
            (layer.of(prism.faces(surface, budget)?, &corners)?, nothing)
        }
        Cut::Rims(ids) => {
            for (k, id) in ids.iter().enumerate() {
                let detail = match whole.loop_with_id(*id) {
                    Ok(rim) if rim.kind == LoopKind::Outer => {
                        format!("loop {id} is the cloth's own edge, not the rim of a hole")
                    }
                    Ok(_) => continue,
                    Err(detail) => detail,
                };
                return Ok(Err((format!("/loops/{k}"), detail)));
            }
            (
                at_loops(scan, whole, ids, budget)?,
                "takes nothing".to_owned(),
            )
        }
    };
    Ok(match faces.is_empty() {
        true => Err((String::new(), nothing)),
        false => Ok(faces),
    })
}

/// The faces of a scan's surface that touch a loop, with those that show their other sides.
fn at_loops(
    scan: &Scan,
    whole: &WeldedScan,
    ids: &[u32],
    budget: &Budget,
) -> Result<Vec<u32>, Exhausted> {
    let faces = &scan.surface.faces;
    budget.spend(FACE_WORK * faces.len() as u64)?;
    let mesh = &whole.surface.mesh;
    let (mut places, mut own) = (HashSet::new(), HashSet::new());
    for rim in ids.iter().filter_map(|id| whole.loops.get(*id as usize)) {
        for face in (rim.vertices.iter()).flat_map(|v| whole.topology.faces_at(*v)) {
            places.insert(triangle_key(&mesh.triangle(face.index())));
            own.extend(whole.surface.soup_faces.of(face));
        }
    }
    let all = (0..faces.len()).filter(|f| {
        own.contains(&(*f as u32)) || places.contains(&triangle_key(&scan.surface.triangle(*f)))
    });
    Ok(all.map(|f| f as u32).collect())
}

/// The places of a triangle's corners, in an order of their own.
fn triangle_key(corners: &[Vec3; 3]) -> [Place; 3] {
    let mut key = [0, 1, 2].map(|k| place(&corners[k]));
    key.sort_unstable();
    key
}

/// Finds the layer of cloth that a cut means.
struct Layer<'a> {
    scan: &'a Scan,
    whole: &'a WeldedScan,
    budget: &'a Budget<'a>,
}

impl Layer<'_> {
    /// Of the faces that a cut reaches, those that are connected within it to the cloth nearest to one of its points,
    /// and loose pieces that lie in it whole. Other layers, which go on beyond the cut, are left.
    fn of(&self, reached: Vec<u32>, points: &[Vec3]) -> Result<Vec<u32>, Exhausted> {
        let (mesh, topology) = (&self.whole.surface.mesh, &self.whole.topology);
        self.budget.spend(PIECE_WORK * reached.len() as u64)?;
        let soup_faces = &self.whole.surface.soup_faces;
        let mut pieces: BTreeMap<FaceId, Option<usize>> = (reached.iter())
            .flat_map(|f| soup_faces.parts(*f))
            .map(|face| (face, None))
            .collect();
        let mut goes_on: Vec<bool> = Vec::new();
        let mut open = Vec::new();
        let seeds: Vec<FaceId> = pieces.keys().copied().collect();
        for seed in seeds {
            if pieces.get(&seed) != Some(&None) {
                continue;
            }
            let number = goes_on.len();
            goes_on.push(false);
            pieces.insert(seed, Some(number));
            open.push(seed);
            while let Some(face) = open.pop() {
                let twins = face.half_edges().map(|h| topology.twin(h));
                for next in twins.into_iter().flatten().map(|twin| twin.face()) {
                    let Some(piece) = pieces.get_mut(&next) else {
                        goes_on[number] = true;
                        continue;
                    };
                    if piece.is_none() {
                        *piece = Some(number);
                        open.push(next);
                    }
                }
            }
        }
        let on_cloth = |piece: &Option<usize>| piece.is_some_and(|p| goes_on[p]);
        let mut steps = Steps::of(self.budget);
        let mut meant = BTreeSet::new();
        for point in points {
            steps.take(NEAREST_WORK * pieces.len() as u64)?;
            let mut nearest: BTreeMap<Option<usize>, f64> = BTreeMap::new();
            let (mut least, mut thin) = (f64::INFINITY, 0.0);
            for (face, piece) in pieces.iter().filter(|(_, piece)| on_cloth(piece)) {
                let corners = mesh.triangle(face.index());
                let away = distance(&corners, point);
                let own = nearest.entry(*piece).or_insert(f64::INFINITY);
                *own = own.min(away);
                if away < least {
                    least = away;
                    thin = SKIN * (corners[1] - corners[0]).norm();
                }
            }
            // A second skin of the same cloth goes with it.
            let close = nearest.iter().filter(|(_, away)| **away <= least + thin);
            meant.extend(close.map(|(piece, _)| *piece));
        }
        let left: Vec<FaceId> = (pieces.iter())
            .filter(|(_, piece)| on_cloth(piece) && !meant.contains(*piece))
            .map(|(face, _)| *face)
            .collect();
        let own: HashSet<u32> = left.iter().filter_map(|f| soup_faces.of(*f)).collect();
        let left = left.iter().map(|f| triangle_key(&mesh.triangle(f.index())));
        let left: HashSet<[Place; 3]> = left.collect();
        let surface = &self.scan.surface;
        // By their places, so that the triangles of the other side are left with them.
        let stays = |f: &u32| {
            own.contains(f) || left.contains(&triangle_key(&surface.triangle(*f as usize)))
        };
        Ok(reached.into_iter().filter(|f| !stays(f)).collect())
    }
}
