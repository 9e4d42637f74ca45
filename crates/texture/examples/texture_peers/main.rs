//! Other ways of example-based completion on the test sets, with the same cloth laid flat and the same scores as `darn evaluate --texture`.
//!
//! `texture_peers [SEED]` fills all holes of the tuned set, or of the siblings of a seed, by PatchMatch completion and by image quilting.
//! `texture_peers SEED write FOLDER` writes each hole as `K.png` (the cloth; alpha is zero in the hole and where nothing is known) for programs that fill
//! pictures; `texture_peers SEED score FOLDER` scores what they wrote as `K-filled.png`. Seed 0 is the tuned set.

mod patch_match;
mod picture;
mod quilting;

use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use darn_budget::Budget;
use darn_texture::testset::{
    ClothRaster, Comparison, FABRICS, Family, LAYOUTS, Phases, Scores, TestScan,
};
use darn_texture::{Completion, Settings};
use picture::Picture;

/// What is done with each hole.
enum Task {
    Fill,
    Write(PathBuf),
    Score(PathBuf),
}

/// A filler's scores and seconds.
type Filled = Vec<(&'static str, Scores, f64)>;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let family = match arguments.next().as_deref() {
        None | Some("0") => Family::Tuned,
        Some(seed) => Family::Sibling(seed.parse()?),
    };
    let folder = |path: Option<String>| path.map(PathBuf::from).ok_or("no folder is named");
    let task = match arguments.next().as_deref() {
        Some("write") => Task::Write(folder(arguments.next())?),
        Some("score") => Task::Score(folder(arguments.next())?),
        _ => Task::Fill,
    };
    let mut number = 0;
    for layout in LAYOUTS {
        for hole in family.holes() {
            let mut sums: BTreeMap<&str, [f64; 5]> = BTreeMap::new();
            for fabric in FABRICS {
                let scan = TestScan::of(family, fabric, layout, hole);
                for (filler, scores, seconds) in of_hole(&scan, number, &task)? {
                    println!(
                        "{:<12} {:<9} {hole:>4} {filler:<18} ΔE {:6.2} ≤ 10 {:5.1} SSIM {:6.3} seam {:5.2} phase {:6.3} {seconds:7.2} s",
                        fabric.name(),
                        layout.name(),
                        scores.delta_e,
                        100.0 * scores.within_10,
                        scores.ssim,
                        scores.seam,
                        scores.phase,
                    );
                    let sum = sums.entry(filler).or_default();
                    let own = [
                        scores.delta_e,
                        scores.within_10,
                        scores.ssim,
                        scores.seam,
                        seconds,
                    ];
                    (0..5).for_each(|k| sum[k] += own[k] / FABRICS.len() as f64);
                }
                number += 1;
            }
            for (filler, [delta_e, within_10, ssim, seam, seconds]) in sums {
                println!(
                    "== {:<9} {hole:>4} {filler:<18} ΔE {delta_e:6.2} ≤ 10 {:5.1} SSIM {ssim:6.3} seam {seam:5.2} {seconds:7.2} s",
                    layout.name(),
                    100.0 * within_10
                );
            }
        }
    }
    Ok(())
}

fn of_hole(scan: &TestScan, number: usize, task: &Task) -> Result<Filled, Box<dyn Error>> {
    let budget = Budget::unlimited();
    let cloth = scan.cloth();
    let begin = Instant::now();
    let completion = Completion::new(&cloth, &scan.patch, &Settings::default(), budget)?;
    let own = completion.texture(budget)?;
    let own_seconds = begin.elapsed().as_secs_f64();
    let raster = ClothRaster::new(&completion);
    let picture = Picture::new(&raster);
    let truth = scan.truth_texels(&completion.places());
    let [hole, known] = completion.masks();
    let scores = |made: &[[u8; 4]]| {
        let comparison = Comparison {
            width: own.width as usize,
            made,
            truth: &truth,
            hole: &hole,
            known: &known,
        };
        comparison.scores(&Phases::new(&scan.swatch, completion.step()))
    };
    let cut =
        |all: &[[u8; 4]]| -> Vec<[u8; 4]> { raster.of_image.iter().map(|at| all[*at]).collect() };
    let (width, height) = (picture.width as u32, picture.height() as u32);
    match task {
        Task::Fill => {
            let mut filled = vec![("darn", scores(&own.layers[0]), own_seconds)];
            type Filler = fn(&Picture) -> Picture;
            let fillers: [(&str, Filler); 3] = [
                ("PatchMatch", patch_match::fill),
                ("quilting, 24", |picture| quilting::fill(picture, 24)),
                ("quilting, 48", |picture| quilting::fill(picture, 48)),
            ];
            for (name, fill) in fillers {
                let begin = Instant::now();
                let made = fill(&picture);
                let seconds = begin.elapsed().as_secs_f64();
                filled.push((name, scores(&cut(&made.texels())), seconds));
            }
            Ok(filled)
        }
        Task::Write(folder) => {
            std::fs::create_dir_all(folder)?;
            let pixels = (0..raster.known.len()).flat_map(|at| {
                let [r, g, b, _] = raster.texels[at];
                let shown = raster.known[at] && !raster.hole[at];
                [r, g, b, if shown { 255 } else { 0 }]
            });
            let image = image::RgbaImage::from_raw(width, height, pixels.collect());
            let image = image.ok_or("a picture's size is wrong")?;
            image.save(folder.join(format!("{number}.png")))?;
            Ok(Vec::new())
        }
        Task::Score(folder) => {
            let seconds = std::fs::read_to_string(folder.join(format!("{number}-seconds.txt")))?;
            let filled = image::open(folder.join(format!("{number}-filled.png")))?.into_rgba8();
            let pixels = filled
                .pixels()
                .map(|p| p.0)
                .zip(&picture.hole)
                .zip(&raster.texels);
            let all: Vec<[u8; 4]> = pixels
                .map(|((made, hole), known)| if *hole { made } else { *known })
                .collect();
            Ok(vec![(
                "filled",
                scores(&cut(&all)),
                seconds.trim().parse()?,
            )])
        }
    }
}
