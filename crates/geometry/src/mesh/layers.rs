//! Other layers of cloth near a hole: faces outside the hole's region that a patch must not cut.

use std::collections::HashSet;

use super::blocks::FaceBlocks;
use super::bounds::Bounds;
use super::index::{FaceId, VertexId};
use super::region::{BoundedMesh, Region};
use super::topology::Topology;
use super::{TriMesh, Vec3};

/// Pieces of fewer faces are scraps: they say nothing of the cloth.
pub const FEWEST_FACES: usize = 8;

/// Faces near a hole, outside its region.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layers {
    /// The faces, as a mesh.
    pub mesh: TriMesh,
    /// Per face the component that it belongs to, where that is not the hole's.
    pub other: Vec<Option<u32>>,
}

impl Layers {
    /// The faces outside `region` whose bounding boxes come within `margin` (scene units) of the rim's. `blocks` are those of
    /// the whole mesh.
    ///
    /// A face with a vertex on the rim is left out: it touches the patch there and does not cut it. So are the faces `left` and scraps:
    /// they are no cloth, and may lie where the cloth was.
    pub fn near(
        whole: &BoundedMesh,
        blocks: &FaceBlocks,
        region: &Region,
        margin: f64,
        left: &[FaceId],
    ) -> Layers {
        let BoundedMesh { mesh, topology, .. } = whole;
        let rim = || (region.rim.iter()).map(|v| region.mesh.positions[*v as usize]);
        let low = rim().fold(Vec3::repeat(f64::MAX), |m, p| m.inf(&p)) - Vec3::repeat(margin);
        let high = rim().fold(Vec3::repeat(f64::MIN), |m, p| m.sup(&p)) + Vec3::repeat(margin);
        let place = Bounds { low, high };
        let own: HashSet<FaceId> = region.faces.iter().chain(left).copied().collect();
        let on_rim: HashSet<VertexId> = (region.rim.iter())
            .map(|v| region.vertices[*v as usize])
            .collect();
        let is_near = |face: &usize| {
            let touches = |v: &u32| on_rim.contains(&VertexId(*v));
            Bounds::of_face(mesh, *face).is_some_and(|b| b.meets(&place))
                && !own.contains(&FaceId(*face as u32))
                && !mesh.faces[*face].iter().any(touches)
                && !is_scrap(topology, FaceId(*face as u32))
        };
        let near: Vec<usize> = blocks.near(&place).filter(is_near).collect();
        let component = |face: usize| topology.component(FaceId(face as u32));
        let holes_own = region.faces.first().map(|f| component(f.index()));
        Layers {
            mesh: mesh.part(near.iter().map(|f| mesh.faces[*f])),
            other: (near.iter())
                .map(|f| Some(component(*f)).filter(|c| Some(*c) != holes_own))
                .collect(),
        }
    }
}

/// Whether the piece that a face belongs to has fewer than [`FEWEST_FACES`] faces.
fn is_scrap(topology: &Topology, face: FaceId) -> bool {
    let mut piece = vec![face];
    let mut seen = 0;
    while let Some(face) = piece.get(seen).copied() {
        seen += 1;
        for half_edge in face.half_edges() {
            let next = topology.twin(half_edge).map(|twin| twin.face());
            piece.extend(next.filter(|next| !piece.contains(next)));
        }
        if piece.len() >= FEWEST_FACES {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::loops::boundary_loops;
    use crate::mesh::region::region_around_hole;
    use crate::mesh::shapes::{concat, sheet};
    use crate::mesh::topology::Topology;
    use crate::mesh::weld::weld;

    fn near_within(mesh: &TriMesh, region: &Region, margin: f64) -> Layers {
        let topology = Topology::new(mesh);
        let loops = boundary_loops(mesh, &topology);
        let whole = BoundedMesh {
            mesh,
            topology: &topology,
            loops: &loops,
        };
        Layers::near(&whole, &FaceBlocks::new(mesh), region, margin, &[])
    }

    #[test]
    fn scraps_are_no_layer_and_larger_pieces_are() {
        let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.1;
        let holed = sheet(30, keep, |u, v| Vec3::new(u, v, 0.0));
        for faces in (2..=12).step_by(2) {
            let strip = sheet(
                12,
                |_, v| v < 1.0 / 12.0,
                |u, v| Vec3::new(0.45 + 0.1 * u, 0.45 + v, 0.01),
            );
            let mut piece = strip;
            piece.faces.truncate(faces);
            let mesh = weld(&concat(&holed, &piece)).mesh;
            let near = near_within(&mesh, &region_around_hole(&mesh, 0.2), 0.06);
            let expected = if faces < FEWEST_FACES { 0 } else { faces };
            assert_eq!(near.mesh.faces.len(), expected);
        }
    }

    #[test]
    fn a_second_layer_is_near_and_the_rest_of_the_sheet_is_far() {
        let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.1;
        let holed = sheet(30, keep, |u, v| Vec3::new(u, v, 0.0));
        let layer = sheet(30, |_, _| true, |u, v| Vec3::new(u, v, 0.05));
        let mesh = weld(&concat(&holed, &layer)).mesh;
        let region = region_around_hole(&mesh, 0.2);
        assert!(region.faces.len() < holed.faces.len());

        let near = near_within(&mesh, &region, 0.06);
        let above = |p: &&Vec3| p.z > 0.0;
        assert!(!near.mesh.faces.is_empty());
        assert_eq!(
            near.mesh.positions.iter().filter(above).count(),
            near.mesh.positions.len()
        );
        assert!(
            (near.mesh.positions.iter()).all(|p| (p.xy() - Vec3::repeat(0.5).xy()).amax() < 0.25)
        );
        assert_eq!(near.other, vec![Some(1); near.mesh.faces.len()]);
        let nearer = near_within(&mesh, &region, 0.04);
        assert_eq!(nearer.mesh.faces, [[0; 3]; 0]);
    }
}
