//! A patch in the scan's own terms: which mesh takes it, which vertices it shares, its attributes and its provenance.

use std::collections::BTreeMap;

use serde_json::json;

use super::cloth::Cloth;
use super::hole::Made;
use super::prepared::Prepared;
use super::{MendError, VERSION};
use darn_contract::v1;
use darn_geometry::mesh::Vec3;
use darn_geometry::mesh::curvature::vertex_normals;
use darn_geometry::mesh::region::Region;
use darn_geometry::patch::attributes::{Columns, extend_attributes};
use darn_geometry::patch::{Patch, quality};
use darn_gltf_scan::{PatchPoint, PatchPrimitive, Scan, ScanPart};
use darn_net::WeightsCard;

/// The patch as a primitive of the part that most of its rim belongs to.
pub fn addition(
    (scan, cloth): (&Scan, &Cloth),
    prepared: &Prepared,
    Made { patch, report }: &Made,
    card: &WeightsCard,
) -> Result<PatchPrimitive, MendError> {
    let (region, chart) = (&prepared.region, &prepared.chart);
    let sources: Vec<Option<(usize, [u32; 3])>> = region
        .faces
        .iter()
        .map(|f| cloth.source(scan, *f))
        .collect();
    let part = majority(patch, region, &sources);
    let look = &scan.parts[part];
    let alike = |other: usize| {
        let other: &ScanPart = &scan.parts[other];
        other.material == look.material
            && other.texcoords.len() == look.texcoords.len()
            && other.colors.len() == look.colors.len()
    };
    let corners: Vec<Option<[u32; 3]>> = sources
        .iter()
        .map(|s| s.filter(|(p, _)| alike(*p)).map(|(_, c)| c))
        .collect();
    let mut any = vec![u32::MAX; region.mesh.positions.len()];
    let mut owners: Vec<(u32, usize)> = Vec::new();
    for (face, source) in region.mesh.faces.iter().zip(&sources) {
        let Some((p, scan_corners)) = source else {
            continue;
        };
        if alike(*p) {
            owners.extend(scan_corners.map(|s| (s, *p)));
        }
        for (v, s) in face.iter().zip(scan_corners) {
            // A vertex of the patch's own node is preferred: its stored bits are copied.
            let own = scan.parts[*p].node == look.node;
            if own || any[*v as usize] == u32::MAX {
                any[*v as usize] = *s;
            }
        }
    }
    // Parts may share vertices; the last to use one is asked.
    owners.sort_by_key(|(s, _)| *s);
    let values = |s: u32| {
        let after = owners.partition_point(|(vertex, _)| *vertex <= s);
        let owner = owners[..after].last().filter(|(vertex, _)| *vertex == s);
        owner.map_or_else(Vec::new, |(_, p)| columns_of(&scan.parts[*p], s))
    };
    let width = 2 * look.texcoords.len() + 4 * look.colors.len();
    let columns = Columns {
        corners: &corners,
        any: &any,
        values: &values,
        width,
    };
    let (dressed, normals) = rayon::join(
        || extend_attributes(&prepared.plan, patch, region, chart, &columns),
        || normals(patch, region),
    );
    let points = dressed.corners.iter().map(|c| match c.scan {
        Some(s) => PatchPoint::Scan(s),
        None => PatchPoint::New(patch.positions[c.vertex as usize]),
    });
    let column = |c: usize| {
        dressed
            .corners
            .iter()
            .map(move |corner| corner.values.get(c).copied().unwrap_or_default() as f32)
    };
    let texcoords = (0..look.texcoords.len()).map(|t| {
        column(2 * t)
            .zip(column(2 * t + 1))
            .map(|(s, t)| [s, t])
            .collect()
    });
    let first = 2 * look.texcoords.len();
    let colors = (0..look.colors.len()).map(|c| {
        let channel = |k: usize| {
            column(first + 4 * c + k)
                .map(|x| x.clamp(0.0, 1.0))
                .collect::<Vec<f32>>()
        };
        let rgba = [channel(0), channel(1), channel(2), channel(3)];
        (0..dressed.corners.len())
            .map(|n| [0, 1, 2, 3].map(|k: usize| rgba[k][n]))
            .collect()
    });
    Ok(PatchPrimitive {
        part,
        material_of: part,
        points: points.collect(),
        faces: dressed.faces,
        both_sides: is_backed(region, cloth),
        normals: dressed
            .corners
            .iter()
            .map(|c| normals[c.vertex as usize])
            .collect(),
        texcoords: texcoords.collect(),
        colors: colors.collect(),
        name: format!("darn reconstruction of hole {}", report.id),
        extras: provenance(report, card),
    })
}

/// Whether most of a region shows its other side by triangles of its own.
fn is_backed(region: &Region, cloth: &Cloth) -> bool {
    let backed = region.faces.iter();
    let backed = backed.filter(|f| cloth.welded.two_sided[f.index()]).count();
    2 * backed > region.faces.len()
}

/// The part that the largest number of rim edges belongs to; the first of them on a tie.
fn majority(patch: &Patch, region: &Region, sources: &[Option<(usize, [u32; 3])>]) -> usize {
    let mut on_rim = vec![false; region.mesh.positions.len()];
    patch.rim.iter().for_each(|v| on_rim[*v as usize] = true);
    let mut votes: BTreeMap<usize, usize> = BTreeMap::new();
    for (face, source) in region.mesh.faces.iter().zip(sources) {
        let touching = face.iter().filter(|v| on_rim[**v as usize]).count();
        if let (2.., Some((part, _))) = (touching, source) {
            *votes.entry(*part).or_default() += 1;
        }
    }
    votes
        .into_iter()
        .max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)))
        .map_or(0, |(part, _)| part)
}

/// Texture coordinates, then colours, of a scan vertex.
fn columns_of(part: &ScanPart, vertex: u32) -> Vec<f64> {
    let at = (vertex - part.vertices.start) as usize;
    let texcoords = part.texcoords.iter().flat_map(|set| set[at]);
    let colors = part.colors.iter().flat_map(|set| set[at]);
    texcoords.chain(colors).map(f64::from).collect()
}

/// Normals of the patch's vertices with the scan's triangles around taken into account, so that the light does not break at the seam.
fn normals(patch: &Patch, region: &Region) -> Vec<Vec3> {
    let all = vertex_normals(&quality::joined(patch, region));
    let inner = region.mesh.positions.len();
    let rim = patch.rim.iter().map(|v| all[*v as usize]);
    let solid = |n: Vec3| if n.norm() > 0.0 { n } else { Vec3::z() };
    rim.chain(all[inner..].iter().copied()).map(solid).collect()
}

/// What `extras.darn` says of a patch: that it is reconstructed, by what, and with which numbers. No timings: same input, same bytes.
fn provenance(report: &v1::HoleReport, card: &WeightsCard) -> serde_json::Value {
    let patch = report.patch.clone().unwrap_or_default();
    let chart = report.chart.unwrap_or_default();
    json!({
        "reconstructed": true,
        "hole": report.id,
        "version": VERSION,
        "weights": { "name": card.name, "sha256": card.sha256 },
        "anchors": report.anchors.len(),
        "edits": report.edits.len(),
        "refinement": patch.refinement,
        "chart": { "stretchMean": chart.stretch_mean, "stretchMax": chart.stretch_max },
        "patch": {
            "area": patch.area,
            "stretchMean": patch.stretch_mean,
            "stretchMax": patch.stretch_max,
            "gaussianCurvature": patch.gaussian_curvature,
            "selfIntersections": patch.self_intersections,
        },
    })
}
