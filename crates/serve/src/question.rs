//! What a request asks beside its scan, constraints or an anchor query: the name of its part, its check, its faults.

use serde::de::DeserializeOwned;

use super::problem::{Asking, Fault};
use darn_contract::{Constraints, FieldError, Search, from_json, v1};

/// Largest text of a question, in bytes.
pub const LIMIT: usize = 1 << 20;
/// What it is sent as, for a person. `application/octet-stream` is read, too: it is what curl says of a file, and says nothing.
pub const MEDIA: &str = "application/json";
/// The same, for us.
pub const MEDIA_READ: [&str; 2] = ["application/json", "application/octet-stream"];

/// Something a request asks.
pub trait Question: Sized {
    /// Which question it is.
    const ASKING: Asking;
    /// The name of its part in multipart/form-data.
    const PART: &'static str;
    /// As the contract has it.
    type Message: DeserializeOwned;

    /// Checks a message; every field at fault.
    ///
    /// # Errors
    /// Those.
    fn examine(message: &Self::Message) -> Result<Self, Vec<FieldError>>;

    /// Checks a message.
    ///
    /// # Errors
    /// `Invalid`, naming every field at fault.
    fn of(message: &Self::Message) -> Result<Self, Fault> {
        Self::examine(message).map_err(|fields| Self::invalid(fields))
    }

    /// Reads a text and checks it.
    ///
    /// # Errors
    /// `AskedTooLarge`, `Malformed` or `Invalid`.
    fn parse(text: &[u8]) -> Result<Self, Fault> {
        if text.len() > LIMIT {
            return Err(Fault::AskedTooLarge {
                what: Self::ASKING,
                limit: LIMIT,
            });
        }
        let message = from_json(text).map_err(|error| Fault::unread(Self::ASKING, error))?;
        Self::of(&message)
    }

    /// The fault of these fields.
    fn invalid(fields: Vec<FieldError>) -> Fault {
        Fault::Invalid {
            what: Self::ASKING,
            fields,
        }
    }
}

impl Question for Constraints {
    const ASKING: Asking = Asking::Constraints;
    const PART: &'static str = "constraints";
    type Message = v1::Constraints;

    fn examine(message: &v1::Constraints) -> Result<Self, Vec<FieldError>> {
        Self::check(message)
    }
}

impl Question for Search {
    const ASKING: Asking = Asking::Query;
    const PART: &'static str = "query";
    type Message = v1::AnchorQuery;

    fn examine(message: &v1::AnchorQuery) -> Result<Self, Vec<FieldError>> {
        Self::check(message)
    }
}

/// Constraints of one moment of a session: they move cloth. What was chosen when it was opened stays.
///
/// # Errors
/// `Invalid`, naming what chooses holes or weights.
pub fn moving(asked: Constraints) -> Result<Constraints, Fault> {
    let unwanted = [
        ("/holes", !asked.holes.is_empty()),
        ("/weights", asked.weights.is_some()),
        ("/up", asked.up.is_some()),
    ];
    let detail = "chosen when the session was opened; open another for another choice";
    without(&unwanted, detail).map(|()| asked)
}

/// Constraints that open a session: they choose holes and weights. What moves cloth comes later.
///
/// # Errors
/// `Invalid`, naming what moves cloth.
pub fn choosing(asked: Constraints) -> Result<Constraints, Fault> {
    let unwanted = [
        ("/anchors", !asked.anchors.is_empty()),
        ("/edits", !asked.edits.is_empty()),
    ];
    let detail = "not taken when a session is opened; send it to /sessions/{id}/inpaint";
    without(&unwanted, detail).map(|()| asked)
}

/// Refuses what came and is unwanted, by pointer.
fn without(unwanted: &[(&str, bool)], detail: &str) -> Result<(), Fault> {
    let came = unwanted.iter().filter(|(_, came)| *came);
    let fields: Vec<FieldError> = came.map(|(at, _)| FieldError::new(*at, detail)).collect();
    if fields.is_empty() {
        Ok(())
    } else {
        Err(Constraints::invalid(fields))
    }
}
