//! Draws a wavy sheet with a hole to a PNG: `cargo run -p darn-render --example draw -- sheet.png`

use darn_geometry::mesh::{Vec3, shapes};
use darn_render::{CLOTH, EdgeLines, PictureOptions, picture};
use image::ImageResult;

fn main() -> ImageResult<()> {
    let path = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "sheet.png".into());
    let mesh = shapes::sheet(
        60,
        |u, v| (u - 0.5).hypot(v - 0.5) > 0.15,
        |u, v| Vec3::new(u, v, 0.05 * (9.0 * u).sin()),
    );
    let options = PictureOptions {
        size: [800, 600],
        lines: EdgeLines::Rims,
        ..PictureOptions::default()
    };
    picture(&mesh, &vec![CLOTH; mesh.faces.len()], &options).save(&path)?;
    println!("{path}");
    Ok(())
}
