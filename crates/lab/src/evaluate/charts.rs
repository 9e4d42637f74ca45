//! The measurements as line charts: Gaussian curvature as in the paper's Fig. 9, error over noise as in its Fig. 13.

use super::report::{EvaluationReport, EvaluationRow, EvaluationStage, FillMethod};
use crate::line_chart::{AxisScale, ChartAxis, ChartLine, ChartSize, INKS, LineChart, svg};

/// Size of one chart.
const SIZE: ChartSize = ChartSize {
    width: 1100,
    height: 520,
};
/// Bins of a histogram.
const BINS: usize = 61;
/// Largest angle defect shown, radians.
const WIDEST: f64 = 0.6;

/// An SVG document with histograms of angle defects before and after the patch and, where several noise levels were measured, the error
/// over noise.
pub fn picture(report: &EvaluationReport) -> String {
    let mut charts: Vec<LineChart> = EvaluationStage::ALL
        .into_iter()
        .map(|stage| histogram(report, stage))
        .collect();
    if report.noises().len() > 1 {
        charts.push(over_noise(report));
    }
    svg(&charts, SIZE)
}

fn axis(label: &str, scale: AxisScale) -> ChartAxis {
    ChartAxis {
        label: label.into(),
        scale,
    }
}

fn ink(fill: FillMethod) -> [u8; 3] {
    match fill {
        FillMethod::Truth => INKS[4],
        FillMethod::Network => INKS[1],
        FillMethod::Membrane => INKS[0],
        FillMethod::ThinPlate => INKS[2],
    }
}

fn histogram(report: &EvaluationReport, stage: EvaluationStage) -> LineChart {
    let pools = report.defects.iter().filter(|pool| pool.stage == stage);
    let lines = pools.map(|pool| ChartLine {
        name: pool.method.name().into(),
        ink: ink(pool.method),
        points: density(&pool.defects),
    });
    LineChart {
        title: format!("Gaussian curvature in the hole, {}", stage.name()),
        x: axis("angle defect of a cell, rad", AxisScale::Linear),
        y: axis("cells per rad", AxisScale::Logarithmic),
        lines: lines.collect(),
    }
}

/// Share of the numbers in each bin ÷ width of the bin; numbers beyond the range count in the total but are not shown.
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

fn over_noise(report: &EvaluationReport) -> LineChart {
    let fills = FillMethod::ALL
        .into_iter()
        .filter(|fill| *fill != FillMethod::Truth);
    let lines = fills.map(|fill| {
        let point = |noise: f64| {
            let wanted = |row: &EvaluationRow| {
                row.noise == noise && row.fill == fill && row.stage == EvaluationStage::Patched
            };
            Some([noise, report.mean(wanted)?.rmse])
        };
        ChartLine {
            name: fill.name().into(),
            ink: ink(fill),
            points: report.noises().into_iter().filter_map(point).collect(),
        }
    });
    LineChart {
        title: "Noise on the known cells, after patch".into(),
        x: axis("standard deviation, cells", AxisScale::Linear),
        y: axis("RMSE, cells", AxisScale::Linear),
        lines: lines.collect(),
    }
}
