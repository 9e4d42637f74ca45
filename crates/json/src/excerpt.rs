//! Texts of callers as errors and reports repeat them.

use std::borrow::Cow;

/// Most bytes of one text of a caller that an error or a report repeats.
pub const EXCERPT_BYTES: usize = 256;

const ELLIPSIS: &str = "…";

/// A caller's text as an error or a report repeats it: cut to [`EXCERPT_BYTES`], so that no answer grows with what was sent.
pub fn excerpt(text: &str) -> Cow<'_, str> {
    cut(text, EXCERPT_BYTES)
}

/// A text cut to at most `limit` bytes, but no fewer than an ellipsis has (3), with which it ends if anything was cut off.
pub fn cut(text: &str, limit: usize) -> Cow<'_, str> {
    if text.len() <= limit {
        return Cow::Borrowed(text);
    }
    let end = text.floor_char_boundary(limit.saturating_sub(ELLIPSIS.len()));
    let kept = text.get(..end).unwrap_or_default();
    Cow::Owned(format!("{kept}{ELLIPSIS}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_cut_text_begins_the_text_and_fits(text in ".{0,40}", limit in 3_usize..60) {
            let short = cut(&text, limit);
            prop_assert!(short.len() <= limit);
            match short.strip_suffix(ELLIPSIS) {
                Some(kept) if text.len() > limit => prop_assert!(text.starts_with(kept)),
                _ => prop_assert_eq!(&short, &text),
            }
        }
    }

    #[test]
    fn an_excerpt_has_its_length() {
        assert_eq!(excerpt("short"), "short");
        assert_eq!(excerpt(&"ä".repeat(1000)).len(), 255);
        assert_eq!(excerpt(&"a".repeat(1000)).len(), EXCERPT_BYTES);
    }
}
