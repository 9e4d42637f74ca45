//! Sewing: panels are triangulated, and the vertices of a seam's two runs become one.

use super::error::GarmentError;
use super::panel::{Panel, PanelMesh, RunUse, Side};
use super::pattern::Pattern;
use darn_geometry::mesh::Vec2;
use rand::Rng;
use std::collections::BTreeMap;

/// A garment that is sewn and lies flat, its front on its back.
#[derive(Debug, Clone)]
pub(super) struct Sewn {
    /// Per vertex its place in the flat lay, (x, z), the mean of the panels' places.
    pub(super) laid: Vec<Vec2>,
    /// Per vertex its layer: −1 on the front, 1 on the back, 0 on a seam between them.
    pub(super) layer: Vec<f64>,
    /// Outwards.
    pub(super) faces: Vec<[u32; 3]>,
    /// Per face its panel and the corners in the panel's drawing.
    pub(super) drawn: Vec<DrawnFace>,
    /// Per opening its vertices, ascending.
    pub(super) openings: Vec<Vec<u32>>,
    /// The outline of every panel in its drawing.
    pub(super) outlines: Vec<Vec<Vec2>>,
}

/// A face in the drawing of its panel.
#[derive(Debug, Clone, Copy)]
pub(super) struct DrawnFace {
    pub(super) panel: usize,
    pub(super) corners: [Vec2; 3],
}

/// A run of a seam.
#[derive(Debug, Clone, Copy)]
struct SeamRun {
    panel: usize,
    run: usize,
}

/// Triangulates and sews a pattern.
pub(super) fn sew(pattern: &Pattern, rng: &mut impl Rng) -> Result<Sewn, GarmentError> {
    let seams = seams(&pattern.panels)?;
    let divisions = divisions(pattern, &seams);
    let mut meshes = Vec::new();
    for (panel, (cut, divisions)) in pattern.panels.iter().zip(&divisions).enumerate() {
        let mesh = cut.triangulate(divisions, pattern.spacing, rng);
        meshes.push(mesh.map_err(|reason| GarmentError::Panel { panel, reason })?);
    }
    Ok(joined(pattern, &meshes, &divisions, &seams))
}

/// The two runs of every seam.
fn seams(panels: &[Panel]) -> Result<Vec<[SeamRun; 2]>, GarmentError> {
    let mut runs: BTreeMap<u16, Vec<SeamRun>> = BTreeMap::new();
    for (panel, cut) in panels.iter().enumerate() {
        for (run, part) in cut.outline.runs.iter().enumerate() {
            if let RunUse::Seam(seam) = part.becomes {
                runs.entry(seam).or_default().push(SeamRun { panel, run });
            }
        }
    }
    let pair = |(seam, found): (u16, Vec<SeamRun>)| {
        let runs = found.len();
        <[SeamRun; 2]>::try_from(found).map_err(|_| GarmentError::Seam { seam, runs })
    };
    runs.into_iter().map(pair).collect()
}

/// Segments of every run: both runs of a seam have the same.
fn divisions(pattern: &Pattern, seams: &[[SeamRun; 2]]) -> Vec<Vec<usize>> {
    let count = |length: f64| ((length / pattern.spacing).round() as usize).max(1);
    let mut all: Vec<Vec<usize>> = (pattern.panels.iter())
        .map(|p| p.outline.runs.iter().map(|r| count(r.length())).collect())
        .collect();
    for pair in seams {
        let length = pair.map(|s| pattern.panels[s.panel].outline.runs[s.run].length());
        let n = count(0.5 * (length[0] + length[1]));
        pair.iter().for_each(|s| all[s.panel][s.run] = n);
    }
    all
}

fn joined(
    pattern: &Pattern,
    meshes: &[PanelMesh],
    divisions: &[Vec<usize>],
    seams: &[[SeamRun; 2]],
) -> Sewn {
    let mut first = vec![0usize];
    for mesh in meshes {
        first.push(first[first.len() - 1] + mesh.points.len());
    }
    let total = first[meshes.len()];
    // Vertex `k` (0 to the number of segments) of a run, among all panels' vertices.
    let vertex = |s: &SeamRun, k: usize| {
        let mesh = &meshes[s.panel];
        first[s.panel] + (mesh.starts[s.run] + k) % mesh.border
    };
    let mut joins = Joins((0..total).collect());
    for [a, b] in seams {
        let n = divisions[a.panel][a.run];
        let same_way = pattern.panels[a.panel].side != pattern.panels[b.panel].side;
        for k in 0..=n {
            joins.join(vertex(a, k), vertex(b, if same_way { k } else { n - k }));
        }
    }
    let mut place = vec![u32::MAX; total];
    let mut count = 0u32;
    for v in 0..total {
        let root = joins.root(v);
        if place[root] == u32::MAX {
            place[root] = count;
            count += 1;
        }
        place[v] = place[root];
    }
    let mut sewn = Sewn {
        laid: vec![Vec2::zeros(); count as usize],
        layer: vec![0.0; count as usize],
        faces: Vec::new(),
        drawn: Vec::new(),
        openings: vec![Vec::new(); pattern.openings.len()],
        outlines: (meshes.iter())
            .map(|m| m.points[..m.border].to_vec())
            .collect(),
    };
    let mut parts = vec![0.0; count as usize];
    for (number, (panel, mesh)) in pattern.panels.iter().zip(meshes).enumerate() {
        let at = |v: usize| place[first[number] + v];
        for (v, p) in mesh.points.iter().enumerate() {
            let v = at(v) as usize;
            sewn.laid[v] += panel.laid(*p);
            sewn.layer[v] += match panel.side {
                Side::Front => -1.0,
                Side::Back => 1.0,
            };
            parts[v] += 1.0;
        }
        for face in &mesh.faces {
            let face = match panel.side {
                Side::Front => *face,
                Side::Back => [face[0], face[2], face[1]],
            };
            sewn.faces.push(face.map(|v| at(v as usize)));
            sewn.drawn.push(DrawnFace {
                panel: number,
                corners: face.map(|v| mesh.points[v as usize]),
            });
        }
        for (run, part) in panel.outline.runs.iter().enumerate() {
            if let RunUse::Open(opening) = part.becomes {
                let s = SeamRun { panel: number, run };
                let along = 0..=divisions[number][run];
                sewn.openings[opening].extend(along.map(|k| place[vertex(&s, k)]));
            }
        }
    }
    for (v, n) in parts.iter().enumerate() {
        sewn.laid[v] /= *n;
        sewn.layer[v] /= *n;
    }
    for opening in &mut sewn.openings {
        opening.sort_unstable();
        opening.dedup();
    }
    sewn
}

/// Sets of vertices that become one; the root of each is its least.
struct Joins(Vec<usize>);

impl Joins {
    fn root(&mut self, mut v: usize) -> usize {
        while self.0[v] != v {
            self.0[v] = self.0[self.0[v]];
            v = self.0[v];
        }
        v
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b);
    }
}
