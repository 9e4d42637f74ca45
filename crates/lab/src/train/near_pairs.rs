//! Cells of a composed grid that are near in space but not on the sheet, for the self-penetration loss. A spatial hash on the CPU finds them,
//! so the cost grows with the number of near pairs and not with all pairs of cells.

use std::collections::HashMap;

use darn_geometry::grid::{CELLS, SIDE};

/// Distance below which two cells repel each other, in cells: balls of half the mean spacing touch.
pub(super) const REACH: f32 = 1.0;
/// Cells at most this far apart on the grid along u and along v are one piece of cloth and do not repel.
const NEIGHBOURS: usize = 3;
/// Most pairs of one grid; a crumpled prediction can have hundreds of thousands.
const MOST: usize = 8192;

/// Pairs of cells of one grid.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct NearPairs {
    /// The cells, lower index first, in ascending order.
    pub pairs: Vec<(usize, usize)>,
    /// Number of found pairs that each kept pair stands for: 1 unless more than [`MOST`] were found.
    pub each: f32,
}

/// Pairs of `present` cells that are nearer than [`REACH`] in space and farther than [`NEIGHBOURS`] on the grid, at least one of them
/// `open`.
///
/// `positions` are in cells, all three lists `CELLS` long. The same input gives the same pairs.
pub(super) fn near_pairs(positions: &[[f32; 3]], present: &[bool], open: &[bool]) -> NearPairs {
    let bucket = |p: &[f32; 3]| p.map(|x| (x / REACH).floor() as i32);
    let mut buckets: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    for k in (0..CELLS).filter(|&k| present[k]) {
        buckets.entry(bucket(&positions[k])).or_default().push(k);
    }
    let mut pairs = Vec::new();
    for a in (0..CELLS).filter(|&k| present[k] && open[k]) {
        let home = bucket(&positions[a]);
        for step in 0..27 {
            let beside = [step % 3, step / 3 % 3, step / 9];
            let at = [0, 1, 2].map(|axis| home[axis].saturating_add(beside[axis] - 1));
            for &b in buckets.get(&at).into_iter().flatten() {
                // A pair of two open cells is found from both ends.
                let counted = !open[b] || a < b;
                if counted
                    && !neighbours(a, b)
                    && squared(&positions[a], &positions[b]) < REACH * REACH
                {
                    pairs.push((a.min(b), a.max(b)));
                }
            }
        }
    }
    pairs.sort_unstable();
    let found = pairs.len();
    if found > MOST {
        pairs = (0..MOST).map(|k| pairs[k * found / MOST]).collect();
    }
    NearPairs {
        each: found as f32 / pairs.len().max(1) as f32,
        pairs,
    }
}

fn neighbours(a: usize, b: usize) -> bool {
    (a % SIDE).abs_diff(b % SIDE) <= NEIGHBOURS && (a / SIDE).abs_diff(b / SIDE) <= NEIGHBOURS
}

fn squared(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A flat sheet, in cells, folded over along the line between columns 31 and 32 with layers `apart` from each other.
    fn folded(apart: f32) -> Vec<[f32; 3]> {
        (0..CELLS)
            .map(|k| {
                let (i, j) = ((k % SIDE) as f32, (k / SIDE) as f32);
                if i < 32.0 {
                    [i, j, 0.0]
                } else {
                    [63.0 - i, j, apart]
                }
            })
            .collect()
    }

    #[test]
    fn a_flat_sheet_has_no_near_pairs() {
        let flat: Vec<[f32; 3]> = (0..CELLS)
            .map(|k| [(k % SIDE) as f32, (k / SIDE) as f32, 0.0])
            .collect();
        assert!(
            near_pairs(&flat, &[true; CELLS], &[true; CELLS])
                .pairs
                .is_empty()
        );
    }

    #[test]
    fn layers_nearer_than_the_reach_repel_each_other() {
        let mut open = vec![false; CELLS];
        open[10 * SIDE + 5] = true;
        let found = near_pairs(&folded(0.5), &[true; CELLS], &open);
        // Over the one open cell at column 5 lies column 58; the cells beside that one are √1.25 away.
        assert_eq!(found.pairs, [(10 * SIDE + 5, 10 * SIDE + 58)]);
        assert!(
            near_pairs(&folded(1.1), &[true; CELLS], &[true; CELLS])
                .pairs
                .is_empty()
        );
        let absent: Vec<bool> = (0..CELLS).map(|k| k % SIDE < 32).collect();
        assert!(near_pairs(&folded(0.5), &absent, &open).pairs.is_empty());
    }

    #[test]
    fn pairs_of_a_crumpled_grid_are_thinned_and_stand_for_all() {
        let found = near_pairs(&vec![[0.2; 3]; CELLS], &[true; CELLS], &[true; CELLS]);
        assert_eq!(found.pairs.len(), MOST);
        let all = (0..CELLS).flat_map(|a| (a + 1..CELLS).map(move |b| (a, b)));
        let apart = all.filter(|&(a, b)| !neighbours(a, b)).count();
        assert!((found.each * MOST as f32 / apart as f32 - 1.0).abs() < 1e-4);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        #[test]
        fn the_hash_finds_what_a_search_over_all_pairs_finds(seed: u64, width in 6f32..40.0) {
            use rand::{Rng, SeedableRng};
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let positions: Vec<[f32; 3]> = (0..CELLS).map(|_| [(); 3].map(|()| rng.random_range(-width..width))).collect();
            let present: Vec<bool> = (0..CELLS).map(|_| rng.random_bool(0.4)).collect();
            let open: Vec<bool> = (0..CELLS).map(|_| rng.random_bool(0.3)).collect();
            let found = near_pairs(&positions, &present, &open);
            let all = (0..CELLS).flat_map(|a| (a + 1..CELLS).map(move |b| (a, b)));
            let wanted: Vec<(usize, usize)> = all
                .filter(|&(a, b)| present[a] && present[b] && (open[a] || open[b]))
                .filter(|&(a, b)| !neighbours(a, b) && squared(&positions[a], &positions[b]) < REACH * REACH)
                .collect();
            prop_assume!(wanted.len() <= MOST);
            prop_assert_eq!(found.pairs, wanted);
        }
    }
}
