//! Whole scans mended end to end, compared with the cloth that was cut out; the metrics are those of `shared/check`.

use std::collections::HashSet;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use serde::Serialize;

use super::cases::gaussian;
use super::error::EvaluateError;
use super::hole_kind::{HoleKind, SCAN_SIDE};
use super::surface_distance::Surface;
use crate::scarffolds::holed_scan::{HoledScan, holed_scan};
use crate::scarffolds::sheets::SimulatedSheet;
use darn_geometry::mesh::curvature::{angle_defect, face_areas, vertex_normals};
use darn_geometry::mesh::index::VertexId;
use darn_geometry::mesh::intersect::intersections_with;
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec3};

/// Points drawn on the patch, and on the cloth that was cut out.
const POINTS: usize = 6000;

/// One mended scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScanRow {
    /// Number of the sheet.
    pub sheet: usize,
    /// Kind of the hole.
    pub cut: HoleKind,
    /// The metrics.
    #[serde(flatten)]
    pub metrics: ScanMetrics,
}

/// The metrics of one mended scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScanMetrics {
    /// Mean distance from points of the patch to points of the truth and back, per cent of the hole's diameter. Of two draws from one surface it
    /// is 0.6.
    pub chamfer: f64,
    /// The same from points of each to the surface of the other: 0 where the patch is the truth.
    pub surface: f64,
    /// The larger of the two 95 % quantiles of these distances, per cent of the hole's diameter.
    pub h95: f64,
    /// Mean angle between the patch and the nearest truth, degrees, ignoring orientation.
    pub normal: f64,
    /// Area ÷ the truth's.
    pub area: f64,
    /// Mean absolute angle defect of the patch's inner vertices, radians.
    pub curvature: f64,
    /// Pairs of triangles that intersect, at least one of them of the patch.
    pub self_intersections: usize,
}

/// Mends a scan. The mended mesh has the vertices of the scan at their positions (as f32), and the new cloth.
pub type MendFunction<'a> = &'a dyn Fn(&HoledScan) -> Result<TriMesh, EvaluateError>;

/// How scans are made from sheets.
#[derive(Debug, Clone, Copy)]
pub struct SyntheticScanOptions {
    /// Seed of holes, vertices and noise.
    pub seed: u64,
    /// Standard deviation of the noise on every coordinate of a vertex, in edges of the scan.
    pub noise: f64,
}

/// Makes a scan with a hole of the given kind from every sheet, mends it and measures it; `None` where nothing was mended.
pub fn over_scans(
    sheets: &[SimulatedSheet],
    kind: HoleKind,
    options: &SyntheticScanOptions,
    mend: MendFunction,
) -> Vec<Option<ScanRow>> {
    let one = |(number, sheet): (usize, &SimulatedSheet)| {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(number as u64);
        let hole = kind.draw(&mut rng);
        let mut scan = holed_scan(sheet, SCAN_SIDE, &hole, &mut rng);
        if options.noise > 0.0 {
            let sigma = options.noise / SCAN_SIDE as f64;
            // The noise has its own generator, so that noise does not change the holes.
            let mut rng = rng.clone();
            for p in &mut scan.mesh.positions {
                *p += Vec3::from_fn(|_, _| gaussian(&mut rng)) * sigma;
            }
        }
        let mended = mend(&scan).ok()?;
        let metrics = ScanMetrics::of(&scan.mesh, &scan.lost, &mended, &mut rng)?;
        Some(ScanRow {
            sheet: number,
            cut: kind,
            metrics,
        })
    };
    sheets.iter().enumerate().map(one).collect()
}

impl ScanMetrics {
    /// The metrics of a mended mesh; `kept` is the mesh before, `lost` the cloth that was cut out of it. `None` if one has no area.
    pub(super) fn of(
        kept: &TriMesh,
        lost: &TriMesh,
        mended: &TriMesh,
        rng: &mut ChaCha8Rng,
    ) -> Option<ScanMetrics> {
        let own = new_faces(kept, mended);
        let patch = TriMesh {
            positions: mended.positions.clone(),
            faces: own.iter().map(|f| mended.faces[*f as usize]).collect(),
        };
        let areas = [&patch, lost].map(|mesh| face_areas(mesh).iter().sum::<f64>());
        if areas.iter().any(|area| *area <= 0.0) {
            return None;
        }
        let diameter = 2.0 * (areas[1] / std::f64::consts::PI).sqrt();
        let points = [points(&patch, rng), points(lost, rng)];
        let [there, back] = [0, 1].map(|k: usize| nearest(&points[k], &points[1 - k]));
        let mean =
            |all: &[NearestPoint]| all.iter().map(|x| x.distance).sum::<f64>() / all.len() as f64;
        let surfaces = [Surface::of(lost), Surface::of(&patch)];
        let off = |k: usize| {
            let each = points[k].iter().map(|p| surfaces[k].distance(&p.position));
            each.sum::<f64>() / points[k].len() as f64
        };
        let q95 = |all: &[NearestPoint]| {
            let mut all: Vec<f64> = all.iter().map(|x| x.distance).collect();
            all.sort_by(f64::total_cmp);
            all[all.len() * 95 / 100]
        };
        Some(ScanMetrics {
            chamfer: 50.0 * (mean(&there) + mean(&back)) / diameter,
            surface: 50.0 * (off(0) + off(1)) / diameter,
            h95: 100.0 * q95(&there).max(q95(&back)) / diameter,
            normal: there.iter().map(|x| x.angle).sum::<f64>() / there.len() as f64,
            area: areas[0] / areas[1],
            curvature: curvature(&patch),
            self_intersections: intersections_with(mended, &own).len(),
        })
    }
}

/// Faces of `after` that `before` does not have, by the positions of their corners.
pub(super) fn new_faces(before: &TriMesh, after: &TriMesh) -> Vec<u32> {
    let key = |mesh: &TriMesh, face: &[u32; 3]| {
        let mut corners = face.map(|v| {
            let p = mesh.positions[v as usize];
            [p.x, p.y, p.z].map(|x| (x as f32).to_bits())
        });
        corners.sort_unstable();
        corners
    };
    let old: HashSet<_> = before.faces.iter().map(|f| key(before, f)).collect();
    let all = 0..after.faces.len() as u32;
    all.filter(|f| !old.contains(&key(after, &after.faces[*f as usize])))
        .collect()
}

/// A point of a surface.
struct SurfacePoint {
    position: Vec3,
    normal: Vec3,
}

/// The point of another surface that is nearest to a point.
struct NearestPoint {
    distance: f64,
    /// Angle between the two normals, degrees, ignoring orientation.
    angle: f64,
}

/// Random points, uniform over the area, with smooth normals.
fn points(mesh: &TriMesh, rng: &mut ChaCha8Rng) -> Vec<SurfacePoint> {
    let normals = vertex_normals(mesh);
    let mut sum = 0.0;
    let ladder: Vec<f64> = face_areas(mesh)
        .iter()
        .map(|area| {
            sum += area;
            sum
        })
        .collect();
    let draw = |_| {
        let at = rng.random_range(0.0..sum);
        let face = mesh.faces[ladder
            .partition_point(|x| *x <= at)
            .min(mesh.faces.len() - 1)];
        let (r, t) = (rng.random::<f64>().sqrt(), rng.random::<f64>());
        let weights = [1.0 - r, r * (1.0 - t), r * t];
        let blend = |values: &[Vec3]| -> Vec3 {
            face.iter()
                .zip(weights)
                .map(|(v, w)| values[*v as usize] * w)
                .sum()
        };
        SurfacePoint {
            position: blend(&mesh.positions),
            normal: blend(&normals),
        }
    };
    (0..POINTS).map(draw).collect()
}

/// The nearest point of `to` for each point of `from`.
fn nearest(from: &[SurfacePoint], to: &[SurfacePoint]) -> Vec<NearestPoint> {
    let entry = |k: usize| GeomWithData::new(<[f64; 3]>::from(to[k].position), k);
    let tree = RTree::bulk_load((0..to.len()).map(entry).collect());
    let to_nearest = |point: &SurfacePoint| {
        let found = tree.nearest_neighbor(&<[f64; 3]>::from(point.position))?;
        let other = &to[found.data];
        let angle = point.normal.angle(&other.normal).to_degrees();
        Some(NearestPoint {
            distance: (point.position - other.position).norm(),
            angle: angle.min(180.0 - angle),
        })
    };
    from.iter().filter_map(to_nearest).collect()
}

/// Mean absolute angle defect of the inner vertices, radians.
fn curvature(patch: &TriMesh) -> f64 {
    let topology = Topology::new(patch);
    let boundary = topology.boundary_vertices();
    let used: HashSet<u32> = patch.faces.iter().flatten().copied().collect();
    let inner: Vec<u32> = used
        .into_iter()
        .filter(|v| !boundary[*v as usize])
        .collect();
    let sum: f64 = inner
        .iter()
        .map(|v| angle_defect(patch, &topology, VertexId(*v)).abs())
        .sum();
    sum / inner.len().max(1) as f64
}

/// A Markdown table of means: one line for each kind of hole, and one for all.
pub fn scan_table(rows: &[Option<ScanRow>]) -> String {
    let mut text = String::from(
        "| scans | mended | chamfer % | to the surface % | h95 % | normals deg | area | K rad | cuts |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    let mended: Vec<&ScanRow> = rows.iter().flatten().collect();
    let groups = HoleKind::ALL
        .into_iter()
        .map(|cut| (format!("{cut:?}").to_lowercase(), Some(cut)))
        .chain([(
            format!("all, {} not mended", rows.len() - mended.len()),
            None,
        )]);
    for (name, cut) in groups {
        let own: Vec<&&ScanRow> = (mended.iter())
            .filter(|row| cut.is_none_or(|cut| cut == row.cut))
            .collect();
        if own.is_empty() {
            continue;
        }
        let mean = |part: fn(&ScanMetrics) -> f64| {
            own.iter().map(|row| part(&row.metrics)).sum::<f64>() / own.len() as f64
        };
        text.push_str(&format!(
            "| {name} | {} | {:.3} | {:.3} | {:.2} | {:.2} | {:.3} | {:.3} | {:.2} |\n",
            own.len(),
            mean(|r| r.chamfer),
            mean(|r| r.surface),
            mean(|r| r.h95),
            mean(|r| r.normal),
            mean(|r| r.area),
            mean(|r| r.curvature),
            mean(|r| r.self_intersections as f64)
        ));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::mesh::Vec2;

    /// Position of a point of the unit square on a sheet bent once, isometric to the plane.
    fn surface(p: Vec2) -> Vec3 {
        Vec3::new(0.5 * (p.x / 0.5).sin(), p.y, 0.5 * (p.x / 0.5).cos())
    }

    /// The sheet.
    fn bent() -> SimulatedSheet {
        let rest = (0..51 * 51).map(|k| Vec2::new((k % 51) as f64, (k / 51) as f64) / 50.0);
        SimulatedSheet {
            positions: rest.map(|p| surface(p).cast().into()).collect(),
        }
    }

    /// The scan with the cloth that was cut out put back.
    fn whole(scan: &HoledScan, shift: f64) -> TriMesh {
        let mut mesh = scan.mesh.clone();
        let base = mesh.positions.len() as u32;
        let moved = scan
            .lost
            .positions
            .iter()
            .map(|p| p + Vec3::new(0.0, shift, 0.0));
        mesh.positions.extend(moved);
        mesh.faces
            .extend(scan.lost.faces.iter().map(|f| f.map(|v| v + base)));
        mesh
    }

    #[test]
    fn what_was_cut_out_is_the_best_patch() {
        let clean = SyntheticScanOptions {
            seed: 3,
            noise: 0.0,
        };
        let perfect = |scan: &HoledScan| Ok(whole(scan, 0.0));
        let rows = over_scans(&[bent()], HoleKind::Circle, &clean, &perfect);
        let row = rows[0].unwrap().metrics;
        // Two draws of points from one surface differ: this is the least value of the metric.
        assert!(
            row.chamfer < 1.5 && row.h95 < 4.0 && row.normal < 4.0,
            "{row:?}"
        );
        assert!(row.surface < 1e-9, "{row:?}");
        assert!((row.area - 1.0).abs() < 1e-9 && row.self_intersections == 0);
        assert!(row.curvature < 0.01);
        let shifted = |scan: &HoledScan| Ok(whole(scan, 0.05));
        let worse = over_scans(&[bent()], HoleKind::Circle, &clean, &shifted)[0]
            .unwrap()
            .metrics;
        assert!(worse.h95 > 2.0 * row.h95 && worse.surface > 0.1);
        assert!(scan_table(&rows).contains("| circle | 1 |"));

        let noisy = SyntheticScanOptions {
            noise: 0.3,
            ..clean
        };
        let blurred = over_scans(&[bent()], HoleKind::Circle, &noisy, &|scan| {
            let off = |(p, q): (&Vec3, &Vec2)| (p - surface(*q)).norm_squared();
            let pairs = scan.mesh.positions.iter().zip(&scan.rest);
            let mean = pairs.map(off).sum::<f64>() / scan.rest.len() as f64;
            assert!((mean.sqrt() * SCAN_SIDE as f64 / 0.3 / 3.0f64.sqrt() - 1.0).abs() < 0.05);
            Ok(whole(scan, 0.0))
        });
        let same_area = blurred[0].unwrap().metrics.area;
        assert!(
            (same_area - 1.0).abs() < 1e-9,
            "the cloth that was cut out has no noise"
        );
    }

    #[test]
    fn a_scan_that_is_not_mended_has_no_row() {
        let clean = SyntheticScanOptions {
            seed: 3,
            noise: 0.0,
        };
        let idle = |scan: &HoledScan| Ok(scan.mesh.clone());
        let failing = |_: &HoledScan| Err(EvaluateError::Nothing("no"));
        let rows: Vec<_> = [&idle as MendFunction, &failing]
            .iter()
            .flat_map(|mend| over_scans(&[bent()], HoleKind::Slit, &clean, *mend))
            .collect();
        assert_eq!(rows, [None, None]);
        assert!(scan_table(&rows).ends_with("|---|\n"));
    }
}
