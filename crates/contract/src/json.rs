//! Reads a message from its canonical proto3 JSON and reports the JSON pointer of an error.
//!
//! The generated deserializers say what they did not expect, but not where; and serde_json's `arbitrary_precision`, which reading glTF
//! needs, breaks the way they buffer numbers. So the text is first parsed to a value; a deserializer written here then walks
//! the value, hands out plain numbers and records the path to an error.

use std::fmt;
use std::sync::LazyLock;

use darn_json::excerpt;
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, Error as _, Expected, IntoDeserializer,
    MapAccess, SeqAccess, Unexpected, Visitor,
    value::{Error as SerdeError, StrDeserializer},
};
use serde_json::{Map, Value, json};

use super::FieldError;

/// Why a text was not read as a message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JsonError {
    /// The text is not JSON.
    #[error("not JSON: {detail}")]
    Syntax {
        /// What is wrong, with line and column.
        detail: String,
    },
    /// The text is JSON, but not of this message.
    #[error("{0}")]
    Shape(FieldError),
}

/// Reads a message; unknown fields are errors.
///
/// # Errors
/// [`JsonError::Syntax`] when the text is not JSON, [`JsonError::Shape`] with a pointer when it is not such a message.
pub fn from_json<T: DeserializeOwned>(text: &[u8]) -> Result<T, JsonError> {
    let value = darn_json::value(text).map_err(|error| JsonError::Syntax {
        detail: excerpt(&error.to_string()).into_owned(),
    })?;
    T::deserialize(ValueReader::element(&value))
        .map_err(|error| JsonError::Shape(error.into_field_error()))
}

/// An error and the path to it, innermost step first.
#[derive(Debug)]
struct PathError {
    detail: String,
    steps: Vec<String>,
}

impl PathError {
    fn under(mut self, step: impl Into<String>) -> Self {
        self.steps.push(step.into());
        self
    }

    fn into_field_error(self) -> FieldError {
        let pointer = self.steps.iter().rev().fold(String::new(), |path, step| {
            path + "/" + &step.replace('~', "~0").replace('/', "~1")
        });
        FieldError::new(pointer, self.detail)
    }
}

impl fmt::Display for PathError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.detail)
    }
}

impl std::error::Error for PathError {}

impl serde::de::Error for PathError {
    fn custom<T: fmt::Display>(detail: T) -> Self {
        let mut detail = detail.to_string();
        // The generated code reads every number through an untagged enum, whose message from serde does not help a caller.
        if detail.starts_with("data did not match any variant") {
            detail = "expected a number of this field's range".to_owned();
        }
        Self {
            detail,
            steps: Vec::new(),
        }
    }

    // What serde says, with the caller's text cut.

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        Self::custom(SerdeError::unknown_field(&excerpt(field), expected))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        Self::custom(SerdeError::unknown_variant(&excerpt(variant), expected))
    }

    fn invalid_value(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::custom(match unexpected {
            Unexpected::Str(text) => {
                SerdeError::invalid_value(Unexpected::Str(&excerpt(text)), expected)
            }
            other => SerdeError::invalid_value(other, expected),
        })
    }

    /// Names JSON types, where serde names Rust types.
    fn invalid_type(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let got = match unexpected {
            Unexpected::Unit | Unexpected::Option => "null".to_owned(),
            Unexpected::Bool(flag) => flag.to_string(),
            Unexpected::Unsigned(number) => format!("the number {number}"),
            Unexpected::Signed(number) => format!("the number {number}"),
            Unexpected::Float(number) => format!("the number {number}"),
            Unexpected::Str(_) => "a string".to_owned(),
            Unexpected::Seq => "an array".to_owned(),
            Unexpected::Map => "an object".to_owned(),
            other => other.to_string(),
        };
        let expected = expected.to_string();
        let expected = match expected.as_str() {
            "a sequence" => "an array",
            text if text.starts_with("struct ") => "an object",
            text => text,
        };
        Self::custom(format!("expected {expected}; got {got}"))
    }
}

/// Deserializes one JSON value by its own type.
struct ValueReader<'v> {
    value: &'v Value,
    /// How null is read here.
    null: NullReading,
}

/// What `"border": "auto"` stands for.
static AUTO: LazyLock<Value> = LazyLock::new(|| json!({ "auto": true }));

/// How null is read: in proto3 JSON a field that is null counts as absent; anywhere else null is a value.
#[derive(Clone, Copy, PartialEq, Eq)]
enum NullReading {
    Value,
    Absent,
}

impl<'v> ValueReader<'v> {
    fn element(value: &'v Value) -> Self {
        let null = NullReading::Value;
        Self { value, null }
    }

    fn field(value: &'v Value) -> Self {
        let null = NullReading::Absent;
        Self { value, null }
    }

    fn is_absent(&self) -> bool {
        self.value.is_null() && self.null == NullReading::Absent
    }
}

/// The integer that a real number equals: proto3 JSON allows an integer to be written `1.0`. Beyond 2^53 a real number no longer
/// identifies one integer.
fn whole(real: f64) -> Option<i64> {
    let exact = real.fract() == 0.0 && real.abs() <= 9_007_199_254_740_992.0;
    // Minus zero is not an integer.
    (exact && !(real == 0.0 && real.is_sign_negative())).then_some(real as i64)
}

impl<'de> Deserializer<'de> for ValueReader<'_> {
    type Error = PathError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, PathError> {
        match self.value {
            Value::Null => visitor.visit_unit(),
            Value::Bool(flag) => visitor.visit_bool(*flag),
            Value::String(text) => visitor.visit_str(text),
            Value::Number(number) => {
                if let Some(natural) = number.as_u64() {
                    visitor.visit_u64(natural)
                } else if let Some(integer) = number.as_i64() {
                    visitor.visit_i64(integer)
                } else if let Some(real) = number.as_f64() {
                    match whole(real) {
                        Some(integer) => match u64::try_from(integer) {
                            Ok(natural) => visitor.visit_u64(natural),
                            Err(_) => visitor.visit_i64(integer),
                        },
                        None => visitor.visit_f64(real),
                    }
                } else {
                    Err(PathError::custom("the number is out of range"))
                }
            }
            Value::Array(items) => visitor.visit_seq(ArrayReader {
                rest: items.iter(),
                index: 0,
            }),
            Value::Object(fields) => visitor.visit_map(ObjectReader {
                rest: fields.iter(),
                pending: None,
            }),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, PathError> {
        match self.value {
            Value::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, PathError> {
        if self.is_absent() {
            return visitor.visit_seq(ArrayReader {
                rest: [].iter(),
                index: 0,
            });
        }
        self.deserialize_any(visitor)
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, PathError> {
        if self.is_absent() {
            return visitor.visit_bool(false);
        }
        self.deserialize_any(visitor)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, PathError> {
        match (name, self.value, &*AUTO) {
            ("darn.v1.Border", Value::String(text), Value::Object(auto)) if text == "auto" => {
                visitor.visit_map(ObjectReader {
                    rest: auto.iter(),
                    pending: None,
                })
            }
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, PathError> {
        visitor.visit_newtype_struct(self)
    }

    serde::forward_to_deserialize_any! {
        i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct
        tuple tuple_struct map enum identifier ignored_any
    }
}

struct ArrayReader<'v> {
    rest: std::slice::Iter<'v, Value>,
    index: usize,
}

impl<'de> SeqAccess<'de> for ArrayReader<'_> {
    type Error = PathError;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, PathError> {
        let Some(value) = self.rest.next() else {
            return Ok(None);
        };
        let index = self.index;
        self.index += 1;
        seed.deserialize(ValueReader::element(value))
            .map(Some)
            .map_err(|error| error.under(index.to_string()))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.rest.len())
    }
}

struct ObjectReader<'v> {
    rest: <&'v Map<String, Value> as IntoIterator>::IntoIter,
    pending: Option<(&'v str, &'v Value)>,
}

impl<'de> MapAccess<'de> for ObjectReader<'_> {
    type Error = PathError;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, PathError> {
        let Some((key, value)) = self.rest.next() else {
            return Ok(None);
        };
        self.pending = Some((key, value));
        let name: StrDeserializer<'_, PathError> = key.as_str().into_deserializer();
        seed.deserialize(name)
            .map(Some)
            .map_err(|error| error.under(key))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, PathError> {
        let (key, value) = self
            .pending
            .take()
            .ok_or_else(|| PathError::custom("a value without its name"))?;
        seed.deserialize(ValueReader::field(value))
            .map_err(|error| error.under(key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1;
    use darn_json::EXCERPT_BYTES;

    fn shape_error(text: &str) -> (String, String) {
        match from_json::<v1::Constraints>(text.as_bytes()) {
            Err(JsonError::Shape(FieldError { pointer, detail })) => (pointer, detail),
            other => panic!("{text} gave {other:?}"),
        }
    }

    #[test]
    fn constraints_of_every_kind_are_read_and_written() {
        let text = r#"{
            "holes":   [{"id": 2}, {"near": [0.1, 1.2, 0]}, {"cut": {"center": [0.4, 1.0, 0.1], "radius": 5e-2}}],
            "anchors": [{"hole": 2, "uv": [0.48, 0.52], "position": [0.11, 1.18, 0.02]},
                        {"hole": 2, "position": [0.11, 1.18, 0.02], "hard": true}],
            "edits":   [{"hole": 2, "grab":  {"uv": [0.5, 0.5], "offset": [0, 0.05, 0]}},
                        {"hole": 2, "twist": {"uv": [0.5, 0.5], "radius": 0.125, "axis": [0, 1, 0], "angle": 0.7}},
                        {"hole": 2, "pinch": {"uvs": [[0.44, 0.23], [0.44, 0.68]], "amount": 0.6}}],
            "weights": "standard",
            "up": [0, 1, 0]
        }"#;
        let read: v1::Constraints = from_json(text.as_bytes()).unwrap();
        assert_eq!(read.holes[1].near, [0.1, 1.2, 0.0]);
        assert_eq!(read.anchors[0].position, [0.11, 1.18, 0.02]);
        assert!(read.anchors[1].hard);
        let Some(v1::edit::Gesture::Pinch(pinch)) = &read.edits[2].gesture else {
            panic!("{read:?}");
        };
        assert_eq!(pinch.uvs.len(), 2);
        assert_eq!(pinch.uvs[0].values.len(), 2);

        let written = serde_json::to_vec(&read).unwrap();
        assert_eq!(from_json::<v1::Constraints>(&written).unwrap(), read);
    }

    #[test]
    fn an_error_has_the_pointer_of_its_place() {
        assert_eq!(shape_error(r#"{"hole": []}"#).0, "/hole");
        assert_eq!(
            shape_error(r#"{"holes": [{"id": 1}, {"i~/d": 2}]}"#).0,
            "/holes/1/i~0~1d"
        );
        assert_eq!(shape_error(r#"{"holes": [{"id": -1}]}"#).0, "/holes/0/id");
        assert_eq!(
            shape_error(r#"{"anchors": [{"uv": [0.5, {}]}]}"#),
            (
                "/anchors/0/uv/1".into(),
                "expected a number of this field's range".into()
            )
        );
        assert_eq!(
            shape_error(r#"{"anchors": [{"uv": [0.5, 1e999]}]}"#).0,
            "/anchors/0/uv/1"
        );
        assert_eq!(shape_error("[1]").0, "");
        assert!(shape_error(r#"{"hole": []}"#).1.contains("unknown field"));
    }

    #[test]
    fn a_null_field_is_absent_and_integers_may_have_a_decimal_point() {
        let text = r#"{"holes": null, "anchors": [{"hole": 2.0, "uv": null, "position": [1.0, -2.0, 5e-1], "hard": null}],
            "edits": null, "weights": null, "up": null}"#;
        let read: v1::Constraints = from_json(text.as_bytes()).unwrap();
        let anchor = v1::Anchor {
            hole: Some(2),
            position: vec![1.0, -2.0, 0.5],
            ..Default::default()
        };
        let expected = v1::Constraints {
            anchors: vec![anchor],
            ..Default::default()
        };
        assert_eq!(read, expected);
        let edit =
            r#"{"edits": [{"grab": null, "hole": null}], "holes": [{"cut": null, "id": 1e1}]}"#;
        let read: v1::Constraints = from_json(edit.as_bytes()).unwrap();
        assert_eq!((read.edits[0].hole, read.holes[0].id), (None, Some(10)));

        for (text, at) in [
            (r#"{"hole": null}"#, "/hole"),
            (r#"{"holes": [null]}"#, "/holes/0"),
            (r#"{"holes": [{"id": 1.5}]}"#, "/holes/0/id"),
            (r#"{"holes": [{"id": -1.0}]}"#, "/holes/0/id"),
        ] {
            assert_eq!(shape_error(text).0, at, "{text}");
        }
        assert_eq!(
            shape_error("null"),
            (String::new(), "expected an object; got null".into())
        );
        assert_eq!(
            shape_error(r#"{"holes": 7}"#).1,
            "expected an array; got the number 7"
        );
    }

    #[test]
    fn an_error_repeats_only_the_beginning_of_a_long_text() {
        let long = "ä~/".repeat(1 << 17);
        let nested = format!(r#"{{"{long}": "#).repeat(100) + "[0" + &"}".repeat(100);
        for text in [
            format!(r#"{{"{long}": 0}}"#),
            format!(r#"{{"holes": [{{"{long}": 0}}]}}"#),
            format!(r#"{{"holes": "{long}"}}"#),
            format!(r#"{{"holes": [{{"id": "{long}"}}]}}"#),
            format!(r#"{{"anchors": [{{"uv": ["{long}"]}}]}}"#),
            format!(r#"{{"anchors": [{{"hard": "{long}"}}]}}"#),
            format!(r#"{{"edits": [{{"pinch": {{"uvs": [[{{"{long}": 1e999}}]]}}}}]}}"#),
            format!(r#"{{"{long}"#),
            format!("[{long}"),
            nested,
        ] {
            let (pointer, detail) = match from_json::<v1::Constraints>(text.as_bytes()) {
                Err(JsonError::Shape(FieldError { pointer, detail })) => (pointer, detail),
                Err(JsonError::Syntax { detail }) => (String::new(), detail),
                Ok(read) => panic!("{read:?}"),
            };
            assert!(pointer.len() <= EXCERPT_BYTES, "{pointer}");
            assert!(detail.len() <= EXCERPT_BYTES + 300, "{detail}");
        }
        let (pointer, detail) = shape_error(&format!(r#"{{"{long}": 0}}"#));
        assert!(pointer.starts_with("/ä~0~1ä") && pointer.ends_with('…'));
        assert!(detail.contains("…`, expected one of `holes`"), "{detail}");
    }

    #[test]
    fn a_text_that_is_not_json_is_a_syntax_error() {
        for text in ["", "{", "{\"holes\": [}", "{} {}", "\u{0}"] {
            assert!(matches!(
                from_json::<v1::Constraints>(text.as_bytes()),
                Err(JsonError::Syntax { .. })
            ));
        }
    }
}
