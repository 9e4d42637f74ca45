//! What a request sends beside its scan: constraints or an anchor query, how they are named, read and checked.

use serde::de::DeserializeOwned;

use super::{
    error::{ParameterKind, RequestError},
    media_types::{JSON, OCTET_STREAM},
};
use darn_contract::port::HolesQuery;
use darn_contract::{Constraints, FieldError, Search, excerpt, from_json, v1};

/// Largest JSON text of constraints or a query, in bytes.
pub const MAX_BYTES: usize = 1 << 20;
/// The media types it is read from. `application/octet-stream` is what curl declares for any file.
pub const MEDIA_TYPES: [&str; 2] = [JSON, OCTET_STREAM];

/// The names of the parts that carry parameters, of every request. No file of a scan has one of them.
pub const PARTS: [&str; 3] = [Constraints::PART, Search::PART, HolesQuery::PART];

/// Constraints or a query, checked.
pub trait Parameters: Sized {
    /// Which of the two.
    const KIND: ParameterKind;
    /// The name of its part in multipart/form-data, and of its field in the first chunk of a gRPC stream.
    const PART: &'static str;
    /// Its message in the contract.
    type Message: DeserializeOwned;

    /// Checks a message.
    ///
    /// # Errors
    /// Every invalid field.
    fn check_message(message: &Self::Message) -> Result<Self, Vec<FieldError>>;

    /// Checks a message.
    ///
    /// # Errors
    /// `Invalid`, naming every invalid field.
    fn from_message(message: &Self::Message) -> Result<Self, RequestError> {
        Self::check_message(message).map_err(Self::invalid)
    }

    /// Reads a JSON text and checks it.
    ///
    /// # Errors
    /// `ParametersTooLarge`, `Malformed` or `Invalid`.
    fn parse(text: &[u8]) -> Result<Self, RequestError> {
        if text.len() > MAX_BYTES {
            return Err(RequestError::ParametersTooLarge {
                kind: Self::KIND,
                limit: MAX_BYTES,
            });
        }
        let message = from_json(text).map_err(|error| RequestError::of_json(Self::KIND, error))?;
        Self::from_message(&message)
    }

    /// The error of these fields.
    fn invalid(fields: Vec<FieldError>) -> RequestError {
        RequestError::Invalid {
            kind: Self::KIND,
            fields,
        }
    }
}

impl Parameters for Constraints {
    const KIND: ParameterKind = ParameterKind::Constraints;
    const PART: &'static str = "constraints";
    type Message = v1::Constraints;

    fn check_message(message: &v1::Constraints) -> Result<Self, Vec<FieldError>> {
        Self::check(message)
    }
}

impl Parameters for Search {
    const KIND: ParameterKind = ParameterKind::Query;
    const PART: &'static str = "query";
    type Message = v1::AnchorQuery;

    fn check_message(message: &v1::AnchorQuery) -> Result<Self, Vec<FieldError>> {
        Self::check(message)
    }
}

/// What is wanted beside a scan's loops; over HTTP it is the URL's query.
impl Parameters for HolesQuery {
    const KIND: ParameterKind = ParameterKind::Query;
    const PART: &'static str = "holes";
    type Message = v1::HolesQuery;

    fn check_message(message: &v1::HolesQuery) -> Result<Self, Vec<FieldError>> {
        Ok(Self {
            suspects: message.suspects,
        })
    }
}

/// Reads the query of `/holes`: `suspects=true`.
///
/// # Errors
/// `Malformed` for a name or a value that is not known.
pub fn holes_query(query: Option<&str>) -> Result<HolesQuery, RequestError> {
    flag(query, "suspects").map(|suspects| HolesQuery { suspects })
}

/// Reads the query of `/sessions/{id}/inpaint`: `draft=true`.
///
/// # Errors
/// `Malformed` for a name or a value that is not known.
pub fn is_draft(query: Option<&str>) -> Result<bool, RequestError> {
    flag(query, "draft")
}

/// Reads the query of a URL that may set one flag, such as `suspects=true`; its name alone counts as true.
fn flag(query: Option<&str>, known: &str) -> Result<bool, RequestError> {
    let pairs = query.unwrap_or_default().split('&');
    let mut is_set = false;
    for pair in pairs.filter(|pair| !pair.is_empty()) {
        is_set = match pair.split_once('=').unwrap_or((pair, "true")) {
            (name, "true") if name == known => true,
            (name, "false") if name == known => false,
            _ => {
                let detail = format!(
                    "`{}` is not known; the URL's query is `{known}=true` or `{known}=false`",
                    excerpt(pair)
                );
                return Err(RequestError::Malformed(detail));
            }
        };
    }
    Ok(is_set)
}

/// Allows only constraints that deform cloth: those of a request to an open session, whose holes and weights are already chosen.
///
/// # Errors
/// `Invalid`, naming the fields that select holes or weights.
pub fn only_edits(constraints: Constraints) -> Result<Constraints, RequestError> {
    let given = [
        ("/holes", !constraints.holes.is_empty()),
        ("/weights", constraints.weights.is_some()),
        ("/up", constraints.up.is_some()),
        ("/fill", constraints.fill.is_some()),
        ("/maxDiameter", constraints.diameters.max.is_some()),
        ("/minDiameter", constraints.diameters.min.is_some()),
        ("/except", !constraints.except.is_empty()),
        ("/acceptDoubtful", constraints.accept_doubtful),
    ];
    let detail = "chosen when the session was opened; open another for another choice";
    refuse_fields(&given, detail).map(|()| constraints)
}

/// Allows only constraints that select holes and weights: those that open a session.
///
/// # Errors
/// `Invalid`, naming the fields that deform cloth.
pub fn only_selection(constraints: Constraints) -> Result<Constraints, RequestError> {
    let given = [
        ("/anchors", !constraints.anchors.is_empty()),
        ("/edits", !constraints.edits.is_empty()),
    ];
    let detail = "not taken when a session is opened; send it to /sessions/{id}/inpaint";
    refuse_fields(&given, detail).map(|()| constraints)
}

/// Refuses the fields, by pointer, that were given.
fn refuse_fields(given: &[(&str, bool)], detail: &str) -> Result<(), RequestError> {
    let unexpected = given.iter().filter(|(_, is_given)| *is_given);
    let fields: Vec<FieldError> = unexpected
        .map(|(pointer, _)| FieldError::new(*pointer, detail))
        .collect();
    if fields.is_empty() {
        return Ok(());
    }
    Err(Constraints::invalid(fields))
}
