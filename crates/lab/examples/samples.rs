//! `darn samples` as a small program, for machines that `scripts/gpu/pack.py` packs for: a few MiB instead of all of `darn`.
//!
//! `samples --sheets FOLDER [--held-out] [--upright] [--count N] [--seed N] [--alike N] [--roughest-of N] > RECORDS`

use darn_lab::scarffolds::samples::SampleRotation;
use darn_lab::train::{SampleStream, StreamedSamples};
use std::error::Error;
use std::str::FromStr;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let said = |name: &str| arguments.iter().any(|a| a == name);
    let stream = SampleStream {
        sheets: value(&arguments, "--sheets", None)?,
        rotation: match said("--upright") {
            true => SampleRotation::Upright,
            false => SampleRotation::Any,
        },
        samples: match said("--held-out") {
            true => StreamedSamples::HeldOut,
            false => StreamedSamples::Random {
                count: value(&arguments, "--count", Some(usize::MAX))?,
                seed: value(&arguments, "--seed", Some(1))?,
                roughest_of: value(&arguments, "--roughest-of", Some(1))?,
                alike: value(&arguments, "--alike", Some(1))?,
            },
        },
    };
    Ok(stream.write(&mut std::io::stdout().lock())?)
}

/// The value after an option, else the default.
fn value<T: FromStr>(arguments: &[String], name: &str, default: Option<T>) -> Result<T, String> {
    let at = arguments.iter().position(|a| a == name);
    let given = at.map(|at| arguments.get(at + 1).map_or("", String::as_str));
    match (given, default) {
        (Some(text), _) => text
            .parse()
            .map_err(|_| format!("{name} {text}: not a value")),
        (None, Some(default)) => Ok(default),
        (None, None) => Err(format!("{name} is missing")),
    }
}
