//! Sparse symmetric positive definite matrices, factored once and solved many times (faer's supernodal Cholesky).

use darn_budget::{Budget, Exhausted};
use faer::linalg::solvers::SolveCore;
use faer::sparse::linalg::solvers::Llt;
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Side};

/// Why a system has no solution.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(crate) enum SolveError {
    /// The matrix could not be factored, or the solution is not finite.
    #[error("the matrix is not positive definite or not finite")]
    NotPositive,
    /// The request's budget is exhausted.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
}

/// The lower triangle of a symmetric matrix as a list of entries; those at the same place add up.
#[derive(Debug, Default)]
pub(crate) struct Symmetric {
    size: usize,
    /// Row, column (not above the diagonal), value.
    entries: Vec<(u32, u32, f64)>,
}

impl Symmetric {
    /// The zero matrix with `size` rows.
    pub fn zero(size: usize) -> Self {
        Symmetric {
            size,
            entries: Vec::new(),
        }
    }

    /// Adds to the entry (i, j) and, by symmetry, (j, i).
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        self.entries.push((i.max(j) as u32, i.min(j) as u32, value));
    }

    /// Adds weight · (xᵢ − xⱼ)² to the quadratic form xᵀAx.
    pub fn add_spring(&mut self, i: usize, j: usize, weight: f64) {
        self.add(i, i, weight);
        self.add(j, j, weight);
        self.add(i, j, -weight);
    }

    /// Adds weight · (Σ cₖ xₖ)² to the quadratic form; `row` holds pairs (k, cₖ).
    pub fn add_square(&mut self, row: &[(usize, f64)], weight: f64) {
        for (a, (i, ci)) in row.iter().enumerate() {
            for (j, cj) in &row[..=a] {
                self.add(*i, *j, weight * ci * cj);
            }
        }
    }

    /// Factors the matrix. That cannot be interrupted, so it is not begun when it would end after the deadline.
    ///
    /// # Errors
    /// `NotPositive` when it is not positive definite; `Exhausted`.
    pub fn factor(&self, budget: &Budget) -> Result<Factor, SolveError> {
        budget.spend_at_once(factor_work(self.size))?;
        let matrix = self.columns();
        let llt = (matrix.sp_cholesky(Side::Lower)).map_err(|_| SolveError::NotPositive)?;
        Ok(Factor {
            llt,
            size: self.size,
        })
    }

    /// The lower triangle in compressed columns; entries at the same place are added up in the order of the list.
    fn columns(&self) -> SparseColMat<usize, f64> {
        let mut starts = vec![0; self.size + 1];
        for entry in &self.entries {
            starts[entry.1 as usize + 1] += 1;
        }
        for column in 0..self.size {
            starts[column + 1] += starts[column];
        }
        let mut fill = starts.clone();
        let mut sorted = vec![(0, 0.0); self.entries.len()];
        for &(row, column, value) in &self.entries {
            sorted[fill[column as usize]] = (row, value);
            fill[column as usize] += 1;
        }
        let (mut ends, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        // Per row the index in `values` of the current column's entry.
        let mut place = vec![usize::MAX; self.size];
        for s in starts.windows(2) {
            let first = rows.len();
            for &(row, value) in &sorted[s[0]..s[1]] {
                let at = &mut place[row as usize];
                if *at >= first && *at < values.len() {
                    values[*at] += value;
                } else {
                    *at = values.len();
                    rows.push(row as usize);
                    values.push(value);
                }
            }
            let mut column: Vec<(usize, f64)> = std::iter::zip(&rows[first..], &values[first..])
                .map(|(r, v)| (*r, *v))
                .collect();
            column.sort_unstable_by_key(|entry| entry.0);
            for (k, (row, value)) in column.into_iter().enumerate() {
                (rows[first + k], values[first + k]) = (row, value);
            }
            ends.push(rows.len());
        }
        let pattern = SymbolicSparseColMat::new_checked(self.size, self.size, ends, None, rows);
        SparseColMat::new(pattern, values)
    }
}

/// About the nanoseconds that factoring a mesh's matrix with this many rows takes: planar meshes fill in like n √n.
fn factor_work(rows: usize) -> u64 {
    (rows as f64 * (1500.0 + 17.0 * (rows as f64).sqrt())) as u64
}

/// The Cholesky factor of a [`Symmetric`].
pub(crate) struct Factor {
    llt: Llt<usize, f64>,
    size: usize,
}

impl Factor {
    /// About the nanoseconds that solving for `columns` right-hand sides takes.
    pub fn solve_work(&self, columns: usize) -> u64 {
        let rows = self.size as f64;
        (columns as f64 * rows * (20.0 + 0.5 * rows.sqrt())) as u64
    }

    /// Solves for K right-hand sides at once, in place: `rhs[i]` holds row i of all of them.
    ///
    /// # Errors
    /// `NotPositive` when the solution is not finite.
    pub fn solve<const K: usize>(&self, rhs: &mut [[f64; K]]) -> Result<(), SolveError> {
        let x = MatMut::from_row_major_slice_mut(rhs.as_flattened_mut(), self.size, K);
        self.llt.solve_in_place_with_conj(Conj::No, x);
        if rhs.iter().flatten().all(|x| x.is_finite()) {
            Ok(())
        } else {
            Err(SolveError::NotPositive)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vertices_of_a_chain_of_springs_are_evenly_spaced() {
        let mut springs = Symmetric::zero(3);
        springs.add(0, 0, 1.0);
        springs.add_spring(0, 1, 1.0);
        springs.add_spring(1, 2, 1.0);
        springs.add(2, 2, 1.0);
        let mut x = [[0.0], [0.0], [4.0]];
        springs
            .factor(Budget::unlimited())
            .unwrap()
            .solve(&mut x)
            .unwrap();
        for (got, want) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((got[0] - want).abs() < 1e-12);
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        let mut m = Symmetric::zero(2);
        m.add(0, 0, -1.0);
        m.add(1, 1, 1.0);
        assert!(m.factor(Budget::unlimited()).is_err());
    }
}
