//! Edits a JSON text and leaves every other character unchanged: spelling of numbers, escapes, spaces, even repeated
//! keys.
//!
//! A round trip through `serde_json::Value` changes characters: even with arbitrary precision it writes `1E5` as
//! `1e+5`.

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use serde_json::Value;
use serde_json::value::RawValue;

use super::error::ScanError;

/// The text of a JSON object, and edits to make in it.
pub(super) struct JsonEdit<'t> {
    text: &'t str,
    root: &'t str,
    /// Replacements in disjoint places; an empty range inserts.
    edits: Vec<(Range<usize>, String)>,
    /// New members of the root object.
    members: String,
    /// The children of values that a path led through, by where the value starts: every patch's path starts at the root,
    /// and the text must not be parsed once for each patch.
    children: HashMap<usize, Children<'t>>,
}

/// An edited text, and how it came about.
pub(super) struct EditedText {
    pub text: String,
    /// The edits, in order.
    pub splices: Vec<Splice>,
}

/// One edit of a text.
pub(super) struct Splice {
    /// Where in the old text, in bytes.
    pub at: usize,
    /// The text that was there.
    pub removed: String,
    /// How many bytes came in its place.
    pub inserted: usize,
}

/// The texts of a value's children.
enum Children<'t> {
    Items(Vec<&'t RawValue>),
    Members(BTreeMap<String, &'t RawValue>),
}

impl<'t> JsonEdit<'t> {
    /// No edits yet. The text is known to parse.
    pub fn new(text: &'t [u8]) -> Result<Self, ScanError> {
        let invalid = || ScanError::Invalid {
            pointer: String::new(),
            detail: "must be a JSON object".into(),
        };
        let text = std::str::from_utf8(text).map_err(|_| invalid())?;
        let root: &RawValue = serde_json::from_str(text).map_err(|_| invalid())?;
        Ok(Self {
            text,
            root: root.get().trim(),
            edits: Vec::new(),
            members: String::new(),
            children: HashMap::new(),
        })
    }

    /// Replaces the value at `path`, which must be there.
    pub fn replace(&mut self, path: &[&str], value: &Value) -> Result<(), ScanError> {
        let old = self
            .find(path)?
            .ok_or_else(|| invalid(path, "is missing"))?;
        self.edits.push((self.span(old), value.to_string()));
        Ok(())
    }

    /// Replaces the value at `path`, or adds it to the object that it would be a member of, which must be there.
    pub fn set(&mut self, path: &[&str], value: &Value) -> Result<(), ScanError> {
        let Some((key, parent)) = path.split_last() else {
            return Err(invalid(path, "is the whole text"));
        };
        if self.find(path)?.is_some() {
            return self.replace(path, value);
        }
        let object = self
            .find(parent)?
            .ok_or_else(|| invalid(parent, "is missing"))?;
        let close = self.span(object).end.saturating_sub(1);
        // One of several new members comes after those before it.
        let is_first = matches!(object.trim_start().strip_prefix('{'), Some(rest) if rest.trim_start().starts_with('}'))
            && !self.edits.iter().any(|(range, _)| *range == (close..close));
        let comma = if is_first { "" } else { "," };
        let member = format!("{comma}{}:{value}", Value::from(*key));
        self.edits.push((close..close, member));
        Ok(())
    }

    /// Appends to the array at `path`; a missing array is created if it is a member of the root.
    pub fn append(&mut self, path: &[&str], values: &[Value]) -> Result<(), ScanError> {
        let new = values
            .iter()
            .map(Value::to_string)
            .collect::<Vec<_>>()
            .join(",");
        match (self.find(path)?, path) {
            (Some(array), _) => {
                let old: Vec<&RawValue> =
                    serde_json::from_str(array).map_err(|_| invalid(path, "must be an array"))?;
                let comma = if old.is_empty() { "" } else { "," };
                let close = self.span(array).end.saturating_sub(1);
                self.edits.push((close..close, format!("{comma}{new}")));
            }
            // The comma is right: the root is never empty, it has an `asset`.
            (None, [key]) => self.members.push_str(&format!(",\"{key}\":[{new}]")),
            (None, _) => return Err(invalid(path, "is missing")),
        }
        Ok(())
    }

    /// How many elements the array at `path` has; `None` if it is missing.
    pub fn length(&mut self, path: &[&str]) -> Result<Option<usize>, ScanError> {
        let Some(array) = self.find(path)? else {
            return Ok(None);
        };
        let items: Vec<&RawValue> =
            serde_json::from_str(array).map_err(|_| invalid(path, "must be an array"))?;
        Ok(Some(items.len()))
    }

    /// Where in the text the value at `path` is; `None` if it is missing.
    pub fn place(&mut self, path: &[&str]) -> Result<Option<Range<usize>>, ScanError> {
        Ok(self.find(path)?.map(|value| self.span(value)))
    }

    /// The edited text.
    pub fn finish(mut self) -> EditedText {
        let close = self.span(self.root).end.saturating_sub(1);
        self.edits
            .push((close..close, std::mem::take(&mut self.members)));
        self.edits.sort_by_key(|(range, _)| range.start);
        let mut out = String::with_capacity(
            self.text.len() + self.edits.iter().map(|(_, new)| new.len()).sum::<usize>(),
        );
        let mut at = 0;
        let mut splices = Vec::with_capacity(self.edits.len());
        for (range, new) in &self.edits {
            out.push_str(self.text.get(at..range.start).unwrap_or_default());
            out.push_str(new);
            at = range.end;
            let removed = self.text.get(range.clone()).unwrap_or_default();
            if !(new.is_empty() && removed.is_empty()) {
                splices.push(Splice {
                    at: range.start,
                    removed: removed.to_owned(),
                    inserted: new.len(),
                });
            }
        }
        out.push_str(self.text.get(at..).unwrap_or_default());
        EditedText { text: out, splices }
    }

    /// The text of the value at `path` (keys and array indices).
    fn find(&mut self, path: &[&str]) -> Result<Option<&'t str>, ScanError> {
        let mut at = self.root;
        for (depth, key) in path.iter().enumerate() {
            let here = path.get(..depth).unwrap_or_default();
            let start = self.span(at).start;
            let children = match self.children.entry(start) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => new.insert(Children::of(at, here)?),
            };
            let next = match (children, key.parse::<usize>()) {
                (Children::Items(items), Ok(index)) => items.get(index).copied(),
                (Children::Items(_), Err(_)) => return Err(invalid(here, "must be an object")),
                (Children::Members(_), Ok(_)) => return Err(invalid(here, "must be an array")),
                (Children::Members(members), Err(_)) => members.get(*key).copied(),
            };
            match next {
                Some(next) => at = next.get(),
                None => return Ok(None),
            }
        }
        Ok(Some(at))
    }

    /// The range of a slice of the text.
    fn span(&self, part: &str) -> Range<usize> {
        let start = (part.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        start..start + part.len()
    }
}

impl<'t> Children<'t> {
    /// The children of the value with this text; of repeated keys the last one counts, as in reading.
    fn of(text: &'t str, path: &[&str]) -> Result<Children<'t>, ScanError> {
        let children = match text.trim_start().starts_with('[') {
            true => serde_json::from_str(text).map(Children::Items),
            false => serde_json::from_str(text).map(Children::Members),
        };
        children.map_err(|_| invalid(path, "must be an object or an array"))
    }
}

fn invalid(path: &[&str], detail: &str) -> ScanError {
    ScanError::Invalid {
        pointer: path.iter().map(|key| format!("/{key}")).collect(),
        detail: detail.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn only_the_edited_places_change() {
        let text = " { \"a\" : [ 1E5 , 2 ] ,\n\"b\":{\"c\": [],\"n\":1.0} , \"\\u0062\\u0062\":[{\"n\" :7}] } ";
        let mut edit = JsonEdit::new(text.as_bytes()).unwrap();
        edit.append(&["a"], &[json!(3), json!({"x": 4})]).unwrap();
        edit.append(&["b", "c"], &[json!(5)]).unwrap();
        edit.replace(&["bb", "0", "n"], &json!(8)).unwrap();
        edit.append(&["new"], &[json!(6)]).unwrap();
        assert_eq!(
            edit.finish().text,
            " { \"a\" : [ 1E5 , 2 ,3,{\"x\":4}] ,\n\"b\":{\"c\": [5],\"n\":1.0} , \"\\u0062\\u0062\":[{\"n\" :8}] ,\"new\":[6]} "
        );
    }

    #[test]
    fn members_are_set_where_they_are_or_at_the_end_of_their_object() {
        let text = "{ \"a\" : { } , \"b\":{\"n\":1.0 }}";
        let mut edit = JsonEdit::new(text.as_bytes()).unwrap();
        edit.set(&["a", "x"], &json!(1)).unwrap();
        edit.set(&["a", "y\""], &json!([2])).unwrap();
        edit.set(&["b", "n"], &json!(3)).unwrap();
        edit.set(&["b", "m"], &json!({})).unwrap();
        assert!(edit.set(&["c", "m"], &json!({})).is_err());
        assert_eq!(
            edit.finish().text,
            "{ \"a\" : { \"x\":1,\"y\\\"\":[2]} , \"b\":{\"n\":3 ,\"m\":{}}}"
        );
    }

    #[test]
    fn missing_and_mistyped_values_are_named() {
        let mut edit = JsonEdit::new(b"{\"a\":{}}").unwrap();
        assert_eq!(edit.append(&["a"], &[]).unwrap_err().pointer(), Some("/a"));
        assert_eq!(
            edit.replace(&["a", "b"], &json!(1)).unwrap_err().pointer(),
            Some("/a/b")
        );
    }
}
