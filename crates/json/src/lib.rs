//! Parses JSON text to a [`Value`] in which every key is an ordinary key, and cuts callers' texts to what errors repeat ([`excerpt`]).
//!
//! `gltf` turns on serde_json's feature `raw_value`. With it, serde_json's own parser treats an object that begins with a private key as a
//! string of JSON to be parsed again, with a fresh recursion limit: nested strings of that kind overflow the stack, and escape any count
//! of what the text contains. This parser reads that key as text.

mod excerpt;

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

pub use excerpt::{EXCERPT_BYTES, cut, excerpt};

/// The private key under which serde_json's feature `arbitrary_precision` hands out a number that is not a machine integer, as its text.
/// An object that a caller wrote with this key is read as that number, which is harmless.
const NUMBER_KEY: &str = "$serde_json::private::Number";

/// Parses a text. Arrays and objects may be nested 127 deep, the limit of serde_json.
///
/// # Errors
/// The text is not JSON, or is nested deeper.
///
/// # Examples
/// ```
/// let value = darn_json::value(br#"{"holes": [{"id": 2}]}"#)?;
/// assert_eq!(value["holes"][0]["id"], 2);
///
/// let raw = darn_json::value(br#"{"$serde_json::private::RawValue": "[0]"}"#)?;
/// assert!(raw.is_object(), "the text of the private key is not parsed");
/// # Ok::<(), serde_json::Error>(())
/// ```
pub fn value(text: &[u8]) -> Result<Value, serde_json::Error> {
    serde_json::from_slice(text).map(|PlainValue(value)| value)
}

/// A value read by [`ValueVisitor`], at any depth.
struct PlainValue(Value);

impl<'de> Deserialize<'de> for PlainValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ValueVisitor).map(PlainValue)
    }
}

struct ValueVisitor;

impl<'de> Visitor<'de> for ValueVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, flag: bool) -> Result<Value, E> {
        Ok(Value::Bool(flag))
    }

    fn visit_u64<E>(self, natural: u64) -> Result<Value, E> {
        Ok(Value::Number(natural.into()))
    }

    fn visit_i64<E>(self, integer: i64) -> Result<Value, E> {
        Ok(Value::Number(integer.into()))
    }

    fn visit_str<E>(self, text: &str) -> Result<Value, E> {
        Ok(Value::String(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut array = Vec::new();
        while let Some(PlainValue(item)) = items.next_element()? {
            array.push(item);
        }
        Ok(Value::Array(array))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = members.next_key::<String>()? {
            if object.is_empty() && key == NUMBER_KEY {
                let number_text: String = members.next_value()?;
                let number: Number = number_text.parse().map_err(A::Error::custom)?;
                return Ok(Value::Number(number));
            }
            let PlainValue(value) = members.next_value()?;
            object.insert(key, value);
        }
        Ok(Value::Object(object))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RAW_VALUE_KEY: &str = "$serde_json::private::RawValue";

    #[test]
    fn the_raw_value_key_is_an_ordinary_key() {
        let text = format!(r#"{{"{RAW_VALUE_KEY}": "[0, 0]"}}"#);
        let read = value(text.as_bytes()).unwrap();
        assert_eq!(read[RAW_VALUE_KEY], "[0, 0]");
    }

    #[test]
    fn nested_strings_of_json_do_not_overflow_the_stack() {
        // Each text is a string inside the next; `\u` escapes keep the length from doubling at each level.
        let mut text = "0".to_owned();
        for _ in 0..60 {
            let inner = text.replace('\\', "\\u005c").replace('"', "\\u0022");
            text = format!(
                "{}{{\"{RAW_VALUE_KEY}\":\"{inner}\"}}{}",
                "[".repeat(100),
                "]".repeat(100)
            );
        }
        assert!(value(text.as_bytes()).is_ok());
        let deep = "[".repeat(128) + &"]".repeat(128);
        assert!(
            value(deep.as_bytes())
                .unwrap_err()
                .to_string()
                .contains("recursion limit")
        );
    }

    /// The text of any JSON value, with numbers in many notations.
    fn any_json() -> impl Strategy<Value = String> {
        let leaf = prop_oneof![
            Just("null".to_owned()),
            Just("true".to_owned()),
            any::<f64>()
                .prop_filter("JSON has finite numbers only", |x| x.is_finite())
                .prop_map(|x| format!("{x:e}")),
            any::<i64>().prop_map(|x| x.to_string()),
            "[0-9]{30}".prop_map(|x| format!("1{x}.0E+5")),
            ".{0,4}".prop_map(|x| Value::String(x).to_string()),
        ];
        leaf.prop_recursive(4, 30, 5, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..5)
                    .prop_map(|items| format!("[{}]", items.join(" , "))),
                prop::collection::vec(("[ab\\\\\"]{0,2}", inner), 0..5).prop_map(|members| {
                    let each = members.iter();
                    let each = each.map(|(k, v)| format!("{}:{v}", Value::String(k.clone())));
                    format!("{{{}}}", each.collect::<Vec<_>>().join(","))
                }),
            ]
        })
    }

    proptest! {
        #[test]
        fn any_other_json_is_read_as_serde_json_reads_it(text in any_json()) {
            let theirs: Value = serde_json::from_str(&text).unwrap();
            prop_assert_eq!(value(text.as_bytes()).unwrap(), theirs);
        }
    }
}
