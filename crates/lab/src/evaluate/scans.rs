//! Whole scans mended end to end, whoever mends them, against the cloth that was cut out: the measures of `shared/check`.

use std::collections::HashSet;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use serde::Serialize;

use super::EvaluateError;
use super::cases::gaussian;
use super::masks::{Cut, SCANNED};
use crate::scarffolds::scanned::{Scanned, scanned};
use crate::scarffolds::sheets::Sheet;
use darn_geometry::mesh::curvature::{angle_defect, face_areas, vertex_normals};
use darn_geometry::mesh::index::VertexId;
use darn_geometry::mesh::intersect::intersections_with;
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec3};

/// Points drawn on the patch, and on what was cut out.
const POINTS: usize = 6000;

/// One mended scan in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScanRow {
    /// Number of the sheet.
    pub sheet: usize,
    /// How the hole was cut.
    pub cut: Cut,
    /// Mean distance from patch to truth and back, per cent of the hole's diameter.
    pub chamfer: f64,
    /// The greater of the two 95 % quantiles of distance, per cent of the hole's diameter.
    pub h95: f64,
    /// Mean angle between patch and nearest truth, degrees, whichever side is up.
    pub normal: f64,
    /// Area ÷ the truth's.
    pub area: f64,
    /// Mean absolute angle defect of the patch's inner vertices, radians.
    pub curvature: f64,
    /// Pairs of triangles that cut each other, one of them the patch's.
    pub self_intersections: usize,
}

/// Mends a scan; the answer has the scan's vertices at their places (as f32), and the new cloth.
pub type Mend<'a> = &'a dyn Fn(&Scanned) -> Result<TriMesh, EvaluateError>;

/// How sheets are scanned.
#[derive(Debug, Clone, Copy)]
pub struct Scanner {
    /// Seed of holes, meshes and noise.
    pub seed: u64,
    /// Standard deviation of the noise on every coordinate of a vertex, in edges of the scan.
    pub noise: f64,
}

/// Scans every sheet with a hole of the given kind, has it mended and measures it; `None` where nothing was mended.
pub fn over_scans(
    sheets: &[Sheet],
    cut: Cut,
    scanner: &Scanner,
    mend: Mend,
) -> Vec<Option<ScanRow>> {
    let one = |(number, sheet): (usize, &Sheet)| {
        let mut rng = ChaCha8Rng::seed_from_u64(scanner.seed);
        rng.set_stream(number as u64);
        let hole = cut.drawn(&mut rng);
        let mut scan = scanned(sheet, SCANNED, &hole, &mut rng);
        if scanner.noise > 0.0 {
            let sigma = scanner.noise / SCANNED as f64;
            // Of its own, so that the holes are those without noise.
            let mut rng = rng.clone();
            for p in &mut scan.mesh.positions {
                *p += Vec3::from_fn(|_, _| gaussian(&mut rng)) * sigma;
            }
        }
        let mended = mend(&scan).ok()?;
        judged(&scan, &mended, &mut rng).map(|row| ScanRow {
            sheet: number,
            cut,
            ..row
        })
    };
    sheets.iter().enumerate().map(one).collect()
}

fn judged(scan: &Scanned, mended: &TriMesh, rng: &mut ChaCha8Rng) -> Option<ScanRow> {
    let own = new_faces(&scan.mesh, mended);
    let patch = TriMesh {
        positions: mended.positions.clone(),
        faces: own.iter().map(|f| mended.faces[*f as usize]).collect(),
    };
    let areas = [&patch, &scan.lost].map(|mesh| face_areas(mesh).iter().sum::<f64>());
    if areas.iter().any(|area| *area <= 0.0) {
        return None;
    }
    let diameter = 2.0 * (areas[1] / std::f64::consts::PI).sqrt();
    let points = [points(&patch, rng), points(&scan.lost, rng)];
    let [there, back] = [0, 1].map(|k: usize| nearest(&points[k], &points[1 - k]));
    let mean = |all: &[(f64, f64)]| all.iter().map(|x| x.0).sum::<f64>() / all.len() as f64;
    let q95 = |all: &[(f64, f64)]| {
        let mut all: Vec<f64> = all.iter().map(|x| x.0).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() * 95 / 100]
    };
    Some(ScanRow {
        sheet: 0,
        cut: Cut::Circle,
        chamfer: 50.0 * (mean(&there) + mean(&back)) / diameter,
        h95: 100.0 * q95(&there).max(q95(&back)) / diameter,
        normal: there.iter().map(|x| x.1).sum::<f64>() / there.len() as f64,
        area: areas[0] / areas[1],
        curvature: curvature(&patch),
        self_intersections: intersections_with(mended, &own).len(),
    })
}

/// Faces of `after` that `before` does not have, by the places of their corners.
fn new_faces(before: &TriMesh, after: &TriMesh) -> Vec<u32> {
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

/// A place on a surface and the direction of the surface there.
type Point = (Vec3, Vec3);

/// Points drawn evenly over the area, with smooth normals.
fn points(mesh: &TriMesh, rng: &mut ChaCha8Rng) -> Vec<Point> {
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
        (blend(&mesh.positions), blend(&normals))
    };
    (0..POINTS).map(draw).collect()
}

/// Distance to the nearest of `to` for each of `from`, and the angle between the two normals, degrees.
fn nearest(from: &[Point], to: &[Point]) -> Vec<(f64, f64)> {
    let entry = |k: usize| GeomWithData::new(<[f64; 3]>::from(to[k].0), k);
    let tree = RTree::bulk_load((0..to.len()).map(entry).collect());
    let to_nearest = |(p, normal): &Point| {
        let found = tree.nearest_neighbor(&<[f64; 3]>::from(*p))?;
        let (q, other) = to[found.data];
        let angle = normal.angle(&other).to_degrees();
        Some(((p - q).norm(), angle.min(180.0 - angle)))
    };
    from.iter().filter_map(to_nearest).collect()
}

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

/// The rows of each kind of hole, and of all, as a Markdown table of means.
pub fn scan_table(rows: &[Option<ScanRow>]) -> String {
    let mut text = String::from(
        "| scans | mended | chamfer % | h95 % | normals deg | area | K rad | cuts |\n|---|---|---|---|---|---|---|---|\n",
    );
    let mended: Vec<&ScanRow> = rows.iter().flatten().collect();
    let groups = Cut::ALL
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
        let mean = |part: fn(&ScanRow) -> f64| {
            own.iter().map(|row| part(row)).sum::<f64>() / own.len() as f64
        };
        text.push_str(&format!(
            "| {name} | {} | {:.3} | {:.2} | {:.2} | {:.3} | {:.3} | {:.2} |\n",
            own.len(),
            mean(|r| r.chamfer),
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

    /// Where a point of the unit square is on a sheet bent once, isometric to the plane.
    fn surface(p: Vec2) -> Vec3 {
        Vec3::new(0.5 * (p.x / 0.5).sin(), p.y, 0.5 * (p.x / 0.5).cos())
    }

    /// The sheet.
    fn bent() -> Sheet {
        let rest = (0..51 * 51).map(|k| Vec2::new((k % 51) as f64, (k / 51) as f64) / 50.0);
        Sheet {
            positions: rest.map(|p| surface(p).cast().into()).collect(),
        }
    }

    /// The cloth with what was cut out put back.
    fn whole(scan: &Scanned, shift: f64) -> TriMesh {
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
        let clean = Scanner {
            seed: 3,
            noise: 0.0,
        };
        let perfect = |scan: &Scanned| Ok(whole(scan, 0.0));
        let rows = over_scans(&[bent()], Cut::Circle, &clean, &perfect);
        let row = rows[0].unwrap();
        // Points drawn twice from one surface are not at the same places: the floor of the measure.
        assert!(
            row.chamfer < 1.5 && row.h95 < 4.0 && row.normal < 4.0,
            "{row:?}"
        );
        assert!((row.area - 1.0).abs() < 1e-9 && row.self_intersections == 0);
        assert!(row.curvature < 0.01);
        let shifted = |scan: &Scanned| Ok(whole(scan, 0.05));
        let worse = over_scans(&[bent()], Cut::Circle, &clean, &shifted)[0].unwrap();
        assert!(worse.h95 > 2.0 * row.h95);
        assert!(scan_table(&rows).contains("| circle | 1 |"));

        let noisy = Scanner {
            noise: 0.3,
            ..clean
        };
        let blurred = over_scans(&[bent()], Cut::Circle, &noisy, &|scan| {
            let off = |(p, q): (&Vec3, &Vec2)| (p - surface(*q)).norm_squared();
            let pairs = scan.mesh.positions.iter().zip(&scan.rest);
            let mean = pairs.map(off).sum::<f64>() / scan.rest.len() as f64;
            assert!((mean.sqrt() * SCANNED as f64 / 0.3 / 3.0f64.sqrt() - 1.0).abs() < 0.05);
            Ok(whole(scan, 0.0))
        });
        let same_area = blurred[0].unwrap().area;
        assert!((same_area - 1.0).abs() < 1e-9, "what is lost has no noise");
    }

    #[test]
    fn a_scan_that_is_not_mended_has_no_row() {
        let clean = Scanner {
            seed: 3,
            noise: 0.0,
        };
        let idle = |scan: &Scanned| Ok(scan.mesh.clone());
        let failing = |_: &Scanned| Err(EvaluateError::Nothing("no"));
        let rows: Vec<_> = [&idle as Mend, &failing]
            .iter()
            .flat_map(|mend| over_scans(&[bent()], Cut::Slit, &clean, *mend))
            .collect();
        assert_eq!(rows, [None, None]);
        assert!(scan_table(&rows).ends_with("|---|\n"));
    }
}
