//! A pattern: the panels of a garment, the body it is draped over, what holds it, and its cloth.

use super::body::Capsule;
use super::cloth::GarmentFabric;
use super::panel::Panel;

/// A pattern with everything that draping it needs.
#[derive(Debug, Clone)]
pub(super) struct Pattern {
    pub(super) panels: Vec<Panel>,
    /// Names of the openings, by the index that [`RunUse::Open`](super::panel::RunUse) has.
    pub(super) openings: Vec<&'static str>,
    /// Mean length of an edge, metres.
    pub(super) spacing: f64,
    pub(super) body: Vec<Capsule>,
    pub(super) rings: Vec<Ring>,
    pub(super) fabric: GarmentFabric,
}

/// An opening that is held on a horizontal or vertical ellipse, as by an elastic band.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ring {
    /// Index of the opening.
    pub(super) opening: usize,
    /// Middle of the ellipse at the end of the motion.
    pub(super) centre: [f32; 3],
    /// Half axis towards the end of the flat lay's opening.
    pub(super) along: [f32; 3],
    /// Half axis towards −y.
    pub(super) front: [f32; 3],
}
