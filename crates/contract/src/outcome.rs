//! How a mend went, in one line.

use std::fmt;

use crate::{codes, v1};

/// Whether a loop should have been filled and could not be: its code is that of a refusal. Loops that are left on purpose, by their kind or because the
/// request did not choose them, have words of their own.
fn failed(skipped: &&v1::Skipped) -> bool {
    skipped.code == NON_MANIFOLD || codes::ALL.iter().any(|c| c.word == skipped.code)
}

/// The code of a hole that is not tried since its rim is no closed line.
const NON_MANIFOLD: &str = "non_manifold";

/// How a mend went: `filled=3 skipped=1 doubtful=0`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Holes that were filled.
    pub filled: usize,
    /// Holes that should have been filled and could not be.
    pub skipped: usize,
    /// Filled holes whose patch is no plausible cloth, and which the request accepts all the same.
    pub doubtful: usize,
}

impl Outcome {
    /// The outcome that a report tells of.
    pub fn of(report: &v1::Report) -> Outcome {
        Outcome {
            filled: report.holes.len(),
            skipped: report.skipped.iter().filter(failed).count(),
            doubtful: (report.holes.iter().filter(|h| !h.doubts.is_empty())).count(),
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "filled={} skipped={} doubtful={}",
            self.filled, self.skipped, self.doubtful
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_that_are_left_on_purpose_do_not_count_as_skipped() {
        const ON_PURPOSE: [&str; 10] = [
            "outer_boundary",
            "tube_end",
            "opening",
            "not_selected",
            "excepted",
            "too_large",
            "too_small",
            "same_mesh",
            "second_skin",
            "cut_away",
        ];
        let skipped = |code: &str| v1::Skipped {
            code: code.to_owned(),
            ..Default::default()
        };
        let report = v1::Report {
            holes: vec![v1::HoleReport::default(); 3],
            skipped: (ON_PURPOSE.into_iter().chain(["not_a_disk", NON_MANIFOLD]))
                .map(skipped)
                .collect(),
            ..Default::default()
        };
        let text = Outcome::of(&report).to_string();
        assert_eq!(text, "filled=3 skipped=2 doubtful=0");
    }
}
