//! Laws of garments and their sets.
