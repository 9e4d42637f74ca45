//! A patch in the scan's terms: the mesh that takes it, the vertices it shares, its attributes and its provenance.

use std::collections::BTreeMap;

use darn_budget::{Budget, Exhausted};
use serde_json::{Map, Value, json};

use crate::hole_report::FilledHole;
use crate::near_seams::{RegionSources, meet_both_sides};
use crate::welded_scan::{SourceFace, WeldedScan};
use darn_contract::v1;
use darn_geometry::mesh::curvature::vertex_normals;
use darn_geometry::mesh::region::Region;
use darn_geometry::mesh::{Vec2, Vec3};
use darn_geometry::patch::attributes::{AttributedPatch, Columns, Corner, extend_attributes};
use darn_geometry::patch::{Patch, quality};
use darn_gltf_scan::{PatchAppearance, PatchPoint, PatchPrimitive, Scan, ScanPart};
use darn_net::WeightsCard;

/// Stands for a vertex of a region that the scan does not have: the new hem's.
const NO_VERTEX: u32 = u32::MAX;

/// Where patches get their attributes and their provenance from.
pub struct PatchSource<'a> {
    /// The scan.
    pub scan: &'a Scan,
    /// Its welded surface.
    pub welded: &'a WeldedScan,
    /// The card of the network that filled the holes.
    pub card: &'a WeightsCard,
    /// What the patches may cost.
    pub budget: &'a Budget<'a>,
}

/// A patch with the scan's attributes continued, and what it takes to give it others.
pub struct DressedPatch<'a> {
    /// As a primitive of the part that most of its rim belongs to.
    pub primitive: PatchPrimitive,
    /// Per point of the primitive its vertex of the patch; one on a texture seam has several.
    pub vertex_of: Vec<u32>,
    /// Per face of the region the scan's face that it was made of.
    pub sources: Vec<Option<SourceFace>>,
    /// Per vertex of the region a vertex of the scan at the same point.
    pub any: Vec<u32>,
    /// Per vertex of the patch its normal in scene space.
    pub normals: Vec<Vec3>,
    /// Per vertex of the patch its place in the chart; empty without one.
    pub patch_flat: &'a [Vec2],
    /// The patch's triangles.
    pub patch_faces: &'a [[u32; 3]],
}

impl PatchSource<'_> {
    /// The patch of a filled hole as a primitive of the part that most of its rim belongs to.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn dressed<'f>(&self, filled: &'f FilledHole) -> Result<DressedPatch<'f>, Exhausted> {
        let PatchSource {
            scan,
            welded,
            card,
            budget,
        } = *self;
        let FilledHole {
            hole,
            patch,
            deviations,
            report,
        } = filled;
        let region = hole.region();
        let faces = region.faces.iter();
        let sources: Vec<Option<SourceFace>> = faces.map(|f| welded.source(scan, *f)).collect();
        let part = majority(patch, region, &sources);
        let look = &scan.parts[part];
        let alike = |other: usize| {
            let other: &ScanPart = &scan.parts[other];
            other.material == look.material
                && other.texcoords.len() == look.texcoords.len()
                && other.colors.len() == look.colors.len()
        };
        let looks_alike = |s: &SourceFace| {
            // A corner of a split face may be a vertex of another part, which has other attributes.
            let own = &scan.parts[s.part].vertices;
            alike(s.part) && s.corners.iter().all(|v| own.contains(v))
        };
        let corners: Vec<Option<[u32; 3]>> = sources
            .iter()
            .map(|s| s.filter(looks_alike).map(|s| s.corners))
            .collect();
        let mut any = vec![NO_VERTEX; region.mesh.positions.len()];
        let mut owners: Vec<(u32, usize)> = Vec::new();
        for (face, source) in region.mesh.faces.iter().zip(&sources) {
            let Some(source) = source else {
                continue;
            };
            if looks_alike(source) {
                owners.extend(source.corners.map(|s| (s, source.part)));
            }
            for (v, s) in face.iter().zip(&source.corners) {
                // A vertex of the patch's own node is preferred: its stored bits are copied.
                let own = scan.parts[source.part].node == look.node;
                if own || any[*v as usize] == NO_VERTEX {
                    any[*v as usize] = *s;
                }
            }
        }
        // Parts may share vertices; the last part that uses a vertex gives its values.
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
            budget,
        };
        let (dressed, normals) = rayon::join(
            || extend_attributes(&hole.attribute_map(), patch, region, &columns),
            || vertex_normals_at_seam(patch, region),
        );
        let mut dressed = dressed?;
        if welded.surface.set_aside.near_seam_vertices > 0 {
            let around = RegionSources {
                region,
                sources: &sources,
            };
            meet_both_sides(&mut dressed, patch, around, scan);
        }
        budget.hold(patch_bytes(dressed.corners.len(), width))?;
        let points = dressed.corners.iter().map(|corner| point(corner, patch));
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
        let primitive = PatchPrimitive {
            part,
            material_of: part,
            points: points.collect(),
            faces: dressed.faces,
            both_sides: is_backed(region, welded) || welded.has_back(report.id),
            appearance: PatchAppearance::Continued,
            normals: dressed
                .corners
                .iter()
                .map(|c| normals[c.vertex as usize])
                .collect(),
            tangents: Vec::new(),
            texcoords: texcoords.collect(),
            colors: colors.collect(),
            deviations: at_corners(deviations, &dressed.corners),
            name: format!("darn reconstruction of hole {}", report.id),
            hole: hole_record(report),
            method: method_record(report, card),
        };
        Ok(DressedPatch {
            primitive,
            vertex_of: dressed.corners.iter().map(|c| c.vertex).collect(),
            sources,
            any,
            normals,
            patch_flat: &patch.flat,
            patch_faces: &patch.faces,
        })
    }

    /// A dressed patch as it is without the scan's attributes, not cut along its texture seams, with columns of its own per vertex:
    /// the primitive, without texture coordinates and colours, and per point its columns.
    pub fn undivided(
        &self,
        filled: &FilledHole,
        dressed: &DressedPatch,
        columns: &[Vec<f64>],
    ) -> (PatchPrimitive, Vec<Vec<f64>>) {
        let (patch, region) = (&filled.patch, filled.hole.region());
        let corner = |(vertex, values): (usize, &Vec<f64>)| Corner {
            vertex: vertex as u32,
            scan: (patch.rim.get(vertex)).map(|v| dressed.any[*v as usize]),
            values: values.clone(),
        };
        let mut whole = AttributedPatch {
            corners: columns.iter().enumerate().map(corner).collect(),
            faces: patch.faces.clone(),
        };
        if self.welded.surface.set_aside.near_seam_vertices > 0 {
            let around = RegionSources {
                region,
                sources: &dressed.sources,
            };
            meet_both_sides(&mut whole, patch, around, self.scan);
        }
        let corners = || whole.corners.iter();
        let primitive = PatchPrimitive {
            points: corners().map(|corner| point(corner, patch)).collect(),
            normals: corners()
                .map(|corner| dressed.normals[corner.vertex as usize])
                .collect(),
            texcoords: Vec::new(),
            colors: Vec::new(),
            deviations: at_corners(&filled.deviations, &whole.corners),
            faces: whole.faces.clone(),
            ..dressed.primitive.clone()
        };
        let columns = whole.corners.into_iter().map(|corner| corner.values);
        (primitive, columns.collect())
    }
}

/// A corner of a patch as a point of its primitive.
fn point(corner: &Corner, patch: &Patch) -> PatchPoint {
    match corner.scan {
        Some(s) if s != NO_VERTEX => PatchPoint::Scan(s),
        _ => PatchPoint::New(patch.positions[corner.vertex as usize]),
    }
}

/// The deviations of a patch's vertices at its corners; none where they are not known.
fn at_corners(deviations: &[f32], corners: &[Corner]) -> Vec<f32> {
    let each = corners.iter();
    each.filter_map(|corner| deviations.get(corner.vertex as usize).copied())
        .collect()
}

/// Bytes of memory of a patch: as columns, as a primitive, and in the answer.
fn patch_bytes(vertices: usize, columns: usize) -> usize {
    vertices * (3 * 24 + 8 * columns + 2 * (24 + 4 * columns + 12) + 60)
}

/// Whether most triangles of a region have a twin that shows their other side.
fn is_backed(region: &Region, welded: &WeldedScan) -> bool {
    let backed = region.faces.iter();
    let backed = backed.filter(|f| welded.surface.is_two_sided(**f)).count();
    2 * backed > region.faces.len()
}

/// The part that most rim edges belong to; the first one on a tie.
fn majority(patch: &Patch, region: &Region, sources: &[Option<SourceFace>]) -> usize {
    let mut on_rim = vec![false; region.mesh.positions.len()];
    patch.rim.iter().for_each(|v| on_rim[*v as usize] = true);
    let mut votes: BTreeMap<usize, usize> = BTreeMap::new();
    for (face, source) in region.mesh.faces.iter().zip(sources) {
        let touching = face.iter().filter(|v| on_rim[**v as usize]).count();
        if let (2.., Some(source)) = (touching, source) {
            *votes.entry(source.part).or_default() += 1;
        }
    }
    votes
        .into_iter()
        .max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)))
        .map_or(0, |(part, _)| part)
}

/// The values of a scan vertex: its texture coordinates, then its colours.
fn columns_of(part: &ScanPart, vertex: u32) -> Vec<f64> {
    let at = (vertex - part.vertices.start) as usize;
    let texcoords = part.texcoords.iter().flat_map(|set| set[at]);
    let colors = part.colors.iter().flat_map(|set| set[at]);
    texcoords.chain(colors).map(f64::from).collect()
}

/// Normals of the patch's vertices, of any length above 0. The scan's triangles around the patch count, too, so that the shading is
/// continuous at the seam.
pub fn vertex_normals_at_seam(patch: &Patch, region: &Region) -> Vec<Vec3> {
    let mut joined = quality::joined(patch, region);
    let inner = region.mesh.positions.len();
    let mut of_patch = vec![false; joined.positions.len()];
    of_patch[inner..].fill(true);
    patch.rim.iter().for_each(|v| of_patch[*v as usize] = true);
    // The other triangles around are many, and decide nothing here.
    (joined.faces).retain(|face| face.iter().any(|v| of_patch[*v as usize]));
    let all = vertex_normals(&joined);
    let rim = patch.rim.iter().map(|v| all[*v as usize]);
    let solid = |n: Vec3| if n.norm() > 0.0 { n } else { Vec3::z() };
    rim.chain(all[inner..].iter().copied()).map(solid).collect()
}

/// What a patch's primitive records about the hole: its id and its numbers. No timings, as the same input gives the
/// same bytes.
fn hole_record(report: &v1::HoleReport) -> Map<String, Value> {
    let patch = report.patch.clone().unwrap_or_default();
    let mut said = Map::new();
    said.insert("id".into(), json!(report.id));
    said.insert("anchors".into(), json!(report.anchors.len()));
    said.insert("edits".into(), json!(report.edits.len()));
    said.insert("refinement".into(), json!(patch.refinement));
    match report.chart {
        Some(c) => {
            let chart = json!({ "stretchMean": c.stretch_mean, "stretchMax": c.stretch_max });
            said.insert("chart".into(), chart);
        }
        None => {
            said.insert("method".into(), json!(patch.method));
        }
    }
    let numbers = json!({
        "area": patch.area,
        "stretchMean": patch.stretch_mean,
        "stretchMax": patch.stretch_max,
        "gaussianCurvature": patch.gaussian_curvature,
        "selfIntersections": patch.self_intersections,
    });
    said.insert("patch".into(), numbers);
    if patch.alternative > 0 {
        said.insert("alternative".into(), json!(patch.alternative));
    }
    if let Some(confidence) = patch.confidence {
        said.insert("confidence".into(), json!(confidence));
    }
    said
}

/// What it records about how its holes were filled: by which weights. Without a chart there is no network in a patch.
fn method_record(report: &v1::HoleReport, card: &WeightsCard) -> Map<String, Value> {
    let weights = json!({ "name": card.name, "sha256": card.sha256 });
    let weights = report.chart.map(|_| ("weights".to_owned(), weights));
    weights.into_iter().collect()
}
