//! The z-buffer: draws triangles and lines with 3 × 3 samples a pixel, one band of rows at a time.

use super::FacePlace;
use super::camera::Camera;
use super::face::DrawableFace;
use super::options::PixelSize;
use super::outline::Segment;
use super::shade::{self, FaceSide, LinearRgb};
use darn_geometry::mesh::{TriMesh, Vec3};
use std::ops::Range;

/// Samples along a pixel's side.
const SAMPLES: usize = 3;

/// A face as the camera sees it.
#[derive(Debug, Clone)]
pub(super) struct ScreenTriangle {
    /// Pixel x, pixel y, depth of the corners.
    corners: [Vec3; 3],
    /// Corner normals in camera axes, facing the eye.
    normals: [Vec3; 3],
    /// Unit vectors from the corners to the eye, camera axes.
    to_eye: [Vec3; 3],
    side: FaceSide,
    /// Index in the mesh.
    face: usize,
}

/// What is drawn.
pub(super) struct Scene<'s> {
    pub triangles: &'s [ScreenTriangle],
    pub segments: &'s [Segment],
    /// The base colour of every point.
    pub paint: &'s (dyn Fn(&FacePlace) -> LinearRgb + Sync),
}

/// All faces as the camera sees them, except those with a corner too near.
pub(super) fn triangles(
    mesh: &TriMesh,
    faces: &[DrawableFace],
    camera: &Camera,
) -> Vec<ScreenTriangle> {
    let normals = shade::vertex_normals(mesh, faces);
    let at = |v: usize| camera.point_in_axes(&mesh.positions.get(v).copied().unwrap_or_default());
    let smooth = |v: usize| camera.direction_in_axes(normals.get(v).copied().unwrap_or_default());
    let shown = |face: &DrawableFace| {
        let seen = face.vertices.map(at);
        let [a, b, c] = seen.each_ref().map(|p| camera.project(p));
        let flat = shade::unit((seen[1] - seen[0]).cross(&(seen[2] - seen[0])));
        // Camera axes are left-handed (z into the picture), so this cross product points to the face's back.
        let side = if flat.dot(&seen[0]) >= 0.0 {
            FaceSide::Front
        } else {
            FaceSide::Back
        };
        let facing = if side == FaceSide::Front { 1.0 } else { -1.0 };
        Some(ScreenTriangle {
            corners: [a?, b?, c?],
            normals: face.vertices.map(|v| smooth(v) * facing),
            to_eye: seen.map(|p| shade::unit(-p)),
            side,
            face: face.face,
        })
    };
    faces.iter().filter_map(shown).collect()
}

/// The pixels of one band of rows, row by row.
#[derive(Debug)]
pub(super) struct RowBand {
    colour: Vec<LinearRgb>,
    depth: Vec<f32>,
    normal: Vec<[f32; 3]>,
}

/// The pixels of the whole picture before occlusion, row by row.
#[derive(Debug)]
pub(super) struct Pixels {
    pub size: PixelSize,
    /// Average of the samples.
    pub colour: Vec<LinearRgb>,
    /// Depth at the pixel's centre; infinite on the background.
    pub depth: Vec<f32>,
    /// Normal at the pixel's centre, camera axes.
    pub normal: Vec<[f32; 3]>,
}

impl Pixels {
    /// The picture of all bands, which are in order from the top.
    pub fn joined(bands: Vec<RowBand>, size: PixelSize) -> Self {
        let mut all = Self {
            size,
            colour: Vec::new(),
            depth: Vec::new(),
            normal: Vec::new(),
        };
        for band in bands {
            all.colour.extend(band.colour);
            all.depth.extend(band.depth);
            all.normal.extend(band.normal);
        }
        all
    }
}

/// Draws some rows of a picture of `size`.
pub(super) fn draw(scene: &Scene<'_>, size: PixelSize, rows: Range<usize>) -> RowBand {
    let mut canvas = Canvas::new(size, rows);
    for triangle in scene.triangles {
        canvas.fill(triangle, scene);
    }
    for segment in scene.segments {
        canvas.stroke(segment);
    }
    canvas.resolved()
}

/// A place of a triangle and its base colour.
struct Sample<'t> {
    t: &'t ScreenTriangle,
    place: FacePlace,
    base: LinearRgb,
}

/// The samples of a band.
struct Canvas {
    /// Samples in a row.
    width: usize,
    /// Sample rows of the band, counted from the picture's top.
    rows: Range<usize>,
    colour: Vec<LinearRgb>,
    depth: Vec<f32>,
    normal: Vec<[f32; 3]>,
}

impl Canvas {
    fn new(size: PixelSize, rows: Range<usize>) -> Self {
        let width = size.width * SAMPLES;
        let rows = rows.start * SAMPLES..rows.end * SAMPLES;
        let count = width * rows.len();
        let behind = |y: usize| shade::background(y as f32 / (size.height * SAMPLES) as f32);
        Self {
            width,
            colour: rows
                .clone()
                .flat_map(|y| std::iter::repeat_n(behind(y), width))
                .collect(),
            depth: vec![f32::INFINITY; count],
            normal: vec![[0.0; 3]; count],
            rows,
        }
    }

    /// The columns and rows of samples in a box of pixel coordinates, within the band.
    fn covered(&self, low: [f64; 2], high: [f64; 2]) -> (Range<usize>, Range<usize>) {
        let samples = SAMPLES as f64;
        // `as` saturates, so a box far outside the picture is empty.
        let x = (low[0] * samples).floor().max(0.0) as usize
            ..((high[0] * samples).ceil().max(0.0) as usize).min(self.width);
        let y = ((low[1] * samples).floor().max(0.0) as usize).max(self.rows.start)
            ..((high[1] * samples).ceil().max(0.0) as usize).min(self.rows.end);
        (x, y)
    }

    /// Draws a triangle.
    fn fill(&mut self, t: &ScreenTriangle, scene: &Scene<'_>) {
        let [a, b, c] = t.corners.map(|p| [p.x, p.y]);
        let doubled = cross(a, b, c);
        if doubled == 0.0 || !doubled.is_finite() {
            return;
        }
        let low = [a[0].min(b[0]).min(c[0]), a[1].min(b[1]).min(c[1])];
        let high = [a[0].max(b[0]).max(c[0]), a[1].max(b[1]).max(c[1])];
        let (columns, rows) = self.covered(low, high);
        let inverse = t.corners.map(|p| 1.0 / p.z);
        for y in rows {
            for x in columns.clone() {
                let p = centre(x, y);
                let on_screen = [
                    cross(b, c, p) / doubled,
                    cross(c, a, p) / doubled,
                    cross(a, b, p) / doubled,
                ];
                if on_screen.iter().any(|&w| w < 0.0) {
                    continue;
                }
                let weight: [f64; 3] = std::array::from_fn(|k| on_screen[k] * inverse[k]);
                let depth = 1.0 / (weight[0] + weight[1] + weight[2]);
                let at = (y - self.rows.start) * self.width + x;
                let nearest = self.depth.get(at).copied().unwrap_or(f32::NEG_INFINITY);
                if (depth as f32) < nearest {
                    let place = FacePlace {
                        face: t.face,
                        weights: weight.map(|w| w * depth),
                    };
                    let base = (scene.paint)(&place);
                    self.put(at, depth as f32, &Sample { t, place, base });
                }
            }
        }
    }

    /// Shades one sample.
    fn put(&mut self, at: usize, depth: f32, sample: &Sample<'_>) {
        let Sample { t, place, base } = *sample;
        let weight = place.weights;
        let blended = |v: &[Vec3; 3]| {
            let sum = shade::unit(v[0] * weight[0] + v[1] * weight[1] + v[2] * weight[2]);
            [sum.x as f32, sum.y as f32, sum.z as f32]
        };
        let normal = blended(&t.normals);
        let light = shade::lit(base, normal, blended(&t.to_eye), t.side);
        if let (Some(c), Some(d), Some(n)) = (
            self.colour.get_mut(at),
            self.depth.get_mut(at),
            self.normal.get_mut(at),
        ) {
            (*c, *d, *n) = (light, depth, normal);
        }
    }

    /// Draws a line over the surface.
    fn stroke(&mut self, s: &Segment) {
        let [a, b] = s.ends.map(|p| [p.x, p.y]);
        let reach = s.style.width * 0.5;
        let low = [a[0].min(b[0]) - reach, a[1].min(b[1]) - reach];
        let high = [a[0].max(b[0]) + reach, a[1].max(b[1]) + reach];
        let (columns, rows) = self.covered(low, high);
        let along = [b[0] - a[0], b[1] - a[1]];
        let length = along[0] * along[0] + along[1] * along[1];
        for y in rows {
            for x in columns.clone() {
                let p = centre(x, y);
                let from = [p[0] - a[0], p[1] - a[1]];
                let part = if length > 0.0 {
                    ((from[0] * along[0] + from[1] * along[1]) / length).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let off = [from[0] - part * along[0], from[1] - part * along[1]];
                if off[0] * off[0] + off[1] * off[1] > reach * reach {
                    continue;
                }
                let depth = 1.0 / ((1.0 - part) / s.ends[0].z + part / s.ends[1].z);
                let at = (y - self.rows.start) * self.width + x;
                if let (Some(c), Some(d)) = (self.colour.get_mut(at), self.depth.get(at))
                    && depth - s.lift <= f64::from(*d)
                {
                    *c = shade::mixed(*c, s.style.ink, s.style.alpha);
                }
            }
        }
    }

    /// The pixels: the average colour of their samples, depth and normal of the middle sample.
    fn resolved(self) -> RowBand {
        let across = self.width / SAMPLES;
        let down = self.rows.len() / SAMPLES;
        let share = 1.0 / (SAMPLES * SAMPLES) as f32;
        let mut band = RowBand {
            colour: Vec::new(),
            depth: Vec::new(),
            normal: Vec::new(),
        };
        for (y, x) in (0..down).flat_map(|y| (0..across).map(move |x| (y, x))) {
            let sample = |j: usize, i: usize| (y * SAMPLES + j) * self.width + x * SAMPLES + i;
            let mut light = [0.0; 3];
            for at in (0..SAMPLES * SAMPLES).map(|k| sample(k / SAMPLES, k % SAMPLES)) {
                let one = self.colour.get(at).copied().unwrap_or_default();
                light = std::array::from_fn(|c| light[c] + share * one[c].clamp(0.0, 1.0));
            }
            let middle = sample(SAMPLES / 2, SAMPLES / 2);
            band.colour.push(light);
            band.depth
                .push(self.depth.get(middle).copied().unwrap_or(f32::INFINITY));
            band.normal
                .push(self.normal.get(middle).copied().unwrap_or_default());
        }
        band
    }
}

/// Centre of a sample in pixel coordinates.
fn centre(x: usize, y: usize) -> [f64; 2] {
    [
        (x as f64 + 0.5) / SAMPLES as f64,
        (y as f64 + 0.5) / SAMPLES as f64,
    ]
}

/// Twice the signed area of a triangle in the picture.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
