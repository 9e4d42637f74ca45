//! Pictures of meshes, drawn in software with a z-buffer, three lights and ambient occlusion.
//!
//! A picture depends on the arguments only. The crate knows no glTF, opens no file and no window; the caller chooses
//! what is drawn in which colour.

mod camera;
mod face;
mod occlusion;
mod options;
mod outline;
mod raster;
mod shade;

pub use options::{CameraDirection, EdgeLines, Framing, MAX_SIDE, PictureOptions};
pub use shade::{CLOTH, MENDED, from_srgb};

use camera::Camera;
use darn_geometry::mesh::TriMesh;
use face::drawable_faces;
use image::{Rgb, RgbImage};
use options::PixelSize;
use rayon::prelude::*;

/// Rows of pixels that are drawn at a time, on one thread. Few rows need little memory for their samples.
const BAND: usize = 32;

/// Draws `mesh` with one base colour for each face (`tints`, sRGB; missing ones are [`CLOTH`]).
///
/// Vertices at the same position must be one vertex (weld first); otherwise every texture seam is drawn as a boundary.
/// Faces with indices out of range or positions that are not finite are left out. The same input gives the same
/// picture, with any number of threads.
pub fn picture(mesh: &TriMesh, tints: &[[u8; 3]], options: &PictureOptions) -> RgbImage {
    let linear: Vec<[f32; 3]> = tints.iter().map(|tint| shade::from_srgb(*tint)).collect();
    let cloth = shade::from_srgb(CLOTH);
    let paint = |place: &FacePlace| linear.get(place.face).copied().unwrap_or(cloth);
    painted(mesh, &paint, options)
}

/// A point of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacePlace {
    /// Index of the face.
    pub face: usize,
    /// Barycentric coordinates of the point at the face's corners.
    pub weights: [f64; 3],
}

/// Draws `mesh` as [`picture`] does, with a base colour of its own at each point: linear red, green, blue from 0 to 1.
pub fn painted(
    mesh: &TriMesh,
    paint: &(dyn Fn(&FacePlace) -> [f32; 3] + Sync),
    options: &PictureOptions,
) -> RgbImage {
    let [width, height] = options.size.map(|side| side.clamp(1, MAX_SIDE) as usize);
    let size = PixelSize { width, height };
    let faces = drawable_faces(mesh);
    let camera = Camera::new(mesh, &faces, options, size);
    let triangles = raster::triangles(mesh, &faces, &camera);
    let segments = outline::segments(mesh, &faces, options.lines, &camera);

    let bands: Vec<raster::RowBand> = (0..height.div_ceil(BAND))
        .into_par_iter()
        .map(|band| {
            let rows = band * BAND..((band + 1) * BAND).min(height);
            let scene = raster::Scene {
                triangles: &triangles,
                segments: &segments,
                paint,
            };
            raster::draw(&scene, size, rows)
        })
        .collect();
    let pixels = raster::Pixels::joined(bands, size);
    let light = occlusion::visibility(&pixels, &camera);

    RgbImage::from_fn(width as u32, height as u32, |x, y| {
        let at = y as usize * width + x as usize;
        let colour = pixels.colour.get(at).copied().unwrap_or_default();
        let open = light.get(at).copied().unwrap_or(1.0);
        Rgb(shade::to_srgb(colour.map(|c| c * open)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::mesh::Vec3;

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

    fn small() -> PictureOptions {
        PictureOptions {
            size: [80, 60],
            direction: CameraDirection::Angles {
                azimuth: 0.0,
                elevation: 0.0,
            },
            ..PictureOptions::default()
        }
    }

    /// How much redder than blue a pixel is.
    fn warmth(p: &Rgb<u8>) -> i32 {
        i32::from(p.0[0]) - i32::from(p.0[2])
    }

    #[test]
    fn the_cloth_is_in_the_middle_of_the_background() {
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
    fn paint_is_asked_for_every_point_of_a_face() {
        let mesh = sheet(1, 0);
        // The second face is red towards its last corner and blue elsewhere.
        let paint = |place: &FacePlace| match place.face == 1 && place.weights[2] > 0.5 {
            true => [0.9, 0.0, 0.0],
            false => [0.0, 0.0, 0.9],
        };
        let drawn = painted(&mesh, &paint, &small());
        let red = drawn.pixels().filter(|p| warmth(p) > 60).count();
        let blue = drawn.pixels().filter(|p| warmth(p) < -60).count();
        // A quarter of one of two faces.
        assert!(5 * red < blue && blue < 9 * red, "{red} {blue}");
    }

    #[test]
    fn both_sides_are_lit() {
        let mesh = sheet(4, 0);
        let behind = PictureOptions {
            direction: CameraDirection::Angles {
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
    fn empty_and_invalid_meshes_give_a_picture() {
        let empty = picture(
            &TriMesh::default(),
            &[],
            &PictureOptions {
                size: [0, 3],
                ..PictureOptions::default()
            },
        );
        assert_eq!(empty.dimensions(), (1, 3));
        let point = Vec3::new(1.0, 1.0, 1.0);
        let invalid = TriMesh {
            positions: vec![
                point,
                point,
                point,
                Vec3::new(f64::NAN, 0.0, 0.0),
                Vec3::new(1e300, -1e300, 1e300),
            ],
            faces: vec![[0, 1, 2], [0, 1, 3], [0, 1, 99], [0, 1, 4]],
        };
        for lines in [EdgeLines::Rims, EdgeLines::Wireframe] {
            let drawn = picture(
                &invalid,
                &[],
                &PictureOptions {
                    size: [9, 9],
                    lines,
                    ..PictureOptions::default()
                },
            );
            assert_eq!(drawn.dimensions(), (9, 9));
        }
    }

    #[test]
    fn the_same_input_gives_the_same_picture() {
        let mesh = sheet(6, 2);
        let options = PictureOptions {
            direction: CameraDirection::Auto,
            lines: EdgeLines::Wireframe,
            ..small()
        };
        assert_eq!(picture(&mesh, &[], &options), picture(&mesh, &[], &options));
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
            &PictureOptions { framing, ..small() },
        );
        let cloth = |image: &RgbImage| image.pixels().filter(|p| warmth(p) > 60).count();
        assert!(cloth(&near) > cloth(&far));
    }
}
