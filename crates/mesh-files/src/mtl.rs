//! The files that an OBJ refers to: material libraries (`mtllib`), and the images that those name (`map_Kd` and the like).
//!
//! A name stands bare on its line, so that one with spaces cannot be told from several names, nor from the options before it. Everything is
//! given that a line may mean; whoever looks for files takes what is there.

use std::collections::BTreeSet;

use crate::text::words;

/// Most names that are given of a file.
const MAX_NAMES: usize = 10_000;
/// Most bytes of a name; systems take no longer paths.
const MAX_NAME: usize = 4096;
/// Most words of a line that a name may begin with: options have a few numbers each.
const MAX_WORDS: usize = 40;
/// The lines of a material library that name an image, beside those that begin with `map_`.
const IMAGES: [&[u8]; 5] = [b"bump", b"disp", b"decal", b"refl", b"norm"];

/// What the lines of an OBJ may name as material libraries: all of a line, and each word of it.
pub fn material_libraries(obj: &[u8]) -> BTreeSet<String> {
    let is_one = |word: &[u8]| word.eq_ignore_ascii_case(b"mtllib");
    let mut names = BTreeSet::new();
    for rest in rests(obj, is_one) {
        let all = std::iter::once(rest).chain(words(rest).take(MAX_WORDS));
        names.extend(all.filter_map(text));
        if names.len() > MAX_NAMES {
            break;
        }
    }
    names
}

/// What the lines of a material library may name as images: a line without its first words, whatever number of them are options.
pub fn material_images(library: &[u8]) -> BTreeSet<String> {
    let is_one = |word: &[u8]| {
        let word = word.to_ascii_lowercase();
        word.starts_with(b"map_") || IMAGES.contains(&word.as_slice())
    };
    let mut names = BTreeSet::new();
    for rest in rests(library, is_one) {
        let mut left = rest;
        for _ in 0..MAX_WORDS {
            names.extend(text(left));
            let end = left.iter().position(u8::is_ascii_whitespace);
            match end.and_then(|end| left.get(end..)) {
                Some(after) => left = after.trim_ascii(),
                None => break,
            }
        }
        if names.len() > MAX_NAMES {
            break;
        }
    }
    names
}

/// What follows the first word of each line that begins with such a word.
fn rests(file: &[u8], is_one: impl Fn(&[u8]) -> bool) -> impl Iterator<Item = &[u8]> {
    let lines = file.split(|byte| matches!(byte, b'\n' | b'\r'));
    lines.filter_map(move |line| {
        let line = line.trim_ascii();
        let end = line.iter().position(u8::is_ascii_whitespace)?;
        let (first, rest) = line.split_at(end);
        is_one(first).then(|| rest.trim_ascii())
    })
}

/// A name, unless it is longer than any is or no UTF-8.
fn text(name: &[u8]) -> Option<String> {
    let is_one = (1..=MAX_NAME).contains(&name.len());
    let name = std::str::from_utf8(name).ok().filter(|_| is_one)?;
    Some(name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(names: &[&str]) -> BTreeSet<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn libraries_are_named_by_lines_and_by_words() {
        let obj = b"# mtllib not.mtl\r\nmtllib my cloth.mtl\r\nv 0 0 0\n  MTLLIB b.mtl\nmtllib\nusemtl mtllib\n";
        let expected = ["my cloth.mtl", "my", "cloth.mtl", "b.mtl"];
        assert_eq!(material_libraries(obj), set(&expected));
    }

    #[test]
    fn images_are_named_behind_options() {
        let library = b"newmtl linen\nKd 1 1 1\nmap_Kd maps\\linen.png\nmap_Bump -bm 0.5 a b.png\nnorm n.png\nmap_Kdx\n";
        let expected = [
            "maps\\linen.png",
            "-bm 0.5 a b.png",
            "0.5 a b.png",
            "a b.png",
            "b.png",
            "n.png",
        ];
        assert_eq!(material_images(library), set(&expected));
    }

    #[test]
    fn a_line_of_a_million_words_has_few_names() {
        let long = [b"map_Kd ".to_vec(), b"a ".repeat(1 << 20)].concat();
        assert_eq!(material_images(&long), set(&[]));
        let many = b"map_Kd a\n".repeat(1 << 10);
        assert_eq!(material_images(&many), set(&["a"]));
    }
}
