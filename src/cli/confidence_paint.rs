//! The colours of reconstructed cloth by how far it may be off: what `darn render --confidence` draws.

use darn_gltf_scan::Scan;
use darn_render::{CLOTH, from_srgb};

/// Colours from certain to least certain, sRGB: their lightness falls evenly, so that people who see no red or green can read them.
const SCALE: [[u8; 3]; 5] = [
    [253, 231, 37],
    [94, 201, 98],
    [33, 145, 140],
    [59, 82, 139],
    [68, 1, 84],
];

/// A scan, and the deviation that gets the last colour.
pub struct ConfidencePaint<'s> {
    scan: &'s Scan,
    /// The largest deviation in the scan, in the scene's unit.
    pub most: f32,
}

impl<'s> ConfidencePaint<'s> {
    /// `None` where no part has deviations above 0.
    pub fn new(scan: &'s Scan) -> Option<Self> {
        let all = scan
            .parts
            .iter()
            .filter_map(|part| part.deviations.as_ref());
        let most = all.flat_map(|set| set.iter().copied()).fold(0.0, f32::max);
        (most > 0.0).then_some(ConfidencePaint { scan, most })
    }

    /// Linear red, green and blue at a point between three vertices of a part.
    pub fn at(&self, part: usize, corners: [u32; 3], weights: [f64; 3]) -> [f32; 3] {
        let own = &self.scan.parts[part];
        let Some(deviations) = &own.deviations else {
            return from_srgb(CLOTH);
        };
        let at = |v: u32| {
            let index = v.checked_sub(own.vertices.start).map(|v| v as usize);
            index
                .and_then(|v| deviations.get(v))
                .copied()
                .unwrap_or(0.0)
        };
        let each = corners.iter().zip(weights);
        let deviation: f32 = each.map(|(v, w)| at(*v) * w as f32).sum();
        colour(deviation / self.most)
    }
}

/// The colour of a share of the scale, 0 to 1.
fn colour(share: f32) -> [f32; 3] {
    let last = SCALE.len() - 1;
    let place = share.clamp(0.0, 1.0) * last as f32;
    let below = (place as usize).min(last - 1);
    let between = place - below as f32;
    let [from, to] = [below, below + 1].map(|k| from_srgb(SCALE[k]));
    [0, 1, 2].map(|k: usize| from[k] + between * (to[k] - from[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_less_certain_the_darker() {
        let light = |share: f32| {
            let [r, g, b] = colour(share);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let scale: Vec<f32> = (0..=20).map(|k| light(k as f32 / 20.0)).collect();
        assert!(scale.is_sorted_by(|a, b| a > b), "{scale:?}");
        assert_eq!(colour(-1.0), colour(0.0));
        assert_eq!(colour(2.0), colour(1.0));
    }
}
