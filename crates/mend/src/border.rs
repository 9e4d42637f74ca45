//! Closes stretches of the cloth's own edge for mending: a helper strip of triangles lies outside the line that the new
//! hem shall follow, so that a bite, a rip or the gap between two torn edges becomes a hole like any other. The strips
//! are part of the welded surface only; they are never written.

use std::collections::HashMap;

use crate::bites::{Bite, bites};
use crate::cut::{Pieces, edge_ends, renumbered};
use crate::error::MendError;
use crate::hem_strip::{HemEnd, HemVertices, NewHem, Way};
use crate::stretch::{Places, Stretch, ahead, into_cloth};
use crate::tears::tears;
use crate::welded_scan::WeldedScan;
use darn_budget::{Budget, Exhausted};
use darn_contract::{Border, Constraints, FieldError, HoleSelector, TornEdge, v1};
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::mesh::nearest::distance_to_segment;
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::Scan;

/// A part of a loop between two torn edges is the end of a rip when it is at most this many times as long as its ends are apart.
const END_OF_A_RIP: f64 = 2.0;

/// The bites and tears at the cloth's own edge, as `POST /holes` lists them.
///
/// # Errors
/// `Exhausted`.
pub fn candidates(
    welded: &WeldedScan,
    budget: &Budget,
) -> Result<Vec<v1::BorderCandidate>, Exhausted> {
    let place = |rim: &BoundaryLoop, k: usize| <[f64; 3]>::from(welded.rim_position(rim, k));
    let bites = all_bites(welded, budget)?.into_iter();
    let bites = bites.map(|(rim, bite)| {
        let border = Border::Line {
            from: place(rim, bite.from),
            to: place(rim, bite.to),
            along: bite.corner.into_iter().map(<[f64; 3]>::from).collect(),
        };
        v1::BorderCandidate {
            r#loop: rim.id.0,
            length: bite.length,
            mouth: bite.mouth,
            depth: bite.depth,
            border: Some(border.into()),
            facing_loop: None,
        }
    });
    let rims: Vec<&BoundaryLoop> = borders(welded).collect();
    let tears = tears(welded, &rims, budget)?.into_iter();
    let tears = tears.map(|tear| {
        let [own, facing] = &tear.edges;
        let border = Border::Tear(tear.edges.each_ref().map(|edge| TornEdge {
            from: place(edge.rim, edge.from),
            to: place(edge.rim, edge.to),
        }));
        v1::BorderCandidate {
            r#loop: own.rim.id.0,
            length: own.length,
            mouth: tear.gap,
            depth: 0.0,
            border: Some(border.into()),
            facing_loop: Some(facing.rim.id.0),
        }
    });
    Ok(bites.chain(tears).collect())
}

/// The bites and torn corners of all loops that are the cloth's own edge.
///
/// # Errors
/// `Exhausted`.
pub fn all_bites<'a>(
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

/// The hems that leave the first and the last vertex of a stretch, of this many edges.
fn hems_of<'a>(stretch: &Stretch<'a>, edges: usize) -> [HemEnd<'a>; 2] {
    [(stretch.from, Way::Back), (stretch.to(), Way::On)].map(|(vertex, way)| HemEnd {
        rim: stretch.rim,
        vertex,
        way,
        edges,
    })
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
                let [before, after] = hems_of(stretch, rest(stretch));
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
        let [before, after] = hems_of(first, room(first));
        let [other_before, other_after] = hems_of(second, room(second));
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
    // What is named by its ends goes before what is found.
    let is_found =
        |entry: usize| matches!(constraints.holes[entry], HoleSelector::Border(Border::Auto));
    closings.sort_by_key(|(entry, _)| is_found(*entry));
    let mut used = HemVertices::default();
    let mut taken: Vec<(usize, Stretch)> = Vec::new();
    let mut notes = Vec::new();
    for (entry, closing) in closings {
        let stretches = closing.stretches();
        let touches = |other: &Stretch| stretches.iter().any(|own| own.overlaps(other));
        let other = taken.iter().find(|(_, other)| touches(other));
        let on_hem = stretches
            .iter()
            .any(|s| s.vertices().any(|v| used.has(s.rim, v)));
        if let Some(detail) = overlap(other.map(|(entry, _)| *entry), on_hem) {
            match is_found(entry) {
                true => notes.push(format!(
                    "/holes/{entry}/border: a bite was left; it {detail}"
                )),
                false => wrong.push(border_error(entry, detail)),
            }
            continue;
        }
        taken.extend(stretches.iter().map(|s| (entry, *s)));
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
    let mut welded = with_strips(scan, whole, &surface, &closed, budget)?;
    welded.cuts.notes.extend(notes);
    Ok(welded)
}

/// Why what an entry names is not closed once more.
fn overlap(other: Option<usize>, on_hem: bool) -> Option<String> {
    match (other, on_hem) {
        (Some(other), _) => Some(format!("overlaps what /holes/{other}/border closes")),
        (None, true) => Some(
            "starts on the hem that another new hem is joined to; mend it in a request of its own"
                .to_owned(),
        ),
        (None, false) => None,
    }
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
    let places = Places::of(whole);
    let (ends, along) = match border {
        Border::Auto => {
            let found = all_bites(whole, budget)?.into_iter();
            let closing = |(rim, bite): (&'a BoundaryLoop, Bite)| {
                let stretch = Stretch {
                    rim,
                    from: bite.from,
                    edges: ahead(rim, bite.from, bite.to),
                };
                Closing::Stretch(stretch, bite.corner.into_iter().collect())
            };
            let all: Vec<Closing> = found.map(closing).collect();
            let detail = "no bite, rip or torn corner was found at the cloth's own edge; name its ends by `from` and `to`";
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
                let ways = places.ways(&ends(own), budget)?;
                Ok::<_, Exhausted>(
                    ways.map(|[on, back]| if away(&on) <= away(&back) { on } else { back }),
                )
            };
            let (first, second) = (named(first, second)?, named(second, first)?);
            return Ok(first.and_then(|first| {
                let second = second.map_err(|detail| format!("in `facing`, {detail}"))?;
                Ok(vec![torn(whole, [first, second])?])
            }));
        }
        Border::Line { from, to, along } => ([*from, *to].map(Vec3::from), along),
    };
    let ways = match places.ways(&ends, budget)? {
        Ok(ways) => ways,
        Err(detail) => return Ok(Err(detail)),
    };
    let runs_on = into_cloth(whole, &ways, budget)?;
    let [on, back] = ways;
    let stretch = if runs_on { on } else { back };
    let mut along: Vec<Vec3> = along.iter().map(|p| Vec3::from(*p)).collect();
    for (k, point) in along.iter().enumerate() {
        let distances = stretch.places(whole).map(|p| (p - point).norm());
        let nearest = distances.fold(f64::INFINITY, f64::min);
        if let Err(detail) = places.within_limit(&format!("along/{k}"), nearest) {
            return Ok(Err(detail));
        }
    }
    if !runs_on {
        along.reverse();
    }
    Ok(Ok(vec![Closing::Stretch(stretch, along)]))
}

/// What closes the gap between two torn edges; or why nothing does.
fn torn<'a>(whole: &WeldedScan, edges: [Stretch<'a>; 2]) -> Result<Closing<'a>, String> {
    let [first, second] = &edges;
    if first.rim.id != second.rim.id {
        let goes_round = |s: &Stretch| matches!(s.rim.kind, LoopKind::TubeEnd | LoopKind::Opening);
        return match goes_round(first) && goes_round(second) {
            true => Err(format!(
                "loops {} and {} are ends of tubes: the gap between them runs all the way round and has no end where a new hem could start; \
                 tubes that are torn in two are not joined",
                first.rim.id, second.rim.id
            )),
            false => Ok(Closing::Tear(edges)),
        };
    }
    // The lips of one rip: what lies between them on the cloth's edge is the rip's end.
    let between = |from: &Stretch<'a>, to: &Stretch<'a>| {
        let end = Stretch {
            rim: from.rim,
            from: from.to(),
            edges: ahead(from.rim, from.to(), to.from),
        };
        let ends = [end.from, end.to()].map(|k| whole.rim_position(end.rim, k));
        let is_short = end.length(whole) <= END_OF_A_RIP * (ends[1] - ends[0]).norm();
        let rip = Stretch {
            rim: from.rim,
            from: from.from,
            edges: from.edges + end.edges + to.edges,
        };
        let is_rip = is_short && rip.edges < rip.rim.vertices.len() && rip.is_bite(whole);
        is_rip.then_some(rip)
    };
    match between(first, second).or_else(|| between(second, first)) {
        Some(rip) => Ok(Closing::Stretch(rip, Vec::new())),
        None if first.overlaps(second) => {
            Err("`facing` names an edge that overlaps the stretch".to_owned())
        }
        None => Ok(Closing::Tear(edges)),
    }
}

#[cfg(test)]
#[path = "border_tests.rs"]
mod tests;
