//! `darn openapi`: the service's OpenAPI document, the same as at `/openapi.json` and in `proto/openapi.json`.

use super::failure::{Failure, OrFail};
use std::io::Write;

/// Runs `darn openapi`.
pub fn run() -> Result<(), Failure> {
    let mut text = serde_json::to_string_pretty(&darn_serve::openapi::document())
        .or_fail("write the document")?;
    text.push('\n');
    // Not print!, which panics when the reader, for example `head`, closes the pipe.
    std::io::stdout()
        .write_all(text.as_bytes())
        .or_fail("write the document")
}
