//! Progress of long work: a bar on a terminal, log lines if there is no terminal.

// Only commands of `darn-lab` count their work.
#![cfg_attr(not(feature = "burn"), allow(dead_code))]

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Log lines of a whole piece of counted work.
const LINES: u64 = 20;

/// Progress of one piece of work; threads may share it.
#[derive(Debug)]
pub struct WorkProgress {
    name: &'static str,
    total: u64,
    done: AtomicU64,
    started: Instant,
    /// `None` if standard error is no terminal.
    bar: Option<ProgressBar>,
}

impl WorkProgress {
    /// Work of `total` equal pieces.
    pub fn counted(name: &'static str, total: u64) -> Self {
        let style = ProgressStyle::with_template("{prefix} [{bar:40}] {pos}/{len} {msg} {eta}");
        Self::shown(name, total, style.map(|style| style.progress_chars("=> ")))
    }

    /// Work of a few stages with names.
    pub fn staged(name: &'static str) -> Self {
        Self::shown(
            name,
            0,
            ProgressStyle::with_template("{prefix} {spinner} {msg} {elapsed}"),
        )
    }

    fn shown(
        name: &'static str,
        total: u64,
        style: Result<ProgressStyle, indicatif::style::TemplateError>,
    ) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(total).with_prefix(name);
            if let Ok(style) = style {
                bar.set_style(style);
            }
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        });
        Self {
            name,
            total,
            done: AtomicU64::new(0),
            started: Instant::now(),
            bar,
        }
    }

    /// Shows the stage that begins now.
    pub fn stage(&self, what: &str) {
        match &self.bar {
            Some(bar) => bar.set_message(what.to_owned()),
            None => tracing::info!(seconds = self.seconds(), "{}: {what}", self.name),
        }
    }

    /// Counts `pieces` more as done.
    pub fn advance(&self, pieces: u64) {
        let before = self.done.fetch_add(pieces, Ordering::Relaxed);
        let now = before + pieces;
        match &self.bar {
            Some(bar) => bar.set_position(now),
            None if step(before, self.total) < step(now, self.total) => {
                tracing::info!(
                    seconds = self.seconds(),
                    "{}: {now} of {}",
                    self.name,
                    self.total
                );
            }
            None => {}
        }
    }

    fn seconds(&self) -> u64 {
        self.started.elapsed().as_secs()
    }
}

impl Drop for WorkProgress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// How many log lines belong to `done` of `total` pieces.
fn step(done: u64, total: u64) -> u64 {
    done.saturating_mul(LINES) / total.max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_work_logs_few_lines() {
        let lines = (0..10_000)
            .filter(|&k| step(k, 10_000) < step(k + 1, 10_000))
            .count();
        assert_eq!(lines as u64, LINES);
    }
}
