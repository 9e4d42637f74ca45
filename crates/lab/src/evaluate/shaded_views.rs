//! Pictures of a filled hole beside pictures of the truth. A fill that is too smooth is near the truth everywhere and still looks wrong: shading
//! shows directions, and structural similarity compares their pattern.

use darn_geometry::grid::CELLS;
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_render::{CLOTH, CameraDirection, EdgeLines, Framing, MENDED, PictureOptions, picture};
use darn_texture::testset::{LightPair, lab};

use super::cases::EvaluationCase;
use super::metrics::faces;

/// Width and height of a picture, pixels.
const SIDE: u32 = 160;
/// Azimuth and elevation of the cameras, degrees: along the axes of space. Cases lie in space in any direction.
const DIRECTIONS: [[f64; 2]; 6] = [
    [0.0, 0.0],
    [90.0, 0.0],
    [180.0, 0.0],
    [270.0, 0.0],
    [0.0, 90.0],
    [0.0, -90.0],
];
/// Radius of the ball in the picture ÷ that of the true hole.
const MARGIN: f64 = 1.2;

/// The truth of a case from six sides.
#[derive(Debug)]
pub(super) struct ShadedViews {
    framing: Framing,
    faces: Vec<[u32; 3]>,
    /// Colour of each face; that of the hole's is another.
    tints: Vec<[u8; 3]>,
    truth: Vec<View>,
}

/// A picture from one side.
#[derive(Debug)]
struct View {
    /// Lightness of each pixel, 0 to 100.
    light: Vec<f64>,
    /// Which pixels show the hole.
    hole: Vec<bool>,
}

impl ShadedViews {
    /// Draws the truth. All pictures of a case have the cameras that this chooses.
    pub fn of(case: &EvaluationCase) -> ShadedViews {
        let sample = &case.sample;
        let present: Vec<bool> = (0..CELLS)
            .map(|k| sample.known[k] || sample.hole[k])
            .collect();
        let truth: Vec<Vec3> = (0..CELLS).map(|k| case.truth(k)).collect();
        let open = || (0..CELLS).filter(|&k| sample.hole[k]).map(|k| truth[k]);
        let centre = open().sum::<Vec3>() / open().count().max(1) as f64;
        let radius = open().map(|p| (p - centre).norm()).fold(1e-6, f64::max);
        let faces = faces(&present);
        let tint = |face: &[u32; 3]| match face.iter().any(|k| sample.hole[*k as usize]) {
            true => MENDED,
            false => CLOTH,
        };
        let mut views = ShadedViews {
            framing: Framing::Focus {
                centre,
                radius: radius * MARGIN,
            },
            tints: faces.iter().map(tint).collect(),
            faces,
            truth: Vec::new(),
        };
        views.truth = views.drawn(&truth);
        views
    }

    /// Mean structural similarity to the truth over all pixels, from all sides, that show the hole's cloth or should. `composed` has one position
    /// per cell; 1 for the truth itself.
    pub fn similarity(&self, composed: &[Vec3]) -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        for (made, truth) in self.drawn(composed).iter().zip(&self.truth) {
            let pair = LightPair {
                width: SIDE as usize,
                made: &made.light,
                truth: &truth.light,
            };
            for at in (0..truth.hole.len()).filter(|&at| made.hole[at] || truth.hole[at]) {
                sum += pair.ssim(at);
                count += 1;
            }
        }
        sum / count.max(1) as f64
    }

    fn drawn(&self, positions: &[Vec3]) -> Vec<View> {
        let mesh = TriMesh {
            positions: positions.to_vec(),
            faces: self.faces.clone(),
        };
        let view = |[azimuth, elevation]: [f64; 2]| {
            let options = PictureOptions {
                size: [SIDE; 2],
                direction: CameraDirection::Angles { azimuth, elevation },
                framing: self.framing,
                lines: EdgeLines::Rims,
            };
            let drawn = picture(&mesh, &self.tints, &options);
            View {
                light: drawn.pixels().map(|pixel| lab(pixel.0)[0]).collect(),
                // Mended cloth is redder than blue in any light; other cloth and the background are not.
                hole: drawn
                    .pixels()
                    .map(|pixel| pixel.0[0] > pixel.0[2])
                    .collect(),
            }
        };
        DIRECTIONS.map(view).into()
    }
}
