//! The `darn` binary: the command line.

#![forbid(unsafe_code)]

mod cli;
mod settings;

use std::process::ExitCode;

use mimalloc::MiMalloc;

#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

fn main() -> ExitCode {
    cli::main()
}
