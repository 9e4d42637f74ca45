//! Texels that nothing covers take the colours of those around (push–pull).

use crate::blend::Value;

/// Fills the texels that are not `covered`: means over cells of 2 × 2, 4 × 4, … texels, the finest that holds any.
pub(crate) fn fill(values: &mut [Value], covered: &[bool], width: usize) {
    if covered.iter().all(|c| *c) || !covered.iter().any(|c| *c) {
        return;
    }
    let height = covered.len() / width;
    let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
    let mut sums = vec![([0.0f32; 4], 0u32); half_width * half_height];
    for at in (0..covered.len()).filter(|at| covered[*at]) {
        let cell = &mut sums[at / width / 2 * half_width + at % width / 2];
        (0..4).for_each(|k| cell.0[k] += values[at][k]);
        cell.1 += 1;
    }
    let half_covered: Vec<bool> = sums.iter().map(|(_, count)| *count > 0).collect();
    let mut half: Vec<Value> = (sums.iter())
        .map(|(sum, count)| sum.map(|x| x / (*count).max(1) as f32))
        .collect();
    fill(&mut half, &half_covered, half_width);
    for at in (0..covered.len()).filter(|at| !covered[*at]) {
        values[at] = half[at / width / 2 * half_width + at % width / 2];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covered_texels_stay_and_others_are_between_them() {
        let covered: Vec<bool> = (0..77).map(|k| k % 5 == 0 && k < 50).collect();
        let mut values: Vec<Value> = (0..77).map(|k| [k as f32, 1.0, 0.0, 0.0]).collect();
        let before = values.clone();
        fill(&mut values, &covered, 11);
        for k in 0..77 {
            if covered[k] {
                assert_eq!(values[k], before[k]);
            }
            assert!((0.0..50.0).contains(&values[k][0]) && values[k][1] == 1.0);
        }
    }
}
