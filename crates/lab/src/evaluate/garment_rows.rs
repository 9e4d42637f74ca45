//! Garments mended end to end: openings taken for holes, holes missed or refused, and how the fills compare with the cloth that was cut out.

use std::collections::{BTreeMap, HashSet};
use std::fmt::Write as _;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::error::EvaluateError;
use super::scan_rows::{ScanMetrics, new_faces};
use crate::garments::set::{GarmentCase, HoleRecord};
use crate::garments::{FlatnessBand, GarmentKind};
use darn_geometry::mesh::loops::boundary_loops;
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec3};

/// A fill whose total mean curvature is more than this many times the truth's has folds that were never there.
const TOO_CURVED: f64 = 1.5;

/// A boundary loop as the mender's list of holes has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ListedLoop {
    /// Its id there.
    pub id: u32,
    /// Whether the mender would fill it without being asked to.
    pub filled_by_default: bool,
    /// Centroid of its curve.
    pub centroid: Vec3,
    /// Its length.
    pub length: f64,
    /// Its turning, radians.
    pub turning: f64,
}

/// Lists the loops of a mesh.
pub type ListFunction<'a> = &'a dyn Fn(&TriMesh) -> Result<Vec<ListedLoop>, EvaluateError>;

/// Mends the hole of a garment; the mended mesh has the vertices of the garment at their positions (as f32), and the new cloth.
pub type MendHoleFunction<'a> = &'a dyn Fn(&AskedHole) -> Result<TriMesh, EvaluateError>;

/// A hole to mend.
#[derive(Debug, Clone, Copy)]
pub struct AskedHole<'a> {
    /// What is known of it.
    pub record: &'a HoleRecord,
    /// The garment without the cloth of the hole.
    pub mesh: &'a TriMesh,
    /// A vertex of its rim.
    pub at: Vec3,
}

/// What garments are mended by.
#[derive(Clone, Copy)]
pub struct GarmentMender<'a> {
    /// Lists loops; `None` for a mender that makes no choice.
    pub list: Option<ListFunction<'a>>,
    /// Mends one hole.
    pub mend: MendHoleFunction<'a>,
}

/// An opening of an intact garment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OpeningRow {
    /// The garment.
    pub garment: String,
    /// The opening's name.
    pub opening: String,
    /// Id of its loop; `None` if the list has no loop there.
    pub id: Option<u32>,
    /// Whether it would be closed by default.
    pub closed: bool,
    /// Its length, metres.
    pub length: f64,
    /// Its turning, radians.
    pub turning: f64,
}

/// A hole of a garment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GarmentRow {
    /// The hole.
    pub name: String,
    /// The garment's kind.
    pub kind: GarmentKind,
    /// Width of the hole ÷ circumference; `None` for a moth hole.
    pub share: Option<f64>,
    /// How flat the cloth around it lies.
    pub band: FlatnessBand,
    /// Whether it is not filled by default.
    pub missed: bool,
    /// Why it was not mended when it was named.
    pub refusal: Option<String>,
    /// The fill.
    #[serde(flatten)]
    pub fill: Option<GarmentFill>,
}

/// How a fill compares with the cloth that was cut out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GarmentFill {
    /// The metrics of scans.
    #[serde(flatten)]
    pub metrics: ScanMetrics,
    /// Total mean curvature ÷ the truth's, both with the edges of the rim.
    pub mean_curvature: f64,
}

/// All measurements of a set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GarmentReport {
    /// Openings of intact garments; empty for a mender that makes no choice.
    pub openings: Vec<OpeningRow>,
    /// Holes.
    pub holes: Vec<GarmentRow>,
}

/// Measures a mender on a set of garments; `done` is called after each garment.
///
/// # Errors
/// A list of loops that cannot be made.
pub fn over_garments(
    cases: &[GarmentCase],
    mender: &GarmentMender,
    done: &dyn Fn(),
) -> Result<GarmentReport, EvaluateError> {
    let mut report = GarmentReport {
        openings: Vec::new(),
        holes: Vec::new(),
    };
    for case in cases {
        if let Some(list) = mender.list {
            report.openings.extend(openings(case, &list(&case.intact)?));
        }
        for (record, hole) in case.record.holes.iter().zip(&case.holes) {
            let at = on_rim(&hole.mesh, &hole.lost, &Vec3::from(record.centroid));
            let asked = AskedHole {
                record,
                mesh: &hole.mesh,
                at,
            };
            let missed = match mender.list {
                Some(list) => {
                    let centroid = loop_centroid(&hole.mesh, &at);
                    let found = list(&hole.mesh)?;
                    !nearest(&found, &centroid).is_some_and(|l| l.filled_by_default)
                }
                None => false,
            };
            let mended = (mender.mend)(&asked);
            let fill = (mended.as_ref().ok())
                .and_then(|mended| fill(&case.intact, &hole.mesh, &hole.lost, mended));
            report.holes.push(GarmentRow {
                name: record.name.clone(),
                kind: case.record.kind,
                share: record.wish.share,
                band: record.band,
                missed,
                refusal: match (&mended, &fill) {
                    (Err(error), _) => Some(error.to_string()),
                    (Ok(_), None) => Some("another loop or nothing was filled".into()),
                    _ => None,
                },
                fill,
            });
        }
        done();
    }
    Ok(report)
}

fn openings(case: &GarmentCase, found: &[ListedLoop]) -> Vec<OpeningRow> {
    // Names are given to loops by the place of their vertices, which both lists know.
    let topology = Topology::new(&case.intact);
    let loops = boundary_loops(&case.intact, &topology);
    let row = |opening: &crate::garments::Opening| {
        let own = loops.iter().min_by(|a, b| {
            let off = |l: &darn_geometry::mesh::loops::BoundaryLoop| {
                let sum: Vec3 = (l.vertices.iter())
                    .map(|v| case.intact.positions[v.index()])
                    .sum();
                (sum / l.vertices.len() as f64 - Vec3::from(opening.centroid)).norm()
            };
            off(a).total_cmp(&off(b))
        });
        let listed = own.and_then(|own| nearest(found, &own.centroid));
        OpeningRow {
            garment: case.record.name.clone(),
            opening: opening.name.clone(),
            id: listed.map(|l| l.id),
            closed: listed.is_some_and(|l| l.filled_by_default),
            length: opening.length,
            turning: listed.map_or(0.0, |l| l.turning),
        }
    };
    case.record.openings.iter().map(row).collect()
}

pub(super) fn nearest<'a>(loops: &'a [ListedLoop], at: &Vec3) -> Option<&'a ListedLoop> {
    let off = |l: &ListedLoop| (l.centroid - at).norm();
    loops.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
}

fn key(p: &Vec3) -> [u32; 3] {
    [p.x, p.y, p.z].map(|x| (x as f32).to_bits())
}

/// The vertex of the rim that is nearest to a point.
pub(super) fn on_rim(mesh: &TriMesh, lost: &TriMesh, centroid: &Vec3) -> Vec3 {
    let kept: HashSet<[u32; 3]> = mesh.positions.iter().map(key).collect();
    let rim = lost.positions.iter().filter(|p| kept.contains(&key(p)));
    let off = |p: &&Vec3| (*p - centroid).norm();
    let found = rim.min_by(|a, b| off(a).total_cmp(&off(b)));
    found.copied().unwrap_or(*centroid)
}

/// Centroid of the loop through a vertex.
pub(super) fn loop_centroid(mesh: &TriMesh, at: &Vec3) -> Vec3 {
    let topology = Topology::new(mesh);
    let through = |l: &darn_geometry::mesh::loops::BoundaryLoop| {
        l.vertices
            .iter()
            .any(|v| key(&mesh.positions[v.index()]) == key(at))
    };
    let loops = boundary_loops(mesh, &topology);
    loops
        .iter()
        .find(|l| through(l))
        .map_or(*at, |l| l.centroid)
}

fn fill(intact: &TriMesh, kept: &TriMesh, lost: &TriMesh, mended: &TriMesh) -> Option<GarmentFill> {
    // A fill of another loop, which a mender may take for the nearest, is no fill of this hole.
    let own = new_faces(kept, mended);
    let patch: HashSet<[u32; 3]> = (own.iter())
        .flat_map(|f| mended.triangle(*f as usize))
        .map(|p| key(&p))
        .collect();
    let remaining: HashSet<[u32; 3]> = kept.positions.iter().map(key).collect();
    let rim: Vec<_> = lost
        .positions
        .iter()
        .map(key)
        .filter(|k| remaining.contains(k))
        .collect();
    if 2 * rim.iter().filter(|k| patch.contains(*k)).count() < rim.len() {
        return None;
    }
    let metrics = ScanMetrics::of(kept, lost, mended, &mut ChaCha8Rng::seed_from_u64(0))?;
    let truth = total_mean_curvature(intact, &new_faces(kept, intact));
    let own = total_mean_curvature(mended, &own);
    Some(GarmentFill {
        metrics,
        mean_curvature: own / truth.max(1e-9),
    })
}

/// ∫|H| over some faces: half of Σ |angle between the two faces| · length over their edges, those to other faces too.
fn total_mean_curvature(mesh: &TriMesh, faces: &[u32]) -> f64 {
    let own: HashSet<u32> = faces.iter().copied().collect();
    let mut sides: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for (number, f) in (0u32..).zip(&mesh.faces) {
        for k in 0..3 {
            let (a, b) = (f[k], f[(k + 1) % 3]);
            sides.entry([a.min(b), a.max(b)]).or_default().push(number);
        }
    }
    let normal = |f: u32| {
        let [a, b, c] = mesh.triangle(f as usize);
        (b - a).cross(&(c - a))
    };
    let bend = |(ends, faces): (&[u32; 2], &Vec<u32>)| match faces[..] {
        [f, g] if own.contains(&f) || own.contains(&g) => {
            let [a, b] = ends.map(|v| mesh.positions[v as usize]);
            0.5 * normal(f).angle(&normal(g)) * (a - b).norm()
        }
        _ => 0.0,
    };
    sides.iter().map(bend).sum()
}

impl GarmentReport {
    /// Markdown tables: what was closed, missed and refused, and the fills by flatness, size and kind.
    pub fn markdown(&self) -> String {
        let mut text = String::new();
        let count = |of: &dyn Fn(&GarmentRow) -> bool| self.holes.iter().filter(|r| of(r)).count();
        let closed = self.openings.iter().filter(|o| o.closed).count();
        let curved = |r: &GarmentRow| r.fill.is_some_and(|f| f.mean_curvature > TOO_CURVED);
        let _ = writeln!(
            text,
            "openings of intact garments closed by default: {closed} of {}\nholes missed by default: {} of {}\n\
             holes refused when named: {}\nfills with more than {TOO_CURVED} × the truth's total mean curvature: {}\n",
            self.openings.len(),
            count(&|r| r.missed),
            self.holes.len(),
            count(&|r| r.refusal.is_some()),
            count(&curved),
        );
        text.push_str(
            "| holes | n | mended | chamfer % | median | to the surface % | h95 % | normals deg | area | too curved |\n|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for band in FlatnessBand::ALL {
            let name = format!("flat within {}", band.name());
            self.line(&mut text, &name, &|r| r.share.is_some() && r.band == band);
        }
        self.line(&mut text, "moth hole", &|r| r.share.is_none());
        for share in [0.15, 0.35, 0.6] {
            let name = format!("{:.0} % of the circumference", 100.0 * share);
            self.line(&mut text, &name, &|r| r.share == Some(share));
        }
        for kind in GarmentKind::ALL {
            self.line(&mut text, kind.name(), &|r| {
                r.share.is_some() && r.kind == kind
            });
        }
        self.line(&mut text, "all but moth holes", &|r| r.share.is_some());
        for row in self.holes.iter() {
            if let Some(refusal) = &row.refusal {
                let _ = writeln!(text, "\nrefused: {}: {refusal}", row.name);
            }
        }
        for o in self.openings.iter().filter(|o| o.closed) {
            let _ = writeln!(
                text,
                "\nclosed: {} {} (loop {:?}, length {:.3}, turning {:.2})",
                o.garment, o.opening, o.id, o.length, o.turning
            );
        }
        text
    }

    fn line(&self, text: &mut String, name: &str, of: &dyn Fn(&GarmentRow) -> bool) {
        let own: Vec<&GarmentRow> = self.holes.iter().filter(|r| of(r)).collect();
        let fills: Vec<GarmentFill> = own.iter().filter_map(|r| r.fill).collect();
        if own.is_empty() {
            return;
        }
        let mean = |part: &dyn Fn(&GarmentFill) -> f64| {
            fills.iter().map(part).sum::<f64>() / fills.len().max(1) as f64
        };
        let mut chamfers: Vec<f64> = fills.iter().map(|f| f.metrics.chamfer).collect();
        chamfers.sort_by(f64::total_cmp);
        let median = chamfers.get(chamfers.len() / 2).copied().unwrap_or(0.0);
        let curved = fills.iter().filter(|f| f.mean_curvature > TOO_CURVED);
        let _ = writeln!(
            text,
            "| {name} | {} | {} | {:.2} | {median:.2} | {:.2} | {:.2} | {:.1} | {:.3} | {} |",
            own.len(),
            fills.len(),
            mean(&|f| f.metrics.chamfer),
            mean(&|f| f.metrics.surface),
            mean(&|f| f.metrics.h95),
            mean(&|f| f.metrics.normal),
            mean(&|f| f.metrics.area),
            curved.count(),
        );
    }
}
