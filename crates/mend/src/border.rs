//! Closes stretches of the cloth's own edge for mending: a helper strip of triangles lies outside the line that the new
//! hem shall follow, so that a bite or a rip becomes a hole like any other. The strip is part of the welded surface
//! only; it is never written.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;

use crate::bites::{Bite, bites};
use crate::cut::{Pieces, edge_ends, renumbered};
use crate::error::MendError;
use crate::welded_scan::WeldedScan;
use darn_budget::{Budget, Exhausted, Steps};
use darn_contract::{Border, Constraints, FieldError, HoleSelector, v1};
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::Scan;

/// Edges of the hem on each side of a stretch that the strip lies along: it must be joined to the cloth by edges, and
/// shows the fill where the hem goes.
const OVERLAP: usize = 4;
/// Edges of the hem on each side that its direction is taken from.
const HEM: usize = 8;
/// Rows of the strip, each as wide as an edge of the hem.
const ROWS: usize = 3;
/// Most points of a new line of hem.
const MOST_POINTS: usize = 4096;
/// Nanoseconds of work a vertex of the borders for a point that is looked for.
const VERTEX_WORK: u64 = 10;

/// The bites at the cloth's own edge, as `POST /holes` lists them.
///
/// # Errors
/// `Exhausted`.
pub fn candidates(
    welded: &WeldedScan,
    budget: &Budget,
) -> Result<Vec<v1::BorderCandidate>, Exhausted> {
    let mut candidates = Vec::new();
    for (rim, bite) in all_bites(welded, budget)? {
        let place = |k: usize| -> Vec<f64> { at(welded, rim, k).iter().copied().collect() };
        let (from, to) = (place(bite.from), place(bite.to));
        candidates.push(v1::BorderCandidate {
            r#loop: rim.id.0,
            length: bite.length,
            mouth: bite.mouth,
            depth: bite.depth,
            border: Some(v1::Border {
                from,
                to,
                ..v1::Border::default()
            }),
        });
    }
    Ok(candidates)
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

/// The place of a loop's vertex, counted on around the loop.
fn at(welded: &WeldedScan, rim: &BoundaryLoop, k: usize) -> Vec3 {
    welded.surface.mesh.positions[rim.vertices[k % rim.vertices.len()].index()]
}

/// A stretch of a loop and the line that closes it.
struct Stretch<'a> {
    /// Index in the request's `holes`.
    entry: usize,
    rim: &'a BoundaryLoop,
    /// Its first vertex in the loop.
    from: usize,
    /// How many edges it has.
    edges: usize,
    /// Points that the line goes through.
    along: Vec<Vec3>,
}

impl Stretch<'_> {
    fn to(&self) -> usize {
        self.from + self.edges
    }

    /// The loop's vertices that it lies between and at.
    fn vertices(&self) -> impl Iterator<Item = usize> {
        let n = self.rim.vertices.len();
        (self.from..=self.to()).map(move |k| k % n)
    }
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
    let mut stretches: Vec<Stretch> = Vec::new();
    for (entry, selector) in constraints.holes.iter().enumerate() {
        let HoleSelector::Border(border) = selector else {
            continue;
        };
        match stretches_of(&whole, entry, border, budget)? {
            Ok(named) => stretches.extend(named),
            Err(detail) => {
                let pointer = format!("/holes/{entry}/border");
                wrong.push(FieldError::new(pointer, detail));
            }
        }
    }
    let (mut surface, mut strips) = (TriMesh::default(), Vec::new());
    if !stretches.is_empty() {
        budget.hold(scan.surface.positions.len() * 24 + scan.surface.faces.len() * 12)?;
        surface = scan.surface.clone();
    }
    let mut taken: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
    for stretch in stretches {
        let used = taken.entry(stretch.rim.id.0).or_default();
        if stretch.vertices().any(|v| used.contains(&v)) {
            // The same bite, named once more.
            continue;
        }
        match strip(&whole, &stretch, used, &mut surface) {
            Ok(line) => strips.push((stretch.entry, line)),
            Err(detail) => {
                let pointer = format!("/holes/{}/border", stretch.entry);
                wrong.push(FieldError::new(pointer, detail));
            }
        }
    }
    if !wrong.is_empty() {
        return Err(MendError::Constraints(wrong));
    }
    if strips.is_empty() {
        return Ok(whole);
    }
    with_strips(scan, whole, &surface, &strips, budget)
}

/// Welds the surface with the strips, and finds the holes that they close.
fn with_strips(
    scan: &Scan,
    whole: WeldedScan,
    surface: &TriMesh,
    strips: &[(usize, Vec<Vec3>)],
    budget: &Budget,
) -> Result<WeldedScan, MendError> {
    let mut across = HashMap::new();
    for (k, (_, line)) in (0u32..).zip(strips) {
        for ends in line.windows(2) {
            across.insert(edge_ends(&ends[1], &ends[0]), k);
        }
    }
    let mut welded = WeldedScan::of_surface(scan, surface, budget)?;
    let pieces = Pieces::of_lines(&whole, across, strips.len());
    let around = pieces.loops_around(&welded);
    let (loops, ids) = renumbered(&welded, &whole, &pieces, &around);
    welded.renumbered(loops, budget)?;
    welded.timings.weld += whole.timings.weld;
    welded.timings.loops += whole.timings.loops;
    welded.cuts = whole.cuts;
    let mut wrong = Vec::new();
    for (k, (entry, line)) in (0u32..).zip(strips) {
        let holes = (around.iter().zip(&ids)).filter(|(near, _)| near.runs_along(k));
        let holes: Vec<u32> = holes.map(|(_, id)| *id).collect();
        let [hole] = holes[..] else {
            let detail =
                "the line does not close the stretch to one hole: it touches the cloth in between";
            wrong.push(FieldError::new(format!("/holes/{entry}/border"), detail));
            continue;
        };
        welded.cuts.add_hole(*entry, hole);
        welded.cuts.notes.push(format!(
            "hole {hole} is a stretch of the cloth's own edge, mended up to a new hem of {} edge(s)",
            line.len() - 1
        ));
    }
    match wrong.is_empty() {
        true => Ok(welded),
        false => Err(MendError::Constraints(wrong)),
    }
}

/// The stretches that an entry names, or why it names none.
fn stretches_of<'a>(
    whole: &'a WeldedScan,
    entry: usize,
    border: &Border,
    budget: &Budget,
) -> Result<Result<Vec<Stretch<'a>>, String>, Exhausted> {
    let (from, to, along) = match border {
        Border::Auto => {
            let found = all_bites(whole, budget)?.into_iter();
            let all: Vec<Stretch> = found
                .map(|(rim, bite)| Stretch {
                    entry,
                    rim,
                    from: bite.from,
                    edges: ahead(rim, bite.from, bite.to),
                    along: Vec::new(),
                })
                .collect();
            if all.is_empty() {
                let detail = "no bite or rip was found at the cloth's own edge; name its ends by `from` and `to`";
                return Ok(Err(detail.to_owned()));
            }
            return Ok(Ok(all));
        }
        Border::Line { from, to, along } => (Vec3::from(*from), Vec3::from(*to), along),
    };
    let mut steps = Steps::of(budget);
    type Nearest<'r> = Option<(f64, &'r BoundaryLoop, usize)>;
    let mut nearest = |point: &Vec3, rims: &[&'a BoundaryLoop]| -> Result<Nearest<'a>, Exhausted> {
        let mut best: Nearest<'a> = None;
        for rim in rims {
            steps.take(VERTEX_WORK * rim.vertices.len() as u64)?;
            for k in 0..rim.vertices.len() {
                let distance = (at(whole, rim, k) - point).norm();
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
    let length = |from: usize, to: usize| -> f64 {
        let ends =
            (from..from + ahead(rim, from, to)).map(|k| at(whole, rim, k + 1) - at(whole, rim, k));
        ends.map(|edge| edge.norm()).sum()
    };
    let mut along: Vec<Vec3> = along.iter().map(|p| Vec3::from(*p)).collect();
    // The shorter way from one to the other; the loop has the cloth on its left.
    let (first, last) = match length(start, end) <= length(end, start) {
        true => (start, end),
        false => {
            along.reverse();
            (end, start)
        }
    };
    Ok(Ok(vec![Stretch {
        entry,
        rim,
        from: first,
        edges: ahead(rim, first, last),
        along,
    }]))
}

/// Edges of a loop from one vertex on to another.
fn ahead(rim: &BoundaryLoop, from: usize, to: usize) -> usize {
    let n = rim.vertices.len();
    (to + n - from) % n
}

/// Adds the strip of a stretch to a surface, marks the vertices of the loop that it uses, and returns the line of the
/// new hem in the loop's direction, both ends included; or why there is no place for it.
fn strip(
    whole: &WeldedScan,
    stretch: &Stretch,
    used: &mut BTreeSet<usize>,
    surface: &mut TriMesh,
) -> Result<Vec<Vec3>, String> {
    let n = stretch.rim.vertices.len();
    let rest = n - stretch.edges;
    let place = |k: usize| at(whole, stretch.rim, k);
    // Counted twice around, so that no index is negative.
    let (from, to) = (stretch.from + n, stretch.to() + n);
    let free = |k: &usize| !used.contains(&(k % n));
    let most = OVERLAP.min(rest.saturating_sub(1) / 2);
    let before = (1..=most).take_while(|k| free(&(from - k))).count();
    let after = (1..=most).take_while(|k| free(&(to + k))).count();
    if before == 0 || after == 0 {
        return Err("too little of the hem is left beside the stretch".to_owned());
    }
    let hem = HEM.min(rest.saturating_sub(1) / 2).max(1);
    let edges = (from - hem..from).chain(to..to + hem);
    let edge = edges.map(|k| (place(k + 1) - place(k)).norm()).sum::<f64>() / (2 * hem) as f64;
    let ends = HemEnds {
        from: place(from),
        to: place(to),
        before: unit(place(from) - place(from - hem)),
        after: unit(place(to + hem) - place(to)),
    };
    let line = ends.line(&stretch.along, edge);
    let mean_outward = |range: Range<usize>| {
        let all = range.map(|k| outward(whole, stretch.rim, k));
        unit(all.sum())
    };
    let (out_before, out_after) = (mean_outward(from - hem..from), mean_outward(to..to + hem));
    // The strip's inner side, in the loop's direction.
    let inner: Vec<Vec3> = (from - before..from)
        .map(place)
        .chain(line.iter().copied())
        .chain((to + 1..=to + after).map(place))
        .collect();
    used.extend((from - before..=to + after).map(|k| k % n));
    let base = surface.positions.len() as u32;
    let count = inner.len();
    for row in 0..=ROWS {
        for (k, p) in inner.iter().enumerate() {
            let share = k as f64 / (count - 1) as f64;
            let tangent = inner[(k + 1).min(count - 1)] - inner[k.saturating_sub(1)];
            let out = out_before.lerp(&out_after, share);
            let tangent = unit(tangent);
            let out = unit(out - tangent * out.dot(&tangent));
            surface.positions.push(p + out * (edge * row as f64));
        }
    }
    let vertex = |row: usize, k: usize| base + (row * count + k) as u32;
    for row in 0..ROWS {
        for k in 0..count - 1 {
            let (a, b) = (vertex(row, k), vertex(row, k + 1));
            let (c, d) = (vertex(row + 1, k), vertex(row + 1, k + 1));
            surface.faces.extend([[b, a, c], [b, c, d]]);
        }
    }
    Ok(line)
}

/// The hem at both ends of a stretch.
struct HemEnds {
    from: Vec3,
    to: Vec3,
    /// Its direction before and after the stretch.
    before: Vec3,
    after: Vec3,
}

impl HemEnds {
    /// A line from one end to the other, in edges of about this length: through the given points, or, without them, the
    /// cubic curve that continues the hem on both sides.
    fn line(&self, along: &[Vec3], edge: f64) -> Vec<Vec3> {
        let chord = (self.to - self.from).norm();
        let curve: Vec<Vec3> = match along {
            [] => (0..=64)
                .map(|k| self.hermite(f64::from(k) / 64.0, chord))
                .collect(),
            points => (std::iter::once(self.from))
                .chain(points.iter().copied())
                .chain([self.to])
                .collect(),
        };
        let mut line = vec![self.from];
        if along.is_empty() {
            let length: f64 = curve.windows(2).map(|e| (e[1] - e[0]).norm()).sum();
            let count = pieces(length, edge);
            line.extend((1..=count).map(|k| self.hermite(k as f64 / count as f64, chord)));
        } else {
            for ends in curve.windows(2) {
                let count = pieces((ends[1] - ends[0]).norm(), edge);
                let point = |k: usize| ends[0].lerp(&ends[1], k as f64 / count as f64);
                line.extend((1..=count).map(point));
                if line.len() > MOST_POINTS {
                    break;
                }
            }
        }
        line.dedup();
        // The ends are the scan's own vertices, bit for bit.
        if let Some(last) = line.last_mut() {
            *last = self.to;
        }
        line
    }

    fn hermite(&self, t: f64, chord: f64) -> Vec3 {
        let (t2, t3) = (t * t, t * t * t);
        self.from * (2.0 * t3 - 3.0 * t2 + 1.0)
            + self.before * (chord * (t3 - 2.0 * t2 + t))
            + self.to * (3.0 * t2 - 2.0 * t3)
            + self.after * (chord * (t3 - t2))
    }
}

/// Edges of about this length that a line of another length is divided into.
fn pieces(length: f64, edge: f64) -> usize {
    let count = (length / edge).round();
    if count.is_finite() {
        (count as usize).clamp(1, MOST_POINTS)
    } else {
        1
    }
}

fn unit(v: Vec3) -> Vec3 {
    v.try_normalize(f64::MIN_POSITIVE)
        .unwrap_or_else(Vec3::zeros)
}

/// The direction out of the cloth at an edge of a loop, in the plane of the triangle there.
fn outward(whole: &WeldedScan, rim: &BoundaryLoop, k: usize) -> Vec3 {
    let along = at(whole, rim, k + 1) - at(whole, rim, k);
    let face = rim.half_edges[k % rim.half_edges.len()].face();
    let [a, b, c] = whole.surface.mesh.triangle(face.index());
    unit(along.cross(&(b - a).cross(&(c - a))))
}
