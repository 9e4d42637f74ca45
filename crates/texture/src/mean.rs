//! The mean of the cloth around a hole, for patches of one colour.

use darn_budget::Budget;

use crate::gather::Gathered;
use crate::input::{Cloth, LayerKind, PatchChart, Settings, TextureError};
use crate::srgb::decoders;

/// Per layer the mean of the cloth's texels near a patch, linear; vectors of layers that have them are not normalised.
///
/// # Errors
/// `Nothing`, `Inconsistent`, `NoDensity`; `Exhausted`.
pub fn mean_texels(
    cloth: &Cloth,
    patch: &PatchChart,
    settings: &Settings,
    budget: &Budget,
) -> Result<Vec<[f32; 4]>, TextureError> {
    cloth.check()?;
    patch.check()?;
    let gathered = Gathered::new(cloth, patch, settings, budget)?;
    let known = &gathered.known[..gathered.frame.len()];
    let mask = match gathered.near.contains(&true) {
        true => &gathered.near,
        false => known,
    };
    let layers = cloth.layers.iter().zip(&gathered.layers);
    Ok(layers
        .map(|(kind, texels)| mean(*kind, texels, mask))
        .collect())
}

fn mean(kind: LayerKind, texels: &[[u8; 4]], mask: &[bool]) -> [f32; 4] {
    let linear = |texel: &[u8; 4], k: usize| {
        let table = match kind.is_srgb() && k < 3 {
            true => &decoders().srgb,
            false => &decoders().linear,
        };
        f64::from(table[texel[k] as usize])
    };
    let shown = || texels.iter().zip(mask).filter(|(_, shown)| **shown);
    let count = shown().count().max(1) as f64;
    [0, 1, 2, 3].map(|k| {
        let sum: f64 = shown().map(|(texel, _)| linear(texel, k)).sum();
        (sum / count) as f32
    })
}
