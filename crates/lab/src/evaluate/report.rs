//! Measures of many cases put together, and their tables.

use std::fmt::Write as _;

use serde::Serialize;

use super::cases::Size;
use super::measure::Measures;
use crate::scarffolds::masks::{SHAPES, Shape};
use darn_geometry::grid::SIDE;

/// Who filled the hole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fill {
    /// The truth itself: what the measures say of real cloth.
    Truth,
    /// The network.
    Network,
    /// [`darn_geometry::smooth::Smooth::Membrane`].
    Membrane,
    /// [`darn_geometry::smooth::Smooth::ThinPlate`].
    ThinPlate,
}

impl Fill {
    /// All of them, in the order of the tables.
    pub const ALL: [Fill; 4] = [Fill::Truth, Fill::Network, Fill::Membrane, Fill::ThinPlate];

    /// For tables and legends.
    pub fn name(self) -> &'static str {
        match self {
            Fill::Truth => "truth",
            Fill::Network => "network",
            Fill::Membrane => "membrane",
            Fill::ThinPlate => "thin plate",
        }
    }
}

/// Before or after the patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// The fill as it came.
    Filled,
    /// Meshed on the rim and with its lengths restored.
    Patched,
}

impl Stage {
    /// Both.
    pub const ALL: [Stage; 2] = [Stage::Filled, Stage::Patched];

    /// For tables.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Filled => "as filled",
            Stage::Patched => "after patch",
        }
    }
}

/// One fill of one case at one level of noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Row {
    /// Number of the case.
    pub case: usize,
    /// Shape of its hole.
    pub shape: Shape,
    /// Size of its hole.
    pub size: Size,
    /// Standard deviation of the noise on known cells, in cells.
    pub noise: f64,
    /// Who filled it.
    pub fill: Fill,
    /// When it was measured.
    pub stage: Stage,
    /// The numbers.
    #[serde(flatten)]
    pub measures: Measures,
}

/// Everything that was measured.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Report {
    /// All measurements.
    pub rows: Vec<Row>,
    /// Fills that could not be patched.
    pub not_patched: usize,
    /// Angle defects of hole cells without noise, for each fill at each stage; not part of the JSON.
    #[serde(skip)]
    pub defects: Vec<(Fill, Stage, Vec<f64>)>,
}

impl Report {
    /// Mean of the rows that are wanted; `None` when there are none.
    pub fn mean(&self, wanted: impl Fn(&Row) -> bool) -> Option<Measures> {
        let found: Vec<&Measures> = (self.rows.iter())
            .filter(|row| wanted(row))
            .map(|row| &row.measures)
            .collect();
        if found.is_empty() {
            return None;
        }
        let of = |part: fn(&Measures) -> f64| {
            found.iter().map(|m| part(m)).sum::<f64>() / found.len() as f64
        };
        Some(Measures {
            rmse: of(|m| m.rmse),
            normal: of(|m| m.normal),
            spacing_mean: of(|m| m.spacing_mean),
            spacing_variance: of(|m| m.spacing_variance),
            area: of(|m| m.area),
            curvature: of(|m| m.curvature),
            self_intersections: of(|m| m.self_intersections),
        })
    }

    /// Levels of noise that were measured, ascending.
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
             | fill | | RMSE cells | normals deg | spacing mean | of 1/64 | spacing variance | area | abs. defect rad | cuts |\n\
             |---|---|---|---|---|---|---|---|---|---|",
            1.0 / SIDE as f64
        );
        for (stage, fill) in stages() {
            let wanted = |row: &Row| row.noise == 0.0 && row.stage == stage && row.fill == fill;
            let Some(m) = self.mean(wanted) else { continue };
            let _ = writeln!(
                text,
                "| {} | {} | {:.3} | {:.2} | {:.6} | {:.4} | {:.2e} | {:.4} | {:.4} | {:.2} |",
                fill.name(),
                stage.name(),
                m.rmse,
                m.normal,
                m.spacing_mean,
                m.spacing_mean * SIDE as f64,
                m.spacing_variance,
                m.area,
                m.curvature,
                m.self_intersections
            );
        }
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
        for size in Size::ALL {
            self.hole_line(text, size.name(), &|row| row.size == size);
        }
    }

    fn hole_line(&self, text: &mut String, name: &str, of: &dyn Fn(&Row) -> bool) {
        let wanted = |row: &Row, fill: Fill| {
            row.noise == 0.0 && row.stage == Stage::Patched && row.fill == fill && of(row)
        };
        let count = self
            .rows
            .iter()
            .filter(|row| wanted(row, Fill::Truth))
            .count();
        if count == 0 {
            return;
        }
        let cell = |fill: Fill| {
            self.mean(|row| wanted(row, fill))
                .map_or_else(String::new, |m| {
                    format!(
                        "{:.2} / {:.1} / {:.1}",
                        m.rmse, m.normal, m.self_intersections
                    )
                })
        };
        let cells = [Fill::Network, Fill::Membrane, Fill::ThinPlate].map(cell);
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

/// All fills at all stages, in the order of the tables.
pub(super) fn stages() -> impl Iterator<Item = (Stage, Fill)> {
    Stage::ALL
        .into_iter()
        .flat_map(|stage| Fill::ALL.map(|fill| (stage, fill)))
}
