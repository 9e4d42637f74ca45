//! Other layers of cloth near a hole: faces outside the hole's region that a patch must not cut.

use std::collections::HashSet;

use super::index::{FaceId, VertexId};
use super::region::Region;
use super::{TriMesh, Vec3};

/// The faces of the whole mesh outside `region` whose bounding boxes come within `margin` (scene units) of the rim's,
/// as a mesh.
///
/// A face with a vertex on the rim is left out: it touches the patch there and does not cut it. So are the faces `left`
/// (ascending): they are no cloth, and may lie where the cloth was.
pub fn layers_near(whole: &TriMesh, region: &Region, margin: f64, left: &[FaceId]) -> TriMesh {
    let rim = || (region.rim.iter()).map(|v| region.mesh.positions[*v as usize]);
    let low = rim().fold(Vec3::repeat(f64::MAX), |m, p| m.inf(&p)) - Vec3::repeat(margin);
    let high = rim().fold(Vec3::repeat(f64::MIN), |m, p| m.sup(&p)) + Vec3::repeat(margin);
    let mut own = vec![false; whole.faces.len()];
    (region.faces.iter().chain(left)).for_each(|f| own[f.index()] = true);
    let on_rim: HashSet<VertexId> = (region.rim.iter())
        .map(|v| region.vertices[*v as usize])
        .collect();
    let near = |(face, own): &(&[u32; 3], bool)| {
        let [a, b, c] = face.map(|v| whole.positions[v as usize]);
        let (least, most) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
        let apart = (0..3).any(|k| most[k] < low[k] || least[k] > high[k]);
        !own && !apart && !face.iter().any(|v| on_rim.contains(&VertexId(*v)))
    };
    let faces = whole.faces.iter().zip(own).filter(near);
    whole.part(faces.map(|(face, _)| *face))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::region::region_around_hole;
    use crate::mesh::shapes::{concat, sheet};
    use crate::mesh::weld::weld;

    #[test]
    fn a_second_layer_is_near_and_the_rest_of_the_sheet_is_far() {
        let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.1;
        let holed = sheet(30, keep, |u, v| Vec3::new(u, v, 0.0));
        let layer = sheet(30, |_, _| true, |u, v| Vec3::new(u, v, 0.05));
        let mesh = weld(&concat(&holed, &layer)).mesh;
        let region = region_around_hole(&mesh, 0.2);
        assert!(region.faces.len() < holed.faces.len());

        let near = layers_near(&mesh, &region, 0.06, &[]);
        let above = |p: &&Vec3| p.z > 0.0;
        assert!(!near.faces.is_empty());
        assert_eq!(
            near.positions.iter().filter(above).count(),
            near.positions.len()
        );
        assert!(
            near.positions
                .iter()
                .all(|p| (p.xy() - Vec3::repeat(0.5).xy()).amax() < 0.25)
        );
        assert_eq!(layers_near(&mesh, &region, 0.04, &[]).faces, [[0; 3]; 0]);
    }
}
