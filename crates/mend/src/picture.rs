//! A small picture of a hole's chart: the scanned cloth light, the new cloth tinted, both shaded by their folds, the
//! rim as a line.

use image::{Rgb, RgbImage};

use crate::edit::map::png;
use crate::hole::Hole;
use darn_geometry::mesh::{Vec2, Vec3};
use darn_geometry::patch::Patch;

/// Pixels of a side.
const SIDE: u32 = 256;
const PAPER: [f64; 3] = [250.0, 250.0, 248.0];
const CLOTH: [f64; 3] = [214.0, 219.0, 228.0];
const MENDED: [f64; 3] = [236.0, 170.0, 118.0];
const RIM: Rgb<u8> = Rgb([120, 60, 30]);

/// Draws the chart as PNG: u runs right, v up. The light comes from one side, so that every fold has a bright and a
/// dark side.
///
/// # Errors
/// Whatever the encoder fails with.
pub fn chart_png(hole: &Hole, patch: &Patch) -> Result<Vec<u8>, image::ImageError> {
    let mut image = RgbImage::from_pixel(SIDE, SIDE, tinted(PAPER, 1.0));
    let chart = &hole.chart;
    let region = &hole.region.mesh;
    let light = light(&region.faces, &region.positions, &chart.flat);
    let mut paint = |faces: &[[u32; 3]], positions: &[Vec3], flat: &[Vec2], colour| {
        for face in faces {
            let p = face.map(|v| positions[v as usize]);
            let normal = (p[1] - p[0]).cross(&(p[2] - p[0]));
            let shade = normal.try_normalize(0.0).map_or(0.0, |n| n.dot(&light));
            let corners = face.map(|v| pixel(chart.frame.uv(flat[v as usize])));
            triangle(&mut image, corners, tinted(colour, 0.8 + 0.2 * shade));
        }
    };
    paint(&region.faces, &region.positions, &chart.flat, CLOTH);
    paint(&patch.faces, &patch.positions, &patch.flat, MENDED);
    let rim = patch.rim.len();
    for k in 0..rim {
        let end = |k: usize| pixel(chart.frame.uv(patch.flat[k]));
        line(&mut image, end(k), end((k + 1) % rim));
    }
    png(&image)
}

/// Light from the side: the mean normal turned by 50 degrees towards the direction that u has in space.
fn light(faces: &[[u32; 3]], positions: &[Vec3], flat: &[Vec2]) -> Vec3 {
    let (mut normal, mut along) = (Vec3::zeros(), Vec3::zeros());
    for face in faces {
        let [a, b, c] = face.map(|v| positions[v as usize]);
        normal += (b - a).cross(&(c - a));
        for (v, w) in [(0, 1), (1, 2), (2, 0)] {
            let (v, w) = (face[v] as usize, face[w] as usize);
            along += (positions[w] - positions[v]) * (flat[w] - flat[v]).x;
        }
    }
    let unit = |v: Vec3| v.try_normalize(0.0).unwrap_or_else(Vec3::z);
    let (sine, cosine) = 50f64.to_radians().sin_cos();
    unit(unit(normal) * cosine + unit(along) * sine)
}

fn tinted(colour: [f64; 3], light: f64) -> Rgb<u8> {
    Rgb(colour.map(|c| (c * light).clamp(0.0, 255.0) as u8))
}

fn pixel(uv: Vec2) -> Vec2 {
    Vec2::new(uv.x, 1.0 - uv.y) * f64::from(SIDE)
}

/// Fills the pixels whose centres lie in a triangle.
fn triangle(image: &mut RgbImage, corners: [Vec2; 3], colour: Rgb<u8>) {
    let [a, b, c] = corners;
    let area = (b - a).perp(&(c - a));
    let (low, high) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
    let span = |low: f64, high: f64| low.max(0.0) as u32..(high.max(0.0).ceil() as u32).min(SIDE);
    for y in span(low.y, high.y) {
        for x in span(low.x, high.x) {
            let p = Vec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let sides = [(a, b), (b, c), (c, a)].map(|(s, e)| (e - s).perp(&(p - s)) * area);
            if sides.iter().all(|s| *s >= -1e-9) {
                image.put_pixel(x, y, colour);
            }
        }
    }
}

/// Draws a line of the rim.
fn line(image: &mut RgbImage, from: Vec2, to: Vec2) {
    let way = to - from;
    let steps = (2.0 * way.amax()).ceil().clamp(1.0, 2.0 * f64::from(SIDE)) as u32;
    for k in 0..=steps {
        let at = from + way * (f64::from(k) / f64::from(steps));
        let (x, y) = (at.x.max(0.0) as u32, at.y.max(0.0) as u32);
        if x < SIDE && y < SIDE {
            image.put_pixel(x, y, RIM);
        }
    }
}
