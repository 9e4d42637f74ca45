//! The header of a PLY.

use std::ops::Range;

use crate::error::MeshFileError;
use crate::text::{number, shown, words};

/// Properties of all elements that a header may declare.
const MAX_PROPERTIES: usize = 1000;
/// Bytes that a header may have.
const MAX_HEADER: usize = 1 << 20;

/// How the rows are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A type of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn of(name: &[u8]) -> Option<Scalar> {
        Some(match name {
            b"char" | b"int8" => Scalar::I8,
            b"uchar" | b"uint8" => Scalar::U8,
            b"short" | b"int16" => Scalar::I16,
            b"ushort" | b"uint16" => Scalar::U16,
            b"int" | b"int32" => Scalar::I32,
            b"uint" | b"uint32" => Scalar::U32,
            b"float" | b"float32" => Scalar::F32,
            b"double" | b"float64" => Scalar::F64,
            _ => return None,
        })
    }

    /// Bytes of a number.
    pub fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    /// What stands for 1 in a colour.
    pub fn full(self) -> f64 {
        match self {
            Scalar::I8 => 127.0,
            Scalar::U8 => 255.0,
            Scalar::I16 => 32_767.0,
            Scalar::U16 => 65_535.0,
            Scalar::I32 => f64::from(i32::MAX),
            Scalar::U32 => f64::from(u32::MAX),
            Scalar::F32 | Scalar::F64 => 1.0,
        }
    }
}

/// A property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property {
    pub name: String,
    /// The type of its number or of each of its numbers.
    pub scalar: Scalar,
    /// The type of a list's length.
    pub length: Option<Scalar>,
}

/// An element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    pub name: String,
    pub rows: usize,
    /// Where the header says how many rows there are.
    pub count: Range<usize>,
    pub properties: Vec<Property>,
}

impl Element {
    /// Index of the first property that has one of some names.
    pub fn property(&self, names: &[&str]) -> Option<usize> {
        (self.properties.iter()).position(|p| names.contains(&p.name.as_str()))
    }
}

/// A header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// The comments that darn wrote, with the places of their lines.
    pub records: Vec<(String, Range<usize>)>,
    /// Where the line `end_header` starts.
    pub end: usize,
    /// Where the rows start.
    pub body: usize,
    /// What ends a line of it.
    pub line_break: &'static str,
}

/// What a comment of darn starts with.
pub const RECORD: &str = "comment darn: ";

/// Reads the header of a PLY.
///
/// # Errors
/// `Line`.
pub fn header(bytes: &[u8]) -> Result<Header, MeshFileError> {
    let head = bytes.get(..MAX_HEADER).unwrap_or(bytes);
    let line_break = match head.get(3..5) {
        Some(b"\r\n") => "\r\n",
        Some([b'\r', _]) => "\r",
        _ => "\n",
    };
    let last = line_break.as_bytes()[line_break.len() - 1];
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut records = Vec::new();
    let (mut start, mut properties) = (0, 0);
    for (line, text) in (1..).zip(head.split_inclusive(|byte| *byte == last)) {
        let place = start..start + text.len();
        start = place.end;
        let mut words = words(text);
        let error = |detail: String| MeshFileError::line(line, detail);
        match words.next() {
            Some(b"ply" | b"obj_info") | None => {}
            Some(b"comment") => {
                let text = String::from_utf8_lossy(text.trim_ascii_end());
                if text.starts_with(RECORD) {
                    records.push((text.into_owned(), place));
                }
            }
            Some(b"format") => {
                let name = words.next().unwrap_or_default();
                encoding = Some(match name {
                    b"ascii" => Encoding::Ascii,
                    b"binary_little_endian" => Encoding::LittleEndian,
                    b"binary_big_endian" => Encoding::BigEndian,
                    _ => return Err(error(format!("{} is no format of a PLY", shown(name)))),
                });
            }
            Some(b"element") => {
                let (name, rows) = (words.next(), words.next());
                let (Some(name), Some(rows)) = (name, rows) else {
                    return Err(error("an element has a name and a number of rows".into()));
                };
                let offset = rows.as_ptr() as usize - bytes.as_ptr() as usize;
                let count = number(rows)
                    .ok_or_else(|| error(format!("{} is no number of rows", shown(rows))))?;
                elements.push(Element {
                    name: String::from_utf8_lossy(name).into_owned(),
                    rows: count,
                    count: offset..offset + rows.len(),
                    properties: Vec::new(),
                });
            }
            Some(b"property") => {
                properties += 1;
                if properties > MAX_PROPERTIES {
                    return Err(error(format!("more than {MAX_PROPERTIES} properties")));
                }
                let Some(element) = elements.last_mut() else {
                    return Err(error("a property before the first element".into()));
                };
                let property = property(&mut words);
                let detail = "a property is `property TYPE NAME` or `property list TYPE TYPE NAME`";
                element
                    .properties
                    .push(property.ok_or_else(|| error(detail.into()))?);
            }
            Some(b"end_header") => {
                let detail = "the header names no format";
                return Ok(Header {
                    encoding: encoding.ok_or_else(|| error(detail.into()))?,
                    elements,
                    records,
                    end: place.start,
                    body: place.end,
                    line_break,
                });
            }
            Some(word) => return Err(error(format!("{} is no line of a header", shown(word)))),
        }
    }
    let lines = head.split(|byte| *byte == last).count();
    Err(MeshFileError::line(lines, "the header has no end_header"))
}

fn property<'l>(words: &mut impl Iterator<Item = &'l [u8]>) -> Option<Property> {
    let (scalar, length) = match words.next()? {
        b"list" => {
            let length = Scalar::of(words.next()?)?;
            (Scalar::of(words.next()?)?, Some(length))
        }
        name => (Scalar::of(name)?, None),
    };
    Some(Property {
        name: String::from_utf8_lossy(words.next()?).into_owned(),
        scalar,
        length,
    })
}
