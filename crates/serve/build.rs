//! Generates the gRPC service of `proto/`, and a client of it for tests, over the messages of `darn-contract`.

use std::{env, error::Error, path::PathBuf};

const FILE: &str = "darn/v1/darn.proto";

fn main() -> Result<(), Box<dyn Error>> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").ok_or("no manifest directory")?)
        .join("../../proto");
    println!("cargo:rerun-if-changed={}", root.join(FILE).display());
    let descriptors = protox::Compiler::new([&root])?
        .include_source_info(true)
        .include_imports(true)
        .open_files([FILE])?
        .file_descriptor_set();
    tonic_prost_build::configure()
        .compile_well_known_types(true)
        .extern_path(".google.protobuf", "::pbjson_types")
        .extern_path(".darn.v1", "::darn_contract::v1")
        .emit_rerun_if_changed(false)
        .compile_fds(descriptors)?;
    Ok(())
}
