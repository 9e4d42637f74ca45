//! Tells finished openings (necks, cuffs, waists, the mouths of bags) from holes among the loops that cloth surrounds.
//!
//! Turning alone cannot: a neck turns by −4.8 to −6.8 radians, a hole by −2π. What tells them apart is how the rim was
//! made and what else the same piece of cloth has: a hem is smooth and sits among other hems of its size; a tear follows
//! the triangles that happen to be left, and lies in a sheet. Every such observation is an [`Evidence`] whose weight is
//! a part of the logarithm of the odds that the loop is an opening.

use std::f64::consts::{PI, TAU};

use super::TriMesh;
use rayon::prelude::*;

use super::curvature::face_area;
use super::index::FaceId;
use super::loops::{BoundaryLoop, LoopKind};
use super::topology::Topology;
use super::turning::vertex_turnings;

/// Logarithm of the odds that a loop is an opening before anything is known about it: most loops that cloth surrounds are
/// damage.
const PRIOR: f64 = -0.5;
/// Deviation of a rim's turning at a vertex from its mean that a hem's own polygon has, radians.
const POLYGON: f64 = 0.5;
/// Deviation beyond which a vertex is a corner, radians.
const CORNER: f64 = 1.0;
/// Corners that a finished opening has at most: the ends of a slit, the point of a neck.
const HEM_CORNERS: usize = 2;
/// Roughness (see [`EvidenceKind::Rim`]) up to which a rim is as smooth as a hem, and from which it is torn; radians.
const SMOOTH: f64 = 0.045;
const TORN: f64 = 0.085;
/// A loop is of another's size when their lengths differ by at most this factor.
const COMPARABLE: f64 = 2.5;
/// Length over the square root of the piece's area below which a loop is too small to put something through.
const SMALL: f64 = 0.1;
/// Turning, radians, below which a loop that does not turn like a hole may be one all the same: in the top of a hood, holes of 60 % of its circumference
/// turn by −1.7 and −1.9.
const UNDECIDED: f64 = -1.2;
/// Vertices up to which the shape of a rim tells nothing; of twice as many it tells all.
const FEW_VERTICES: usize = 6;
/// Two loops are a pair, such as armholes, when their lengths differ by at most this share.
const PAIR: f64 = 0.08;

/// Something that speaks for a loop being a finished opening, or against it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// What was looked at.
    pub kind: EvidenceKind,
    /// What was measured; its unit depends on `kind`.
    pub value: f64,
    /// Its part of the logarithm of the odds: above 0 for an opening, below 0 for a hole.
    pub weight: f64,
}

/// What was looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EvidenceKind {
    /// How the rim turns on the surface: the mean amount, radians, by which the turning at a vertex differs from the
    /// rim's mean by more than a polygon's does.
    Rim,
    /// Sharp corners of the rim.
    Corners,
    /// The turning of an outer boundary of the same piece, radians: the loop lies in a sheet.
    Sheet,
    /// How many other openings and tube ends of comparable size the same piece has.
    Company,
    /// A loop of the same piece that is as long: the relative difference.
    Pair,
    /// The loop's length over the square root of the piece's area.
    Size,
    /// Gaussian curvature that a fill would have to hold, radians: 2π plus the loop's turning.
    Curvature,
    /// The loop's turning, radians, where it is nearer to a tube end's than to a hole's.
    Turning,
}

/// The kind of a loop that cloth surrounds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Verdict {
    pub(super) kind: LoopKind,
    /// Probability of that kind, 0.5 to 1.
    pub(super) confidence: f64,
    pub(super) evidence: Vec<Evidence>,
}

/// How a rim turns.
#[derive(Debug, Clone, Copy)]
struct Rim {
    roughness: f64,
    corners: usize,
}

/// Whether a loop may be a hole: it turns like one, or so far that a hole in strongly curved cloth may turn so.
fn may_be_hole(l: &BoundaryLoop) -> bool {
    l.kind == LoopKind::Hole || l.kind == LoopKind::TubeEnd && l.turning < UNDECIDED
}

/// Decides for each loop that may be a hole whether it is one, or a finished opening; `None` for other loops, and for tube ends that stay tube ends.
///
/// Takes time in the order of the boundary's length, and of the mesh's faces when any loop is in question.
pub(super) fn verdicts(
    mesh: &TriMesh,
    topology: &Topology,
    loops: &[BoundaryLoop],
) -> Vec<Option<Verdict>> {
    if !loops.iter().any(may_be_hole) {
        return vec![None; loops.len()];
    }
    let areas = component_areas(mesh, topology);
    let mut pieces: Vec<Vec<usize>> = vec![Vec::new(); topology.components];
    for (k, l) in loops.iter().enumerate() {
        pieces[l.component as usize].push(k);
    }
    let rims: Vec<Rim> = loops.iter().map(|l| rim(mesh, topology, l)).collect();
    let mut verdicts = vec![None; loops.len()];
    for (piece, members) in pieces.iter().enumerate() {
        let piece = Piece::new(loops, &rims, members, areas[piece]);
        for &k in members.iter().filter(|k| may_be_hole(&loops[**k])) {
            let verdict = Verdict::of(piece.evidence(k));
            let changes = loops[k].kind == LoopKind::Hole || verdict.kind == LoopKind::Hole;
            verdicts[k] = changes.then_some(verdict);
        }
    }
    verdicts
}

/// Faces whose areas one thread adds up at once.
const PART: usize = 1 << 14;

/// Per component its area, scene units squared; the same with any number of threads.
fn component_areas(mesh: &TriMesh, topology: &Topology) -> Vec<f64> {
    let faces = mesh.faces.len();
    let parts = (0..faces.div_ceil(PART)).into_par_iter();
    // The sums of runs of faces of the same component.
    let sums = parts.map(|part| {
        let mut runs: Vec<(u32, f64)> = Vec::new();
        for face in PART * part..faces.min(PART * (part + 1)) {
            let component = topology.component(FaceId(face as u32));
            let area = face_area(mesh, face);
            match runs.last_mut().filter(|(last, _)| *last == component) {
                Some((_, sum)) => *sum += area,
                None => runs.push((component, area)),
            }
        }
        runs
    });
    let mut areas = vec![0.0; topology.components];
    for (component, area) in sums.collect::<Vec<_>>().into_iter().flatten() {
        areas[component as usize] += area;
    }
    areas
}

impl Verdict {
    fn of(evidence: Vec<Evidence>) -> Verdict {
        let odds = PRIOR + evidence.iter().map(|e| e.weight).sum::<f64>();
        Verdict {
            kind: if odds > 0.0 {
                LoopKind::Opening
            } else {
                LoopKind::Hole
            },
            confidence: 1.0 / (1.0 + (-odds.abs()).exp()),
            evidence,
        }
    }
}

impl Rim {
    /// Whether it is as smooth as a finished edge.
    fn is_hem(&self) -> bool {
        self.roughness < SMOOTH && self.corners <= HEM_CORNERS
    }
}

/// How the turning of a rim is spread over its vertices. Turning is measured on the surface, so that folds do not count.
fn rim(mesh: &TriMesh, topology: &Topology, l: &BoundaryLoop) -> Rim {
    let turnings: Vec<f64> = vertex_turnings(mesh, topology, &l.half_edges).collect();
    let count = turnings.len().max(1) as f64;
    let mean = turnings.iter().sum::<f64>() / count;
    let deviations = || turnings.iter().map(|t| (t - mean).abs());
    let beyond: f64 = deviations().map(|d| (d - POLYGON).max(0.0)).sum();
    Rim {
        roughness: beyond / count,
        corners: deviations().filter(|d| *d > CORNER).count(),
    }
}

/// A connected piece of cloth with its loops.
struct Piece<'a> {
    loops: &'a [BoundaryLoop],
    rims: &'a [Rim],
    /// Lengths of the loops that are smooth or the ends of tubes, ascending.
    hems: Vec<f64>,
    /// The largest turning of its outer boundaries.
    outer: Option<f64>,
    /// Square root of its area.
    size: f64,
}

impl<'a> Piece<'a> {
    fn new(loops: &'a [BoundaryLoop], rims: &'a [Rim], members: &[usize], area: f64) -> Piece<'a> {
        let is_hem = |k: &&usize| match loops[**k].kind {
            LoopKind::TubeEnd => true,
            LoopKind::Hole | LoopKind::Opening => rims[**k].is_hem(),
            LoopKind::Outer => false,
        };
        let mut hems: Vec<f64> = (members.iter().filter(is_hem))
            .map(|k| loops[*k].length)
            .collect();
        hems.sort_unstable_by(f64::total_cmp);
        let outer = (members.iter().map(|k| &loops[*k])).filter(|l| l.kind == LoopKind::Outer);
        Piece {
            loops,
            rims,
            hems,
            outer: outer.map(|l| l.turning).reduce(f64::max),
            size: area.sqrt(),
        }
    }

    /// What speaks for and against loop `k` being an opening.
    fn evidence(&self, k: usize) -> Vec<Evidence> {
        let (l, rim) = (&self.loops[k], self.rims[k]);
        let smoothness = (2.0 * (TORN - rim.roughness) / (TORN - SMOOTH) - 1.0).clamp(-1.0, 1.0);
        let is_hem = rim.is_hem();
        let size = l.length / self.size.max(f64::MIN_POSITIVE);
        // The rim of a missing triangle is as smooth as a rim of three edges can be.
        let told =
            (l.vertices.len().saturating_sub(FEW_VERTICES) as f64 / FEW_VERTICES as f64).min(1.0);
        let large = (size / SMALL).min(1.0);
        let mut found = Vec::new();
        let mut add = |kind, value, weight| {
            if weight != 0.0 {
                found.push(Evidence {
                    kind,
                    value,
                    weight,
                });
            }
        };
        let believed = if smoothness > 0.0 { told * large } else { told };
        add(
            EvidenceKind::Rim,
            rim.roughness,
            3.0 * smoothness * believed,
        );
        if rim.corners > HEM_CORNERS {
            let beyond = (rim.corners - HEM_CORNERS).min(3) as f64;
            add(
                EvidenceKind::Corners,
                rim.corners as f64,
                -1.5 - 1.5 * beyond,
            );
        }
        if let Some(turning) = self.outer {
            // A flared skirt's hem turns by less than a sheet's edge.
            let share = ((turning - PI) / (5.0 - PI)).clamp(0.0, 1.0);
            add(EvidenceKind::Sheet, turning, -3.5 * share);
        }
        let company = self.like(l.length, COMPARABLE) - usize::from(is_hem);
        add(
            EvidenceKind::Company,
            company as f64,
            0.75 * company.min(2) as f64 * large,
        );
        if is_hem && self.like(l.length, 1.0 + PAIR) > 1 {
            add(EvidenceKind::Pair, PAIR, large);
        }
        if large < 1.0 {
            add(EvidenceKind::Size, size, -2.0 * (1.0 - large));
        }
        let curvature = TAU + l.turning;
        if l.kind == LoopKind::TubeEnd {
            let tube = 1.0 - (UNDECIDED - l.turning) / (UNDECIDED + PI);
            add(EvidenceKind::Turning, l.turning, 3.0 * tube);
        }
        add(
            EvidenceKind::Curvature,
            curvature,
            0.5 * (curvature.abs() - 1.0).clamp(0.0, 2.0),
        );
        found
    }

    /// How many hems have this length, within a factor.
    fn like(&self, length: f64, factor: f64) -> usize {
        let low = self.hems.partition_point(|l| *l * factor < length);
        let high = self.hems.partition_point(|l| *l <= length * factor);
        high.saturating_sub(low)
    }
}

impl EvidenceKind {
    /// A stable word for programs.
    pub fn code(self) -> &'static str {
        match self {
            EvidenceKind::Rim => "rim",
            EvidenceKind::Corners => "corners",
            EvidenceKind::Sheet => "sheet",
            EvidenceKind::Company => "other_openings",
            EvidenceKind::Pair => "pair",
            EvidenceKind::Size => "size",
            EvidenceKind::Curvature => "curvature",
            EvidenceKind::Turning => "turning",
        }
    }
}

impl Evidence {
    /// What was found, for a person.
    pub fn reason(&self) -> String {
        let value = self.value;
        match self.kind {
            EvidenceKind::Rim if self.weight > 0.0 => {
                format!("the rim is smooth, as a hem is (roughness {value:.3} rad a vertex)")
            }
            EvidenceKind::Rim => {
                format!("the rim is ragged, as a tear's is (roughness {value:.3} rad a vertex)")
            }
            EvidenceKind::Corners => format!("the rim has {value:.0} sharp corners"),
            EvidenceKind::Sheet => {
                format!("it lies in a sheet with an outer boundary (turning {value:.2})")
            }
            EvidenceKind::Company => {
                format!(
                    "the same piece has {value:.0} other opening(s) or tube end(s) of comparable size"
                )
            }
            EvidenceKind::Pair => {
                "the same piece has another opening that is as long, as sleeves and armholes have"
                    .to_owned()
            }
            EvidenceKind::Size => {
                format!("it is small: {value:.3} times the square root of the piece's area")
            }
            EvidenceKind::Curvature => {
                format!(
                    "flat cloth would not close it: a fill must hold {value:.2} rad of curvature"
                )
            }
            EvidenceKind::Turning => format!(
                "it turns by {value:.2} rad, where the end of a tube turns by about 0 and a hole by about -6.28"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Vec3;
    use crate::mesh::loops::boundary_loops;
    use crate::mesh::shapes::{jitter, tube};
    use crate::mesh::weld::weld;

    fn loops_of(soup: &TriMesh) -> Vec<BoundaryLoop> {
        let welded = weld(soup);
        boundary_loops(&welded.mesh, &welded.topology())
    }

    fn placed(mesh: TriMesh, place: impl Fn(&Vec3) -> Vec3) -> TriMesh {
        TriMesh {
            positions: mesh.positions.iter().map(place).collect(),
            faces: mesh.faces,
        }
    }

    /// A sphere with a smooth mouth at either pole, each `mouth` radians wide from the pole, and a torn hole in its side.
    fn lantern(n: usize, mouth: f64, hole: f64) -> TriMesh {
        let torn = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > hole;
        placed(tube(n, torn), |p| {
            let polar = mouth + (PI - 2.0 * mouth) * p.z / 4.0;
            Vec3::new(p.x * polar.sin(), p.y * polar.sin(), -polar.cos())
        })
    }

    /// A flat ring: a simple sheet with a smooth round hole.
    fn ring(n: usize, hole: f64) -> TriMesh {
        placed(tube(n, |_, _| true), |p| {
            let r = hole + (1.0 - hole) * (1.0 - p.z / 4.0);
            Vec3::new(p.x * r, p.y * r, 0.0)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        // On coarser spheres the vertices of the torn rim themselves hold so much of the curvature that it turns like a tube's end.
        #[test]
        fn smooth_mouths_are_openings_and_a_torn_hole_is_a_hole(n in 26usize..50, mouth in 0.3..0.9f64, hole in 0.1..0.2f64, noise in 0.0..0.03f64) {
            let mut found: Vec<(LoopKind, bool)> = loops_of(&jitter(&lantern(n, mouth, hole), noise / n as f64, 3))
                .iter()
                .map(|l| (l.kind, l.confidence > 0.7))
                .collect();
            found.sort_unstable_by_key(|f| f.0 == LoopKind::Opening);
            prop_assert_eq!(found, [(LoopKind::Hole, true), (LoopKind::Opening, true), (LoopKind::Opening, true)]);
        }

        #[test]
        fn a_smooth_hole_in_a_simple_sheet_is_a_hole(n in 12usize..60, hole in 0.1..0.6f64) {
            let loops = loops_of(&ring(n, hole));
            let hole = loops.iter().find(|l| l.turning < 0.0).expect("a hole");
            prop_assert_eq!(hole.kind, LoopKind::Hole, "{:?}", hole.evidence);
        }

        #[test]
        fn a_small_smooth_hole_is_a_hole(n in 30usize..60, noise in 0.0..0.02f64) {
            let pinhole = 0.02;
            let soup = jitter(&lantern(n, pinhole, -1.0), noise * pinhole / n as f64, 5);
            let kinds: Vec<LoopKind> = loops_of(&soup).iter().map(|l| l.kind).collect();
            prop_assert_eq!(kinds, [LoopKind::Hole, LoopKind::Hole]);
        }
    }

    #[test]
    fn a_window_with_straight_sides_is_a_hole() {
        let window = |u: f64, v: f64| (u - 0.5).abs() > 0.4 || (v - 0.5).abs() > 0.15;
        let loops = loops_of(&tube(60, window));
        let rim = loops.iter().find(|l| l.turning < -PI).expect("a hole");
        assert_eq!(rim.kind, LoopKind::Hole, "{:?}", rim.evidence);
    }

    #[test]
    fn the_weights_make_the_confidence() {
        for l in loops_of(&lantern(24, 0.5, 0.15)) {
            let odds = PRIOR + l.evidence.iter().map(|e| e.weight).sum::<f64>();
            let opening = 1.0 / (1.0 + (-odds).exp());
            let expected = if l.kind == LoopKind::Opening {
                opening
            } else {
                1.0 - opening
            };
            assert!((l.confidence - expected).abs() < 1e-12);
            assert!(l.evidence.iter().all(|e| !e.reason().is_empty()));
        }
    }

    #[test]
    fn the_diameter_is_the_largest_width() {
        let loops = loops_of(&ring(40, 0.25));
        let mut widths: Vec<f64> = loops.iter().map(|l| l.diameter).collect();
        widths.sort_unstable_by(f64::total_cmp);
        assert!(
            (widths[0] - 0.5).abs() < 0.01 && (widths[1] - 2.0).abs() < 0.01,
            "{widths:?}"
        );
    }
}
