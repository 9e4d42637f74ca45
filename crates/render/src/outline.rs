//! Edges as lines: boundary edges always, all edges for a wireframe.

use super::camera::Camera;
use super::face::DrawableFace;
use super::options::EdgeLines;
use super::shade::{LinearRgb, RIM_INK, WIRE_INK};
use darn_geometry::mesh::{TriMesh, Vec3};

/// A line to draw.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    /// Pixel x, pixel y, depth of both ends.
    pub ends: [Vec3; 2],
    pub style: LineStyle,
    /// How far in front of the surface the line is drawn, units of depth, so that its own faces do not hide it.
    pub lift: f64,
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineStyle {
    /// Width in pixels.
    pub width: f64,
    /// Coverage of the ink, 0 to 1.
    pub alpha: f32,
    pub ink: LinearRgb,
}

const WIRE: LineStyle = LineStyle {
    width: 0.8,
    alpha: 0.55,
    ink: WIRE_INK,
};
const RIM: LineStyle = LineStyle {
    width: 1.7,
    alpha: 0.85,
    ink: RIM_INK,
};

/// The lines of a picture; the wireframe comes first, so that rims are drawn over it.
pub(super) fn segments(
    mesh: &TriMesh,
    faces: &[DrawableFace],
    lines: EdgeLines,
    camera: &Camera,
) -> Vec<Segment> {
    let edges = edges(faces);
    let seen = |v: usize| {
        camera.project(&camera.point_in_axes(&mesh.positions.get(v).copied().unwrap_or_default()))
    };
    let segment = |edge: &MeshEdge, style: LineStyle| {
        let ends = [seen(edge.start)?, seen(edge.end)?];
        let lift = 1.2e-3 * ends[0].z.min(ends[1].z);
        Some(Segment { ends, style, lift })
    };
    let wires: Vec<_> = match lines {
        EdgeLines::Rims => Vec::new(),
        EdgeLines::Wireframe => edges
            .iter()
            .filter_map(|edge| segment(edge, WIRE))
            .collect(),
    };
    let rims = edges
        .iter()
        .filter(|edge| edge.faces == 1)
        .filter_map(|edge| segment(edge, RIM));
    wires.into_iter().chain(rims).collect()
}

/// An edge of the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct MeshEdge {
    /// The smaller vertex.
    start: usize,
    /// The larger vertex.
    end: usize,
    /// Number of faces at it.
    faces: usize,
}

/// Every edge once, in order of its vertices.
fn edges(faces: &[DrawableFace]) -> Vec<MeshEdge> {
    let sides = |f: &DrawableFace| {
        [
            [f.vertices[0], f.vertices[1]],
            [f.vertices[1], f.vertices[2]],
            [f.vertices[2], f.vertices[0]],
        ]
    };
    let mut all: Vec<[usize; 2]> = faces
        .iter()
        .flat_map(sides)
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    all.sort_unstable();
    all.chunk_by(|a, b| a == b)
        .filter_map(|same| {
            let &[start, end] = same.first()?;
            let faces = same.len();
            Some(MeshEdge { start, end, faces })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shared_edge_of_two_faces_is_no_boundary() {
        let faces = [[0, 1, 2], [0, 2, 3]].map(|vertices| DrawableFace { face: 0, vertices });
        let found = edges(&faces);
        assert_eq!(found.len(), 5);
        assert_eq!(found.iter().filter(|edge| edge.faces == 1).count(), 4);
        assert!(found.contains(&MeshEdge {
            start: 0,
            end: 2,
            faces: 2
        }));
    }
}
