//! Fills the transparent parts of `K.png` in a folder by the `texture-synthesis` crate, as `K-filled.png`; `K-seconds.txt` is the time.
//! `cargo run --release -p darn-texture --example texture_peers -- 0 write FOLDER` makes such a folder, and `… 0 score FOLDER` reads it.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use texture_synthesis::{Dims, Example, Session};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("no folder is named")?;
    let folder = Path::new(&folder);
    for number in 0.. {
        let cloth = folder.join(format!("{number}.png"));
        if !cloth.exists() {
            return Ok(());
        }
        fill(folder, number)?;
    }
    Ok(())
}

fn fill(folder: &Path, number: usize) -> Result<(), Box<dyn Error>> {
    let picture = image::open(folder.join(format!("{number}.png")))?.into_rgba8();
    let (width, height) = picture.dimensions();
    // The crate fills squares of the example's own size.
    let side = width.max(height);
    let mut example = image::RgbaImage::from_pixel(side, side, image::Rgba([0, 0, 0, 255]));
    let mut mask = image::RgbaImage::from_pixel(side, side, image::Rgba([0, 0, 0, 255]));
    for (x, y, pixel) in picture.enumerate_pixels() {
        let [r, g, b, a] = pixel.0;
        if a > 0 {
            example.put_pixel(x, y, image::Rgba([r, g, b, 255]));
            mask.put_pixel(x, y, image::Rgba([255; 4]));
        }
    }
    let (at, masked) = (folder.join("example.png"), folder.join("mask.png"));
    example.save(&at)?;
    mask.save(&masked)?;
    let begin = Instant::now();
    let known = Example::builder(&at).set_sample_method(&masked);
    let session = Session::builder()
        .inpaint_example(&masked, known, Dims::square(side))
        .seed(1)
        .max_thread_count(2)
        .build()?;
    let filled = session.run(None).into_image().into_rgba8();
    let seconds = begin.elapsed().as_secs_f64();
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let bytes = pixels.flat_map(|(x, y)| filled.get_pixel(x, y).0).collect();
    let cut = image::RgbaImage::from_raw(width, height, bytes).ok_or("a picture's size is wrong")?;
    cut.save(folder.join(format!("{number}-filled.png")))?;
    std::fs::write(folder.join(format!("{number}-seconds.txt")), seconds.to_string())?;
    Ok(())
}
