//! Ambient occlusion from the depth buffer: pixels in the valleys of folds get darker.
//!
//! The estimator of McGuire et al., *The Alchemy Screen-Space Ambient Obscurance Algorithm* (2011).

use super::camera::Camera;
use super::options::PixelSize;
use super::raster::Pixels;
use rayon::prelude::*;

/// Depth samples for each pixel.
const TAPS: usize = 24;
/// Radius of the neighbourhood as a share of the picture's shorter side.
const REACH: f64 = 0.055;
/// The largest part of the light that occlusion removes.
const STRENGTH: f32 = 0.85;

/// One factor for each pixel: 1 in the open, near 0 in deep valleys.
pub(super) fn visibility(pixels: &Pixels, camera: &Camera) -> Vec<f32> {
    let raw: Vec<f32> = (0..pixels.depth.len())
        .into_par_iter()
        .map(|at| open(pixels, camera, at))
        .collect();
    smoothed(pixels, &raw)
}

/// The depth at a pixel, if there is cloth.
fn depth(pixels: &Pixels, x: isize, y: isize) -> Option<f32> {
    let PixelSize { width, height } = pixels.size;
    let (x, y) = (
        usize::try_from(x).ok().filter(|x| *x < width)?,
        usize::try_from(y).ok().filter(|y| *y < height)?,
    );
    pixels
        .depth
        .get(y * width + x)
        .copied()
        .filter(|d| d.is_finite())
}

/// The visibility of one pixel, before smoothing.
fn open(pixels: &Pixels, camera: &Camera, at: usize) -> f32 {
    let PixelSize { width, height } = pixels.size;
    let (x, y) = ((at % width) as isize, (at / width) as isize);
    let Some(own) = depth(pixels, x, y) else {
        return 1.0;
    };
    let normal = pixels.normal.get(at).copied().unwrap_or_default();
    let point = |x: isize, y: isize, d: f32| {
        camera.unproject([x as f64 + 0.5, y as f64 + 0.5], f64::from(d))
    };
    let here = point(x, y, own);
    let reach = REACH * width.min(height) as f64;
    let radius = reach * f64::from(own) / camera.focal;
    // Each of 4 × 4 pixels rotates the spiral by another angle; `smoothed` averages exactly these.
    let turn = ((x & 3) * 4 + (y & 3)) as f64 * (std::f64::consts::TAU / 16.0);
    let mut sum = 0.0;
    for tap in 0..TAPS {
        let part = (tap as f64 + 0.5) / TAPS as f64;
        let angle = turn + part * 7.0 * std::f64::consts::TAU;
        let (dx, dy) = (
            (angle.cos() * part * reach).round() as isize,
            (angle.sin() * part * reach).round() as isize,
        );
        let Some(other) = depth(pixels, x + dx, y + dy) else {
            continue;
        };
        let to = (point(x + dx, y + dy, other) - here) / radius;
        let square = to.norm_squared();
        let rise =
            to.x * f64::from(normal[0]) + to.y * f64::from(normal[1]) + to.z * f64::from(normal[2]);
        // Cloth far in front is another layer, not the wall of a valley.
        let near = (1.0 - 0.25 * square).max(0.0);
        sum += near * (rise - 0.03).max(0.0) / (square + 0.02);
    }
    let taken = (sum / TAPS as f64 * 1.6).min(1.0) as f32;
    1.0 - STRENGTH * taken
}

/// Averages over 4 × 4 pixels of nearly the same depth.
fn smoothed(pixels: &Pixels, raw: &[f32]) -> Vec<f32> {
    let width = pixels.size.width;
    let one = |at: usize| {
        let (x, y) = ((at % width) as isize, (at / width) as isize);
        let Some(own) = depth(pixels, x, y) else {
            return 1.0;
        };
        let (mut sum, mut count) = (0.0, 0.0f32);
        for (i, j) in (-2..2).flat_map(|j| (-2..2).map(move |i| (x + i, y + j))) {
            let alike = depth(pixels, i, j).is_some_and(|d| (d - own).abs() < 0.01 * own);
            if let Some(value) = alike
                .then(|| raw.get(j as usize * width + i as usize))
                .flatten()
            {
                sum += value;
                count += 1.0;
            }
        }
        if count > 0.0 {
            sum / count
        } else {
            raw.get(at).copied().unwrap_or(1.0)
        }
    };
    (0..raw.len()).into_par_iter().map(one).collect()
}
