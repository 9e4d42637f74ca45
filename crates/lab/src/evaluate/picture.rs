//! The measurements as curves: Gaussian curvature as in the paper's Fig. 9, error over noise as in its Fig. 13.

use image::RgbImage;

use super::report::{Fill, Report, Stage};
use darn_render::chart::{Axis, Chart, INKS, Line, Scale, stacked};

/// Size of one chart in pixels.
const SIZE: [u32; 2] = [1100, 520];
/// Bins of a histogram.
const BINS: usize = 61;
/// Angle defects shown, radians, either way.
const WIDEST: f64 = 0.6;

/// Histograms of angle defects before and after the patch, and, where several levels were measured, the error over noise.
pub fn picture(report: &Report) -> RgbImage {
    let mut charts: Vec<RgbImage> = Stage::ALL
        .into_iter()
        .map(|stage| histogram(report, stage).drawn(SIZE))
        .collect();
    if report.noises().len() > 1 {
        charts.push(over_noise(report).drawn(SIZE));
    }
    stacked(&charts)
}

fn axis(label: &str, scale: Scale) -> Axis {
    Axis {
        label: label.into(),
        scale,
    }
}

fn ink(fill: Fill) -> [u8; 3] {
    match fill {
        Fill::Truth => INKS[4],
        Fill::Network => INKS[1],
        Fill::Membrane => INKS[0],
        Fill::ThinPlate => INKS[2],
    }
}

fn histogram(report: &Report, stage: Stage) -> Chart {
    let pools = report.defects.iter().filter(|(_, s, _)| *s == stage);
    let lines = pools.map(|(fill, _, defects)| Line {
        name: fill.name().into(),
        ink: ink(*fill),
        points: density(defects),
    });
    Chart {
        title: format!("Gaussian curvature in the hole, {}", stage.name()),
        x: axis("angle defect of a cell, rad", Scale::Linear),
        y: axis("cells per rad", Scale::Logarithmic),
        lines: lines.collect(),
    }
}

/// Share of the numbers in each bin ÷ the bin's width; numbers beyond the range are counted but not shown.
fn density(numbers: &[f64]) -> Vec<[f64; 2]> {
    let width = 2.0 * WIDEST / BINS as f64;
    let mut counts = [0usize; BINS];
    for x in numbers {
        let bin = ((x + WIDEST) / width).floor();
        if (0.0..BINS as f64).contains(&bin) {
            counts[bin as usize] += 1;
        }
    }
    let whole = numbers.len().max(1) as f64 * width;
    let bins = counts.iter().enumerate();
    bins.map(|(bin, &count)| [(bin as f64 + 0.5) * width - WIDEST, count as f64 / whole])
        .collect()
}

fn over_noise(report: &Report) -> Chart {
    let fills = Fill::ALL.into_iter().filter(|fill| *fill != Fill::Truth);
    let lines = fills.map(|fill| {
        let point = |noise: f64| {
            let wanted = |row: &super::Row| {
                row.noise == noise && row.fill == fill && row.stage == Stage::Patched
            };
            Some([noise, report.mean(wanted)?.rmse])
        };
        Line {
            name: fill.name().into(),
            ink: ink(fill),
            points: report.noises().into_iter().filter_map(point).collect(),
        }
    });
    Chart {
        title: "Noise on the known cells, after patch".into(),
        x: axis("standard deviation, cells", Scale::Linear),
        y: axis("RMSE, cells", Scale::Linear),
        lines: lines.collect(),
    }
}
