//! Bodies: tapered capsules that grow from nothing inside the flat garment and then move into their pose.

use crate::scarffolds::contacts::friction_share;
use crate::scarffolds::lattice::Vec3f;

/// A tapered capsule: all points within a radius of a segment, the radius going linearly from end to end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Capsule {
    /// Its ends while it grows, metres; in the plane y = 0, so that front panels are pushed to the front.
    pub(super) start: [[f32; 3]; 2],
    /// Its ends in the pose.
    pub(super) pose: [[f32; 3]; 2],
    /// Its radii, metres.
    pub(super) radius: [f32; 2],
}

/// A capsule at a moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct PosedCapsule {
    ends: [Vec3f; 2],
    radius: [f32; 2],
}

impl Capsule {
    /// A capsule that does not move.
    pub(super) fn still(ends: [[f32; 3]; 2], radius: [f32; 2]) -> Self {
        Self {
            start: ends,
            pose: ends,
            radius,
        }
    }

    /// The capsule when `grown` of its radius and `moved` of its motion are done (0 to 1 each).
    pub(super) fn at(&self, grown: f32, moved: f32) -> PosedCapsule {
        let end = |k: usize| Vec3f::from(self.start[k]).lerp(&Vec3f::from(self.pose[k]), moved);
        PosedCapsule {
            ends: [end(0), end(1)],
            radius: self.radius.map(|r| r * grown),
        }
    }
}

impl PosedCapsule {
    /// Moves a vertex out of the capsule, to `margin` above its surface, with friction; `before` is its position at the start of the step.
    pub(super) fn push_out(&self, x: &mut Vec3f, before: &Vec3f, margin: f32, friction: f32) {
        let axis = self.ends[1] - self.ends[0];
        let from = *x - self.ends[0];
        let share = (from.dot(&axis) / axis.norm_squared().max(1.0e-12)).clamp(0.0, 1.0);
        let radius = self.radius[0] + (self.radius[1] - self.radius[0]) * share;
        let d = from - axis * share;
        let (far2, reach) = (d.norm_squared(), radius + margin);
        if far2 >= reach * reach || far2 < 1.0e-14 {
            return;
        }
        let far = far2.sqrt();
        let (out, depth) = (d / far, reach - far);
        let slide = *x - before;
        let slide = slide - out * out.dot(&slide);
        *x += out * depth - slide * friction_share(&slide, friction * depth);
    }
}
