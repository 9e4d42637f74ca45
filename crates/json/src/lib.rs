//! JSON text to a value in which every key is a key.
//!
//! serde_json's own reader of values takes an object that begins with its private key for a raw value (a feature that `gltf` turns on)
//! for a *text* to be parsed anew: with a depth of its own, so that a nest of such texts overflows the stack, and past every count of
//! what the text holds.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

/// The private key under which serde_json hands out a number as it is spelled (`arbitrary_precision`), but for integers. An object that somebody wrote
/// with it is read as that number, which costs and harms nothing.
const SPELLED: &str = "$serde_json::private::Number";

/// Reads a text; arrays and objects may lie in each other 127 deep, as serde_json has it.
///
/// # Errors
/// When it is not JSON, or deeper than that.
pub fn value(text: &[u8]) -> Result<Value, serde_json::Error> {
    serde_json::from_slice(text).map(|Plain(value)| value)
}

struct Plain(Value);

impl<'de> Deserialize<'de> for Plain {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Building).map(Plain)
    }
}

struct Building;

impl<'de> Visitor<'de> for Building {
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
        while let Some(Plain(item)) = items.next_element()? {
            array.push(item);
        }
        Ok(Value::Array(array))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = members.next_key::<String>()? {
            if object.is_empty() && key == SPELLED {
                let spelled: String = members.next_value()?;
                let number: Number = spelled.parse().map_err(A::Error::custom)?;
                return Ok(Value::Number(number));
            }
            let Plain(value) = members.next_value()?;
            object.insert(key, value);
        }
        Ok(Value::Object(object))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RAW: &str = "$serde_json::private::RawValue";

    #[test]
    fn a_private_key_is_a_key() {
        let text = format!(r#"{{"{RAW}": "[0, 0]"}}"#);
        let read = value(text.as_bytes()).unwrap();
        assert_eq!(read[RAW], "[0, 0]");
    }

    #[test]
    fn no_nest_is_too_deep_for_the_stack() {
        // Each text lies as a string in the next; without quotation marks in need of more and more backslashes.
        let mut text = "0".to_owned();
        for _ in 0..60 {
            let inner = text.replace('\\', "\\u005c").replace('"', "\\u0022");
            text = format!(
                "{}{{\"{RAW}\":\"{inner}\"}}{}",
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

    /// Any value, numbers spelled in any way.
    fn any_json() -> impl Strategy<Value = String> {
        let leaf = prop_oneof![
            Just("null".to_owned()),
            Just("true".to_owned()),
            any::<f64>()
                .prop_filter("JSON has no others", |x| x.is_finite())
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
        fn all_else_is_read_as_serde_json_reads_it(text in any_json()) {
            let theirs: Value = serde_json::from_str(&text).unwrap();
            prop_assert_eq!(value(text.as_bytes()).unwrap(), theirs);
        }
    }
}
