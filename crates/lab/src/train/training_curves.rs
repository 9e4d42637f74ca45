//! The curves of a run: two CSV files that grow, and an SVG of them that is redrawn with every score.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use super::checkpoint::replace;
use super::error::TrainError;
use super::loss::LossTerms;
use super::options::RunStart;
use super::progress::TrainProgress;
use crate::line_chart::{AxisScale, ChartAxis, ChartLine, ChartSize, INKS, LineChart, svg};

const STEPS: &str = "loss.csv";
const SCORES: &str = "scores.csv";
const PICTURE: &str = "curves.svg";
/// New columns are added at the end: a resumed run may have lines of an older version.
const STEP_COLUMNS: &str = "step,minutes,rate,loss,data,gradient,stretch,norm,self_penetration";
const SCORE_COLUMNS: [&str; 5] = ["rmse", "rmse_median", "normal", "spacing", "area"];
/// Size of one chart.
const SIZE: ChartSize = ChartSize {
    width: 1100,
    height: 420,
};
/// Most points of a curve; lines of the file are averaged down to them.
const POINTS: usize = 400;

/// The open files of a run.
pub(super) struct TrainingCurves {
    steps: File,
    scores: File,
    dir: PathBuf,
}

impl TrainingCurves {
    /// Opens the files in `dir`: new ones, or those of the resumed run.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn open(dir: &Path, start: RunStart) -> Result<TrainingCurves, TrainError> {
        let open = |name: &str, header: &str| {
            let path = dir.join(name);
            let mut options = OpenOptions::new();
            let append = start == RunStart::Resume;
            options
                .create(true)
                .write(true)
                .append(append)
                .truncate(!append);
            let opened = options.open(&path).and_then(|mut file| {
                if file.metadata()?.len() == 0 {
                    writeln!(file, "{header}")?;
                }
                Ok(file)
            });
            opened.map_err(|source| TrainError::File { path, source })
        };
        let scores = SCORE_COLUMNS.join(",");
        let fill = SCORE_COLUMNS.map(|name| format!("fill_{name}")).join(",");
        Ok(TrainingCurves {
            steps: open(STEPS, STEP_COLUMNS)?,
            scores: open(SCORES, &format!("step,minutes,{scores},{fill}"))?,
            dir: dir.to_owned(),
        })
    }

    /// Adds the line of a step.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn step(&mut self, p: &TrainProgress, rate: f64) -> Result<(), TrainError> {
        let LossTerms {
            total,
            data,
            gradient,
            stretch,
            self_penetration,
        } = p.loss;
        let line = writeln!(
            self.steps,
            "{},{:.3},{rate:.3e},{total:.4},{data:.4},{gradient:.4},{stretch:.4},{:.3},{self_penetration:.5}",
            p.step, p.minutes, p.norm
        );
        line.map_err(|source| TrainError::File {
            path: self.dir.join(STEPS),
            source,
        })
    }

    /// Adds the line of a step with scores and redraws all curves.
    ///
    /// # Errors
    /// Files that cannot be read or written.
    pub fn scores(&mut self, p: &TrainProgress) -> Result<(), TrainError> {
        let values = p
            .scores
            .iter()
            .flat_map(|scores| [scores.network, scores.fill])
            .flat_map(|s| [s.rmse, s.rmse_median, s.normal, s.spacing, s.area]);
        let values: Vec<String> = values.map(|v| format!("{v:.4}")).collect();
        let line = writeln!(
            self.scores,
            "{},{:.3},{}",
            p.step,
            p.minutes,
            values.join(",")
        );
        line.map_err(|source| TrainError::File {
            path: self.dir.join(SCORES),
            source,
        })?;
        draw(&self.dir)
    }
}

/// Draws the curves in `dir` into its `curves.svg`.
fn draw(dir: &Path) -> Result<(), TrainError> {
    let read = |name: &str| {
        let path = dir.join(name);
        std::fs::read_to_string(&path).map_err(|source| TrainError::File { path, source })
    };
    let (steps, scores) = (CsvTable::of(&read(STEPS)?), CsvTable::of(&read(SCORES)?));
    let terms = ["loss", "data", "gradient", "stretch", "self_penetration"];
    let chart = |title: &str, label: &str, table: &CsvTable, names: &[&str]| LineChart {
        title: title.into(),
        x: axis("minutes", AxisScale::Linear),
        y: axis(label, AxisScale::Logarithmic),
        lines: names
            .iter()
            .zip(INKS)
            .map(|(name, ink)| table.line(name, ink))
            .collect(),
    };
    let charts = [
        chart("training", "loss", &steps, &terms),
        chart(
            "held-out samples",
            "cells",
            &scores,
            &["rmse", "rmse_median", "fill_rmse"],
        ),
        chart(
            "held-out samples",
            "degrees",
            &scores,
            &["normal", "fill_normal"],
        ),
    ];
    replace(&dir.join(PICTURE), svg(&charts, SIZE).as_bytes())
}

fn axis(label: &str, scale: AxisScale) -> ChartAxis {
    ChartAxis {
        label: label.into(),
        scale,
    }
}

/// A CSV file of numbers, by column. Missing and unreadable numbers are NaN.
struct CsvTable {
    columns: Vec<(String, Vec<f64>)>,
}

impl CsvTable {
    fn of(text: &str) -> CsvTable {
        let mut lines = text.lines();
        let names = lines.next().unwrap_or_default().split(',');
        let mut columns: Vec<(String, Vec<f64>)> =
            names.map(|name| (name.to_owned(), Vec::new())).collect();
        for line in lines {
            let mut fields = line.split(',');
            for (_, column) in &mut columns {
                let number = fields.next().and_then(|field| field.parse().ok());
                column.push(number.unwrap_or(f64::NAN));
            }
        }
        CsvTable { columns }
    }

    fn column(&self, name: &str) -> &[f64] {
        let found = self.columns.iter().find(|(n, _)| n == name);
        found.map_or(&[], |(_, column)| column)
    }

    /// A column over the minutes, averaged to at most [`POINTS`] points.
    fn line(&self, name: &str, ink: [u8; 3]) -> ChartLine {
        let (x, y) = (self.column("minutes"), self.column(name));
        let group = y.len().div_ceil(POINTS).max(1);
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
        let points = x.chunks(group).zip(y.chunks(group));
        ChartLine {
            name: name.into(),
            ink,
            points: points.map(|(x, y)| [mean(x), mean(y)]).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::score::HeldOutScores;

    #[test]
    fn curves_grow_and_are_drawn() {
        let dir = tempfile::tempdir().unwrap();
        let progress = |step: u64| TrainProgress {
            step,
            minutes: step as f64,
            share: 0.0,
            loss: LossTerms {
                total: 1.0 / (step + 1) as f32,
                data: 0.5,
                gradient: 0.25,
                stretch: 0.125,
                self_penetration: 0.0,
            },
            norm: 1.0,
            scores: Some(HeldOutScores::default()),
        };
        for (start, steps) in [(RunStart::Fresh, 0..3), (RunStart::Resume, 3..6)] {
            let mut curves = TrainingCurves::open(dir.path(), start).unwrap();
            for step in steps {
                curves.step(&progress(step), 1e-3).unwrap();
                curves.scores(&progress(step)).unwrap();
            }
        }
        let table = CsvTable::of(&std::fs::read_to_string(dir.path().join(STEPS)).unwrap());
        assert_eq!(table.column("step"), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(table.column("self_penetration"), [0.0; 6]);
        let picture = std::fs::read_to_string(dir.path().join(PICTURE)).unwrap();
        assert!(picture.starts_with("<svg ") && picture.contains("self_penetration"));
    }

    #[test]
    fn lines_of_an_older_run_are_read() {
        let table = CsvTable::of("step,minutes,loss\n1,0.5,2\n2,1.0,3,0.25\n");
        assert_eq!(table.column("loss"), [2.0, 3.0]);
        assert!(table.column("norm").is_empty());
        assert!(table.line("norm", INKS[0]).points.is_empty());
    }
}
