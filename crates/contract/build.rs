//! Generates the contract's types from `proto/`, without an installed `protoc`.
//!
//! protox parses the files; prost writes the messages, pbjson their canonical proto3 JSON. The gRPC service is generated in `darn-serve`.
//! The descriptor itself is kept beside them: the OpenAPI document takes its schemas from it, so that they cannot drift.

use std::{env, error::Error, fs, path::PathBuf};

use prost::Message as _;

const FILES: [&str; 1] = ["darn/v1/darn.proto"];

fn main() -> Result<(), Box<dyn Error>> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").ok_or("no manifest directory")?)
        .join("../../proto");
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    for file in FILES {
        println!("cargo:rerun-if-changed={}", root.join(file).display());
    }

    let descriptors = protox::Compiler::new([&root])?
        .include_source_info(true)
        .include_imports(true)
        .open_files(FILES)?
        .file_descriptor_set();
    let bytes = descriptors.encode_to_vec();
    fs::write(out.join("darn.descriptors.bin"), &bytes)?;

    prost_build::Config::new()
        .compile_well_known_types()
        .extern_path(".google.protobuf", "::pbjson_types")
        .bytes([".darn.v1"])
        .compile_fds(descriptors)?;

    pbjson_build::Builder::new()
        .register_descriptors(&bytes)?
        .extern_path(".google.protobuf", "::pbjson_types")
        .emit_fields()
        .build(&[".darn.v1"])?;
    Ok(())
}
