//! The faces of a soup on their way to a welded mesh, and what is done to those that do not fit together as they are.
//!
//! In order: slivers at the border are left out, border vertices that nearly meet become one place, border edges are
//! split where vertices of others lie on them, the half-edges are paired ([`joints`](super::joints)), faces are turned
//! so that neighbours face one way, and fins are left out.

use std::borrow::Cow;
use std::cmp::Reverse;

use darn_budget::{Budget, Exhausted, Steps};

use super::TriMesh;
use super::border::{Border, Junction, PlacedFaces, bounded};
use super::index::{FaceId, HalfEdgeId};
use super::joints::{Joints, joints, turned_half_edge, turning};
use super::pairing::{Paired, Pairing, Twins, pair_half_edges};
use super::topology::face_components;
use super::weld::{SetAside, SoupFaces};

/// Faces that a fin may have.
const MAX_FIN: usize = 8;
/// Nanoseconds of work a face in one pass over the mesh.
const FACE_WORK: u64 = 150;

/// Per face a vertex of the soup in the exact place of each corner; the soup's own faces where every vertex has a place of
/// its own.
type Places<'a> = Cow<'a, [[u32; 3]]>;

/// Faces that lead back to those of a soup.
#[derive(Debug, Clone, Default)]
pub(super) struct Sources {
    /// Which faces of the soup they are.
    pub soup_faces: SoupFaces,
    /// Per face whether a face left out shows its other side; empty where none does.
    pub two_sided: Vec<bool>,
}

/// Faces with corners of their own.
#[derive(Debug, Clone, Default)]
struct Working {
    /// Per face its corners, vertices of the soup.
    corners: Vec<[u32; 3]>,
    sources: Sources,
}

/// The mesh of a soup before its vertices are numbered.
pub(super) struct Repaired<'a> {
    /// The faces.
    pub sources: Sources,
    /// Per face a vertex of the soup in the exact place of each corner.
    pub places: Places<'a>,
    /// The faces that were turned or split, ascending, with the soup's vertices at their corners.
    pub changed: Vec<(FaceId, [u32; 3])>,
    /// Their twins.
    pub twins: Twins,
    /// What [`Topology::non_manifold`](super::topology::Topology::non_manifold) lists.
    pub non_manifold: Vec<HalfEdgeId>,
    /// What was changed.
    pub set_aside: SetAside,
}

/// A soup, the faces of it that are looked at, and what decides whether they meet.
pub(super) struct Repair<'a> {
    /// The soup.
    pub soup: &'a TriMesh,
    /// Per vertex of the soup its exact place.
    pub exact: &'a [u32],
    /// Precision of the coordinates of a vertex of the soup, scene units.
    pub precision: &'a dyn Fn(u32) -> f64,
    /// What it may cost.
    pub budget: &'a Budget<'a>,
}

impl Repair<'_> {
    /// Joins the faces; those of a clean soup as they are.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn joined(&self) -> Result<Repaired<'_>, Exhausted> {
        let mut sources = self.proper_faces();
        let mut set_aside = SetAside {
            degenerate_faces: self.soup.faces.len() - sources.soup_faces.len(),
            ..SetAside::default()
        };
        let mut places = self.places_of(&sources);
        let mut pairing = pair_half_edges(&places, self.exact);
        let duplicates = duplicates(&places, &pairing, &mut sources.two_sided);
        if !duplicates.is_empty() {
            set_aside.duplicate_faces = duplicates.len();
            (sources, places) = self.apart_from(&duplicates, sources)?;
            pairing = pair_half_edges(&places, self.exact);
        }
        let slivers = self.border_slivers(&places, &pairing.twins);
        if !slivers.is_empty() {
            set_aside.degenerate_faces += slivers.len();
            (sources, places) = self.apart_from(&slivers, sources)?;
            pairing = pair_half_edges(&places, self.exact);
        }
        let border = self.border(&places, &pairing.twins)?;
        let near = border.near_places()?;
        let mut junctions = match near.as_slice() {
            [] => border.junctions()?,
            _ => Vec::new(),
        };
        drop(border);
        if near.is_empty() && junctions.is_empty() && pairing.non_manifold.is_empty() {
            return Ok(Repaired {
                sources,
                places,
                changed: Vec::new(),
                twins: pairing.twins,
                non_manifold: Vec::new(),
                set_aside,
            });
        }
        drop(pairing);
        self.budget.spend_at_once(FACE_WORK * places.len() as u64)?;
        let soup_faces = sources.soup_faces.iter();
        let mut faces = Working {
            corners: soup_faces.map(|f| self.soup.faces[f as usize]).collect(),
            sources,
        };
        let mut place = self.exact.to_vec();
        if !near.is_empty() {
            set_aside.near_seam_vertices = near.len();
            let mut lowest: Vec<u32> = (0..place.len() as u32).collect();
            near.iter()
                .for_each(|(from, to)| lowest[*from as usize] = *to);
            place.iter_mut().for_each(|p| *p = lowest[*p as usize]);
            places = placed(&faces.corners, &place).into();
            let twins = pair_half_edges(&places, &place).twins;
            junctions = self.border(&places, &twins)?.junctions()?;
        }
        if !junctions.is_empty() {
            set_aside.t_junctions = junctions.len();
            faces = faces.split(&junctions);
            places = placed(&faces.corners, &place).into();
        }
        self.chosen(faces, &places, set_aside)
    }

    /// The faces with three different places.
    fn proper_faces(&self) -> Sources {
        let is_proper = |face: &[u32; 3]| match face.map(|v| self.exact.get(v as usize)) {
            [Some(a), Some(b), Some(c)] => a != b && b != c && c != a,
            _ => false,
        };
        let all = &self.soup.faces;
        let soup_faces = match all.iter().all(is_proper) {
            true => SoupFaces::Same(all.len()),
            false => {
                let proper = (0u32..).zip(all).filter(|(_, face)| is_proper(face));
                SoupFaces::Listed(proper.map(|(f, _)| f).collect())
            }
        };
        Sources {
            soup_faces,
            two_sided: Vec::new(),
        }
    }

    /// The soup's faces by exact places.
    fn places_of(&self, sources: &Sources) -> Places<'_> {
        let is_own_place = |(v, place): (u32, &u32)| v == *place;
        let all = sources.soup_faces.len() == self.soup.faces.len();
        if all && (0u32..).zip(self.exact).all(is_own_place) {
            return Cow::Borrowed(&self.soup.faces);
        }
        let soup_faces = sources.soup_faces.iter();
        let place = |v: u32| self.exact[v as usize];
        soup_faces
            .map(|f| self.soup.faces[f as usize].map(place))
            .collect()
    }

    /// The faces but for some, which are ascending, and their places.
    fn apart_from(
        &self,
        left_out: &[FaceId],
        sources: Sources,
    ) -> Result<(Sources, Places<'_>), Exhausted> {
        let faces = sources.soup_faces.len();
        self.budget.spend_at_once(FACE_WORK * faces as u64)?;
        let sources = sources.only(|f| left_out.binary_search(&FaceId(f as u32)).is_err());
        let places = self.places_of(&sources);
        Ok((sources, places))
    }

    /// The faces at the border that are no higher than the tolerance, ascending: they keep borders apart that meet.
    fn border_slivers(&self, places: &[[u32; 3]], twins: &Twins) -> Vec<FaceId> {
        let is_sliver = |f: &FaceId| {
            let corners = places[f.index()];
            let [a, b, c] = corners.map(|v| self.soup.positions[v as usize]);
            let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
            let precision = corners.map(self.precision).into_iter().fold(0.0, f64::max);
            let doubled = (b - a).cross(&(c - a)).norm();
            let squared = longest * longest;
            squared.is_normal() && doubled <= longest * bounded(precision, longest)
        };
        let mut slivers: Vec<FaceId> = (twins.boundary().map(HalfEdgeId::face))
            .filter(is_sliver)
            .collect();
        slivers.dedup();
        slivers
    }

    fn border<'b>(
        &'b self,
        places: &'b [[u32; 3]],
        twins: &Twins,
    ) -> Result<Border<'b>, Exhausted> {
        let placed = self.placed_faces(places);
        Border::of(placed, twins, self.precision, self.budget)
    }

    fn placed_faces<'b>(&'b self, places: &'b [[u32; 3]]) -> PlacedFaces<'b> {
        PlacedFaces {
            positions: &self.soup.positions,
            faces: places,
        }
    }

    /// Pairs the half-edges of faces that do not all fit together.
    fn chosen(
        &self,
        mut faces: Working,
        places: &[[u32; 3]],
        mut set_aside: SetAside,
    ) -> Result<Repaired<'_>, Exhausted> {
        self.budget.spend_at_once(FACE_WORK * places.len() as u64)?;
        let mut steps = Steps::of(self.budget);
        let exact = placed(&faces.corners, self.exact);
        let from = |h: HalfEdgeId| exact[h.face().index()][h.corner()];
        let is_exact = |g: HalfEdgeId, h: HalfEdgeId| {
            let (a, b) = (from(g), from(g.next()));
            let (c, d) = (from(h), from(h.next()));
            (a.min(b), a.max(b)) == (c.min(d), c.max(d))
        };
        let joints = joints(self.placed_faces(places), is_exact, &mut steps)?;
        let turning = turning(&joints);
        let turned = |h: HalfEdgeId| turned_half_edge(h, &turning.turned);
        let Joints {
            twins: before,
            mut crowded,
            ..
        } = joints;
        crowded.extend(turning.apart.iter().map(|pair| pair.to_vec()));
        let mut twins = Twins::unpaired(before.half_edges());
        for h in (0..before.half_edges() as u32).map(HalfEdgeId) {
            if let Some(g) = before.twin(h).filter(|g| *g > h) {
                twins.join(turned(g), turned(h));
            }
        }
        for [g, h] in &turning.joined {
            twins.join(turned(*g), turned(*h));
        }
        for (corners, turned) in faces.corners.iter_mut().zip(&turning.turned) {
            if *turned {
                corners.swap(1, 2);
            }
        }
        crowded.iter_mut().flatten().for_each(|h| *h = turned(*h));
        let is_fin = fins(&twins, &crowded);
        let flipped = turning.turned.iter().zip(&is_fin);
        set_aside.flipped_faces = flipped.filter(|(turned, fin)| **turned && !**fin).count();
        set_aside.fins = is_fin.iter().filter(|fin| **fin).count();
        let (twins, non_manifold) = without(&is_fin, &twins, &crowded);
        let faces = faces.only(|f| !is_fin[f]);
        let unlike = |(f, corners): (u32, &[u32; 3])| {
            let own = faces.sources.soup_faces.of(FaceId(f))?;
            let is_same = self.soup.faces[own as usize] == *corners;
            (!is_same).then_some((FaceId(f), *corners))
        };
        Ok(Repaired {
            places: placed(&faces.corners, self.exact).into(),
            changed: (0u32..).zip(&faces.corners).filter_map(unlike).collect(),
            sources: faces.sources,
            twins,
            non_manifold,
            set_aside,
        })
    }
}

/// The faces that have the three places of an earlier one, ascending; marks those that are kept and have a copy which
/// shows the other side.
fn duplicates(places: &[[u32; 3]], pairing: &Pairing, two_sided: &mut Vec<bool>) -> Vec<FaceId> {
    // Two faces with the same places share three edges: each of these has no pair, or is a pair of the two.
    let may_be = |f: FaceId| {
        let [g, h, _] = f
            .half_edges()
            .map(|h| pairing.twins.twin(h).map(HalfEdgeId::face));
        let unpaired = |h: HalfEdgeId| pairing.non_manifold.binary_search(&h).is_ok();
        match (g, h) {
            (Some(g), Some(h)) => g == h,
            _ => f.half_edges().into_iter().any(unpaired),
        }
    };
    let sorted = |f: FaceId| {
        let mut key = places[f.index()];
        key.sort_unstable();
        (key, f)
    };
    let faces = (0..places.len() as u32).map(FaceId);
    let mut candidates: Vec<([u32; 3], FaceId)> =
        faces.filter(|f| may_be(*f)).map(sorted).collect();
    candidates.sort_unstable();
    // Around a face of three different places, two of the three steps ascend in one orientation and one in the other.
    let ascends_twice = |f: FaceId| {
        let [a, b, c] = places[f.index()];
        let steps = [(a, b), (b, c), (c, a)];
        steps.iter().filter(|(from, to)| from < to).count() == 2
    };
    let mut found = Vec::new();
    for group in candidates.chunk_by(|x, y| x.0 == y.0) {
        let (kept, copies) = (group[0].1, &group[1..]);
        if (copies.iter()).any(|c| ascends_twice(c.1) != ascends_twice(kept)) {
            two_sided.resize(places.len(), false);
            two_sided[kept.index()] = true;
        }
        found.extend(copies.iter().map(|copy| copy.1));
    }
    found.sort_unstable();
    found
}

/// The faces by places.
fn placed(corners: &[[u32; 3]], place: &[u32]) -> Vec<[u32; 3]> {
    let face = |corners: &[u32; 3]| corners.map(|v| place[v as usize]);
    corners.iter().map(face).collect()
}

/// Per face whether it belongs to a fin: a connected piece of few faces at an edge that larger pieces share.
fn fins(twins: &Twins, crowded: &[Vec<HalfEdgeId>]) -> Vec<bool> {
    let (component, count) = face_components(twins);
    let mut size = vec![0usize; count];
    component.iter().for_each(|&c| size[c as usize] += 1);
    let most = MAX_FIN.min(component.len() / 4);
    let mut fin = vec![false; count];
    for group in crowded.iter().filter(|group| group.len() > 2) {
        let pieces = || group.iter().map(|h| component[h.face().index()]);
        // Where everything at an edge is small, its largest piece is the cloth.
        let largest = pieces().max_by_key(|&c| (size[c as usize], Reverse(c)));
        for c in pieces().filter(|&c| Some(c) != largest) {
            fin[c as usize] |= size[c as usize] <= most;
        }
    }
    component.iter().map(|&c| fin[c as usize]).collect()
}

/// The twins of the faces that are no fins, which come off whole, and what
/// [`Topology::non_manifold`](super::topology::Topology::non_manifold) lists of them.
fn without(
    is_fin: &[bool],
    twins: &Twins,
    crowded: &[Vec<HalfEdgeId>],
) -> (Twins, Vec<HalfEdgeId>) {
    let mut number = vec![0; is_fin.len()];
    let kept = number.iter_mut().zip(is_fin).filter(|(_, fin)| !**fin);
    (0u32..).zip(kept).for_each(|(k, (number, _))| *number = k);
    let renumbered = |h: HalfEdgeId| FaceId(number[h.face().index()]).half_edges()[h.corner()];
    let is_kept = |h: &HalfEdgeId| !is_fin[h.face().index()];
    let is_shared = |group: &&Vec<HalfEdgeId>| group.iter().filter(|h| is_kept(h)).count() > 1;
    let shared = crowded.iter().filter(is_shared).flatten();
    let unjoined = shared.filter(|h| is_kept(h) && twins.twin(**h).is_none());
    let mut non_manifold: Vec<HalfEdgeId> = unjoined.map(|&h| renumbered(h)).collect();
    non_manifold.sort_unstable();
    non_manifold.dedup();
    let half_edges = (0..twins.half_edges() as u32)
        .map(HalfEdgeId)
        .filter(is_kept);
    let twins = half_edges.map(|h| twins.twin(h).map(renumbered)).collect();
    (twins, non_manifold)
}

impl Sources {
    /// The faces whose indices pass a test.
    fn only(self, test: impl Fn(usize) -> bool) -> Sources {
        Sources {
            soup_faces: SoupFaces::Listed(filtered(self.soup_faces.iter(), &test)),
            two_sided: filtered(self.two_sided, &test),
        }
    }
}

/// The values whose indices pass a test.
fn filtered<T>(values: impl IntoIterator<Item = T>, test: impl Fn(usize) -> bool) -> Vec<T> {
    let each = values.into_iter().enumerate();
    each.filter(|(f, _)| test(*f))
        .map(|(_, value)| value)
        .collect()
}

impl Working {
    /// The faces whose indices pass a test.
    fn only(self, test: impl Fn(usize) -> bool) -> Working {
        Working {
            corners: filtered(self.corners, &test),
            sources: self.sources.only(test),
        }
    }

    /// Splits faces at the vertices on their edges; `junctions` are in the order of edges, and along each.
    fn split(self, junctions: &[Junction]) -> Working {
        let mut out = Vec::new();
        let (mut soup_faces, mut two_sided) = (Vec::new(), Vec::new());
        let mut by_face = junctions.chunk_by(|x, y| x.half_edge.face() == y.half_edge.face());
        let mut next = by_face.next();
        for (f, corners) in (0u32..).zip(self.corners) {
            let own = next.filter(|on| on[0].half_edge.face() == FaceId(f));
            let parts = match own {
                Some(on) => {
                    next = by_face.next();
                    parts(FaceId(f), corners, on)
                }
                None => vec![corners],
            };
            let own = self.sources.soup_faces.of(FaceId(f));
            soup_faces.extend(parts.iter().filter_map(|_| own));
            let is_two_sided = self.sources.two_sided.get(f as usize);
            two_sided.extend(parts.iter().filter_map(|_| is_two_sided));
            out.extend(parts);
        }
        Working {
            corners: out,
            sources: Sources {
                soup_faces: SoupFaces::Listed(soup_faces),
                two_sided,
            },
        }
    }
}

/// The parts of a face whose edges have further vertices: fans from the opposite corners, one edge after another.
fn parts(face: FaceId, corners: [u32; 3], junctions: &[Junction]) -> Vec<[u32; 3]> {
    let on = |side: usize| {
        let on_side = junctions
            .iter()
            .filter(move |j| j.half_edge == face.half_edges()[side]);
        on_side.map(|j| j.place)
    };
    let mut parts = vec![corners];
    for side in 0..3 {
        let (from, to) = (corners[side], corners[(side + 1) % 3]);
        // The one part that has the whole edge, and its corner across.
        let Some((at, across)) = parts.iter().enumerate().find_map(|(at, part)| {
            let k = (0..3).find(|&k| part[k] == from && part[(k + 1) % 3] == to)?;
            Some((at, part[(k + 2) % 3]))
        }) else {
            continue;
        };
        let stops: Vec<u32> = [from].into_iter().chain(on(side)).chain([to]).collect();
        let fan = stops.windows(2).map(|ends| [ends[0], ends[1], across]);
        let fan: Vec<[u32; 3]> = fan.collect();
        parts.splice(at..=at, fan);
    }
    parts
}
