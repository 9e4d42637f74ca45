//! Values of the elements near a place in a large mesh.

use std::iter::repeat_n;
use std::ops::{Index, IndexMut};

/// Elements of a page.
const PAGE: usize = 512;

/// A value for every element of a mesh, in pages that exist once one of their values is written: what is done around a
/// hole costs no pass over the whole mesh.
#[derive(Debug, Clone)]
pub(super) struct SparseValues<T> {
    pages: Vec<Option<Box<[T]>>>,
    /// The value of all elements that were not written.
    unwritten: T,
}

impl<T: Copy> SparseValues<T> {
    /// The same value for `len` elements.
    pub fn new(len: usize, value: T) -> Self {
        SparseValues {
            pages: vec![None; len.div_ceil(PAGE)],
            unwritten: value,
        }
    }

    /// The elements of the pages that exist, ascending; all others have the first value.
    pub fn written(&self) -> impl Iterator<Item = usize> {
        let pages = self.pages.iter().enumerate();
        let written = pages.filter(|(_, page)| page.is_some());
        written.flat_map(|(k, _)| PAGE * k..PAGE * (k + 1))
    }
}

impl<T> Index<usize> for SparseValues<T> {
    type Output = T;

    #[inline]
    fn index(&self, element: usize) -> &T {
        match &self.pages[element / PAGE] {
            Some(page) => &page[element % PAGE],
            None => &self.unwritten,
        }
    }
}

impl<T: Copy> IndexMut<usize> for SparseValues<T> {
    #[inline]
    fn index_mut(&mut self, element: usize) -> &mut T {
        let unwritten = self.unwritten;
        let page =
            self.pages[element / PAGE].get_or_insert_with(|| repeat_n(unwritten, PAGE).collect());
        &mut page[element % PAGE]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn values_are_those_of_a_vector(
            len in 1usize..3000, writes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..40),
        ) {
            let (mut dense, mut sparse) = (vec![7; len], SparseValues::new(len, 7));
            for (at, value) in writes {
                let at = at.index(len);
                (dense[at], sparse[at]) = (value, value);
            }
            prop_assert!((0..len).all(|k| dense[k] == sparse[k]));
            let written: Vec<usize> = sparse.written().filter(|k| *k < len && sparse[*k] != 7).collect();
            let expected: Vec<usize> = (0..len).filter(|k| dense[*k] != 7).collect();
            prop_assert_eq!(written, expected);
        }
    }
}
