//! Tells finished openings (necks, cuffs, waists, the mouths of bags) from holes among the loops that cloth surrounds.
//!
//! Turning alone cannot: a neck turns by −3.6 to −6.8 radians, a hole by −2π. What tells them apart is how the cloth lies around the loop and what
//! other edges the same piece has. At an opening the cloth runs towards the loop from one side, as a tube runs towards its end; around a hole it
//! goes on. A rim that is torn while the piece's other edges are finished is a hole's. Where all edges are as rough, because the scan was
//! trimmed or is noisy, a rough rim says nothing; where all are as smooth, because the mesh was smoothed, a smooth one says nothing either.
//! Every such observation is an [`Evidence`] whose weight is a part of the logarithm of the odds that the loop is an opening.
//!
//! The weights began as a logistic regression over 3,200 loops of the garments of `darn garments --seed 1` and `--seed 2`, and of sheets with one hole
//! and four: intact, cropped, trimmed, ripped, noisy, decimated, remeshed and smoothed. Those of the prior and of roundness were chosen again, among
//! 3,000 combinations, by the mistakes over 10,000 loops of garments of seeds 1, 77 and 4242 and of their torn and bitten openings.

use std::f64::consts::{PI, TAU};

use super::TriMesh;
use rayon::prelude::*;

use super::curvature::face_area;
use super::index::FaceId;
use super::loops::{BoundaryLoop, LoopKind};
use super::rim_shape::RimShape;
use super::topology::Topology;

/// Logarithm of the odds that a loop is an opening before anything is known about it: most loops that cloth surrounds are
/// damage.
pub(super) const PRIOR: f64 = -1.0;
/// The odds' logarithm is believed up to this size: of the loops beyond it one in sixty is of the other kind.
pub(super) const SUREST: f64 = 4.0;
/// Roughness (see [`EvidenceKind::Rim`]) up to which a rim is finished, and from which it is torn; radians.
const FINISHED: f64 = 0.1;
const TORN: f64 = 0.3;
/// The median roughness of a piece's other edges up to which they are finished; radians.
const ALL_FINISHED: f64 = 0.05;
/// Weights of a rim that is torn beside finished edges, and of one that is finished beside torn ones.
const TORN_WEIGHT: f64 = -4.8;
const FINISHED_WEIGHT: f64 = 4.0;
/// Share of a mouth (see [`EvidenceKind::Mouth`]) at which as many loops are holes as openings, and its weight.
const EVEN_MOUTH: f64 = 0.5;
const MOUTH_WEIGHT: f64 = 5.2;
/// Curvature that a hole's fill may hold, radians, the most that is told of more, and its weight.
const CURVED: f64 = 0.5;
const MOST_CURVED: f64 = 1.5;
const CURVATURE_WEIGHT: f64 = 2.4;
/// Weight of a sheet around the loop.
const SHEET_WEIGHT: f64 = -3.7;
/// Turning of a sheet's outer boundary, radians: a flared skirt's hem turns by less.
const SHEET: f64 = 5.0;
/// Roundness (see [`EvidenceKind::Roundness`]) of as many holes as openings, the least that is told, and its weight.
const EVEN_ROUNDNESS: f64 = 0.75;
const LEAST_ROUNDNESS: f64 = 0.2;
const ROUNDNESS_WEIGHT: f64 = 4.0;
/// Length over the square root of the piece's area below which a loop is too small to put something through, and its weight.
const SMALL: f64 = 0.1;
const SMALL_WEIGHT: f64 = -2.0;
/// Turning, radians, below which a loop that does not turn like a hole may be one all the same: in the top of a hood, holes of 60 % of its circumference
/// turn by −1.7 and −1.9.
const UNDECIDED: f64 = -1.2;
/// Vertices up to which the shape of a rim tells nothing; of twice as many it tells all.
const FEW_VERTICES: usize = 6;

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
    /// How the rim turns on the surface where it is smoothest: the mean amount, radians, by which the turning at a vertex differs from the
    /// rim's mean by more than a polygon's does; compared with the piece's other edges.
    Rim,
    /// Whether the cloth runs towards the loop from one side: 1 at the end of a tube, 0 in a flat sheet.
    Mouth,
    /// The turning of an outer boundary of the same piece, radians: the loop lies in a sheet.
    Sheet,
    /// 4π times the area of the flattest surface across it over its length squared: 1 for a circle.
    Roundness,
    /// The loop's length over the square root of the piece's area.
    Size,
    /// Gaussian curvature that a fill would have to hold, radians: 2π plus the loop's turning.
    Curvature,
}

/// The kind of a loop that cloth surrounds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Verdict {
    pub(super) kind: LoopKind,
    /// Probability of that kind, 0.5 to 0.98.
    pub(super) confidence: f64,
    pub(super) evidence: Vec<Evidence>,
}

/// Whether a loop may be a hole: it turns like one, or so far that a hole in strongly curved cloth may turn so.
fn may_be_hole(l: &BoundaryLoop) -> bool {
    l.kind == LoopKind::Hole || l.kind == LoopKind::TubeEnd && l.turning < UNDECIDED
}

/// Decides for each loop that may be a hole whether it is one, a finished opening, or the end of a tube; `None` for other loops. A tube's end whose rim is
/// torn where the piece's other edges are finished stays one, in doubt.
///
/// Takes time in the order of the boundary's length, and of the mesh's faces when any loop is in question.
pub(super) fn verdicts(
    mesh: &TriMesh,
    topology: &Topology,
    loops: &[BoundaryLoop],
) -> Vec<Option<Verdict>> {
    let in_question = |l: &BoundaryLoop| matches!(l.kind, LoopKind::Hole | LoopKind::TubeEnd);
    if !loops.iter().any(in_question) {
        return vec![None; loops.len()];
    }
    let areas = component_areas(mesh, topology);
    let mut pieces: Vec<Vec<usize>> = vec![Vec::new(); topology.components];
    for (k, l) in loops.iter().enumerate() {
        pieces[l.component as usize].push(k);
    }
    let rims: Vec<RimShape> = loops
        .par_iter()
        .map(|l| RimShape::of(mesh, topology, l))
        .collect();
    let mut verdicts = vec![None; loops.len()];
    for (piece, members) in pieces.iter().enumerate() {
        let piece = Piece::new(loops, &rims, members, areas[piece]);
        for &k in members {
            verdicts[k] = match (loops[k].kind, may_be_hole(&loops[k])) {
                (LoopKind::Hole, _) => Some(Verdict::of(piece.evidence(k))),
                (LoopKind::TubeEnd, may_be_hole) => {
                    Verdict::of_tube_end(piece.evidence(k), may_be_hole)
                }
                _ => None,
            };
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
            confidence: 1.0 / (1.0 + (-odds.abs().min(SUREST)).exp()),
            evidence,
        }
    }

    /// Of a loop that turns like a tube's end; `None` where nothing says otherwise.
    fn of_tube_end(evidence: Vec<Evidence>, may_be_hole: bool) -> Option<Verdict> {
        if !may_be_hole && !evidence.iter().any(Evidence::is_torn_rim) {
            return None;
        }
        let verdict = Verdict::of(evidence);
        if verdict.kind != LoopKind::Hole {
            return Some(Verdict {
                kind: LoopKind::TubeEnd,
                ..verdict
            });
        }
        if may_be_hole {
            return Some(verdict);
        }
        // Its turning and the rest of the evidence contradict each other.
        Some(Verdict {
            kind: LoopKind::TubeEnd,
            confidence: 0.5,
            ..verdict
        })
    }
}

/// A connected piece of cloth with its loops.
struct Piece<'a> {
    loops: &'a [BoundaryLoop],
    rims: &'a [RimShape],
    /// Roughness of all its edges, ascending.
    edges: Vec<f64>,
    /// How much it is a sheet, 0 to 1, and the largest turning of its outer boundaries.
    sheet: Option<(f64, f64)>,
    /// Square root of its area.
    size: f64,
}

impl<'a> Piece<'a> {
    fn new(
        loops: &'a [BoundaryLoop],
        rims: &'a [RimShape],
        members: &[usize],
        area: f64,
    ) -> Piece<'a> {
        let mut edges: Vec<f64> = members.iter().map(|k| rims[*k].roughness).collect();
        edges.sort_unstable_by(f64::total_cmp);
        let outer = (members.iter().map(|k| &loops[*k])).filter(|l| l.kind == LoopKind::Outer);
        let turning = outer.map(|l| l.turning).reduce(f64::max);
        Piece {
            loops,
            rims,
            edges,
            sheet: turning.map(|turning| (share(turning, PI, SHEET), turning)),
            size: area.sqrt(),
        }
    }

    /// Of the roughness of the other edges than loop `k`, ascending, that at a place.
    fn other_edge(&self, k: usize, place: usize) -> f64 {
        let own = self.rims[k].roughness;
        let before = self.edges.partition_point(|e| *e < own);
        self.edges[place + usize::from(place >= before)]
    }

    /// What speaks for and against loop `k` being an opening.
    fn evidence(&self, k: usize) -> Vec<Evidence> {
        let (l, rim) = (&self.loops[k], self.rims[k]);
        let size = l.length / self.size.max(f64::MIN_POSITIVE);
        // The rim of a missing triangle is as smooth as a rim of three edges can be.
        let few = FEW_VERTICES as f64;
        let told = share(l.vertices.len() as f64, few, 2.0 * few);
        let large = (size / SMALL).min(1.0);
        let believed = told * large;
        let (sheet, outer) = self.sheet.unwrap_or((0.0, 0.0));
        let curvature = TAU + l.turning;
        let mouth = MOUTH_WEIGHT * (rim.mouth - EVEN_MOUTH);
        let round = rim.roundness.max(LEAST_ROUNDNESS) - EVEN_ROUNDNESS;
        let curved = (curvature - CURVED).clamp(0.0, MOST_CURVED);
        let all = [
            (
                EvidenceKind::Rim,
                rim.roughness,
                self.rim(k, sheet, large) * told,
            ),
            (
                EvidenceKind::Mouth,
                rim.mouth,
                if mouth > 0.0 { mouth * believed } else { mouth },
            ),
            (EvidenceKind::Sheet, outer, SHEET_WEIGHT * sheet),
            (
                EvidenceKind::Roundness,
                rim.roundness,
                ROUNDNESS_WEIGHT * round * told,
            ),
            (EvidenceKind::Size, size, SMALL_WEIGHT * (1.0 - large)),
            (
                EvidenceKind::Curvature,
                curvature,
                CURVATURE_WEIGHT * curved * believed,
            ),
        ];
        (all.into_iter().filter(|(.., weight)| *weight != 0.0))
            .map(|(kind, value, weight)| Evidence {
                kind,
                value,
                weight,
            })
            .collect()
    }

    /// The weight of loop `k`'s rim beside the piece's other edges.
    fn rim(&self, k: usize, sheet: f64, large: f64) -> f64 {
        let torn = |roughness: f64| share(roughness, FINISHED, TORN);
        let own = self.rims[k].roughness;
        let others = self.edges.len() - 1;
        if others == 0 {
            // Without other edges nobody knows.
            return 0.5 * TORN_WEIGHT * torn(own);
        }
        let usual = self.other_edge(k, (others - 1) / 2);
        let roughest = self.other_edge(k, others - 1);
        let finished = share(own, FINISHED, 0.0) * torn(roughest);
        TORN_WEIGHT * torn(own) * share(usual, TORN, ALL_FINISHED)
            + FINISHED_WEIGHT * finished * large * (1.0 - sheet)
    }
}

/// Where a value lies on the way from one to another, 0 to 1.
fn share(value: f64, from: f64, to: f64) -> f64 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}

impl EvidenceKind {
    /// A stable word for programs.
    pub fn code(self) -> &'static str {
        match self {
            EvidenceKind::Rim => "rim",
            EvidenceKind::Mouth => "mouth",
            EvidenceKind::Sheet => "sheet",
            EvidenceKind::Roundness => "roundness",
            EvidenceKind::Size => "size",
            EvidenceKind::Curvature => "curvature",
        }
    }
}

impl Evidence {
    /// Whether it says that the rim is torn where the piece's other edges are finished.
    pub fn is_torn_rim(&self) -> bool {
        self.kind == EvidenceKind::Rim && self.weight < 0.0
    }

    /// What was found, for a person.
    pub fn reason(&self) -> String {
        let value = self.value;
        match self.kind {
            EvidenceKind::Rim if self.weight > 0.0 => {
                format!(
                    "the rim is finished where another edge of the piece is torn (roughness {value:.3} rad a vertex)"
                )
            }
            EvidenceKind::Rim => {
                format!(
                    "the rim is torn where the piece's other edges are finished (roughness {value:.3} rad a vertex)"
                )
            }
            EvidenceKind::Mouth if self.weight > 0.0 => {
                format!("the cloth runs towards it as towards the end of a tube ({value:.2} of 1)")
            }
            EvidenceKind::Mouth => {
                format!("the cloth goes on around it ({value:.2}, where the end of a tube has 1)")
            }
            EvidenceKind::Sheet => {
                format!("it lies in a sheet with an outer boundary (turning {value:.2})")
            }
            EvidenceKind::Roundness if self.weight > 0.0 => {
                format!("it is round ({value:.2} of a circle's 1)")
            }
            EvidenceKind::Roundness => {
                format!("it is long or lobed ({value:.2}, where a circle has 1)")
            }
            EvidenceKind::Size => {
                format!("it is small: {value:.3} times the square root of the piece's area")
            }
            EvidenceKind::Curvature => {
                format!(
                    "flat cloth would not close it: a fill must hold {value:.2} rad of curvature"
                )
            }
        }
    }
}
