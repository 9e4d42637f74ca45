//! Generates the gRPC service of `proto/`, and a client of it for tests, over the messages of `darn-contract`; and the table of the
//! editor's files, each plain and compressed.

use std::{
    env,
    error::Error,
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

use flate2::{Compression, GzBuilder};
use sha2::{Digest as _, Sha256};

const FILE: &str = "darn/v1/darn.proto";

fn main() -> Result<(), Box<dyn Error>> {
    let workspace =
        PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").ok_or("no manifest directory")?)
            .join("../..");
    grpc(&workspace.join("proto"))?;
    editor(&workspace)
}

fn grpc(root: &Path) -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed={}", root.join(FILE).display());
    let descriptors = protox::Compiler::new([root])?
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

/// Writes `editor_files.rs`: the files of `web/dist`, and the example scan.
fn editor(workspace: &Path) -> Result<(), Box<dyn Error>> {
    let dist = workspace.join("web/dist");
    println!("cargo:rerun-if-changed={}", dist.display());
    let mut files = vec![
        ("/".to_owned(), dist.join("index.html")),
        (
            "/editor/scarf_hole.glb".to_owned(),
            workspace.join("examples/scarf_hole.glb"),
        ),
    ];
    for entry in fs::read_dir(dist.join("editor"))? {
        let entry = entry?;
        let name = entry
            .file_name()
            .into_string()
            .map_err(|_| "a file name is not UTF-8")?;
        files.push((format!("/editor/{name}"), entry.path()));
    }
    files.sort();
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("no output directory")?);
    let mut table = "static FILES: &[EditorFile] = &[\n".to_owned();
    for (index, (path, file)) in files.iter().enumerate() {
        println!("cargo:rerun-if-changed={}", file.display());
        let plain = fs::read(file)?;
        let digest = Sha256::digest(&plain);
        let hash: String = digest[..8]
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        // Without a file name and a time of change, so that equal files give equal bytes.
        let mut encoder = GzBuilder::new().write(Vec::new(), Compression::best());
        encoder.write_all(&plain)?;
        let gzip = out.join(format!("editor_{index}.gz"));
        fs::write(&gzip, encoder.finish()?)?;
        let (media_type, file) = (media_type(path)?, file.canonicalize()?);
        table += &format!(
            "EditorFile {{ path: {path:?}, media_type: {media_type:?}, hash: {hash:?}, \
                plain: include_bytes!({file:?}), gzip: include_bytes!({gzip:?}) }},\n"
        );
    }
    table += "];\n";
    fs::write(out.join("editor_files.rs"), table)?;
    Ok(())
}

/// The media type of an editor's file by the ending of its path.
fn media_type(path: &str) -> Result<&'static str, String> {
    match path.rsplit_once('.').map_or("", |(_, ending)| ending) {
        "" => Ok("text/html; charset=utf-8"),
        "js" => Ok("text/javascript; charset=utf-8"),
        "css" => Ok("text/css; charset=utf-8"),
        "svg" => Ok("image/svg+xml"),
        "wasm" => Ok("application/wasm"),
        "glb" => Ok("model/gltf-binary"),
        _ => Err(format!(
            "web/dist has a file of no known media type: {path}"
        )),
    }
}
