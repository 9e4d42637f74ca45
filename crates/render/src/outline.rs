//! Which edges are drawn as lines: boundary edges always, all edges for a wireframe.

use super::camera::Camera;
use super::shade::{Light, RIM_INK, WIRE_INK};
use super::{Drawable, Lines};
use darn_geometry::mesh::{TriMesh, Vec3};

/// A line to be drawn.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    /// Pixel x, pixel y, depth of both ends.
    pub ends: [Vec3; 2],
    /// Width in pixels.
    pub width: f64,
    /// Coverage of the ink, 0 to 1.
    pub alpha: f32,
    pub ink: Light,
    /// How far the line is drawn in front of the surface, units of depth; keeps it from sinking into its own faces.
    pub lift: f64,
}

/// The lines of a picture, wireframe first, so that rims lie on top.
pub(super) fn segments(
    mesh: &TriMesh,
    faces: &[Drawable],
    lines: Lines,
    camera: &Camera,
) -> Vec<Segment> {
    let edges = edges(faces);
    let seen = |v: usize| {
        camera.projected(&camera.seen(&mesh.positions.get(v).copied().unwrap_or_default()))
    };
    let segment = |&([a, b], _): &([usize; 2], usize), width: f64, ink: Light, alpha: f32| {
        let ends = [seen(a)?, seen(b)?];
        let lift = 1.2e-3 * ends[0].z.min(ends[1].z);
        Some(Segment {
            ends,
            width,
            alpha,
            ink,
            lift,
        })
    };
    let wires: Vec<_> = match lines {
        Lines::Rims => Vec::new(),
        Lines::Wireframe => edges
            .iter()
            .filter_map(|e| segment(e, 0.8, WIRE_INK, 0.55))
            .collect(),
    };
    let rims = edges
        .iter()
        .filter(|(_, faces)| *faces == 1)
        .filter_map(|e| segment(e, 1.7, RIM_INK, 0.85));
    wires.into_iter().chain(rims).collect()
}

/// Every edge once, in order, with the number of faces at it.
fn edges(faces: &[Drawable]) -> Vec<([usize; 2], usize)> {
    let sides = |f: &Drawable| {
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
        .filter_map(|same| same.first().map(|&edge| (edge, same.len())))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shared_edge_of_two_faces_is_no_boundary() {
        let faces = [[0, 1, 2], [0, 2, 3]].map(|vertices| Drawable { face: 0, vertices });
        let found = edges(&faces);
        assert_eq!(found.len(), 5);
        assert_eq!(found.iter().filter(|(_, n)| *n == 1).count(), 4);
        assert!(found.contains(&([0, 2], 2)));
    }
}
