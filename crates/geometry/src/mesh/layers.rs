//! Other layers of cloth about a hole: what a patch must not cut, though it is no part of the hole's region.

use std::collections::HashSet;

use super::region::Region;
use super::{TriMesh, Vec3};

/// The faces of the whole mesh that are not a region's and come within `beyond` (scene units) of the box around its rim.
///
/// A face that meets the rim in a point is left out: it touches the patch there and does not cut it.
pub fn layers_near(whole: &TriMesh, region: &Region, beyond: f64) -> TriMesh {
    let rim = || (region.rim.iter()).map(|v| region.mesh.positions[*v as usize]);
    let low = rim().fold(Vec3::repeat(f64::MAX), |m, p| m.inf(&p)) - Vec3::repeat(beyond);
    let high = rim().fold(Vec3::repeat(f64::MIN), |m, p| m.sup(&p)) + Vec3::repeat(beyond);
    let mut own = vec![false; whole.faces.len()];
    region.faces.iter().for_each(|f| own[*f as usize] = true);
    let on_rim: HashSet<u32> = (region.rim.iter())
        .map(|v| region.vertices[*v as usize])
        .collect();
    let near = |(face, own): &(&[u32; 3], bool)| {
        let [a, b, c] = face.map(|v| whole.positions[v as usize]);
        let (least, most) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
        let apart = (0..3).any(|k| most[k] < low[k] || least[k] > high[k]);
        !own && !apart && !face.iter().any(|v| on_rim.contains(v))
    };
    let faces = whole.faces.iter().zip(own).filter(near);
    whole.part(faces.map(|(face, _)| *face))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::region::grow;
    use crate::mesh::shapes::sheet;
    use crate::mesh::topology::Topology;
    use crate::mesh::weld::weld;

    #[test]
    fn a_second_layer_is_near_and_the_rest_of_the_sheet_is_far() {
        let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.1;
        let mut soup = sheet(30, keep, |u, v| Vec3::new(u, v, 0.0));
        let layer = sheet(30, |_, _| true, |u, v| Vec3::new(u, v, 0.05));
        let (base, first) = (soup.positions.len() as u32, soup.faces.len());
        soup.positions.extend(&layer.positions);
        soup.faces
            .extend(layer.faces.iter().map(|f| f.map(|v| base + v)));
        let mesh = weld(&soup).mesh;
        let topology = Topology::new(&mesh);
        let loops = boundary_loops(&mesh, &topology);
        let hole = loops.iter().position(|l| l.kind == LoopKind::Hole).unwrap();
        let region = grow(&mesh, &topology, &loops, hole, 0.2).unwrap();
        assert!(region.faces.len() < first);

        let near = layers_near(&mesh, &region, 0.06);
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
        assert_eq!(layers_near(&mesh, &region, 0.04).faces, [[0; 3]; 0]);
    }
}
