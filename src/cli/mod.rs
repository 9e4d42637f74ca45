//! The command line: one file for each command, which reads files, calls the crates and writes files.
//!
//! Exit codes: 0 done, 1 failed, 64 wrong usage or settings. Geometry, HTTP routes and training belong to the crates,
//! not here.

mod batch;
mod bench;
#[cfg(feature = "burn")]
mod calibrate;
mod confidence_paint;
#[cfg(feature = "burn")]
mod evaluate;
mod failure;
mod files;
#[cfg(feature = "burn")]
mod garments;
mod healthcheck;
mod holes;
mod inpaint;
mod key;
mod mend_summary;
#[cfg(feature = "burn")]
mod mended;
mod network;
mod openapi;
mod optimize_anchor;
mod progress;
mod provenance;
mod provenance_date;
#[cfg(test)]
mod provenance_tests;
mod render;
#[cfg(feature = "burn")]
mod samples;
mod scan_paint;
#[cfg(feature = "burn")]
mod scarffolds;
mod serve;
mod strip;
#[cfg(feature = "burn")]
mod texture_table;
#[cfg(feature = "burn")]
mod train;

use crate::settings::ServeCommand;
use clap::{Parser, Subcommand};
use darn_serve::{LogDelivery, LogFormat, LogGuard, start_logging, write_to_stderr};
use failure::Failure;
use std::io::IsTerminal;
use std::process::ExitCode;

/// Wrong usage or settings (`EX_USAGE` of BSD's sysexits).
const USAGE: u8 = 64;

/// Mends holes in scanned fabric.
#[derive(Debug, Parser)]
#[command(name = "darn", version, about, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: CliCommand,
}

#[derive(Debug, Subcommand)]
enum CliCommand {
    /// Serve HTTP: POST a scan to /inpaint, get it back mended
    Serve(Box<ServeCommand>),
    /// Fill the holes of a scan
    Inpaint(inpaint::InpaintArgs),
    /// Take everything out of a scan that darn put in
    Strip(strip::StripArgs),
    /// Search where on a hole's chart a point in space belongs
    OptimizeAnchor(optimize_anchor::OptimizeAnchorArgs),
    /// List the boundary loops of a scan: its holes, its border, the ends of its sleeves
    Holes(holes::HolesArgs),
    /// Draw a shaded picture of a scan; reconstructed cloth is tinted
    Render(render::RenderArgs),
    /// Ask a running service whether it is ready: exit 0 if so, 1 if not
    Healthcheck(healthcheck::HealthcheckArgs),
    /// Simulate sheets of cloth to train on
    #[cfg(feature = "burn")]
    Scarffolds(scarffolds::ScarffoldsArgs),
    /// Drape garments with openings and holes, whose truth is known, over simple bodies
    #[cfg(feature = "burn")]
    Garments(garments::GarmentsArgs),
    /// Write samples to learn from to standard output, for a trainer outside this program
    #[cfg(feature = "burn")]
    Samples(samples::SamplesArgs),
    /// Train a network on simulated sheets
    #[cfg(feature = "burn")]
    Train(train::TrainArgs),
    /// Measure a network's fills on held-out sheets
    #[cfg(feature = "burn")]
    Evaluate(evaluate::EvaluateArgs),
    /// Measure how far a network's answers are off on held-out sheets, and write it into its weights file
    #[cfg(feature = "burn")]
    Calibrate(calibrate::CalibrateArgs),
    /// Measure how long the network and a mend take here
    Bench(bench::BenchArgs),
    /// Make keys for a service
    Key(key::KeyArgs),
    /// Print the service's OpenAPI document
    Openapi,
}

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // clap returns help and version as errors too; those exit with 0.
            let code = if error.use_stderr() { USAGE } else { 0 };
            return match error.print() {
                Ok(()) => ExitCode::from(code),
                Err(_) => ExitCode::FAILURE,
            };
        }
    };
    match run(cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            write_to_stderr(&format!("darn: {failure}"));
            ExitCode::from(failure.code())
        }
    }
}

fn run(command: CliCommand) -> Result<(), Failure> {
    // The service starts logging with its own settings.
    let _log = match command {
        CliCommand::Serve(_) => None,
        _ => Some(start_command_log()?),
    };
    match command {
        CliCommand::Serve(settings) => serve::run(&settings),
        CliCommand::Inpaint(args) => inpaint::run(&args),
        CliCommand::Strip(args) => strip::run(&args),
        CliCommand::OptimizeAnchor(args) => optimize_anchor::run(&args),
        CliCommand::Holes(args) => holes::run(&args),
        CliCommand::Render(args) => render::run(&args),
        CliCommand::Healthcheck(args) => healthcheck::run(&args),
        #[cfg(feature = "burn")]
        CliCommand::Scarffolds(args) => scarffolds::run(&args),
        #[cfg(feature = "burn")]
        CliCommand::Garments(args) => garments::run(&args),
        #[cfg(feature = "burn")]
        CliCommand::Samples(args) => samples::run(&args),
        #[cfg(feature = "burn")]
        CliCommand::Train(args) => train::run(&args),
        #[cfg(feature = "burn")]
        CliCommand::Evaluate(args) => evaluate::run(&args),
        #[cfg(feature = "burn")]
        CliCommand::Calibrate(args) => calibrate::run(&args),
        CliCommand::Bench(args) => bench::run(&args),
        CliCommand::Key(args) => key::run(&args),
        CliCommand::Openapi => openapi::run(),
    }
}

fn start_command_log() -> Result<LogGuard, Failure> {
    start_logging(command_log(), LogFormat::Text, LogDelivery::Patient)
        .map_err(|error| Failure::Usage(error.to_string()))
}

/// The log filter of a command: warnings, and progress if no terminal shows a bar.
fn command_log() -> &'static str {
    if std::io::stderr().is_terminal() {
        "warn"
    } else {
        "warn,darn=info"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }
}
