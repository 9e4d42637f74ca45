//! The curves of a run: two CSV files that grow, and a picture of them that is drawn anew with every score.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use image::ImageFormat;

use super::checkpoint::replace;
use super::trainer::Progress;
use super::{Start, TrainError};
use darn_render::chart::{Axis, Chart, INKS, Line, Scale, stacked};

const STEPS: &str = "loss.csv";
const SCORES: &str = "scores.csv";
const PICTURE: &str = "curves.png";
/// New columns go to the end: a run that is resumed may have older lines.
const STEP_COLUMNS: &str = "step,minutes,rate,loss,data,gradient,stretch,norm,self_penetration";
const SCORE_COLUMNS: [&str; 5] = ["rmse", "rmse_median", "normal", "spacing", "area"];
/// Size of one chart in pixels.
const SIZE: [u32; 2] = [1100, 420];
/// Points of a drawn curve; more lines of the file are averaged.
const POINTS: usize = 400;

/// The open files of a run.
pub struct Curves {
    steps: File,
    scores: File,
    dir: PathBuf,
}

impl Curves {
    /// Opens the files in `dir`: new ones, or those of the run that is resumed.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn open(dir: &Path, start: Start) -> Result<Curves, TrainError> {
        let open = |name: &str, header: &str| {
            let path = dir.join(name);
            let mut options = OpenOptions::new();
            let append = start == Start::Resume;
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
        Ok(Curves {
            steps: open(STEPS, STEP_COLUMNS)?,
            scores: open(SCORES, &format!("step,minutes,{scores},{fill}"))?,
            dir: dir.to_owned(),
        })
    }

    /// Adds a step.
    ///
    /// # Errors
    /// A full disk and the like.
    pub fn step(&mut self, p: &Progress, rate: f64) -> Result<(), TrainError> {
        let [total, data, gradient, stretch, self_penetration] = p.loss;
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

    /// Adds the scores of a step and draws all curves.
    ///
    /// # Errors
    /// A full disk and the like.
    pub fn scores(&mut self, p: &Progress) -> Result<(), TrainError> {
        let values = p
            .scores
            .iter()
            .flatten()
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

/// Draws the curves in `dir` into its `curves.png`.
///
/// # Errors
/// Files that cannot be read or written.
pub fn draw(dir: &Path) -> Result<(), TrainError> {
    let read = |name: &str| {
        let path = dir.join(name);
        std::fs::read_to_string(&path).map_err(|source| TrainError::File { path, source })
    };
    let (steps, scores) = (Table::of(&read(STEPS)?), Table::of(&read(SCORES)?));
    let terms = ["loss", "data", "gradient", "stretch", "self_penetration"];
    let chart = |title: &str, label: &str, table: &Table, names: &[&str]| Chart {
        title: title.into(),
        x: axis("minutes", Scale::Linear),
        y: axis(label, Scale::Logarithmic),
        lines: names
            .iter()
            .zip(INKS)
            .map(|(name, ink)| table.line(name, ink))
            .collect(),
    };
    let picture = stacked(&[
        chart("training", "loss", &steps, &terms).drawn(SIZE),
        chart(
            "held-out samples",
            "cells",
            &scores,
            &["rmse", "rmse_median", "fill_rmse"],
        )
        .drawn(SIZE),
        chart(
            "held-out samples",
            "degrees",
            &scores,
            &["normal", "fill_normal"],
        )
        .drawn(SIZE),
    ]);
    let path = dir.join(PICTURE);
    let mut png = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut png, ImageFormat::Png)
        .map_err(|error| TrainError::File {
            path: path.clone(),
            source: std::io::Error::other(error),
        })?;
    replace(&path, &png.into_inner())
}

fn axis(label: &str, scale: Scale) -> Axis {
    Axis {
        label: label.into(),
        scale,
    }
}

/// A CSV file of numbers, column by column. Missing and unreadable numbers are not a number.
struct Table {
    columns: Vec<(String, Vec<f64>)>,
}

impl Table {
    fn of(text: &str) -> Table {
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
        Table { columns }
    }

    fn column(&self, name: &str) -> &[f64] {
        let found = self.columns.iter().find(|(n, _)| n == name);
        found.map_or(&[], |(_, column)| column)
    }

    /// A column over the minutes, averaged to few points.
    fn line(&self, name: &str, ink: [u8; 3]) -> Line {
        let (x, y) = (self.column("minutes"), self.column(name));
        let group = y.len().div_ceil(POINTS).max(1);
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
        let points = x.chunks(group).zip(y.chunks(group));
        Line {
            name: name.into(),
            ink,
            points: points.map(|(x, y)| [mean(x), mean(y)]).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Score;

    #[test]
    fn curves_grow_and_are_drawn() {
        let dir = tempfile::tempdir().unwrap();
        let progress = |step: u64| Progress {
            step,
            minutes: step as f64,
            share: 0.0,
            loss: [1.0 / (step + 1) as f32, 0.5, 0.25, 0.125, 0.0],
            norm: 1.0,
            scores: Some([Score::default(); 2]),
        };
        for (start, steps) in [(Start::Fresh, 0..3), (Start::Resume, 3..6)] {
            let mut curves = Curves::open(dir.path(), start).unwrap();
            for step in steps {
                curves.step(&progress(step), 1e-3).unwrap();
                curves.scores(&progress(step)).unwrap();
            }
        }
        let table = Table::of(&std::fs::read_to_string(dir.path().join(STEPS)).unwrap());
        assert_eq!(table.column("step"), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(table.column("self_penetration"), [0.0; 6]);
        let png = std::fs::read(dir.path().join(PICTURE)).unwrap();
        assert_eq!(&png[1..4], b"PNG");
    }

    #[test]
    fn lines_of_an_older_run_are_read() {
        let table = Table::of("step,minutes,loss\n1,0.5,2\n2,1.0,3,0.25\n");
        assert_eq!(table.column("loss"), [2.0, 3.0]);
        assert!(table.column("norm").is_empty());
        assert!(table.line("norm", INKS[0]).points.is_empty());
    }
}
