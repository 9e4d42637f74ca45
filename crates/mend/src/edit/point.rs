//! A point of the cloth and where in space it should be.

use darn_geometry::flatten::UvSquare;
use darn_geometry::mesh::{Vec2, Vec3};
use darn_geometry::patch::Firmness;

/// A point of a hole's cloth with its target: an anchor's, or one that a gesture placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedPoint {
    /// Where on the chart's unit square.
    pub uv: Vec2,
    /// The same in the chart's plane, scene units.
    pub flat: Vec2,
    /// Where it lies on the cloth without constraints, scene space.
    pub origin: Vec3,
    /// Where it should lie, scene space.
    pub target: Vec3,
    /// Whether other points make room for it.
    pub firmness: Firmness,
}

impl PlacedPoint {
    /// How far it should move, scene units.
    pub fn displacement(&self) -> Vec3 {
        self.target - self.origin
    }
}

/// The cloth of a hole without constraints.
#[derive(Clone, Copy)]
pub struct ClothSurface<'a> {
    /// The chart's unit square.
    pub square: UvSquare,
    /// The position, in scene space, at a point of the chart's plane. It may be slow.
    pub position: &'a dyn Fn(Vec2) -> Vec3,
}

impl ClothSurface<'_> {
    /// The position at a uv, scene space.
    pub fn at(&self, uv: Vec2) -> Vec3 {
        (self.position)(self.square.point(uv))
    }

    /// The point at a uv, with a target.
    pub fn point(&self, uv: Vec2, target: Vec3, firmness: Firmness) -> PlacedPoint {
        let flat = self.square.point(uv);
        PlacedPoint {
            uv,
            flat,
            origin: (self.position)(flat),
            target,
            firmness,
        }
    }
}
