//! What texels are compared by: four numbers a texel, from all layers.

use rayon::prelude::*;

use crate::input::LayerKind;

/// Lightness, red–green, yellow–blue, and one number for the other layers; zero where the cloth is not known.
pub(crate) type Feature = [f32; 4];

/// Weights of the opponent colours against lightness: the eye sees differences of hue in fine structure less.
const HUE_WEIGHT: f32 = 0.7;
/// Weight of the other layers against lightness.
const OTHER_WEIGHT: f32 = 0.5;

/// Features of every known texel. `layers` are the rasters of all layers.
pub(crate) fn features(
    kinds: &[LayerKind],
    layers: &[Vec<[u8; 4]>],
    known: &[bool],
) -> Vec<Feature> {
    let feature = feature(kinds, layers);
    (0..known.len())
        .into_par_iter()
        .map(|at| if known[at] { feature(at) } else { [0.0; 4] })
        .collect()
}

/// The feature of a known texel.
pub(crate) fn feature(
    kinds: &[LayerKind],
    layers: &[Vec<[u8; 4]>],
) -> impl Fn(usize) -> Feature + Sync {
    let base = (kinds.iter().position(|k| *k == LayerKind::BaseColour))
        .or_else(|| kinds.iter().position(|k| *k == LayerKind::Colour));
    let others: Vec<usize> = (0..kinds.len()).filter(|k| Some(*k) != base).collect();
    let share = OTHER_WEIGHT / (others.len().max(1) as f32).sqrt();
    let unit = |x: u8| f32::from(x) / 255.0;
    move |at: usize| {
        let mut feature = [0.0; 4];
        if let Some(base) = base {
            let [r, g, b, a] = layers[base][at].map(unit);
            feature[0] = (r + g + b) / 3.0 * a;
            feature[1] = HUE_WEIGHT * (r - g) * a;
            feature[2] = HUE_WEIGHT * (0.5 * (r + g) - b) * a;
            feature[3] = 0.5 * a;
        }
        for layer in &others {
            let [r, g, b, _] = layers[*layer][at].map(unit);
            // Unequal weights, so that opposite changes of two channels do not cancel.
            feature[3] += share * (r + 0.7 * g + 0.4 * b);
        }
        feature
    }
}

/// Squared distance of two features.
#[inline]
pub(crate) fn distance(a: Feature, b: Feature) -> f32 {
    let d: Feature = std::array::from_fn(|k| a[k] - b[k]);
    (d[0] * d[0] + d[1] * d[1]) + (d[2] * d[2] + d[3] * d[3])
}
