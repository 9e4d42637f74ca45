//! Words and numbers of lines of text.

use std::str::FromStr;

/// The words of a line.
pub fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let words = line.split(|byte| byte.is_ascii_whitespace());
    words.filter(|word| !word.is_empty())
}

/// A number.
pub fn number<T: FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A number that is neither NaN nor infinite.
pub fn finite(word: &[u8]) -> Option<f64> {
    number(word).filter(|x: &f64| x.is_finite())
}

/// A word for a message, cut short.
pub fn shown(word: &[u8]) -> String {
    const SHOWN: usize = 40;
    let text = String::from_utf8_lossy(word);
    let cut: String = text.chars().take(SHOWN).collect();
    format!("{cut:?}")
}

/// Decimals with which a coordinate of a mesh of some extent is written: seven digits, as f32 has, of the extent.
pub fn decimals(extent: f64) -> usize {
    const DIGITS: f64 = 7.0;
    let whole = match extent > 0.0 && extent.is_finite() {
        true => extent.log10().floor(),
        false => 0.0,
    };
    (DIGITS - whole).clamp(0.0, 30.0) as usize
}
