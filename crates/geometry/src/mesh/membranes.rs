//! Where a mesher has probably sealed a hole: patches of triangles that are far larger than those around them.

use std::collections::{BTreeMap, BTreeSet};

use darn_budget::{Budget, Exhausted};

use super::curvature::face_areas;
use super::index::{FaceId, HalfEdgeId, VertexId};
use super::topology::Topology;
use super::{TriMesh, Vec3};

/// A face starts a membrane when its longest side is longer than this many median edges of its component.
const SEED: f64 = 2.2;
/// A face belongs to a membrane when its longest side is longer than this many.
const MEMBER: f64 = 1.7;
/// Least ratio of the median edge of a membrane to that of the cloth around it.
const COARSER: f64 = 1.7;
/// Largest ratio of the median edge around a membrane to that of its component: where the cloth grows coarser
/// gradually, nothing was sealed.
const GRADUAL: f64 = 1.4;
/// Least area of a membrane, in median faces of the cloth around it.
const LEAST_AREA: f64 = 8.0;
/// Nanoseconds of work a face.
const FACE_WORK: u64 = 250;

/// A patch of triangles far larger than those around it, with cloth on all sides.
#[derive(Debug, Clone, PartialEq)]
pub struct Membrane {
    /// Its faces, ascending.
    pub faces: Vec<FaceId>,
    /// Its area, scene units squared.
    pub area: f64,
    /// Mean of its faces, weighted by area.
    pub centroid: Vec3,
    /// The longest closed line around it, in the direction of its faces.
    pub rim: Vec<VertexId>,
    /// Vertices that are not at its border.
    pub inner: usize,
    /// Its median edge, scene units.
    pub edge: f64,
    /// The median edge of the faces around it, scene units.
    pub edge_around: f64,
    /// Median over its faces of longest side ÷ height on it, where 1.15 is equilateral.
    pub stretch: f64,
}

/// The membranes of a welded mesh, largest first. O(n log n).
///
/// # Errors
/// `Exhausted`.
pub fn membranes(
    mesh: &TriMesh,
    topology: &Topology,
    budget: &Budget,
) -> Result<Vec<Membrane>, Exhausted> {
    budget.spend_at_once(FACE_WORK * mesh.faces.len() as u64)?;
    let search = Search::of(mesh, topology);
    let mut of_face = vec![false; mesh.faces.len()];
    let mut found = Vec::new();
    for seed in (0..mesh.faces.len() as u32).map(FaceId) {
        if of_face[seed.index()] || search.size(seed) <= SEED {
            continue;
        }
        let group = search.group(seed, &mut of_face);
        found.extend(search.membrane(group));
    }
    found.sort_by(|a, b| b.area.total_cmp(&a.area));
    Ok(found)
}

struct Search<'a> {
    mesh: &'a TriMesh,
    topology: &'a Topology,
    areas: Vec<f64>,
    /// Per component its median edge.
    medians: Vec<f64>,
}

impl<'a> Search<'a> {
    fn of(mesh: &'a TriMesh, topology: &'a Topology) -> Search<'a> {
        let mut edges: Vec<Vec<f64>> = vec![Vec::new(); topology.components];
        for face in (0..mesh.faces.len() as u32).map(FaceId) {
            let lengths = face.half_edges().map(|h| length(mesh, topology, h));
            edges[topology.component(face) as usize].extend(lengths);
        }
        Search {
            areas: face_areas(mesh),
            medians: edges.into_iter().map(median).collect(),
            mesh,
            topology,
        }
    }

    fn longest(&self, face: FaceId) -> f64 {
        let sides = face
            .half_edges()
            .map(|h| length(self.mesh, self.topology, h));
        sides.into_iter().fold(0.0, f64::max)
    }

    /// The longest side of a face in median edges of its component.
    fn size(&self, face: FaceId) -> f64 {
        let median = self.medians[self.topology.component(face) as usize];
        self.longest(face) / median
    }

    /// The large faces connected to a seed, and those between their vertices.
    fn group(&self, seed: FaceId, of_face: &mut [bool]) -> BTreeSet<FaceId> {
        let mut group = BTreeSet::from([seed]);
        let mut vertices = BTreeSet::new();
        let mut small = BTreeSet::new();
        let mut open = vec![seed];
        of_face[seed.index()] = true;
        while let Some(face) = open.pop() {
            vertices.extend(self.mesh.faces[face.index()]);
            for next in self.across(face) {
                if of_face[next.index()] {
                    continue;
                }
                if self.size(next) > MEMBER {
                    of_face[next.index()] = true;
                    group.insert(next);
                    open.push(next);
                } else {
                    small.insert(next);
                }
            }
        }
        // Ears: a mesher's triangles between neighbours of the rim are no larger than the cloth's.
        let between = |f: &FaceId| {
            let corners = self.mesh.faces[f.index()];
            !of_face[f.index()] && corners.iter().all(|v| vertices.contains(v))
        };
        let ears: Vec<FaceId> = small.into_iter().filter(between).collect();
        for ear in ears {
            of_face[ear.index()] = true;
            group.insert(ear);
        }
        group
    }

    fn across(&self, face: FaceId) -> impl Iterator<Item = FaceId> {
        let twins = face.half_edges().into_iter().map(|h| self.topology.twin(h));
        twins.flatten().map(|twin| twin.face())
    }

    /// The membrane of a group of faces, if it is one.
    fn membrane(&self, group: BTreeSet<FaceId>) -> Option<Membrane> {
        let (mesh, topology) = (self.mesh, self.topology);
        let mut border = Vec::new();
        for h in group.iter().flat_map(|f| f.half_edges()) {
            // At the cloth's own edge nothing was sealed.
            if !group.contains(&topology.twin(h)?.face()) {
                border.push(h);
            }
        }
        let edge_of = |h: HalfEdgeId| length(mesh, topology, h);
        let around: BTreeSet<FaceId> = (border.iter())
            .flat_map(|h| topology.faces_at(topology.origin(*h)))
            .filter(|f| !group.contains(f))
            .collect();
        let edges = |faces: &BTreeSet<FaceId>| {
            median(
                faces
                    .iter()
                    .flat_map(|f| f.half_edges())
                    .map(edge_of)
                    .collect(),
            )
        };
        let (edge, edge_around) = (edges(&group), edges(&around));
        let component = topology.component(*group.first()?) as usize;
        let area: f64 = group.iter().map(|f| self.areas[f.index()]).sum();
        let face_around = median(around.iter().map(|f| self.areas[f.index()]).collect());
        let is_one = edge > COARSER * edge_around
            && edge_around < GRADUAL * self.medians[component]
            && area > LEAST_AREA * face_around;
        if !is_one {
            return None;
        }
        let mut moment = Vec3::zeros();
        let mut stretches = Vec::new();
        let mut vertices = BTreeSet::new();
        for face in &group {
            let [a, b, c] = mesh.triangle(face.index());
            let (own, longest) = (self.areas[face.index()], self.longest(*face));
            moment += (a + b + c) * (own / 3.0);
            stretches.push(longest * longest / (2.0 * own).max(f64::MIN_POSITIVE));
            vertices.extend(mesh.faces[face.index()]);
        }
        let at_border: BTreeSet<u32> = border.iter().map(|h| topology.origin(*h).0).collect();
        Some(Membrane {
            area,
            centroid: moment / area,
            rim: self.longest_line(&border),
            inner: vertices.len() - at_border.len(),
            edge,
            edge_around,
            stretch: median(stretches),
            faces: group.into_iter().collect(),
        })
    }

    /// The longest of the closed lines that half-edges form.
    fn longest_line(&self, border: &[HalfEdgeId]) -> Vec<VertexId> {
        let mut leaving: BTreeMap<VertexId, Vec<HalfEdgeId>> = BTreeMap::new();
        for h in border.iter().rev() {
            leaving
                .entry(self.topology.origin(*h))
                .or_default()
                .push(*h);
        }
        let mut longest = (0.0, Vec::new());
        for start in border {
            let (mut line, mut size) = (Vec::new(), 0.0);
            let mut at = self.topology.origin(*start);
            while let Some(h) = leaving.get_mut(&at).and_then(Vec::pop) {
                line.push(at);
                size += length(self.mesh, self.topology, h);
                at = self.topology.target(h);
            }
            if size > longest.0 {
                longest = (size, line);
            }
        }
        longest.1
    }
}

fn length(mesh: &TriMesh, topology: &Topology, h: HalfEdgeId) -> f64 {
    let at = |v: VertexId| mesh.positions[v.index()];
    (at(topology.target(h)) - at(topology.origin(h))).norm()
}

/// The middle of a list's values; 0 of an empty list.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::shapes::{holed_sheet, jitter, sheet};
    use crate::mesh::topology::Topology;
    use crate::mesh::weld::weld;

    fn found(mesh: &TriMesh) -> Vec<Membrane> {
        let welded = weld(mesh);
        membranes(&welded.mesh, &welded.topology(), Budget::unlimited()).unwrap()
    }

    /// A folded sheet with a hole that a fan closes: from its first vertex, or from its middle.
    fn sealed(from_middle: bool) -> (TriMesh, usize) {
        let mut mesh = jitter(&weld(&holed_sheet(30, 0.2)).mesh, 0.003, 3);
        for p in &mut mesh.positions {
            p.z += 0.05 * (12.0 * p.x).sin();
        }
        let loops = boundary_loops(&mesh, &Topology::new(&mesh));
        let hole = loops.iter().find(|l| l.kind == LoopKind::Hole).unwrap();
        let mut rim: Vec<u32> = hole.vertices.iter().map(|v| v.0).collect();
        // A fan's first and last triangles must not be triangles that the sheet has.
        let is_face = |corners: [u32; 3]| {
            mesh.faces
                .iter()
                .any(|f| corners.iter().all(|v| f.contains(v)))
        };
        let at = |k: usize| rim[k % rim.len()];
        let starts = (2..rim.len() + 2).find(|k| {
            !is_face([at(*k), at(k + 1), at(k + 2)]) && !is_face([at(*k), at(k - 1), at(k - 2)])
        });
        let start = starts.unwrap() % rim.len();
        rim.rotate_left(start);
        let before = mesh.faces.len();
        if from_middle {
            let middle = mesh.positions.len() as u32;
            mesh.positions.push(hole.centroid);
            let following = rim.iter().cycle().skip(1);
            mesh.faces
                .extend(rim.iter().zip(following).map(|(a, b)| [*b, *a, middle]));
        } else {
            let ends = rim[1..].windows(2);
            mesh.faces.extend(ends.map(|e| [rim[0], e[1], e[0]]));
        }
        let lid = mesh.faces.len() - before;
        (mesh, lid)
    }

    #[test]
    fn a_hole_that_a_fan_closed_is_found_with_all_its_faces() {
        for from_middle in [false, true] {
            let (mesh, lid) = sealed(from_middle);
            let found = found(&mesh);
            let [membrane] = &found[..] else {
                panic!("{found:?}");
            };
            let first = mesh.faces.len() - lid;
            let (of_lid, teeth): (Vec<FaceId>, Vec<FaceId>) =
                membrane.faces.iter().partition(|f| f.index() >= first);
            let missed = lid - of_lid.len();
            assert!(missed <= 2, "{missed} of {lid}");
            // A tooth of the cloth lies between neighbours of the rim, as a mesher's triangle does.
            let rim: BTreeSet<u32> = mesh.faces[first..].iter().flatten().copied().collect();
            for tooth in &teeth {
                assert!(mesh.faces[tooth.index()].iter().all(|v| rim.contains(v)));
            }
            assert_eq!(membrane.inner, usize::from(from_middle) + teeth.len());
            let around = rim.len() - usize::from(from_middle);
            assert_eq!(membrane.rim.len() + teeth.len() + missed, around);
            assert!((membrane.centroid - Vec3::new(0.5, 0.5, 0.0)).xy().norm() < 0.1);
        }
    }

    #[test]
    fn cloth_that_is_whole_or_grows_coarser_has_no_membrane() {
        let bent = |u: f64, v: f64| Vec3::new(u, v, 0.1 * (9.0 * u).sin());
        assert!(found(&sheet(25, |_, _| true, bent)).is_empty());
        assert!(found(&holed_sheet(25, 0.2)).is_empty());
        let graded = |u: f64, v: f64| Vec3::new(u * u * u, v, 0.0);
        assert!(found(&sheet(25, |_, _| true, graded)).is_empty());
    }
}
