//! An error and its causes as one line of text.

use std::error::Error;

/// The error's text and those of its causes, with `: ` between them. A cause whose text is already there is left out, since many errors
/// repeat their cause in their own text.
pub fn error_chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let more = cause.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        next = cause.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("{text}")]
    struct Outer {
        text: &'static str,
        source: std::io::Error,
    }

    fn outer(text: &'static str) -> Outer {
        Outer {
            text,
            source: std::io::Error::other("disk on fire"),
        }
    }

    #[test]
    fn a_cause_is_said_once() {
        assert_eq!(error_chain(&outer("outer")), "outer: disk on fire");
        let repeats = outer("outer, for disk on fire");
        assert_eq!(error_chain(&repeats), "outer, for disk on fire");
    }
}
