//! Normals of a grid of positions.

use darn_geometry::grid::SIDE;
use darn_geometry::mesh::Vec3;

/// The four neighbours of cell `k`, counter-clockwise from the right one; `None` at the border and where one is not `present`.
pub(crate) fn neighbours(present: &[bool], k: usize) -> Option<[usize; 4]> {
    let (i, j) = (k % SIDE, k / SIDE);
    if i == 0 || j == 0 || i + 1 == SIDE || j + 1 == SIDE {
        return None;
    }
    let all = [k + 1, k + SIDE, k - 1, k - SIDE];
    all.iter().all(|&n| present[n]).then_some(all)
}

/// Cross product of the central differences at cell `k`: its length is four times the cell's area.
pub(crate) fn normal(x: &[Vec3], present: &[bool], k: usize) -> Option<Vec3> {
    let [right, upper, left, lower] = neighbours(present, k)?;
    Some((x[right] - x[left]).cross(&(x[upper] - x[lower])))
}
