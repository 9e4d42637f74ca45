//! Pictures of meshes, drawn in software: a z-buffer, three lights, a little occlusion; for a person to look at a result.
//! May use mesh types and the `image` crate; a picture is a pure function of what is passed in.
//! No glTF, no files, no windows: the command decides what is drawn in which colour.

mod camera;
mod occlusion;
mod outline;
mod raster;
mod shade;

use camera::Camera;
use darn_geometry::mesh::{TriMesh, Vec3};
use image::{Rgb, RgbImage};
use rayon::prelude::*;

/// Base colour of cloth as it was scanned (sRGB).
pub const CLOTH: [u8; 3] = [142, 160, 186];
/// Base colour of cloth that was reconstructed (sRGB): warm, so that it is told from evidence at a glance.
pub const MENDED: [u8; 3] = [226, 146, 88];

/// The longest side of a picture, in pixels.
pub const MAX_SIDE: u32 = 8192;

/// Rows of pixels drawn at a time: bounds the memory of supersampling and is the grain of parallel work.
const BAND: usize = 32;

/// What the camera sees and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Width and height in pixels; clamped to 1 ..= [`MAX_SIDE`].
    pub size: [u32; 2],
    /// From where the camera looks.
    pub aim: Aim,
    /// How much of the mesh is in the picture.
    pub framing: Framing,
    /// Which edges are drawn.
    pub lines: Lines,
}

impl Default for View {
    fn default() -> Self {
        Self {
            size: [1200, 900],
            aim: Aim::Auto,
            framing: Framing::Whole,
            lines: Lines::Rims,
        }
    }
}

/// From where the camera looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim {
    /// Towards the broad side of the cloth, slightly oblique so that folds show.
    Auto,
    /// Degrees: azimuth turns about +y (0 looks from +z, 90 from +x), elevation lifts the camera (90 looks straight down).
    Angles {
        /// Turn about +y, degrees.
        azimuth: f64,
        /// Height over the horizon, degrees.
        elevation: f64,
    },
}

/// How much of the mesh is in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Framing {
    /// All of it.
    Whole,
    /// A ball, say around a hole; `Aim::Auto` then faces the cloth inside the ball.
    Focus {
        /// Centre of the ball, scene space.
        centre: Vec3,
        /// Radius of the ball, scene units; must be positive.
        radius: f64,
    },
}

/// Which edges are drawn over the shading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lines {
    /// Boundary edges only: the rims of holes and the border of the cloth.
    Rims,
    /// Every edge.
    Wireframe,
}

/// Draws `mesh` with one base colour a face (`tints`, sRGB; missing ones are [`CLOTH`]).
///
/// Vertices at one place must be one vertex (weld first), else every texture seam is drawn as a boundary. Faces with indices out of
/// range or positions that are not finite are left out. Same input, same picture, whatever the number of threads.
pub fn picture(mesh: &TriMesh, tints: &[[u8; 3]], view: &View) -> RgbImage {
    let width = view.size[0].clamp(1, MAX_SIDE) as usize;
    let height = view.size[1].clamp(1, MAX_SIDE) as usize;
    let faces = drawable(mesh);
    let camera = Camera::aimed(mesh, &faces, view, [width, height]);
    let triangles = raster::triangles(mesh, &faces, tints, &camera);
    let segments = outline::segments(mesh, &faces, view.lines, &camera);

    let bands: Vec<raster::Band> = (0..height.div_ceil(BAND))
        .into_par_iter()
        .map(|band| {
            let rows = band * BAND..((band + 1) * BAND).min(height);
            raster::draw(&triangles, &segments, [width, height], rows)
        })
        .collect();
    let pixels = raster::Pixels::joined(bands, [width, height]);
    let light = occlusion::visibility(&pixels, &camera);

    RgbImage::from_fn(width as u32, height as u32, |x, y| {
        let at = y as usize * width + x as usize;
        let colour = pixels.colour.get(at).copied().unwrap_or_default();
        let open = light.get(at).copied().unwrap_or(1.0);
        Rgb(shade::to_srgb(colour.map(|c| c * open)))
    })
}

/// A face that can be drawn, with its place in the mesh.
#[derive(Debug, Clone, Copy)]
struct Drawable {
    face: usize,
    vertices: [usize; 3],
}

fn drawable(mesh: &TriMesh) -> Vec<Drawable> {
    let sound = |&v: &u32| {
        mesh.positions
            .get(v as usize)
            .is_some_and(|p| p.iter().all(|c| c.is_finite()))
    };
    let all = mesh.faces.iter().enumerate();
    all.filter(|(_, f)| f.iter().all(sound))
        .map(|(face, f)| Drawable {
            face,
            vertices: f.map(|v| v as usize),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square sheet in the xy plane, `n` cells a side, with a square hole of `hole` cells in its middle.
    fn sheet(n: usize, hole: usize) -> TriMesh {
        let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
        let positions = (0..(n + 1) * (n + 1))
            .map(|k| Vec3::new((k % (n + 1)) as f64, (k / (n + 1)) as f64, 0.0))
            .collect();
        let middle = (n - hole) / 2..(n + hole) / 2;
        let mut faces = Vec::new();
        for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
            if !(middle.contains(&i) && middle.contains(&j)) {
                faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        TriMesh { positions, faces }
    }

    fn small() -> View {
        View {
            size: [80, 60],
            aim: Aim::Angles {
                azimuth: 0.0,
                elevation: 0.0,
            },
            ..View::default()
        }
    }

    /// How much redder than blue a pixel is.
    fn warmth(p: &Rgb<u8>) -> i32 {
        i32::from(p.0[0]) - i32::from(p.0[2])
    }

    #[test]
    fn the_cloth_is_in_the_middle_and_background_around_it() {
        let mesh = sheet(8, 0);
        let drawn = picture(&mesh, &vec![MENDED; mesh.faces.len()], &small());
        assert!(
            warmth(drawn.get_pixel(40, 30)) > 60,
            "{:?}",
            drawn.get_pixel(40, 30)
        );
        assert!(warmth(drawn.get_pixel(1, 30)).abs() < 30);
    }

    #[test]
    fn a_hole_shows_the_background() {
        let mesh = sheet(8, 4);
        let drawn = picture(&mesh, &vec![MENDED; mesh.faces.len()], &small());
        assert!(warmth(drawn.get_pixel(40, 30)).abs() < 30);
    }

    #[test]
    fn both_sides_are_lit() {
        let mesh = sheet(4, 0);
        let behind = View {
            aim: Aim::Angles {
                azimuth: 180.0,
                elevation: 0.0,
            },
            ..small()
        };
        let drawn = picture(&mesh, &vec![MENDED; mesh.faces.len()], &behind);
        let seen = drawn.get_pixel(40, 30);
        assert!(warmth(seen) > 40 && seen.0[0] > 90, "{seen:?}");
    }

    #[test]
    fn the_nearer_face_hides_the_farther() {
        let mut mesh = sheet(1, 0);
        let count = mesh.positions.len() as u32;
        let nearer: Vec<Vec3> = mesh
            .positions
            .iter()
            .map(|p| p + Vec3::new(0.0, 0.0, 0.2))
            .collect();
        let above: Vec<[u32; 3]> = mesh.faces.iter().map(|f| f.map(|v| v + count)).collect();
        mesh.positions.extend(nearer);
        mesh.faces.splice(0..0, above);
        let drawn = picture(&mesh, &[MENDED, MENDED, CLOTH, CLOTH], &small());
        assert!(warmth(drawn.get_pixel(40, 30)) > 60);
    }

    #[test]
    fn nothing_and_nonsense_give_a_picture_all_the_same() {
        let nothing = picture(
            &TriMesh::default(),
            &[],
            &View {
                size: [0, 3],
                ..View::default()
            },
        );
        assert_eq!(nothing.dimensions(), (1, 3));
        let point = Vec3::new(1.0, 1.0, 1.0);
        let nonsense = TriMesh {
            positions: vec![
                point,
                point,
                point,
                Vec3::new(f64::NAN, 0.0, 0.0),
                Vec3::new(1e300, -1e300, 1e300),
            ],
            faces: vec![[0, 1, 2], [0, 1, 3], [0, 1, 99], [0, 1, 4]],
        };
        for lines in [Lines::Rims, Lines::Wireframe] {
            let drawn = picture(
                &nonsense,
                &[],
                &View {
                    size: [9, 9],
                    lines,
                    ..View::default()
                },
            );
            assert_eq!(drawn.dimensions(), (9, 9));
        }
    }

    #[test]
    fn the_same_input_gives_the_same_picture() {
        let mesh = sheet(6, 2);
        let view = View {
            aim: Aim::Auto,
            lines: Lines::Wireframe,
            ..small()
        };
        assert_eq!(picture(&mesh, &[], &view), picture(&mesh, &[], &view));
    }

    #[test]
    fn focus_brings_the_cloth_nearer() {
        let mesh = sheet(8, 2);
        let framing = Framing::Focus {
            centre: Vec3::new(4.0, 4.0, 0.0),
            radius: 2.0,
        };
        let far = picture(&mesh, &vec![MENDED; mesh.faces.len()], &small());
        let near = picture(
            &mesh,
            &vec![MENDED; mesh.faces.len()],
            &View { framing, ..small() },
        );
        let cloth = |image: &RgbImage| image.pixels().filter(|p| warmth(p) > 60).count();
        assert!(cloth(&near) > cloth(&far));
    }
}
