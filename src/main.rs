//! The `darn` binary: one command line over the library.

#![forbid(unsafe_code)]

mod cli;
mod settings;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
