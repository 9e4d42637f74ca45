//! Closes stretches of the cloth's own edge for mending: a helper strip of triangles lies outside the line that the new
//! hem shall follow, so that a bite, a rip or the gap between two torn edges becomes a hole like any other. The strips
//! are part of the welded surface only; they are never written.

use std::collections::HashMap;

use crate::bites::{Bite, bites};
use crate::cut::{Pieces, edge_ends, renumbered};
use crate::error::MendError;
use crate::hem_strip::{HemEnd, HemVertices, NewHem, Way};
use crate::tears::tears;
use crate::welded_scan::WeldedScan;
use darn_budget::{Budget, Exhausted, Steps};
use darn_contract::{Border, Constraints, FieldError, HoleSelector, TornEdge, v1};
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::mesh::nearest::distance_to_segment;
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::Scan;

/// Nanoseconds of work a vertex of the borders for a point that is looked for.
const VERTEX_WORK: u64 = 10;

/// The bites and tears at the cloth's own edge, as `POST /holes` lists them.
///
/// # Errors
/// `Exhausted`.
pub fn candidates(
    welded: &WeldedScan,
    budget: &Budget,
) -> Result<Vec<v1::BorderCandidate>, Exhausted> {
    let place = |rim: &BoundaryLoop, k: usize| -> Vec<f64> {
        welded.rim_position(rim, k).iter().copied().collect()
    };
    let bites = all_bites(welded, budget)?.into_iter();
    let bites = bites.map(|(rim, bite)| v1::BorderCandidate {
        r#loop: rim.id.0,
        length: bite.length,
        mouth: bite.mouth,
        depth: bite.depth,
        border: Some(v1::Border {
            from: place(rim, bite.from),
            to: place(rim, bite.to),
            ..v1::Border::default()
        }),
        facing_loop: None,
    });
    let rims: Vec<&BoundaryLoop> = borders(welded).collect();
    let tears = tears(welded, &rims, budget)?.into_iter();
    let tears = tears.map(|tear| {
        let [own, facing] = tear.edges;
        v1::BorderCandidate {
            r#loop: own.rim.id.0,
            length: own.length,
            mouth: tear.gap,
            depth: 0.0,
            border: Some(v1::Border {
                from: place(own.rim, own.from),
                to: place(own.rim, own.to),
                facing: Some(v1::TornEdge {
                    from: place(facing.rim, facing.from),
                    to: place(facing.rim, facing.to),
                }),
                ..v1::Border::default()
            }),
            facing_loop: Some(facing.rim.id.0),
        }
    });
    Ok(bites.chain(tears).collect())
}

fn all_bites<'a>(
    welded: &'a WeldedScan,
    budget: &Budget,
) -> Result<Vec<(&'a BoundaryLoop, Bite)>, Exhausted> {
    let mut all = Vec::new();
    for rim in borders(welded) {
        let found = bites(&welded.surface.mesh, &welded.topology, rim, budget)?;
        all.extend(found.into_iter().map(|bite| (rim, bite)));
    }
    Ok(all)
}

/// The loops that are the cloth's own edge.
fn borders(welded: &WeldedScan) -> impl Iterator<Item = &BoundaryLoop> {
    (welded.loops.iter()).filter(|rim| rim.kind != LoopKind::Hole && !rim.vertices.is_empty())
}

/// A stretch of a loop.
#[derive(Clone, Copy)]
struct Stretch<'a> {
    rim: &'a BoundaryLoop,
    /// Its first vertex in the loop.
    from: usize,
    /// How many edges it has.
    edges: usize,
}

impl<'a> Stretch<'a> {
    fn to(&self) -> usize {
        (self.from + self.edges) % self.rim.vertices.len()
    }

    /// The loop's vertices that it lies between and at.
    fn vertices(&self) -> impl Iterator<Item = usize> {
        let n = self.rim.vertices.len();
        (self.from..=self.from + self.edges).map(move |k| k % n)
    }

    /// The places of these vertices, scene space.
    fn places(&self, whole: &WeldedScan) -> impl Iterator<Item = Vec3> {
        let places = self.from..=self.from + self.edges;
        places.map(|k| whole.rim_position(self.rim, k))
    }

    fn overlaps(&self, other: &Stretch) -> bool {
        let n = self.rim.vertices.len();
        let within = |s: &Stretch, vertex: usize| (vertex + n - s.from) % n <= s.edges;
        self.rim.id == other.rim.id && (within(self, other.from) || within(other, self.from))
    }

    /// The hems that leave its first and its last vertex, of this many edges.
    fn hems(&self, edges: usize) -> [HemEnd<'a>; 2] {
        [(self.from, Way::Back), (self.to(), Way::On)].map(|(vertex, way)| HemEnd {
            rim: self.rim,
            vertex,
            way,
            edges,
        })
    }
}

/// What is closed to one hole.
enum Closing<'a> {
    /// A stretch, by a line through these points.
    Stretch(Stretch<'a>, Vec<Vec3>),
    /// What lies between two torn edges, by two lines.
    Tear([Stretch<'a>; 2]),
}

impl<'a> Closing<'a> {
    fn stretches(&self) -> &[Stretch<'a>] {
        match self {
            Closing::Stretch(stretch, _) => std::slice::from_ref(stretch),
            Closing::Tear(edges) => edges,
        }
    }

    /// The lines that close it, in the direction of the first stretch's loop.
    fn hems(&self, whole: &WeldedScan) -> Vec<NewHem<'_>> {
        let rest = |stretch: &Stretch| stretch.rim.vertices.len() - stretch.edges;
        let [first, second] = match self {
            Closing::Stretch(stretch, along) => {
                let [before, after] = stretch.hems(rest(stretch));
                return vec![NewHem {
                    before,
                    after,
                    along,
                }];
            }
            Closing::Tear(edges) => edges,
        };
        // On one loop, the hem from one edge to the other belongs to both.
        let room = |stretch: &Stretch| match first.rim.id == second.rim.id {
            true => ahead(first.rim, first.to(), second.from).min(ahead(
                first.rim,
                second.to(),
                first.from,
            )),
            false => rest(stretch),
        };
        let [before, after] = first.hems(room(first));
        let [other_before, other_after] = second.hems(room(second));
        let far = |a: &HemEnd, b: &HemEnd| (a.place(whole, 0) - b.place(whole, 0)).norm();
        // A loop has the cloth on its left. Where both pieces show the same side, one loop runs along the gap against the other.
        let same_side = far(&before, &other_after) + far(&other_before, &after);
        let other_side = far(&before, &other_before) + far(&other_after, &after);
        let [next, last] = match same_side <= other_side {
            true => [other_after, other_before],
            false => [other_before, other_after],
        };
        let between = |before, after| NewHem {
            before,
            after,
            along: &[],
        };
        vec![between(before, next), between(last, after)]
    }

    /// What it is, for the report; `lines` are its new hems.
    fn told(&self, lines: &[Vec<Vec3>]) -> String {
        let edges: Vec<String> = (lines.iter().map(|line| (line.len() - 1).to_string())).collect();
        let edges = edges.join(" and ");
        match self {
            Closing::Stretch(..) => format!(
                "is a stretch of the cloth's own edge, mended up to a new hem of {edges} edge(s)"
            ),
            Closing::Tear([first, second]) => format!(
                "lies between torn edges of loops {} and {}, mended up to new hems of {edges} edge(s)",
                first.rim.id, second.rim.id
            ),
        }
    }
}

/// A hole that strips close.
struct Closed {
    /// Index in the request's `holes`.
    entry: usize,
    /// Its new hems.
    lines: Vec<Vec<Vec3>>,
    /// What it is.
    told: String,
}

/// The surface with the stretches closed that a request names, each as a hole; as it is when it names none.
///
/// # Errors
/// `Constraints` for a stretch that cannot be closed; `Exhausted`.
pub fn closed(
    scan: &Scan,
    whole: WeldedScan,
    constraints: &Constraints,
    budget: &Budget,
) -> Result<WeldedScan, MendError> {
    let mut wrong = Vec::new();
    let mut closings: Vec<(usize, Closing)> = Vec::new();
    for (entry, selector) in constraints.holes.iter().enumerate() {
        let HoleSelector::Border(border) = selector else {
            continue;
        };
        match closings_of(&whole, border, budget)? {
            Ok(named) => closings.extend(named.into_iter().map(|closing| (entry, closing))),
            Err(detail) => wrong.push(border_error(entry, detail)),
        }
    }
    let (mut surface, mut closed) = (TriMesh::default(), Vec::new());
    if !closings.is_empty() {
        budget.hold(scan.surface.positions.len() * 24 + scan.surface.faces.len() * 12)?;
        surface = scan.surface.clone();
    }
    let mut used = HemVertices::default();
    for (entry, closing) in closings {
        let mut stretches = closing.stretches().iter();
        if stretches.any(|s| s.vertices().any(|v| used.has(s.rim, v))) {
            // The same bite, named once more.
            continue;
        }
        let hems = closing.hems(&whole).into_iter();
        let lines = hems.map(|hem| hem.add_strip(&whole, &mut used, &mut surface));
        match lines.collect::<Result<Vec<_>, String>>() {
            Ok(lines) => closed.push(Closed {
                entry,
                told: closing.told(&lines),
                lines,
            }),
            Err(detail) => wrong.push(border_error(entry, detail)),
        }
    }
    if !wrong.is_empty() {
        return Err(MendError::Constraints(wrong));
    }
    if closed.is_empty() {
        return Ok(whole);
    }
    with_strips(scan, whole, &surface, &closed, budget)
}

fn border_error(entry: usize, detail: impl Into<String>) -> FieldError {
    FieldError::new(format!("/holes/{entry}/border"), detail)
}

/// Welds the surface with the strips, and finds the holes that they close.
fn with_strips(
    scan: &Scan,
    whole: WeldedScan,
    surface: &TriMesh,
    closed: &[Closed],
    budget: &Budget,
) -> Result<WeldedScan, MendError> {
    let mut across = HashMap::new();
    for (k, Closed { lines, .. }) in (0u32..).zip(closed) {
        for ends in lines.iter().flat_map(|line| line.windows(2)) {
            // The hole's loop runs along a line the one way or the other, as the pieces' sides lie.
            across.insert(edge_ends(&ends[1], &ends[0]), k);
            across.insert(edge_ends(&ends[0], &ends[1]), k);
        }
    }
    let mut welded = WeldedScan::of_surface(scan, surface, budget)?;
    let pieces = Pieces::of_lines(&whole, across, closed.len());
    let around = pieces.loops_around(&welded);
    let (loops, ids) = renumbered(&welded, &whole, &pieces, &around);
    welded.with_loops(scan, loops, budget)?;
    welded.timings.weld += whole.timings.weld;
    welded.timings.loops += whole.timings.loops;
    welded.cuts = whole.cuts;
    let mut wrong = Vec::new();
    for (k, Closed { entry, told, .. }) in (0u32..).zip(closed) {
        let holes = (around.iter().zip(&ids)).filter(|(near, _)| near.runs_along(k));
        let holes: Vec<u32> = holes.map(|(_, id)| *id).collect();
        let [hole] = holes[..] else {
            let detail = "the new hem does not close the stretch to one hole: it touches the cloth in between";
            wrong.push(border_error(*entry, detail));
            continue;
        };
        welded.cuts.add_hole(*entry, hole);
        welded.cuts.notes.push(format!("hole {hole} {told}"));
    }
    match wrong.is_empty() {
        true => Ok(welded),
        false => Err(MendError::Constraints(wrong)),
    }
}

/// What an entry closes, or why it closes nothing.
fn closings_of<'a>(
    whole: &'a WeldedScan,
    border: &Border,
    budget: &Budget,
) -> Result<Result<Vec<Closing<'a>>, String>, Exhausted> {
    let (ends, along) = match border {
        Border::Auto => {
            let found = all_bites(whole, budget)?.into_iter();
            let stretch = |(rim, bite): (&'a BoundaryLoop, Bite)| Stretch {
                rim,
                from: bite.from,
                edges: ahead(rim, bite.from, bite.to),
            };
            let all: Vec<Closing> = found
                .map(|bite| Closing::Stretch(stretch(bite), Vec::new()))
                .collect();
            let detail = "no bite or rip was found at the cloth's own edge; name its ends by `from` and `to`";
            return Ok(match all.is_empty() {
                true => Err(detail.to_owned()),
                false => Ok(all),
            });
        }
        Border::Tear([first, second]) => {
            let ends = |edge: &TornEdge| [edge.from, edge.to].map(Vec3::from);
            // Of the two ways along a piece's edge, the one that lies along the other torn edge.
            let named = |own: &TornEdge, other: &TornEdge| {
                let [from, to] = ends(other);
                let away = |stretch: &Stretch| {
                    let places = stretch
                        .places(whole)
                        .map(|p| distance_to_segment(&p, &from, &to));
                    places.sum::<f64>() / (stretch.edges + 1) as f64
                };
                stretch_between(whole, ends(own), &away, budget)
            };
            let (first, second) = (named(first, second)?, named(second, first)?);
            return Ok(first.and_then(|first| {
                let second = second.map_err(|detail| format!("in `facing`, {detail}"))?;
                let edges = [first.stretch, second.stretch];
                match edges[0].overlaps(&edges[1]) {
                    true => Err("`facing` names an edge that overlaps the stretch".to_owned()),
                    false => Ok(vec![Closing::Tear(edges)]),
                }
            }));
        }
        Border::Line { from, to, along } => ([*from, *to].map(Vec3::from), along),
    };
    let length = |stretch: &Stretch| -> f64 {
        let places: Vec<Vec3> = stretch.places(whole).collect();
        places
            .windows(2)
            .map(|ends| (ends[1] - ends[0]).norm())
            .sum()
    };
    let stretch = stretch_between(whole, ends, &length, budget)?;
    Ok(stretch.map(|named| {
        let mut along: Vec<Vec3> = along.iter().map(|p| Vec3::from(*p)).collect();
        if named.runs_back {
            along.reverse();
        }
        vec![Closing::Stretch(named.stretch, along)]
    }))
}

/// A way along a loop between two points.
struct NamedStretch<'a> {
    stretch: Stretch<'a>,
    /// Whether it starts at the second point.
    runs_back: bool,
}

/// The stretch of the cloth's own edge between the places nearest to two points, of the two ways the one with the smaller `cost`; or why there
/// is none.
fn stretch_between<'a>(
    whole: &'a WeldedScan,
    [from, to]: [Vec3; 2],
    cost: &dyn Fn(&Stretch) -> f64,
    budget: &Budget,
) -> Result<Result<NamedStretch<'a>, String>, Exhausted> {
    let mut steps = Steps::of(budget);
    type Nearest<'r> = Option<(f64, &'r BoundaryLoop, usize)>;
    let mut nearest = |point: &Vec3, rims: &[&'a BoundaryLoop]| -> Result<Nearest<'a>, Exhausted> {
        let mut best: Nearest<'a> = None;
        for rim in rims {
            steps.take(VERTEX_WORK * rim.vertices.len() as u64)?;
            for k in 0..rim.vertices.len() {
                let distance = (whole.rim_position(rim, k) - point).norm();
                if best.is_none_or(|(least, ..)| distance < least) {
                    best = Some((distance, *rim, k));
                }
            }
        }
        Ok(best)
    };
    let rims: Vec<&BoundaryLoop> = borders(whole).collect();
    let Some((_, rim, start)) = nearest(&from, &rims)? else {
        return Ok(Err("the scan's cloth has no edge of its own".to_owned()));
    };
    let Some((_, _, end)) = nearest(&to, &[rim])? else {
        return Ok(Err("the scan's cloth has no edge of its own".to_owned()));
    };
    if start == end {
        let detail = "`from` and `to` are nearest to the same vertex of the cloth's edge";
        return Ok(Err(detail.to_owned()));
    }
    let way = |from: usize, to: usize| Stretch {
        rim,
        from,
        edges: ahead(rim, from, to),
    };
    let (on, back) = (way(start, end), way(end, start));
    let runs_back = cost(&on) > cost(&back);
    Ok(Ok(NamedStretch {
        stretch: if runs_back { back } else { on },
        runs_back,
    }))
}

/// Edges of a loop from one vertex on to another.
fn ahead(rim: &BoundaryLoop, from: usize, to: usize) -> usize {
    let n = rim.vertices.len();
    (to + n - from) % n
}
