//! `darn evaluate --texture`: the textures of patches on ten fabrics with known answers, beside what is done without them.

use super::failure::{Failure, OrFail};
use super::files;
use darn_texture::testset::{FABRICS, Family, LAYOUTS, Scores, TestScan, Trial};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// Differences of ΔE between fillers that do not count.
const SAME_DELTA_E: f64 = 0.3;

/// One hole of the test set.
struct Row {
    fabric: &'static str,
    layout: &'static str,
    hole: usize,
    trial: Trial,
    milliseconds: f64,
}

/// Prints the table; the pictures (truth, own texture, continued coordinates, averaged ones) go to a folder, the numbers to a file.
pub fn run(family: Family, pictures: Option<&Path>, json: Option<&Path>) -> Result<(), Failure> {
    println!(
        "{:<12} {:<9} {:>4} | {:^35} | {:^35} | {:^35} | chosen",
        "fabric",
        "layout",
        "hole",
        "own: ΔE, ≤ 10, SSIM, seam, phase",
        "continue: the same",
        "average: the same"
    );
    let mut rows: Vec<Row> = Vec::new();
    for hole in family.holes() {
        for layout in LAYOUTS {
            let first = rows.len();
            for fabric in FABRICS {
                let scan = TestScan::of(family, fabric, layout, hole);
                let started = Instant::now();
                let trial = Trial::new(&scan).or_fail("complete a texture")?;
                let row = Row {
                    fabric: fabric.name(),
                    layout: layout.name(),
                    hole,
                    trial,
                    milliseconds: started.elapsed().as_secs_f64() * 1e3,
                };
                print_row(&row);
                rows.push(row);
            }
            if let Some(folder) = pictures {
                let name = format!("{hole}-{}.png", layout.name()).replace(' ', "_");
                picture(&rows[first..], &folder.join(name))?;
            }
        }
    }
    for layout in LAYOUTS {
        print_summary(family, layout.name(), &rows);
    }
    match json {
        Some(path) => {
            let all: Vec<Value> = rows.iter().map(numbers).collect();
            files::write(path, &files::json(&json!(all), "write the report")?)
        }
        None => Ok(()),
    }
}

fn print_row(row: &Row) {
    let [own, continued, average] = row.trial.scores.map(|scores| {
        format!(
            "{:6.2} {:6.1} {:6.3} {:6.2} {:7.3}",
            scores.delta_e,
            100.0 * scores.within_10,
            scores.ssim,
            scores.seam,
            scores.phase
        )
    });
    println!(
        "{:<12} {:<9} {:>4} | {own} | {continued} | {average} | {} ({:.3}, cloth {:.3}) {:.0} ms",
        row.fabric,
        row.layout,
        row.hole,
        chosen(row),
        row.trial.continued.hole,
        row.trial.continued.cloth,
        row.milliseconds,
    );
}

/// What a mend without a choice takes.
fn chosen_scores(row: &Row) -> &Scores {
    let [own, continued, _] = &row.trial.scores;
    match row.trial.continued.is_as_good() {
        true => continued,
        false => own,
    }
}

/// The name of what a mend without a choice takes.
fn chosen(row: &Row) -> &'static str {
    match row.trial.continued.is_as_good() {
        true => "continue",
        false => "own",
    }
}

/// Means over the fabrics of a layout, by size of hole, and what misses the targets.
fn print_summary(family: Family, layout: &str, rows: &[Row]) {
    for hole in family.holes() {
        let of = || (rows.iter()).filter(|row| row.layout == layout && row.hole == hole);
        let count = of().count().max(1) as f64;
        let mean = |k: usize| of().map(|row| row.trial.scores[k].delta_e).sum::<f64>() / count;
        let seam = of().map(|row| row.trial.scores[0].seam).fold(0.0, f64::max);
        let phase = (of().map(|row| row.trial.scores[0].phase))
            .filter(|phase| phase.is_finite())
            .fold(0.0, f64::max);
        let mean_chosen = of().map(|row| chosen_scores(row).delta_e).sum::<f64>() / count;
        let worse = of().filter(|row| {
            let [_, continued, average] = &row.trial.scores;
            chosen_scores(row).delta_e > continued.delta_e.min(average.delta_e) + SAME_DELTA_E
        });
        let missed = of().filter(|row| {
            let [own, continued, _] = &row.trial.scores;
            3.0 * own.delta_e > continued.delta_e
        });
        println!(
            "{layout}, holes of {hole}: mean ΔE own {:.2}, continue {:.2}, average {:.2}, chosen {mean_chosen:.2}; chosen worse than a peer {}; \
             own above a third of continue {} of {count}; largest seam {seam:.2}, phase {phase:.3}",
            mean(0),
            mean(1),
            mean(2),
            worse.count(),
            missed.count(),
        );
    }
}

fn numbers(row: &Row) -> Value {
    let [own, continued, average] = row.trial.scores.map(|scores| {
        let Scores {
            delta_e,
            within_10,
            ssim,
            seam,
            phase,
        } = scores;
        json!({"delta_e": delta_e, "within_10": within_10, "ssim": ssim, "seam": seam, "phase": phase})
    });
    json!({
        "fabric": row.fabric,
        "layout": row.layout,
        "hole": row.hole,
        "own": own,
        "continue": continued,
        "average": average,
        "chosen": chosen(row),
        "milliseconds": row.milliseconds,
    })
}

/// All fabrics of one layout below each other.
fn picture(rows: &[Row], path: &Path) -> Result<(), Failure> {
    let height = |row: &Row| row.trial.truth.len() / row.trial.width;
    let width = rows
        .iter()
        .map(|row| 4 * row.trial.width)
        .max()
        .unwrap_or(1);
    let all: usize = rows.iter().map(height).sum();
    let mut picture = image::RgbaImage::new(width as u32, all as u32);
    let mut top = 0;
    for row in rows {
        let made = row.trial.made.iter();
        for (k, pixels) in [&row.trial.truth].into_iter().chain(made).enumerate() {
            for (at, pixel) in pixels.iter().enumerate() {
                let x = k * row.trial.width + at % row.trial.width;
                let y = top + at / row.trial.width;
                picture.put_pixel(x as u32, y as u32, image::Rgba(*pixel));
            }
        }
        top += height(row);
    }
    let name = path.display();
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).or_fail(format!("make the folder of {name}"))?;
    }
    picture.save(path).or_fail(format!("write {name}"))
}
