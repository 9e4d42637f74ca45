//! Prints the table of the test set, and writes a picture of every trial: truth, what is missing, darn's own texture, continued coordinates,
//! averaged coordinates.
//!
//! `cargo run --release -p darn-texture --example texture_table -- [DIRECTORY [HOLE]]`

use std::path::Path;
use std::time::Instant;

use darn_texture::testset::{FABRICS, HOLES, LAYOUTS, Scores, TestScan, Trial};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let directory = arguments.next();
    let only: Option<usize> = arguments.next().map(|x| x.parse()).transpose()?;
    println!(
        "{:<12} {:<9} {:>4}  {:^38} | {:^26} | {:^13} | continued",
        "fabric",
        "layout",
        "hole",
        "own: ΔE ≤10 SSIM seam phase",
        "continue: ΔE ≤10 seam phase",
        "average: ΔE"
    );
    for hole in HOLES.into_iter().filter(|h| only.is_none_or(|o| o == *h)) {
        for layout in LAYOUTS {
            let mut trials = Vec::new();
            for fabric in FABRICS {
                let scan = TestScan::new(fabric, layout, hole);
                let begin = Instant::now();
                let trial = Trial::new(&scan)?;
                let [own, on, mean] = trial.scores;
                let Scores {
                    delta_e,
                    within_10,
                    ssim,
                    seam,
                    phase,
                } = own;
                println!(
                    "{:<12} {:<9} {hole:>4}  {delta_e:6.2} {:5.1} {ssim:6.3} {seam:6.2} {phase:6.3} | {:6.2} {:5.1} {:6.2} {:6.3} | {:6.2} {:5.1} | {:.3} {:.3} {} {:.0} ms",
                    fabric.name(),
                    layout.name(),
                    100.0 * within_10,
                    on.delta_e,
                    100.0 * on.within_10,
                    on.seam,
                    on.phase,
                    mean.delta_e,
                    100.0 * mean.within_10,
                    trial.continued.hole,
                    trial.continued.cloth,
                    if trial.continued.is_as_good() {
                        "continue"
                    } else {
                        "own"
                    },
                    begin.elapsed().as_secs_f64() * 1000.0,
                );
                trials.push(trial);
            }
            if let Some(directory) = &directory {
                let name = format!("{hole}-{}.png", layout.name()).replace(' ', "_");
                sheet(&trials, &Path::new(directory).join(name))?;
            }
        }
    }
    Ok(())
}

/// All fabrics of one layout below each other.
fn sheet(trials: &[Trial], path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let width = trials.iter().map(|t| 4 * t.width).max().unwrap_or(1);
    let height: usize = trials.iter().map(|t| t.truth.len() / t.width).sum();
    let mut picture = image::RgbaImage::new(width as u32, height as u32);
    let mut top = 0;
    for trial in trials {
        let all = [&trial.truth, &trial.made[0], &trial.made[1], &trial.made[2]];
        for (k, pixels) in all.into_iter().enumerate() {
            for (at, pixel) in pixels.iter().enumerate() {
                let (x, y) = (k * trial.width + at % trial.width, top + at / trial.width);
                picture.put_pixel(x as u32, y as u32, image::Rgba(*pixel));
            }
        }
        top += trial.truth.len() / trial.width;
    }
    std::fs::create_dir_all(path.parent().unwrap_or(Path::new(".")))?;
    picture.save(path)?;
    Ok(())
}
