//! How many texels a length of cloth has around the hole, and the raster that follows from it.

use crate::frame::{Frame, bounds, doubled_area};
use crate::input::{Cloth, LayerKind, PatchChart, Settings, TextureError};

/// Cloth around the patch in the raster, as a share of the patch's longer side.
const AROUND: f64 = 0.75;
/// The same at least when the raster would be too large: less cloth to copy from, but more texels for the patch.
const AROUND_LEAST: f64 = 0.4;
/// Texels around the patch that are enough, where [`AROUND_LEAST`] does not ask for more: beside a large hole there are repeats without going far.
const AROUND_ENOUGH: f64 = 192.0;
/// Texels of a side of the raster that a setting cannot forbid.
const LEAST_SIDE: u32 = 64;
/// Texels of cloth around the patch at least.
const AROUND_TEXELS: f64 = 96.0;

/// Texels per length of the chart: the median over the faces near the patch of √(texel area ÷ chart area), of the most detailed base colour,
/// or of another layer when the base colour has no image.
pub(crate) fn density(cloth: &Cloth, patch: &PatchChart) -> Result<f64, TextureError> {
    let base = |k: &LayerKind| *k == LayerKind::BaseColour;
    let first = cloth.layers.iter().position(base).unwrap_or(0);
    let others = (0..cloth.layers.len()).filter(|k| *k != first);
    std::iter::once(first)
        .chain(others)
        .find_map(|layer| layer_density(cloth, patch, layer))
        .ok_or(TextureError::NoDensity)
}

fn layer_density(cloth: &Cloth, patch: &PatchChart, layer: usize) -> Option<f64> {
    let [low, high] = bounds(&patch.flat, &patch.faces);
    let reach = 0.25 * (high[0] - low[0]).max(high[1] - low[1]);
    let near = |p: [f64; 2]| (0..2).all(|k| p[k] > low[k] - reach && p[k] < high[k] + reach);
    let measured = |only_near: bool| {
        let mut all: Vec<f64> = Vec::new();
        for (face, corners) in cloth.faces.iter().enumerate() {
            let source = &cloth.materials[cloth.material_of[face] as usize][layer];
            let Some(image) = source.image else { continue };
            let flat = corners.map(|v| cloth.flat[v as usize]);
            if only_near && !flat.iter().any(|p| near(*p)) {
                continue;
            }
            let size = [f64::from(image.width), f64::from(image.height)];
            let at = cloth.texcoords[source.texcoords][face]
                .map(|t| [f64::from(t[0]) * size[0], f64::from(t[1]) * size[1]]);
            let density = (doubled_area(at) / doubled_area(flat)).abs().sqrt();
            if density.is_finite() && density > 0.0 {
                all.push(density);
            }
        }
        let middle = all.len() / 2;
        (!all.is_empty()).then(|| *all.select_nth_unstable_by(middle, f64::total_cmp).1)
    };
    measured(true).or_else(|| measured(false))
}

/// The raster around the patch.
pub(crate) fn frame(
    cloth: &Cloth,
    patch: &PatchChart,
    settings: &Settings,
) -> Result<Frame, TextureError> {
    let mut density = density(cloth, patch)?;
    let [low, high] = bounds(&patch.flat, &patch.faces);
    let around = bounds(&cloth.flat, &cloth.faces);
    let side = (high[0] - low[0]).max(high[1] - low[1]);
    let most = f64::from(settings.max_side.max(LEAST_SIDE));
    let margin = settings.margin.min(settings.max_side.max(LEAST_SIDE) / 8);
    if !(side > 0.0 && side.is_finite() && (side * density).is_finite()) {
        return Err(TextureError::NoDensity);
    }
    let window = |reach: f64, density: f64| -> [[f64; 2]; 2] {
        let border = f64::from(margin + 1) / density;
        let from = |k: usize| (low[k] - reach).max(around[0][k]).min(low[k] - border);
        let to = |k: usize| (high[k] + reach).min(around[1][k]).max(high[k] + border);
        [[from(0), from(1)], [to(0), to(1)]]
    };
    let longest = |w: [[f64; 2]; 2]| (w[1][0] - w[0][0]).max(w[1][1] - w[0][1]);
    let enough = (AROUND_ENOUGH / density).max(AROUND_LEAST * side);
    let wanted = (AROUND * side).min(enough).max(AROUND_TEXELS / density);
    let mut reach = wanted;
    if longest(window(reach, density)) * density > most {
        reach = (0.5 * (most / density - side)).clamp(AROUND_LEAST * side, wanted);
    }
    let mut cut = window(reach, density);
    if longest(cut) * density > most {
        density = (most - 2.0 * f64::from(margin + 1)) / longest(cut);
        cut = window(reach, density);
    }
    let texels =
        |k: usize| (((cut[1][k] - cut[0][k]) * density).ceil() as usize).clamp(1, most as usize);
    Ok(Frame {
        origin: [cut[0][0], cut[1][1]],
        step: 1.0 / density,
        width: texels(0),
        height: texels(1),
    })
}
