//! Texture coordinates and colours of the patch: those of the scan on the rim, their smooth continuation inside.
//!
//! A texture seam that meets the rim continues through the patch. Every texture island at the rim is extended alone (an
//! affine fit over the chart plus the harmonic extension of its residual at the rim), and every face of the patch takes
//! the values of one island. Two faces belong to one island when their columns agree at common points, even when they
//! share no vertices.

mod affine;

use std::collections::{BTreeMap, BTreeSet};

use darn_budget::{Budget, Exhausted};

use super::Patch;
use super::harmonic::HarmonicExtension;
use crate::cholesky::SolveError;
use crate::flatten::Chart;
use crate::mesh::region::Region;

/// The scan's attributes around a hole, as columns of numbers.
pub struct Columns<'a> {
    /// Per region face: the scan vertices at its corners; `None` for faces with other attributes (another material).
    pub corners: &'a [Option<[u32; 3]>],
    /// Per region vertex: one scan vertex at the same point, with any attributes.
    pub any: &'a [u32],
    /// The columns of one scan vertex: `width` numbers.
    pub values: &'a (dyn Fn(u32) -> Vec<f64> + Sync),
    /// Number of columns.
    pub width: usize,
    /// What extending them may cost.
    pub budget: &'a Budget<'a>,
}

/// A vertex of the patch with its attributes; a patch vertex on a texture seam has one on each side.
#[derive(Debug, Clone, PartialEq)]
pub struct Corner {
    /// The patch vertex.
    pub vertex: u32,
    /// On the rim: the scan vertex at the same point.
    pub scan: Option<u32>,
    /// Its columns, `width` numbers.
    pub values: Vec<f64>,
}

/// The patch with attributes, cut along texture seams.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributedPatch {
    /// Vertices.
    pub corners: Vec<Corner>,
    /// Faces as indices into `corners`, in the patch's order.
    pub faces: Vec<[u32; 3]>,
}

/// How attributes are continued from the rim into a patch.
pub struct AttributeMap<'a> {
    /// The harmonic extension from the whole rim.
    rim_extension: &'a HarmonicExtension,
    /// The chart of the patch; without one there is no affine fit.
    chart: Option<&'a Chart>,
}

impl<'a> AttributeMap<'a> {
    /// For a patch in a chart.
    pub(super) fn on_chart(rim_extension: &'a HarmonicExtension, chart: &'a Chart) -> Self {
        let chart = Some(chart);
        AttributeMap {
            rim_extension,
            chart,
        }
    }

    /// For a patch in space.
    pub(super) fn on_surface(rim_extension: &'a HarmonicExtension) -> Self {
        AttributeMap {
            rim_extension,
            chart: None,
        }
    }
}

/// Extends the scan's attributes into a patch; `map` must be of the plan or fair patch that it comes from.
///
/// # Errors
/// `Exhausted`: every texture island at the rim is extended over the whole patch.
pub fn extend_attributes(
    map: &AttributeMap,
    patch: &Patch,
    region: &Region,
    columns: &Columns,
) -> Result<AttributedPatch, Exhausted> {
    let corners = shared_corners(region, columns);
    let islands = islands(&corners, columns.width);
    let around = RimAttributes {
        columns,
        map,
        rim: rim_edges(patch, region, columns, &islands),
        corners,
        islands,
    };
    let rim = &around.rim;
    let labels: Vec<u32> = rim
        .iter()
        .flatten()
        .map(|e| e.island)
        .collect::<BTreeSet<_>>()
        .into_iter()
        .collect();
    let faces = face_labels(patch, &around, &labels);
    let extended: BTreeMap<u32, Vec<Vec<f64>>> = labels
        .iter()
        .map(|l| Ok((*l, extend_island(*l, patch, region, &around)?)))
        .collect::<Result<_, Exhausted>>()?;

    let mut index = BTreeMap::new();
    let mut corners: Vec<Corner> = Vec::new();
    let mut corner = |vertex: u32, label: Option<u32>| {
        *index.entry((vertex, label)).or_insert_with(|| {
            let own = label.and_then(|l| scan_vertex(rim, vertex, l));
            let at_rim = patch.rim.get(vertex as usize);
            let values = match (own, label) {
                (Some(scan), _) => (columns.values)(scan),
                (None, Some(l)) => extended[&l][vertex as usize].clone(),
                (None, None) => vec![0.0; columns.width],
            };
            corners.push(Corner {
                vertex,
                scan: own.or_else(|| at_rim.map(|v| columns.any[*v as usize])),
                values,
            });
            corners.len() as u32 - 1
        })
    };
    let faces = patch
        .faces
        .iter()
        .zip(&faces)
        .map(|(f, label)| f.map(|v| corner(v, *label)))
        .collect();
    Ok(AttributedPatch { corners, faces })
}

/// Nanoseconds of work a face of the region and island.
const FACE_WORK: u64 = 10;
/// Nanoseconds of work a value of a patch vertex: its fit and its harmonic extension.
const VALUE_WORK: u64 = 300;

/// The attributes around a hole with their texture islands.
struct RimAttributes<'a> {
    columns: &'a Columns<'a>,
    map: &'a AttributeMap<'a>,
    /// The scan's side of every rim edge, in the order of the patch's rim; `None` where the face there has other
    /// attributes.
    rim: Vec<Option<RimEdge>>,
    /// Per region face: its [`shared_corners`].
    corners: Vec<Option<[u32; 3]>>,
    /// Per region face: its island, `None` for faces with other attributes.
    islands: Vec<Option<u32>>,
}

/// The scan's side of the rim edge from rim vertex k to k + 1: the island and the scan vertices at both ends.
#[derive(Debug, Clone, Copy)]
struct RimEdge {
    island: u32,
    from: u32,
    to: u32,
}

/// The scan vertex that an island has at a rim vertex.
fn scan_vertex(rim: &[Option<RimEdge>], vertex: u32, island: u32) -> Option<u32> {
    let k = vertex as usize;
    if k >= rim.len() {
        return None;
    }
    let of = |edge: Option<RimEdge>| edge.filter(|e| e.island == island);
    of(rim[k])
        .map(|e| e.from)
        .or_else(|| of(rim[(k + rim.len() - 1) % rim.len()]).map(|e| e.to))
}

/// Per region face: its corners, where scan vertices at one region vertex with equal columns become one of them.
///
/// O(n log n) in the corners.
fn shared_corners(region: &Region, columns: &Columns) -> Vec<Option<[u32; 3]>> {
    let faces = || region.mesh.faces.iter().zip(columns.corners);
    let mut uses: Vec<(u32, u32)> = faces()
        .filter_map(|(face, corners)| Some(face.iter().copied().zip((*corners)?)))
        .flatten()
        .collect();
    uses.sort_unstable();
    uses.dedup();
    let firsts: Vec<u32> = uses
        .chunk_by(|a, b| a.0 == b.0)
        .flat_map(|at_one_vertex| first_alike(at_one_vertex, columns))
        .collect();
    let first = |used: (u32, u32)| firsts[uses.partition_point(|other| *other < used)];
    faces()
        .map(|(face, corners)| {
            corners.map(|corners| std::array::from_fn(|k| first((face[k], corners[k]))))
        })
        .collect()
}

/// For each of the scan vertices at one region vertex: the first of them with equal columns.
fn first_alike(uses: &[(u32, u32)], columns: &Columns) -> Vec<u32> {
    // Most vertices of an indexed scan are alone; this spares reading their columns.
    if let [(_, alone)] = uses {
        return vec![*alone];
    }
    let mut seen = BTreeMap::new();
    uses.iter()
        .map(|(_, scan)| {
            let values = (columns.values)(*scan).into_iter();
            // The sum with 0 gives −0 and 0 the same bits.
            let bits: Vec<u64> = values.map(|x| (x + 0.0).to_bits()).collect();
            *seen.entry(bits).or_insert(*scan)
        })
        .collect()
}

/// The island of every region face, which is the lowest scan vertex of all faces connected by shared vertices; `None`
/// for faces with other attributes.
fn islands(corners: &[Option<[u32; 3]>], width: usize) -> Vec<Option<u32>> {
    // Without columns there are no seams.
    if width == 0 {
        return corners.iter().map(|c| c.map(|_| 0)).collect();
    }
    let all = || corners.iter().flatten();
    let mut vertices: Vec<u32> = all().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let index = |v: &u32| vertices.partition_point(|other| other < v);
    let mut parent: Vec<usize> = (0..vertices.len()).collect();
    let root = |parent: &[usize], mut k: usize| {
        while parent[k] != k {
            k = parent[k];
        }
        k
    };
    for corners in all() {
        let own = corners.each_ref().map(index);
        let roots = own.map(|k| root(&parent, k));
        let lowest = roots[0].min(roots[1]).min(roots[2]);
        // The corners point at the root too, which keeps paths short.
        (roots.iter().chain(&own)).for_each(|k| parent[*k] = lowest);
    }
    corners
        .iter()
        .map(|corners| corners.map(|[v, ..]| vertices[root(&parent, index(&v))]))
        .collect()
}

/// The scan's side of every rim edge, in the order of the patch's rim; `None` where the face there has other
/// attributes.
fn rim_edges(
    patch: &Patch,
    region: &Region,
    columns: &Columns,
    islands: &[Option<u32>],
) -> Vec<Option<RimEdge>> {
    let count = patch.rim.len();
    // The scan's face at a rim edge has the edge in the opposite direction.
    let wanted: BTreeMap<(u32, u32), usize> = (0..count)
        .map(|k| ((patch.rim[(k + 1) % count], patch.rim[k]), k))
        .collect();
    let mut edges = vec![None; count];
    let faces = region.mesh.faces.iter().zip(columns.corners);
    for ((face, corners), island) in faces.zip(islands) {
        let (Some(corners), Some(island)) = (*corners, *island) else {
            continue;
        };
        for k in 0..3 {
            if let Some(edge) = wanted.get(&(face[k], face[(k + 1) % 3])) {
                let (to, from) = (corners[k], corners[(k + 1) % 3]);
                edges[*edge] = Some(RimEdge { island, from, to });
            }
        }
    }
    edges
}

/// The island of every patch face: at a rim edge that of the scan's face there, elsewhere the one with the largest
/// harmonic measure (the extension of 1 on its part of the rim and 0 on the rest).
fn face_labels(patch: &Patch, around: &RimAttributes, labels: &[u32]) -> Vec<Option<u32>> {
    if labels.len() < 2 {
        return vec![labels.first().copied(); patch.faces.len()];
    }
    let rim = &around.rim;
    let measures: Vec<Vec<f64>> = labels
        .iter()
        .map(|label| {
            let on = |k: usize| {
                f64::from(u8::from(
                    rim[k % rim.len()].is_some_and(|e| e.island == *label),
                ))
            };
            let at_rim: Vec<[f64; 1]> = (0..rim.len())
                .map(|k| [0.5 * (on(k) + on(k + rim.len() - 1))])
                .collect();
            around.map.rim_extension.extend(&at_rim).map_or_else(
                |_| vec![0.0; patch.positions.len()],
                |x| x.into_iter().map(|[x]| x).collect(),
            )
        })
        .collect();
    let at_rim_edge = |f: &[u32; 3]| {
        (0..3).find_map(|k| {
            let edge = rim.get(f[k] as usize).copied().flatten()?;
            (f[(k + 1) % 3] as usize == (f[k] as usize + 1) % rim.len()).then_some(edge.island)
        })
    };
    let largest = |f: &[u32; 3]| {
        let sum = |l: usize| f.iter().map(|v| measures[l][*v as usize]).sum::<f64>();
        (0..labels.len())
            .max_by(|a, b| sum(*a).total_cmp(&sum(*b)).then(b.cmp(a)))
            .map(|l| labels[l])
    };
    patch
        .faces
        .iter()
        .map(|f| at_rim_edge(f).or_else(|| largest(f)))
        .collect()
}

/// One island's columns at every patch vertex: an affine map of the chart, if there is one, plus the harmonic extension
/// of the residual at the rim.
fn extend_island(
    label: u32,
    patch: &Patch,
    region: &Region,
    around: &RimAttributes,
) -> Result<Vec<Vec<f64>>, Exhausted> {
    let (columns, rim) = (around.columns, &around.rim);
    let budget = columns.budget;
    budget.spend(FACE_WORK * region.mesh.faces.len() as u64)?;
    let count = patch.positions.len();
    budget.spend(VALUE_WORK * (columns.width * count) as u64)?;
    budget.hold((size_of::<Vec<f64>>() + 8 * columns.width) * count)?;
    let mut values = match around.map.chart {
        Some(chart) => affine::values(label, patch, region, chart, around),
        None => vec![vec![0.0; columns.width]; count],
    };
    let held: Vec<(u32, u32)> = (0..rim.len() as u32)
        .filter_map(|k| Some((k, scan_vertex(rim, k, label)?)))
        .collect();
    let vertices: Vec<u32> = held.iter().map(|(k, _)| *k).collect();
    let from_part;
    let extension = if vertices.len() == rim.len() {
        Ok(around.map.rim_extension)
    } else {
        from_part = match around.map.chart {
            Some(_) => HarmonicExtension::new(&patch.flat, &patch.faces, &vertices, budget),
            None => HarmonicExtension::on_surface(&patch.mesh(), &vertices, budget),
        };
        from_part.as_ref()
    };
    if let Err(SolveError::Exhausted(exhausted)) = extension {
        return Err(*exhausted);
    }
    if let Ok(extension) = extension {
        let own: Vec<Vec<f64>> = held
            .iter()
            .map(|(_, scan)| (columns.values)(*scan))
            .collect();
        for c in 0..columns.width {
            budget.check()?;
            let residual: Vec<[f64; 1]> = own
                .iter()
                .zip(&vertices)
                .map(|(own, k)| [own[c] - values[*k as usize][c]])
                .collect();
            if let Ok(extended) = extension.extend(&residual) {
                values
                    .iter_mut()
                    .zip(&extended)
                    .for_each(|(v, [d])| v[c] += d);
            }
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flatten::{FlattenLimits, flatten};
    use crate::mesh::index::FaceId;
    use crate::mesh::region::region_around_hole;
    use crate::mesh::shapes::{concat, explode, sheet};
    use crate::mesh::weld::weld;
    use crate::mesh::{TriMesh, Vec3};
    use crate::patch::{PatchOptions, plan};

    /// A wavy sheet with a round hole, and its texture, which is mirrored right of the middle, on separate vertices.
    fn two_islands() -> (TriMesh, Vec<Vec<f64>>) {
        let [left, right] = [false, true].map(|right| {
            let keep = |u: f64, v: f64| (u > 0.5) == right && (u - 0.5).hypot(v - 0.5) > 0.2;
            sheet(36, keep, |u, v| Vec3::new(u, v, 0.06 * (10.0 * u).sin()))
        });
        let plain = left.positions.iter().map(|p| vec![0.4 * p.x, p.y]);
        let mirrored = right.positions.iter().map(|p| vec![1.0 - 0.4 * p.x, p.y]);
        (concat(&left, &right), plain.chain(mirrored).collect())
    }

    /// The attributed patch of a mesh's hole; `texture` holds the columns of its vertices.
    fn attributed(soup: &TriMesh, texture: &[Vec<f64>]) -> AttributedPatch {
        let welded = weld(soup);
        let region = region_around_hole(&welded.mesh, f64::INFINITY);
        let chart = flatten(&region, &FlattenLimits::default(), Budget::unlimited()).unwrap();
        let (options, filled) = (
            PatchOptions::default(),
            vec![Vec3::zeros(); crate::grid::CELLS],
        );
        let plan = plan(&region, &chart, &options).unwrap();
        let patch = plan.patch(&chart, &filled, &[], &options).unwrap();

        let source = |f: &FaceId| welded.soup_corners(soup, *f).expect("a face");
        let corners: Vec<Option<[u32; 3]>> = region.faces.iter().map(|f| Some(source(f))).collect();
        let mut any = vec![0; region.mesh.positions.len()];
        for (face, f) in region.mesh.faces.iter().zip(&region.faces) {
            (face.iter().zip(source(f))).for_each(|(v, s)| any[*v as usize] = s);
        }
        let values = |s: u32| texture[s as usize].clone();
        let columns = Columns {
            corners: &corners,
            any: &any,
            values: &values,
            width: texture[0].len(),
            budget: Budget::unlimited(),
        };
        extend_attributes(&plan.attribute_map(&chart), &patch, &region, &columns).unwrap()
    }

    #[test]
    fn separate_and_shared_vertices_give_the_same_attributes() {
        let (soup, texture) = two_islands();
        let own: Vec<Vec<f64>> = (soup.faces.iter().flatten())
            .map(|v| texture[*v as usize].clone())
            .collect();
        let shared = attributed(&soup, &texture);
        let apart = attributed(&explode(&soup), &own);
        assert_eq!(apart.faces, shared.faces);
        assert_eq!(apart.corners.len(), shared.corners.len());
        for (a, b) in apart.corners.iter().zip(&shared.corners) {
            assert_eq!(a.vertex, b.vertex);
            let off = (a.values.iter().zip(&b.values)).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-6, "{a:?} {b:?}");
        }
        for face in &apart.faces {
            let [a, b, c] = face.map(|v| apart.corners[v as usize].values[0]);
            let smeared = a.max(b).max(c) - a.min(b).min(c);
            assert!(smeared < 0.1, "a triangle spans two islands: {a} {b} {c}");
        }
    }

    #[test]
    fn without_columns_there_are_no_seams() {
        let soup = explode(&two_islands().0);
        let bare = attributed(&soup, &vec![Vec::new(); soup.positions.len()]);
        let vertices: BTreeSet<u32> = bare.corners.iter().map(|c| c.vertex).collect();
        assert_eq!(vertices.len(), bare.corners.len());
    }
}
