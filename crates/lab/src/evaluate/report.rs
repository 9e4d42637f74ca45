//! The measurements of many cases: means and Markdown tables.

use std::fmt::Write as _;

use serde::Serialize;

use super::cases::HoleSize;
use super::metrics::FillMetrics;
use crate::scarffolds::masks::{MaskShape, SHAPES};
use darn_geometry::grid::SIDE;

/// Quantiles at which distributions are compared.
const QUANTILES: usize = 1000;

/// How the hole was filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FillMethod {
    /// With the truth: the metrics of real cloth.
    Truth,
    /// By the network.
    Network,
    /// By [`darn_geometry::smooth::Smooth::Membrane`].
    Membrane,
    /// By [`darn_geometry::smooth::Smooth::ThinPlate`].
    ThinPlate,
}

impl FillMethod {
    /// All methods, in the order of the tables.
    pub const ALL: [FillMethod; 4] = [
        FillMethod::Truth,
        FillMethod::Network,
        FillMethod::Membrane,
        FillMethod::ThinPlate,
    ];

    /// Its name in tables and legends.
    pub fn name(self) -> &'static str {
        match self {
            FillMethod::Truth => "truth",
            FillMethod::Network => "network",
            FillMethod::Membrane => "membrane",
            FillMethod::ThinPlate => "thin plate",
        }
    }
}

/// Whether a fill is measured before or after the patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EvaluationStage {
    /// The fill itself.
    Filled,
    /// The patch: meshed from the rim, with its lengths restored.
    Patched,
}

impl EvaluationStage {
    /// Both stages.
    pub const ALL: [EvaluationStage; 2] = [EvaluationStage::Filled, EvaluationStage::Patched];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            EvaluationStage::Filled => "as filled",
            EvaluationStage::Patched => "after patch",
        }
    }
}

/// One fill of one case at one noise level and one stage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EvaluationRow {
    /// Number of the case.
    pub case: usize,
    /// Shape of its first hole.
    pub shape: MaskShape,
    /// Size of its holes.
    pub size: HoleSize,
    /// Standard deviation of the noise on known cells, in cells.
    pub noise: f64,
    /// How it was filled.
    pub fill: FillMethod,
    /// Before or after the patch.
    pub stage: EvaluationStage,
    /// The metrics.
    #[serde(flatten)]
    pub metrics: FillMetrics,
}

/// Angle defects of the hole cells of all cases without noise, radians.
#[derive(Debug, Clone, PartialEq)]
pub struct AngleDefects {
    /// How the holes were filled.
    pub method: FillMethod,
    /// Before or after the patch.
    pub stage: EvaluationStage,
    /// One number for each hole cell.
    pub defects: Vec<f64>,
}

/// All measurements of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct EvaluationReport {
    /// One row for each measurement.
    pub rows: Vec<EvaluationRow>,
    /// Number of fills that could not be patched.
    pub not_patched: usize,
    /// The angle defects, for each method at each stage; not part of the JSON.
    #[serde(skip)]
    pub defects: Vec<AngleDefects>,
}

impl EvaluationReport {
    /// Mean of the rows for which `wanted` is true; `None` when there are none.
    pub fn mean(&self, wanted: impl Fn(&EvaluationRow) -> bool) -> Option<FillMetrics> {
        let found: Vec<&FillMetrics> = (self.rows.iter())
            .filter(|row| wanted(row))
            .map(|row| &row.metrics)
            .collect();
        if found.is_empty() {
            return None;
        }
        let of = |part: fn(&FillMetrics) -> f64| {
            found.iter().map(|m| part(m)).sum::<f64>() / found.len() as f64
        };
        Some(FillMetrics {
            rmse: of(|m| m.rmse),
            normal: of(|m| m.normal),
            spacing_mean: of(|m| m.spacing_mean),
            spacing_variance: of(|m| m.spacing_variance),
            area: of(|m| m.area),
            curvature: of(|m| m.curvature),
            self_intersections: of(|m| m.self_intersections),
            ssim: of(|m| m.ssim),
        })
    }

    /// The measured noise levels, ascending.
    pub fn noises(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self.rows.iter().map(|row| row.noise).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }

    /// The tables as Markdown: all cases, by hole, by noise.
    pub fn markdown(&self) -> String {
        let mut text = String::new();
        self.whole(&mut text);
        self.by_hole(&mut text);
        self.by_noise(&mut text);
        if self.not_patched > 0 {
            let _ = writeln!(text, "\n{} fill(s) could not be patched.", self.not_patched);
        }
        text
    }

    fn whole(&self, text: &mut String) {
        let cases = self.rows.iter().map(|row| row.case + 1).max().unwrap_or(0);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{cases} samples, no noise; spacing of the truth: 1/64 = {:.6}\n\n\
             | fill | | RMSE cells | normals deg | spacing mean | of 1/64 | spacing variance | area | abs. defect rad | from the truth's | cuts | SSIM |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|",
            1.0 / SIDE as f64
        );
        for (stage, fill) in stages() {
            let wanted =
                |row: &EvaluationRow| row.noise == 0.0 && row.stage == stage && row.fill == fill;
            let Some(m) = self.mean(wanted) else { continue };
            let _ = writeln!(
                text,
                "| {} | {} | {:.3} | {:.2} | {:.6} | {:.4} | {:.2e} | {:.4} | {:.4} | {:.4} | {:.2} | {:.3} |",
                fill.name(),
                stage.name(),
                m.rmse,
                m.normal,
                m.spacing_mean,
                m.spacing_mean * SIDE as f64,
                m.spacing_variance,
                m.area,
                m.curvature,
                self.defect_distance(fill, stage),
                m.self_intersections,
                m.ssim
            );
        }
    }

    /// Wasserstein distance of a fill's angle defects from those of the truth as it is, radians: averages look alike where a fill is too smooth here
    /// and too rough there.
    fn defect_distance(&self, method: FillMethod, stage: EvaluationStage) -> f64 {
        let pool = |method, stage| {
            let mut each = self.defects.iter();
            let found = each.find(|pool| pool.method == method && pool.stage == stage);
            found.map_or(&[][..], |pool| &pool.defects)
        };
        let truth = pool(FillMethod::Truth, EvaluationStage::Filled);
        wasserstein(pool(method, stage), truth)
    }

    fn by_hole(&self, text: &mut String) {
        let _ = writeln!(
            text,
            "\nBy hole: RMSE in cells / normals in degrees / cuts, after patch, no noise\n\n\
             | hole | samples | network | membrane | thin plate |\n|---|---|---|---|---|"
        );
        for (shape, _) in SHAPES {
            let name = format!("{shape:?}").to_lowercase();
            self.hole_line(text, &name, &|row| row.shape == shape);
        }
        for size in HoleSize::ALL {
            self.hole_line(text, size.name(), &|row| row.size == size);
        }
    }

    fn hole_line(&self, text: &mut String, name: &str, of: &dyn Fn(&EvaluationRow) -> bool) {
        let wanted = |row: &EvaluationRow, fill: FillMethod| {
            row.noise == 0.0 && row.stage == EvaluationStage::Patched && row.fill == fill && of(row)
        };
        let count = self
            .rows
            .iter()
            .filter(|row| wanted(row, FillMethod::Truth))
            .count();
        if count == 0 {
            return;
        }
        let cell = |fill: FillMethod| {
            self.mean(|row| wanted(row, fill))
                .map_or_else(String::new, |m| {
                    format!(
                        "{:.2} / {:.1} / {:.1}",
                        m.rmse, m.normal, m.self_intersections
                    )
                })
        };
        let cells = [
            FillMethod::Network,
            FillMethod::Membrane,
            FillMethod::ThinPlate,
        ]
        .map(cell);
        let _ = writeln!(text, "| {name} | {count} | {} |", cells.join(" | "));
    }

    fn by_noise(&self, text: &mut String) {
        let noises = self.noises();
        if noises.len() < 2 {
            return;
        }
        let _ = writeln!(
            text,
            "\nBy noise on the known cells (standard deviation in cells): RMSE in cells / normals in degrees\n\n\
             | fill | | {} |\n|---|---|{}",
            noises
                .iter()
                .map(f64::to_string)
                .collect::<Vec<_>>()
                .join(" | "),
            "---|".repeat(noises.len())
        );
        for (stage, fill) in stages() {
            let cells: Vec<String> = (noises.iter())
                .filter_map(|noise| {
                    self.mean(|row| row.noise == *noise && row.fill == fill && row.stage == stage)
                })
                .map(|m| format!("{:.3} / {:.1}", m.rmse, m.normal))
                .collect();
            let _ = writeln!(
                text,
                "| {} | {} | {} |",
                fill.name(),
                stage.name(),
                cells.join(" | ")
            );
        }
    }
}

/// The distance of two distributions of numbers: how far one has to be moved on average to become the other (Wasserstein 1). 0 if one is empty.
fn wasserstein(a: &[f64], b: &[f64]) -> f64 {
    if a.is_empty() || b.is_empty() {
        return 0.0;
    }
    let sorted = |numbers: &[f64]| {
        let mut sorted = numbers.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted
    };
    let (a, b) = (sorted(a), sorted(b));
    let quantile = |of: &[f64], n: usize| of[(n * of.len() + of.len() / 2) / QUANTILES];
    let apart = |n: usize| (quantile(&a, n) - quantile(&b, n)).abs();
    (0..QUANTILES).map(apart).sum::<f64>() / QUANTILES as f64
}

/// All methods at all stages, in the order of the tables.
pub(super) fn stages() -> impl Iterator<Item = (EvaluationStage, FillMethod)> {
    EvaluationStage::ALL
        .into_iter()
        .flat_map(|stage| FillMethod::ALL.map(|fill| (stage, fill)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distributions_are_as_far_apart_as_one_is_moved() {
        let ramp: Vec<f64> = (0..5000).map(f64::from).collect();
        let moved: Vec<f64> = ramp.iter().rev().map(|x| x + 3.0).collect();
        assert_eq!(wasserstein(&ramp, &ramp), 0.0);
        assert!((wasserstein(&ramp, &moved) - 3.0).abs() < 1e-9);
        assert!((wasserstein(&[0.0, 1.0], &[0.0, 0.0, 1.0, 1.0])).abs() < 1e-9);
        assert_eq!(wasserstein(&[], &ramp), 0.0);
    }
}
