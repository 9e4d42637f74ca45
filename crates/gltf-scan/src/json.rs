//! A JSON value together with its JSON pointer, so that every error can name the place.

use serde_json::{Number, Value};

use super::error::ScanError;

/// A value inside the scan's JSON and the RFC 6901 pointer to it.
#[derive(Debug, Clone)]
pub(super) struct JsonPlace<'a> {
    pub value: &'a Value,
    pub pointer: String,
}

impl<'a> JsonPlace<'a> {
    /// The whole document.
    pub fn root(value: &'a Value) -> Self {
        Self {
            value,
            pointer: String::new(),
        }
    }

    /// An error about this place.
    pub fn invalid(&self, detail: impl Into<String>) -> ScanError {
        ScanError::Invalid {
            pointer: self.pointer.clone(),
            detail: detail.into(),
        }
    }

    /// The member `key` of this object, if there is one.
    pub fn get(&self, key: &str) -> Result<Option<JsonPlace<'a>>, ScanError> {
        let object = self
            .value
            .as_object()
            .ok_or_else(|| self.invalid("must be an object"))?;
        Ok(object.get(key).map(|value| JsonPlace {
            value,
            pointer: format!("{}/{key}", self.pointer),
        }))
    }

    /// The member `key` of this object, which must be there.
    pub fn need(&self, key: &str) -> Result<JsonPlace<'a>, ScanError> {
        self.get(key)?.ok_or_else(|| ScanError::Invalid {
            pointer: format!("{}/{key}", self.pointer),
            detail: "is missing".into(),
        })
    }

    /// The elements of this array.
    pub fn items(&self) -> Result<impl Iterator<Item = JsonPlace<'a>>, ScanError> {
        let array = self.array()?;
        let pointer = self.pointer.clone();
        Ok(array.iter().enumerate().map(move |(i, value)| JsonPlace {
            value,
            pointer: format!("{pointer}/{i}"),
        }))
    }

    /// The element `index` of this array, if it is that long.
    pub fn item(&self, index: usize) -> Result<Option<JsonPlace<'a>>, ScanError> {
        let value = self.array()?.get(index);
        Ok(value.map(|value| JsonPlace {
            value,
            pointer: format!("{}/{index}", self.pointer),
        }))
    }

    /// The element that `from` (an integer) refers to in the array `key` of this object.
    pub fn referred(
        &self,
        key: &str,
        from: &JsonPlace<'_>,
    ) -> Result<(usize, JsonPlace<'a>), ScanError> {
        let index = from.integer()?;
        let array: &'a [Value] = match self.get(key)? {
            Some(place) => place.array()?,
            None => &[],
        };
        match array.get(index) {
            Some(value) => Ok((
                index,
                JsonPlace {
                    value,
                    pointer: format!("{}/{key}/{index}", self.pointer),
                },
            )),
            None => Err(from.invalid(format!(
                "refers to {key}[{index}], but there are {}",
                array.len()
            ))),
        }
    }

    /// The elements of this array, without their places.
    pub fn array(&self) -> Result<&'a [Value], ScanError> {
        self.value
            .as_array()
            .map(Vec::as_slice)
            .ok_or_else(|| self.invalid("must be an array"))
    }

    /// This string.
    pub fn text(&self) -> Result<&'a str, ScanError> {
        self.value
            .as_str()
            .ok_or_else(|| self.invalid("must be a string"))
    }

    /// This number, which must be finite.
    pub fn number(&self) -> Result<f64, ScanError> {
        self.value
            .as_f64()
            .filter(|x| x.is_finite())
            .ok_or_else(|| self.invalid("must be a finite number"))
    }

    /// A count, offset or index; `1.0` is read as `1`.
    pub fn integer(&self) -> Result<usize, ScanError> {
        self.value
            .as_number()
            .and_then(integral)
            .and_then(|n| usize::try_from(n).ok())
            .ok_or_else(|| self.invalid("must be a non-negative integer"))
    }

    /// The integer member `key`, or `default` if it is missing.
    pub fn integer_or(&self, key: &str, default: usize) -> Result<usize, ScanError> {
        self.get(key)?.map_or(Ok(default), |place| place.integer())
    }

    /// The boolean member `key`, or false if it is missing.
    pub fn flag(&self, key: &str) -> Result<bool, ScanError> {
        match self.get(key)? {
            Some(place) => place
                .value
                .as_bool()
                .ok_or_else(|| place.invalid("must be true or false")),
            None => Ok(false),
        }
    }

    /// An array of exactly `N` finite numbers.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N], ScanError> {
        if self.array()?.len() != N {
            return Err(self.invalid(format!("must have {N} numbers")));
        }
        let mut out = [0.0; N];
        for (slot, place) in out.iter_mut().zip(self.items()?) {
            *slot = place.number()?;
        }
        Ok(out)
    }

    /// The object `extensions/<name>` of this object, if there is one.
    pub fn extension(&self, name: &str) -> Result<Option<JsonPlace<'a>>, ScanError> {
        match self.get("extensions")? {
            Some(extensions) => extensions.get(name),
            None => Ok(None),
        }
    }
}

/// The number as an integer, in any spelling, up to 2⁵³.
pub(super) fn integral(number: &Number) -> Option<u64> {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    number.as_u64().or_else(|| {
        let x = number.as_f64()?;
        (x.fract() == 0.0 && (0.0..=EXACT).contains(&x)).then_some(x as u64)
    })
}

/// An upper bound of the number of values in a JSON text, without parsing it: its opening brackets, commas and colons
/// outside strings.
pub(super) fn values_at_most(text: &[u8]) -> usize {
    let (mut count, mut inside, mut escaped) = (1, false, false);
    for &byte in text {
        if inside {
            match byte {
                _ if escaped => escaped = false,
                b'\\' => escaped = true,
                b'"' => inside = false,
                _ => {}
            }
        } else {
            match byte {
                b'"' => inside = true,
                b'{' | b'[' | b',' | b':' => count += 1,
                _ => {}
            }
        }
    }
    count
}

/// Bytes of memory that a parsed JSON value takes: its own place, and what it has allocated. Counted, since a list of empty lists takes
/// sixty times as much as its text.
pub(crate) fn json_held(json: &Value) -> usize {
    // A map's entry: its key, its value, their hash, and its place in the table of the map.
    const ENTRY: usize = size_of::<String>() + size_of::<Value>() + 2 * size_of::<usize>();
    let (mut held, mut open) = (size_of::<Value>(), vec![json]);
    while let Some(value) = open.pop() {
        match value {
            Value::Null | Value::Bool(_) => {}
            // Numbers keep their text.
            Value::Number(number) => held += number.as_str().len(),
            Value::String(text) => held += text.capacity(),
            Value::Array(items) => {
                held += size_of::<Value>() * items.capacity();
                open.extend(items);
            }
            Value::Object(members) => {
                held += members
                    .keys()
                    .map(|key| ENTRY + key.capacity())
                    .sum::<usize>();
                open.extend(members.values());
            }
        }
    }
    held
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn integers_may_be_spelled_as_floats() {
        for (text, want) in [
            ("1", Some(1)),
            ("1.0", Some(1)),
            ("2e3", Some(2000)),
            ("1.5", None),
            ("-1", None),
            ("1e99", None),
        ] {
            let value: Value = serde_json::from_str(text).unwrap();
            assert_eq!(JsonPlace::root(&value).integer().ok(), want, "{text}");
        }
    }

    #[test]
    fn errors_name_the_place() {
        let value = json!({"accessors": [{"count": "many"}], "at": 4});
        let root = JsonPlace::root(&value);
        let accessor = root
            .get("accessors")
            .unwrap()
            .unwrap()
            .items()
            .unwrap()
            .next()
            .unwrap();
        assert_eq!(
            accessor.integer_or("count", 0).unwrap_err().pointer(),
            Some("/accessors/0/count")
        );
        assert_eq!(
            accessor.need("type").unwrap_err().pointer(),
            Some("/accessors/0/type")
        );
        let error = root
            .referred("accessors", &root.need("at").unwrap())
            .unwrap_err();
        assert_eq!(
            error.to_string(),
            "/at: refers to accessors[4], but there are 1"
        );
    }

    #[test]
    fn strings_do_not_count_as_structure() {
        assert!(values_at_most(br#"{"a":"[[[,,,\"[[","b":[1,2]}"#) <= 8);
    }
}
