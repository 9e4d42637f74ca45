//! Cuts damaged cloth out of a scan before its holes are filled: which triangles go, what becomes of the loops, and
//! which holes each cut leaves.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::cut_faces::chosen;
use crate::error::MendError;
use crate::welded_scan::WeldedScan;
use darn_budget::{Budget, Exhausted};
use darn_contract::{Constraints, FieldError, HoleSelector, v1};
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::curvature::face_areas;
use darn_geometry::mesh::index::{FaceId, HalfEdgeId, LoopId, VertexId};
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_gltf_scan::{Scan, ScanError};

/// Nanoseconds of work a face in finding the pieces that are cut out, and the loops around them.
const PIECES_WORK: u64 = 60;
/// Bytes of memory an edge of the loops and of the pieces' borders.
const EDGE: usize = 80;

/// What the cuts of a request made of a scan's loops; by default there were none.
#[derive(Debug, Default)]
pub struct CutLoops {
    /// The holes to fill, by the index of the cut in the request's `holes`.
    entries: BTreeMap<usize, Vec<u32>>,
    /// What was cut out at a hole, by the hole's id.
    reports: BTreeMap<u32, v1::CutReport>,
    /// What a person should know about the cuts.
    pub notes: Vec<String>,
}

impl CutLoops {
    /// The holes that an entry of the request's `holes` left; none where it is no cut.
    pub fn of_entry(&self, index: usize) -> &[u32] {
        self.entries.get(&index).map_or(&[], Vec::as_slice)
    }

    /// Adds a hole to those of an entry.
    pub fn add_hole(&mut self, index: usize, hole: u32) {
        self.entries.entry(index).or_default().push(hole);
    }

    /// What was cut out at a hole.
    pub fn report(&self, hole: u32) -> Option<v1::CutReport> {
        self.reports.get(&hole).copied()
    }
}

/// A scan without the cloth that a request cuts out.
pub struct CutScan {
    /// The scan; its vertices have the numbers they had.
    pub scan: Scan,
    /// Its surface. Loops keep their ids, as [`v1::Loop::id`] says; a loop that is gone is left without vertices.
    pub welded: WeldedScan,
}

impl CutScan {
    /// Cuts out what a request asks for; `None` when it asks for no cut.
    ///
    /// # Errors
    /// `Constraints` for a cut that takes nothing, all of a piece of cloth, or cloth at its own edge; `Exhausted`.
    pub fn of(
        scan: &Scan,
        whole: &WeldedScan,
        constraints: &Constraints,
        budget: &Budget,
    ) -> Result<Option<CutScan>, MendError> {
        let mut wrong = Vec::new();
        let mut entries = Vec::new();
        let mut is_cut = vec![false; scan.surface.faces.len()];
        for (index, selector) in constraints.holes.iter().enumerate() {
            let HoleSelector::Cut(cut) = selector else {
                continue;
            };
            let mut faces = match chosen(scan, whole, cut, budget)? {
                Ok(faces) => faces,
                Err((member, detail)) => {
                    let pointer = format!("/holes/{index}/cut{member}");
                    wrong.push(FieldError::new(pointer, detail));
                    continue;
                }
            };
            scan.spread_to_instances(&mut faces);
            budget.hold(4 * faces.len())?;
            for face in &faces {
                is_cut[*face as usize] = true;
            }
            entries.push(CutEntry { index, faces });
        }
        if !wrong.is_empty() {
            return Err(MendError::Constraints(wrong));
        }
        let Some(first) = entries.first() else {
            return Ok(None);
        };
        if is_cut.iter().all(|cut| *cut) {
            let detail = "takes all of the scan's cloth";
            return Err(MendError::Constraints(vec![first.error(detail)]));
        }
        let rest = scan.without_faces(&is_cut, budget);
        let rest = rest.map_err(|error| match error {
            ScanError::Exhausted(exhausted) => MendError::Exhausted(exhausted),
            other => MendError::Constraints(vec![first.error(&other.to_string())]),
        })?;
        let mut welded = WeldedScan::of(&rest, budget)?;
        budget.spend(PIECES_WORK * (is_cut.len() + rest.surface.faces.len()) as u64)?;
        let pieces = Pieces::of(whole, &is_cut, budget)?;
        let around = pieces.loops_around(&welded);
        let (loops, ids) = renumbered(&welded, whole, &pieces, &around);
        welded.with_loops(&rest, loops, budget)?;
        let around = around
            .into_iter()
            .zip(ids)
            .map(|(near, id)| NearLoop { id, ..near });
        let cut = CutLoopsDraft {
            scan: &rest,
            welded: &welded,
            whole,
            pieces: &pieces,
            around: around.collect(),
        };
        welded.cuts = cut.of_entries(&entries)?;
        welded.timings.weld += whole.timings.weld;
        welded.timings.loops += whole.timings.loops;
        Ok(Some(CutScan { scan: rest, welded }))
    }
}

/// A cut of a request.
struct CutEntry {
    /// Its index in `holes`.
    index: usize,
    /// The faces of the scan's surface that it takes, ascending.
    faces: Vec<u32>,
}

impl CutEntry {
    fn error(&self, detail: &str) -> FieldError {
        FieldError::new(format!("/holes/{}/cut", self.index), detail)
    }
}

/// A place in space, bit for bit; −0 is 0.
pub type Place = [u64; 3];

/// The places of an edge's ends, in its direction.
pub type EdgeEnds = [Place; 2];

/// The place of a point.
pub fn place(p: &Vec3) -> Place {
    [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())
}

/// The ends of a half-edge, in its direction.
fn edge_key(welded: &WeldedScan, half_edge: HalfEdgeId) -> EdgeEnds {
    let at = |v: VertexId| place(&welded.surface.mesh.positions[v.index()]);
    let topology = &welded.topology;
    [
        at(topology.origin(half_edge)),
        at(topology.target(half_edge)),
    ]
}

/// The key of the edge from one place to another.
pub fn edge_ends(from: &Vec3, to: &Vec3) -> EdgeEnds {
    [place(from), place(to)]
}

/// Connected pieces of cloth that are cut out, or that helper strips stand for.
pub struct Pieces {
    /// Per face of the whole surface its piece; `None` where it stays.
    of_face: Vec<Option<u32>>,
    all: Vec<Piece>,
    /// The piece on the other side of a half-edge of the rest.
    across: HashMap<EdgeEnds, u32>,
    /// The loop of the whole scan that runs along a half-edge.
    old_loop: HashMap<EdgeEnds, u32>,
}

#[derive(Default)]
struct Piece {
    faces: u32,
    area: f64,
    /// The loops of the whole scan that bound it.
    loops: BTreeSet<u32>,
}

impl Pieces {
    /// Pieces that stand for lines only, whose edges from one end to the other are given.
    pub fn of_lines(whole: &WeldedScan, across: HashMap<EdgeEnds, u32>, count: usize) -> Pieces {
        let old = whole.loops.iter().flat_map(|rim| {
            let ends = rim.half_edges.iter().map(|h| edge_key(whole, *h));
            ends.map(|ends| (ends, rim.id.0))
        });
        Pieces {
            of_face: Vec::new(),
            all: (0..count).map(|_| Piece::default()).collect(),
            across,
            old_loop: old.collect(),
        }
    }

    fn of(whole: &WeldedScan, is_cut: &[bool], budget: &Budget) -> Result<Pieces, Exhausted> {
        let mesh = &whole.surface.mesh;
        let mut loop_at = HashMap::new();
        let mut old_loop = HashMap::new();
        let edges: usize = whole.loops.iter().map(|rim| rim.half_edges.len()).sum();
        budget.hold(EDGE * edges + 24 * mesh.faces.len())?;
        for rim in &whole.loops {
            for h in &rim.half_edges {
                loop_at.insert(*h, rim.id.0);
                old_loop.insert(edge_key(whole, *h), rim.id.0);
            }
        }
        let areas = face_areas(mesh);
        let goes = |f: FaceId| {
            let own = whole.surface.soup_faces.of(f);
            own.is_some_and(|own| is_cut[own as usize])
        };
        let mut of_face: Vec<Option<u32>> = vec![None; mesh.faces.len()];
        let mut all: Vec<Piece> = Vec::new();
        let mut across = HashMap::new();
        let mut open = Vec::new();
        for seed in (0..mesh.faces.len() as u32).map(FaceId) {
            if !goes(seed) || of_face[seed.index()].is_some() {
                continue;
            }
            let number = all.len() as u32;
            let mut piece = Piece::default();
            of_face[seed.index()] = Some(number);
            open.push(seed);
            while let Some(face) = open.pop() {
                piece.faces += 1;
                piece.area += areas[face.index()];
                for h in face.half_edges() {
                    let Some(twin) = whole.topology.twin(h) else {
                        piece.loops.extend(loop_at.get(&h));
                        continue;
                    };
                    if !goes(twin.face()) {
                        across.insert(edge_key(whole, twin), number);
                    } else if of_face[twin.face().index()].is_none() {
                        of_face[twin.face().index()] = Some(number);
                        open.push(twin.face());
                    }
                }
            }
            all.push(piece);
        }
        budget.hold(EDGE * across.len())?;
        Ok(Pieces {
            of_face,
            all,
            across,
            old_loop,
        })
    }

    /// What each loop of the rest runs along.
    pub fn loops_around(&self, rest: &WeldedScan) -> Vec<NearLoop> {
        let near = |rim: &BoundaryLoop| {
            let keys = || rim.half_edges.iter().map(|h| edge_key(rest, *h));
            NearLoop {
                id: rim.id.0,
                pieces: keys()
                    .filter_map(|k| self.across.get(&k).copied())
                    .collect(),
                old: keys()
                    .filter_map(|k| self.old_loop.get(&k).copied())
                    .collect(),
            }
        };
        rest.loops.iter().map(near).collect()
    }
}

/// A loop of the rest, and what it runs along.
pub struct NearLoop {
    id: u32,
    /// Pieces that were cut out.
    pieces: BTreeSet<u32>,
    /// Loops of the whole scan.
    old: BTreeSet<u32>,
}

impl NearLoop {
    /// Whether it runs along a piece.
    pub fn runs_along(&self, piece: u32) -> bool {
        self.pieces.contains(&piece)
    }
}

/// The old ids that a new loop may take.
type Candidates<'a> = &'a dyn Fn(&NearLoop) -> BTreeSet<u32>;

/// The loops of the rest at their ids, and these in the order that the loops have there. A loop keeps the lowest id of
/// those that it runs along, then of those that its pieces lay at; new ones are numbered on. A loop of the whole scan
/// whose id nobody keeps stays as an outer boundary without vertices.
pub fn renumbered(
    rest: &WeldedScan,
    whole: &WeldedScan,
    pieces: &Pieces,
    around: &[NearLoop],
) -> (Vec<BoundaryLoop>, Vec<u32>) {
    let mut taken = BTreeSet::new();
    let mut ids: Vec<Option<u32>> = vec![None; around.len()];
    let beside = |near: &NearLoop| -> BTreeSet<u32> {
        let all = near.pieces.iter().map(|p| &pieces.all[*p as usize]);
        all.flat_map(|piece| piece.loops.iter().copied()).collect()
    };
    let untouched = |near: &NearLoop| match near.pieces.is_empty() {
        true => near.old.clone(),
        false => BTreeSet::new(),
    };
    // What a line closes is no loop that was there before, though it runs along the cloth's own edge.
    let is_closed = |near: &NearLoop| {
        near.pieces
            .iter()
            .any(|p| pieces.all[*p as usize].faces == 0)
    };
    let along = |near: &NearLoop| match is_closed(near) {
        true => BTreeSet::new(),
        false => near.old.clone(),
    };
    let steps: [Candidates; 3] = [&untouched, &along, &beside];
    for candidates in steps {
        for (id, near) in ids.iter_mut().zip(around) {
            if id.is_none() {
                *id = candidates(near).into_iter().find(|old| taken.insert(*old));
            }
        }
    }
    let mut next = whole.loops.len() as u32;
    let ids: Vec<u32> = (ids.into_iter())
        .map(|id| {
            id.unwrap_or_else(|| {
                next += 1;
                next - 1
            })
        })
        .collect();
    let gone = (whole.loops.iter())
        .filter(|rim| !taken.contains(&rim.id.0))
        .map(|rim| BoundaryLoop {
            vertices: Vec::new(),
            half_edges: Vec::new(),
            length: 0.0,
            area: 0.0,
            component: u32::MAX,
            kind: LoopKind::Outer,
            non_manifold: false,
            ..rim.clone()
        });
    let kept = rest.loops.iter().zip(&ids).map(|(rim, id)| BoundaryLoop {
        id: LoopId(*id),
        ..rim.clone()
    });
    let mut loops: Vec<BoundaryLoop> = kept.chain(gone).collect();
    loops.sort_by_key(|rim| rim.id);
    (loops, ids)
}

/// What the holes of each cut are found from.
struct CutLoopsDraft<'a> {
    scan: &'a Scan,
    welded: &'a WeldedScan,
    whole: &'a WeldedScan,
    pieces: &'a Pieces,
    around: Vec<NearLoop>,
}

impl CutLoopsDraft<'_> {
    /// The holes of every cut.
    ///
    /// # Errors
    /// `Constraints` for each cut that leaves no hole.
    fn of_entries(&self, entries: &[CutEntry]) -> Result<CutLoops, MendError> {
        let mut cuts = CutLoops::default();
        let mut wrong = Vec::new();
        for entry in entries {
            let pieces = self.pieces_of(entry);
            let holes: BTreeSet<u32> = pieces.iter().flat_map(|p| self.holes_of(*p)).collect();
            if holes.is_empty() {
                wrong.push(entry.error(&self.why_none(&pieces)));
                continue;
            }
            cuts.notes.extend(self.note(entry, &pieces));
            for hole in &holes {
                cuts.reports.insert(*hole, self.report(*hole));
            }
            cuts.entries
                .insert(entry.index, holes.into_iter().collect());
        }
        match wrong.is_empty() {
            true => Ok(cuts),
            false => Err(MendError::Constraints(wrong)),
        }
    }

    fn pieces_of(&self, entry: &CutEntry) -> BTreeSet<u32> {
        let soup_faces = self.whole.surface.soup_faces.iter();
        let own = soup_faces.zip(&self.pieces.of_face);
        own.filter(|(soup, _)| entry.faces.binary_search(soup).is_ok())
            .filter_map(|(_, piece)| *piece)
            .collect()
    }

    fn loop_of(&self, near: &NearLoop) -> &BoundaryLoop {
        &self.welded.loops[near.id as usize]
    }

    /// The loops around a piece.
    fn around(&self, piece: u32) -> impl Iterator<Item = &NearLoop> {
        (self.around.iter()).filter(move |near| near.pieces.contains(&piece))
    }

    /// The loop of the whole scan that is no hole and that a loop runs along.
    fn own_edge(&self, near: &NearLoop) -> Option<&BoundaryLoop> {
        let mut old = near.old.iter().map(|id| &self.whole.loops[*id as usize]);
        old.find(|rim| rim.kind != LoopKind::Hole)
    }

    /// The holes around a piece: the one loop around it, whatever its kind, since the cloth was whole there; of several,
    /// those that are holes, since the others surround what was cut off.
    fn holes_of(&self, piece: u32) -> Vec<u32> {
        let inner: Vec<&NearLoop> = (self.around(piece))
            .filter(|near| self.own_edge(near).is_none())
            .filter(|near| self.welded.on_first_instance(self.scan, self.loop_of(near)))
            .collect();
        let is_only = inner.len() == 1 && self.around(piece).count() == 1;
        (inner.into_iter())
            .filter(|near| match self.loop_of(near).kind {
                LoopKind::Hole | LoopKind::Opening => true,
                LoopKind::Outer => false,
                _ => is_only,
            })
            .map(|near| near.id)
            .collect()
    }

    /// Why a cut leaves no hole.
    fn why_none(&self, pieces: &BTreeSet<u32>) -> String {
        let around = || pieces.iter().flat_map(|p| self.around(*p));
        if let Some(rim) = around().find_map(|near| self.own_edge(near)) {
            let what = match rim.kind {
                LoopKind::TubeEnd => "the end of a tube",
                LoopKind::Opening => "an opening",
                _ => "the cloth's own edge",
            };
            return format!(
                "reaches {what} (loop {}); a cut leaves cloth on all sides, so that a hole is left to mend",
                rim.id
            );
        }
        if around().next().is_none() {
            return "takes a whole piece of cloth: no rim is left to mend from".to_owned();
        }
        "leaves no hole: it goes all around the cloth, and cuts one part of it from the other"
            .to_owned()
    }

    /// What a person should know about a cut that leaves a hole.
    fn note(&self, entry: &CutEntry, pieces: &BTreeSet<u32>) -> Option<String> {
        let whole = pieces.iter().filter(|p| self.around(**p).next().is_none());
        let whole = whole.count();
        let sides = pieces.iter().filter(|p| !self.holes_of(**p).is_empty());
        let sides = sides.count();
        let open = pieces.len() - whole - sides;
        let mut parts = Vec::new();
        if sides > 1 {
            parts.push(format!(
                "took cloth in {sides} places that are not connected within it (layers, or folds)"
            ));
        }
        if whole > 0 {
            parts.push(format!("took {whole} loose piece(s) whole"));
        }
        if open > 0 {
            parts.push(format!(
                "took cloth at {open} place(s) where no hole is left, such as the cloth's own edge; they stay open"
            ));
        }
        (!parts.is_empty()).then(|| format!("cut {} {}", entry.index, parts.join(", and ")))
    }

    /// What was cut out at a hole.
    fn report(&self, hole: u32) -> v1::CutReport {
        let near = self.around.iter().filter(|near| near.id == hole);
        let pieces = near.flat_map(|near| &near.pieces);
        let mut report = v1::CutReport::default();
        for piece in pieces.map(|p| &self.pieces.all[*p as usize]) {
            report.faces += piece.faces;
            report.area += piece.area;
        }
        report
    }
}
