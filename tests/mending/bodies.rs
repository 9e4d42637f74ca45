//! Cloth over a body, or behind one: other components of the scan near a hole. The new cloth keeps to the side of them that
//! the cloth around the hole lies on.

use darn_contract::Constraints;
use darn_geometry::mesh::shapes::{concat, sheet};
use darn_geometry::mesh::{TriMesh, Vec3};

use super::cloth::{MendedScan, mended, packed};

/// Height of a body with a knob, such as a shoulder.
fn body(u: f64, v: f64) -> f64 {
    let away = (u - 0.5).hypot(v - 0.5);
    0.2 * (-away * away / (2.0 * 0.11 * 0.11)).exp()
}

/// Cloth at a distance from the body, with a hole over the knob; then the body.
fn dressed(distance: f64) -> TriMesh {
    let round = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.17;
    let cloth = sheet(40, round, |u, v| Vec3::new(u, v, body(u, v) + distance));
    let body = sheet(60, |_, _| true, |u, v| Vec3::new(u, v, body(u, v)));
    concat(&cloth, &body)
}

#[test]
fn a_patch_stays_on_the_side_of_a_body_that_its_cloth_lies_on() {
    for distance in [0.01, 0.03, -0.01] {
        let bytes = packed(&dressed(distance), &[]);
        let mended = mended(&bytes, &Constraints::default()).expect("one hole");
        assert_eq!(mended.report.holes.len(), 1);
        let patch = mended.report.holes[0].patch.as_ref().expect("a patch");
        assert_eq!(patch.self_intersections, 0, "at {distance}");
        let new = MendedScan::of(&mended.bytes).new_positions();
        assert!(new.len() > 50);
        // A body of triangles is flatter than the function by less than this.
        let slack = 0.002;
        for p in new {
            let height = (p.z - body(p.x, p.y)) * distance.signum();
            assert!(
                height > -slack,
                "{p:?} is {height} from the body, cloth at {distance}"
            );
        }
    }
}
