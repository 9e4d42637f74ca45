//! The `darn` binary: the command line.

#![forbid(unsafe_code)]

mod allocator;
mod cli;
mod settings;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
