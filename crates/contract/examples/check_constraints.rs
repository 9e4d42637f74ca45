//! Reads constraints as JSON from standard input and prints every error in them, one per line.
//!
//! ```sh
//! echo '{"anchors": [{"uv": [0.5, 2], "position": [0, 0]}]}' | cargo run -p darn-contract --example check_constraints
//! ```

use std::error::Error;
use std::io::{self, Read};

use darn_contract::{Constraints, JsonError, from_json, v1};

fn main() -> Result<(), Box<dyn Error>> {
    let mut text = Vec::new();
    io::stdin().read_to_end(&mut text)?;
    let errors = match from_json::<v1::Constraints>(&text) {
        Ok(message) => Constraints::check(&message).err().unwrap_or_default(),
        Err(JsonError::Shape(error)) => vec![error],
        Err(error @ JsonError::Syntax { .. }) => return Err(error.into()),
    };
    for error in &errors {
        println!("{error}");
    }
    println!("{} errors", errors.len());
    Ok(())
}
