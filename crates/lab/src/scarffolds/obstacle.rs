//! Fixed obstacles that the sheet falls on: signed distances, and the push out of them.

use super::contacts::friction_share;
use super::fabric::FabricParameters;
use super::field::{InverseMasses, VertexField, inverse_mass, slot};
use super::lattice::{VERTICES, Vec3f};

/// A fixed obstacle.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Obstacle {
    /// A ball.
    Sphere {
        /// Its middle.
        center: [f32; 3],
        /// Its radius.
        radius: f32,
    },
    /// An infinitely long horizontal cylinder.
    Bar {
        /// A point of its axis.
        center: [f32; 3],
        /// Unit direction of its axis in the xy plane.
        along: [f32; 2],
        /// Its radius.
        radius: f32,
    },
    /// An upright box with round edges: a table or a chest.
    Block {
        /// Its middle.
        center: [f32; 3],
        /// Half its sides, before rounding.
        half: [f32; 3],
        /// Radius of its edges, added all around.
        radius: f32,
    },
    /// The half space below a height.
    Floor {
        /// Its height.
        z: f32,
    },
}

impl Obstacle {
    /// Signed distance of a point from the surface, and the unit direction out of it.
    fn distance(&self, p: &Vec3f) -> (f32, Vec3f) {
        let from = |d: Vec3f, radius: f32| {
            let length = d.norm_squared().sqrt();
            let out = if length > 1e-9 {
                d * (1.0 / length)
            } else {
                Vec3f::z()
            };
            (length - radius, out)
        };
        match *self {
            Self::Sphere { center, radius } => from(p - Vec3f::from(center), radius),
            Self::Bar {
                center,
                along,
                radius,
            } => {
                let axis = Vec3f::new(along[0], along[1], 0.0);
                let d = p - Vec3f::from(center);
                from(d - axis * axis.dot(&d), radius)
            }
            Self::Block {
                center,
                half,
                radius,
            } => {
                let d = p - Vec3f::from(center);
                let over = d.abs() - Vec3f::from(half);
                if over.max() > 0.0 {
                    let outside = over
                        .map(|o| o.max(0.0))
                        .zip_map(&d, |o, s| if s < 0.0 { -o } else { o });
                    from(outside, radius)
                } else {
                    let axis = over.imax();
                    let mut out = Vec3f::zeros();
                    out[axis] = if d[axis] < 0.0 { -1.0 } else { 1.0 };
                    (over[axis] - radius, out)
                }
            }
            Self::Floor { z } => (p.z - z, Vec3f::z()),
        }
    }

    /// Moves vertices out of the obstacle, to half a thickness above its surface, with friction. `before` holds the positions at the start
    /// of the step.
    pub(super) fn push_out(
        &self,
        positions: &mut VertexField,
        before: &VertexField,
        masses: &InverseMasses,
        fabric: &FabricParameters,
    ) {
        for k in 0..VERTICES {
            let slot = slot(k);
            let x = positions.at(slot);
            let (distance, out) = self.distance(&x);
            let depth = 0.5 * fabric.thickness - distance;
            if depth > 0.0 && inverse_mass(masses, slot) > 0.0 {
                let slide = x - before.at(slot);
                let slide = slide - out * out.dot(&slide);
                positions.set(
                    slot,
                    &(x + out * depth - slide * friction_share(&slide, fabric.friction * depth)),
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(range: f32) -> impl Strategy<Value = Vec3f> {
        proptest::array::uniform3(-range..range).prop_map(Vec3f::from)
    }

    fn obstacle() -> impl Strategy<Value = Obstacle> {
        (
            proptest::array::uniform3(-0.5f32..0.5),
            0.05f32..0.5,
            0.0f32..6.2,
            0usize..4,
        )
            .prop_map(|(center, radius, turn, kind)| match kind {
                0 => Obstacle::Sphere { center, radius },
                1 => Obstacle::Bar {
                    center,
                    along: [turn.cos(), turn.sin()],
                    radius,
                },
                2 => Obstacle::Block {
                    center,
                    half: [0.2, 0.3, radius],
                    radius: 0.05,
                },
                _ => Obstacle::Floor { z: center[2] },
            })
    }

    proptest! {
        #[test]
        fn a_step_of_the_distance_outwards_ends_on_the_surface(obstacle in obstacle(), p in point(1.0)) {
            let (distance, out) = obstacle.distance(&p);
            prop_assert!((out.norm() - 1.0).abs() < 1e-4);
            prop_assert!(obstacle.distance(&(p - out * distance)).0.abs() < 1e-4);
        }
    }
}
