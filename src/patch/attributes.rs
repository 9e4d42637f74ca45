//! Texture coordinates and colours of the patch: on the rim the scan's own, inside their smooth continuation.
//!
//! A texture seam that runs into the hole runs on through the patch: each island of the texture around the rim is continued on its own
//! (affine fit over the chart plus the harmonic extension of what is left at the rim), and the patch's faces are shared out among them.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix3};

use super::harmonic::Extension;
use super::{Patch, Plan};
use crate::flatten::Chart;
use crate::mesh::Vec2;
use crate::mesh::region::Region;

/// The scan's attributes around a hole, as columns of numbers.
pub struct Columns<'a> {
    /// Per region face: the scan vertices at its corners; `None` for faces whose attributes mean something else (another material).
    pub corners: &'a [Option<[u32; 3]>],
    /// Per region vertex: one scan vertex at its place, whatever its attributes.
    pub any: &'a [u32],
    /// The columns of one scan vertex; always `width` long.
    pub values: &'a (dyn Fn(u32) -> Vec<f64> + Sync),
    /// Number of columns.
    pub width: usize,
}

/// A vertex of the patch as it is written: patch vertices on a texture seam occur once per side.
#[derive(Debug, Clone, PartialEq)]
pub struct Corner {
    /// The patch vertex.
    pub vertex: u32,
    /// The scan vertex it coincides with, on the rim.
    pub scan: Option<u32>,
    /// Its columns.
    pub values: Vec<f64>,
}

/// The patch with its seams cut open.
#[derive(Debug, Clone, PartialEq)]
pub struct Dressed {
    /// Vertices.
    pub corners: Vec<Corner>,
    /// Faces, in the patch's order.
    pub faces: Vec<[u32; 3]>,
}

/// Carries the columns over into the patch.
///
/// `plan` is the one that the patch was made by.
pub fn dress(
    (plan, patch): (&Plan, &Patch),
    region: &Region,
    chart: &Chart,
    columns: &Columns,
) -> Dressed {
    let islands = Islands::of(columns);
    let around = Around {
        columns,
        seam: plan.seam(),
        rim: rim_edges(patch, region, columns, &islands),
        islands,
    };
    let rim = &around.rim;
    let labels: Vec<u32> = rim
        .iter()
        .flatten()
        .map(|e| e.island)
        .collect::<std::collections::BTreeSet<_>>()
        .into_iter()
        .collect();
    let faces = face_labels(patch, &around, &labels);
    let sheets: BTreeMap<u32, Vec<Vec<f64>>> = labels
        .iter()
        .map(|l| (*l, continued(*l, patch, region, chart, &around)))
        .collect();

    let mut index = BTreeMap::new();
    let mut corners: Vec<Corner> = Vec::new();
    let mut place = |vertex: u32, label: Option<u32>| {
        *index.entry((vertex, label)).or_insert_with(|| {
            let own = label.and_then(|l| scan_vertex(rim, vertex, l));
            let at_rim = patch.rim.get(vertex as usize);
            let values = match (own, label) {
                (Some(scan), _) => (columns.values)(scan),
                (None, Some(l)) => sheets[&l][vertex as usize].clone(),
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
        .map(|(f, label)| f.map(|v| place(v, *label)))
        .collect();
    Dressed { corners, faces }
}

/// The attributes around a hole, sorted out.
struct Around<'a> {
    columns: &'a Columns<'a>,
    /// The extension from all of the rim.
    seam: &'a Extension,
    /// The scan's side of every rim edge, in the patch's order.
    rim: Vec<Option<RimEdge>>,
    islands: Islands,
}

/// The scan's side of a rim edge, from rim vertex k to k + 1.
#[derive(Debug, Clone, Copy)]
struct RimEdge {
    island: u32,
    from: u32,
    to: u32,
}

/// The scan vertex at a rim vertex on the side of an island.
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

/// The island of every scan vertex that has attributes to carry: region faces joined where they share scan vertices.
struct Islands {
    /// The vertices, ascending.
    vertices: Vec<u32>,
    /// Of each its island, named by its lowest vertex.
    labels: Vec<u32>,
}

impl Islands {
    fn of(columns: &Columns) -> Islands {
        let all = || columns.corners.iter().flatten();
        let mut vertices: Vec<u32> = all().flatten().copied().collect();
        vertices.sort_unstable();
        vertices.dedup();
        let place = |v: &u32| vertices.partition_point(|other| other < v);
        let mut parent: Vec<usize> = (0..vertices.len()).collect();
        let root = |parent: &[usize], mut k: usize| {
            while parent[k] != k {
                k = parent[k];
            }
            k
        };
        for corners in all() {
            let places = corners.each_ref().map(place);
            let roots = places.map(|k| root(&parent, k));
            let lowest = roots[0].min(roots[1]).min(roots[2]);
            // Pointing the corners themselves at the root as well keeps the paths short.
            (roots.iter().chain(&places)).for_each(|k| parent[*k] = lowest);
        }
        let labels = (0..vertices.len())
            .map(|k| vertices[root(&parent, k)])
            .collect();
        Islands { vertices, labels }
    }

    /// The island of a scan vertex of the region; none without attributes.
    fn get(&self, vertex: u32) -> Option<u32> {
        let place = self.vertices.binary_search(&vertex).ok()?;
        Some(self.labels[place])
    }
}

/// The scan's side of every rim edge, in the patch's order; `None` where the face there has no attributes to carry.
fn rim_edges(
    patch: &Patch,
    region: &Region,
    columns: &Columns,
    islands: &Islands,
) -> Vec<Option<RimEdge>> {
    let count = patch.rim.len();
    // The face beside the rim runs along it the other way round.
    let wanted: BTreeMap<(u32, u32), usize> = (0..count)
        .map(|k| ((patch.rim[(k + 1) % count], patch.rim[k]), k))
        .collect();
    let mut edges = vec![None; count];
    for (face, corners) in region.mesh.faces.iter().zip(columns.corners) {
        let Some(corners) = corners else { continue };
        for k in 0..3 {
            if let Some(edge) = wanted.get(&(face[k], face[(k + 1) % 3])) {
                let (to, from) = (corners[k], corners[(k + 1) % 3]);
                edges[*edge] = islands.get(from).map(|island| RimEdge { island, from, to });
            }
        }
    }
    edges
}

/// Which island every patch face belongs to: the one whose part of the rim is harmonically nearest.
fn face_labels(patch: &Patch, around: &Around, labels: &[u32]) -> Vec<Option<u32>> {
    if labels.len() < 2 {
        return vec![labels.first().copied(); patch.faces.len()];
    }
    let rim = &around.rim;
    let nearness: Vec<Vec<f64>> = labels
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
            around.seam.extend(&at_rim).map_or_else(
                |_| vec![0.0; patch.flat.len()],
                |x| x.into_iter().map(|[x]| x).collect(),
            )
        })
        .collect();
    let beside = |f: &[u32; 3]| {
        (0..3).find_map(|k| {
            let edge = rim.get(f[k] as usize).copied().flatten()?;
            (f[(k + 1) % 3] as usize == (f[k] as usize + 1) % rim.len()).then_some(edge.island)
        })
    };
    let nearest = |f: &[u32; 3]| {
        let sum = |l: usize| f.iter().map(|v| nearness[l][*v as usize]).sum::<f64>();
        (0..labels.len())
            .max_by(|a, b| sum(*a).total_cmp(&sum(*b)).then(b.cmp(a)))
            .map(|l| labels[l])
    };
    patch
        .faces
        .iter()
        .map(|f| beside(f).or_else(|| nearest(f)))
        .collect()
}

/// One island's columns at every patch vertex: affine over the chart, plus the harmonic extension of the remainder at its rim.
fn continued(
    label: u32,
    patch: &Patch,
    region: &Region,
    chart: &Chart,
    around: &Around,
) -> Vec<Vec<f64>> {
    let (columns, rim) = (around.columns, &around.rim);
    let mut samples: Vec<(u32, Vec2)> = Vec::new();
    for (face, corners) in region.mesh.faces.iter().zip(columns.corners) {
        // The corners of a face are of one island.
        if let Some(corners) = corners.filter(|c| around.islands.get(c[0]) == Some(label)) {
            let flat = face.map(|v| chart.flat[v as usize]);
            samples.extend(corners.into_iter().zip(flat));
        }
    }
    samples.sort_by_key(|(scan, _)| *scan);
    samples.dedup_by_key(|(scan, _)| *scan);
    let fit = affine_fit(&samples, columns, patch);
    let at = |p: &Vec2| -> Vec<f64> {
        (0..columns.width)
            .map(|c| fit[(0, c)] + fit[(1, c)] * p.x + fit[(2, c)] * p.y)
            .collect()
    };
    let held: Vec<(u32, u32)> = (0..rim.len() as u32)
        .filter_map(|k| Some((k, scan_vertex(rim, k, label)?)))
        .collect();
    let vertices: Vec<u32> = held.iter().map(|(k, _)| *k).collect();
    let mut values: Vec<Vec<f64>> = patch.flat.iter().map(&at).collect();
    let from_part;
    let extension = if vertices.len() == rim.len() {
        Ok(around.seam)
    } else {
        from_part = Extension::new(&patch.flat, &patch.faces, &vertices);
        from_part.as_ref()
    };
    if let Ok(extension) = extension {
        let own: Vec<Vec<f64>> = held
            .iter()
            .map(|(_, scan)| (columns.values)(*scan))
            .collect();
        for c in 0..columns.width {
            let left: Vec<[f64; 1]> = own
                .iter()
                .zip(&vertices)
                .map(|(own, k)| [own[c] - values[*k as usize][c]])
                .collect();
            if let Ok(spread) = extension.extend(&left) {
                values
                    .iter_mut()
                    .zip(&spread)
                    .for_each(|(v, [d])| v[c] += d);
            }
        }
    }
    values
}

/// Least-squares affine map from the chart to the columns, samples near the hole weighing most; rows: constant, x, y.
fn affine_fit(samples: &[(u32, Vec2)], columns: &Columns, patch: &Patch) -> DMatrix<f64> {
    let rim = patch.rim.len() as f64;
    let centre = patch.flat.iter().take(patch.rim.len()).sum::<Vec2>() / rim;
    let size = patch
        .flat
        .iter()
        .take(patch.rim.len())
        .map(|p| (p - centre).norm_squared())
        .sum::<f64>()
        / rim;
    let mut normal = Matrix3::zeros();
    let mut rhs = nalgebra::Matrix3xX::zeros(columns.width);
    for (scan, p) in samples {
        let d = (p - centre) / size.sqrt().max(f64::MIN_POSITIVE);
        let weight = (-d.norm_squared()).exp() + 1e-6;
        let row = nalgebra::Vector3::new(1.0, d.x, d.y);
        normal += row * row.transpose() * weight;
        for (c, value) in (columns.values)(*scan).iter().enumerate() {
            (0..3).for_each(|r| rhs[(r, c)] += weight * row[r] * value);
        }
    }
    // A touch of ridge: a single line of samples leaves one slope open, which then is zero.
    normal += Matrix3::from_diagonal(&nalgebra::Vector3::new(0.0, 1e-9, 1e-9))
        * normal.trace().max(f64::MIN_POSITIVE);
    let solution = normal.try_inverse().map_or_else(
        || DMatrix::zeros(3, columns.width),
        |inverse| DMatrix::from_fn(3, columns.width, |r, c| (inverse * rhs.column(c))[r]),
    );
    // Back from centred, scaled coordinates to the chart's.
    let scale = size.sqrt().max(f64::MIN_POSITIVE);
    DMatrix::from_fn(3, columns.width, |r, c| match r {
        0 => solution[(0, c)] - (solution[(1, c)] * centre.x + solution[(2, c)] * centre.y) / scale,
        _ => solution[(r, c)] / scale,
    })
}
