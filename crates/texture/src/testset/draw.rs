//! The numbers by which siblings differ from the cloth that the completion's constants were chosen on.

/// A test set: ten fabrics in three layouts with three sizes of holes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// The set on which the completion's constants were chosen.
    Tuned,
    /// The same kinds with other numbers, drawn by a seed.
    Sibling(u32),
}

impl Family {
    /// Diameters of the holes, in texels.
    pub fn holes(self) -> [usize; 3] {
        match self {
            Family::Tuned => super::HOLES,
            Family::Sibling(_) => [71, 118, 230],
        }
    }
}

/// Draws numbers of one member of a family. Same family, name and salt give the same number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Draw {
    /// `None`: the tuned set's own numbers.
    state: Option<u64>,
}

/// Share of a number by which siblings differ from it at most.
const ABOUT: f32 = 0.2;

fn mixed(h: u64) -> u64 {
    let h = (h ^ (h >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h ^ (h >> 32)
}

impl Draw {
    pub(super) fn new(family: Family, name: &str) -> Draw {
        let Family::Sibling(seed) = family else {
            return Draw { state: None };
        };
        let start = u64::from(seed).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let state = name
            .bytes()
            .fold(start, |h, byte| mixed(h ^ u64::from(byte)).rotate_left(17));
        Draw { state: Some(state) }
    }

    /// `tuned` for the tuned set, a number in a range for siblings.
    pub(super) fn between(&self, salt: u32, tuned: f32, [low, high]: [f32; 2]) -> f32 {
        let Some(state) = self.state else {
            return tuned;
        };
        let h = mixed(state ^ u64::from(salt).wrapping_mul(0xD1B5_4A32_D192_ED03));
        low + (high - low) * (h as u32 as f32 / u32::MAX as f32)
    }

    /// `tuned` for the tuned set, a number near it for siblings.
    pub(super) fn about(&self, salt: u32, tuned: f32) -> f32 {
        self.between(salt, tuned, [1.0 - ABOUT, 1.0 + ABOUT].map(|by| by * tuned))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Fabric, Layout, TestScan};
    use super::*;

    #[test]
    fn siblings_are_drawn_again_by_their_seed_and_differ_by_it() {
        let sheet = |seed| TestScan::of(Family::Sibling(seed), Fabric::Plaid, Layout::Atlas, 71);
        let (one, again, two) = (sheet(1), sheet(1), sheet(2));
        assert!(one.texels == again.texels && one.patch.faces == again.patch.faces);
        assert!(one.texels != two.texels && one.patch.faces != two.patch.faces);
    }

    #[test]
    fn the_tuned_set_has_its_own_numbers() {
        let draw = Draw::new(Family::Tuned, "plaid");
        assert_eq!(draw.between(1, 5.0, [6.0, 7.0]), 5.0);
        assert_eq!(draw.about(1, 5.0), 5.0);
    }
}
