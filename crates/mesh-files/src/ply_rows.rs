//! The rows of a PLY's elements, read and written.

use std::io::Write as _;

use crate::ply_header::{Encoding, Scalar};

/// Reads numbers one after another.
pub struct RowReader<'b> {
    bytes: &'b [u8],
    encoding: Encoding,
    /// Where the next number is looked for.
    pub at: usize,
}

impl<'b> RowReader<'b> {
    pub fn new(bytes: &'b [u8], encoding: Encoding, at: usize) -> Self {
        RowReader {
            bytes,
            encoding,
            at,
        }
    }

    /// The next number; `None` if there is none.
    pub fn next(&mut self, scalar: Scalar) -> Option<f64> {
        if self.encoding == Encoding::Ascii {
            return self.next_word();
        }
        let bytes = self.bytes.get(self.at..self.at + scalar.size())?;
        self.at += scalar.size();
        let is_big = self.encoding == Encoding::BigEndian;
        macro_rules! number {
            ($type:ty) => {{
                let bytes = bytes.try_into().ok()?;
                f64::from(match is_big {
                    true => <$type>::from_be_bytes(bytes),
                    false => <$type>::from_le_bytes(bytes),
                })
            }};
        }
        Some(match scalar {
            Scalar::I8 => number!(i8),
            Scalar::U8 => number!(u8),
            Scalar::I16 => number!(i16),
            Scalar::U16 => number!(u16),
            Scalar::I32 => number!(i32),
            Scalar::U32 => number!(u32),
            Scalar::F32 => number!(f32),
            Scalar::F64 => number!(f64),
        })
    }

    fn next_word(&mut self) -> Option<f64> {
        let rest = self.bytes.get(self.at..)?;
        let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let word = &rest[start..];
        let length = word.iter().position(u8::is_ascii_whitespace);
        let word = &word[..length.unwrap_or(word.len())];
        self.at += start + word.len();
        crate::text::number(word)
    }

    /// Goes on behind the end of the line, where rows are lines.
    pub fn end_line(&mut self) {
        if self.encoding != Encoding::Ascii {
            return;
        }
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let blanks = rest
            .iter()
            .take_while(|byte| matches!(byte, b' ' | b'\t'))
            .count();
        self.at += match rest.get(blanks..) {
            Some([b'\r', b'\n', ..]) => blanks + 2,
            Some([b'\n' | b'\r', ..]) => blanks + 1,
            // A last line without an end, or a row that shares its line with the next one.
            _ => 0,
        };
    }
}

/// Writes numbers one after another.
pub struct RowWriter {
    encoding: Encoding,
    line_break: &'static str,
    /// Whether the line that the rows follow has no end: then each starts with a line break instead of ending with one.
    follows_open_line: bool,
    is_first: bool,
    pub out: Vec<u8>,
}

impl RowWriter {
    /// Rows that follow `before`.
    pub fn new(before: &[u8], encoding: Encoding, line_break: &'static str) -> Self {
        let ended = before
            .last()
            .is_some_and(|byte| matches!(byte, b'\n' | b'\r'));
        RowWriter {
            encoding,
            line_break,
            follows_open_line: encoding == Encoding::Ascii && !ended,
            is_first: true,
            out: Vec::new(),
        }
    }

    pub fn start_row(&mut self) {
        if self.follows_open_line {
            self.out.extend_from_slice(self.line_break.as_bytes());
        }
        self.is_first = true;
    }

    pub fn end_row(&mut self) {
        if self.encoding == Encoding::Ascii && !self.follows_open_line {
            self.out.extend_from_slice(self.line_break.as_bytes());
        }
    }

    /// Writes a number, rounded to what its type can have.
    pub fn push(&mut self, number: f64, scalar: Scalar) {
        if self.encoding == Encoding::Ascii {
            let space = if self.is_first { "" } else { " " };
            self.is_first = false;
            // Writing to a vector does not fail.
            match scalar {
                Scalar::F32 => write!(self.out, "{space}{}", number as f32),
                Scalar::F64 => write!(self.out, "{space}{number}"),
                _ => write!(self.out, "{space}{}", number.round()),
            }
            .ok();
            return;
        }
        let is_big = self.encoding == Encoding::BigEndian;
        macro_rules! push {
            ($value:expr) => {{
                let value = $value;
                let bytes = if is_big {
                    value.to_be_bytes()
                } else {
                    value.to_le_bytes()
                };
                self.out.extend_from_slice(&bytes);
            }};
        }
        // A cast keeps within the type's bounds.
        match scalar {
            Scalar::I8 => push!(number.round() as i8),
            Scalar::U8 => push!(number.round() as u8),
            Scalar::I16 => push!(number.round() as i16),
            Scalar::U16 => push!(number.round() as u16),
            Scalar::I32 => push!(number.round() as i32),
            Scalar::U32 => push!(number.round() as u32),
            Scalar::F32 => push!(number as f32),
            Scalar::F64 => push!(number),
        }
    }
}
