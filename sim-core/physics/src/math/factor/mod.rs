//! Sparse symmetric factor A = Lᵀ D L, and solve (Featherstone 2008, section 6.5).
//!
//! Elimination runs from the last dof to the first, so that a tree makes no fill. The pattern is fixed when the model is
//! compiled: independent parts of the scene are blocks, each a packed lower triangle or the paths of a tree. A solve
//! eliminates the right-hand side along with the matrix. There are three kernels, which do the same operations in the same
//! order, but for products with zeros, which change at most the sign of a zero:
//!
//! - [`dense`]: small full blocks, such as an arm, unrolled,
//! - [`tree`]: trees, unrolled along their paths,
//! - [`general`]: other blocks, three rows at a time, by the runs of their columns.
//!
//! [`rows`] is for matrices that few worlds factor. [`update`] has the rows that rank-one updates reach; the solver makes them.

mod dense;
mod general;
mod pattern;
mod rows;
mod tree;
mod update;

pub use pattern::Pattern;
pub use update::UpdatePath;

use crate::lane::Num;
use pattern::{Block, Kind};

/// Place of entry (row, column) with column ≤ row in a packed lower triangle.
#[inline(always)]
const fn tri(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// Replaces x by A⁻¹ x, and A by its factor: L below the diagonal, 1/D on it. Zeros that a general block keeps must be 0.
#[inline(always)]
pub fn solve<F: Num>(pattern: &Pattern, a: &mut [F], x: &mut [F]) {
    for block in pattern.blocks() {
        let (a, x) = (block.of_matrix(a), &mut x[block.range()]);
        match block.kind {
            Kind::Dense | Kind::Tree => tree::solve(pattern, block, a, x),
            Kind::General => general::solve(pattern, block, a, x),
        }
    }
}

/// Replaces A by its factor, as [`solve`] leaves it.
#[inline(always)]
pub fn decompose<F: Num>(pattern: &Pattern, a: &mut [F]) {
    for block in pattern.blocks() {
        rows::decompose(pattern, block, block.of_matrix(a));
    }
}

/// Replaces x by A⁻¹ x, for the factor of A.
#[inline(always)]
pub fn substitute<F: Num>(pattern: &Pattern, factor: &[F], x: &mut [F]) {
    for block in pattern.blocks() {
        let x = &mut x[block.range()];
        rows::substitute(pattern, block, block.of_matrix_ref(factor), x);
    }
}

/// 1/D of a pivot; 0 for one that is not positive, of which rounding has left nothing. Its unknown is then the coupling to
/// others alone.
#[inline(always)]
pub(crate) fn inverse<F: Num>(pivot: F) -> F {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    F::select(zero.lt(pivot), one.div(pivot), zero)
}

/// y = A x for a packed symmetric A.
#[inline(always)]
pub fn multiply<F: Num>(pattern: &Pattern, a: &[F], x: &[F], y: &mut [F]) {
    for block in pattern.blocks() {
        let (a, x, y) = (
            block.of_matrix_ref(a),
            &x[block.range()],
            &mut y[block.range()],
        );
        match block.kind {
            Kind::Dense => dense::multiply(block.size, a, x, y),
            Kind::Tree => tree::multiply(pattern, block, a, x, y),
            Kind::General => general::multiply(pattern, block, a, x, y),
        }
    }
}

impl Block {
    #[inline(always)]
    fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.size
    }
    #[inline(always)]
    fn of_matrix<'a, F>(&self, a: &'a mut [F]) -> &'a mut [F] {
        &mut a[self.offset..self.offset + self.len]
    }
    #[inline(always)]
    fn of_matrix_ref<'a, F>(&self, a: &'a [F]) -> &'a [F] {
        &a[self.offset..self.offset + self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The order of operations that all kernels keep: one row after another, by the runs of its columns.
    fn solve_by_rows(pattern: &Pattern, block: &Block, a: &mut [f64], x: &mut [f64]) {
        for k in (0..block.size).rev() {
            let columns: Vec<usize> = (pattern.runs(block, k).iter())
                .flat_map(|run| run.start..run.end)
                .collect();
            let pivot = inverse(a[tri(k, k)]);
            a[tri(k, k)] = pivot;
            for (n, &i) in columns.iter().enumerate().rev() {
                let share = a[tri(k, i)] * pivot;
                for &j in &columns[..n + 1] {
                    a[tri(i, j)] = share.fnma(a[tri(k, j)], a[tri(i, j)]);
                }
                a[tri(k, i)] = share;
            }
            for &i in &columns {
                x[i] = x[k].fnma(a[tri(k, i)], x[i]);
            }
            x[k] *= pivot;
        }
        for k in 0..block.size {
            for i in pattern
                .runs(block, k)
                .iter()
                .flat_map(|run| run.start..run.end)
            {
                x[k] = a[tri(k, i)].fnma(x[i], x[k]);
            }
        }
    }

    /// A x = b for a matrix of the pattern, against the matrix itself.
    fn check(size: usize, entries: &[(usize, usize)]) {
        let pattern = Pattern::new(size, entries.iter().copied());
        let mut a = vec![0.0; pattern.len()];
        for &(i, j) in entries {
            a[pattern.at(i.max(j), i.min(j))] = ((i * 7 + j * 3) as f64).sin();
        }
        for k in 0..size {
            a[pattern.at(k, k)] = 20.0 + k as f64;
        }
        let x: Vec<f64> = (0..size).map(|k| (k as f64).cos()).collect();
        let mut b = vec![0.0; size];
        multiply(&pattern, &a, &x, &mut b);
        for i in 0..size {
            let row = (0..size).filter_map(|j| pattern.find(i, j).map(|at| a[at] * x[j]));
            assert!((row.sum::<f64>() - b[i]).abs() < 1e-12, "row {i} of A x");
        }
        let mut factor = a.clone();
        decompose(&pattern, &mut factor);
        let mut by_factor = b.clone();
        substitute(&pattern, &factor, &mut by_factor);
        solve(&pattern, &mut a, &mut b);
        // the same bits, but for the sign of a zero
        assert_eq!((factor, by_factor), (a, b.clone()));
        for (got, expected) in b.iter().zip(&x) {
            assert!((got - expected).abs() < 1e-13, "{got}, expected {expected}");
        }
    }

    fn full(size: usize) -> Vec<(usize, usize)> {
        (0..size)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .collect()
    }

    #[test]
    fn full_matrices_of_every_size_solve() {
        for size in 1..=20 {
            check(size, &full(size));
        }
    }

    #[test]
    fn branching_tree_with_a_loop_and_a_second_block_solves() {
        // two legs on a trunk, a coupling between the legs, and another robot behind
        check(
            9,
            &[
                (1, 0),
                (2, 0),
                (2, 1),
                (3, 0),
                (4, 0),
                (4, 3),
                (4, 2),
                (6, 5),
                (7, 5),
                (8, 6),
                (8, 5),
            ],
        );
    }

    /// A trunk of 3 with legs of 1 to 4 and of 20, and another tree.
    fn two_trees() -> (usize, Vec<(usize, usize)>) {
        let mut entries = full(3);
        let mut size = 3;
        for length in [1, 2, 3, 4, 20] {
            for k in size..size + length {
                entries.extend((0..3).chain(size..k).map(|i| (k, i)));
            }
            size += length;
        }
        entries.extend([(size + 1, size), (size + 2, size)]);
        (size + 3, entries)
    }

    #[test]
    fn trees_solve_and_are_kept_without_their_zeros() {
        let (size, entries) = two_trees();
        let pattern = Pattern::new(size, entries.iter().copied());
        assert!(
            pattern
                .blocks()
                .iter()
                .all(|block| block.kind == Kind::Tree)
        );
        assert_eq!(pattern.len(), entries.len() + size);
        check(size, &entries);
    }

    #[test]
    fn a_general_block_has_no_entry_that_it_never_visits() {
        // two branches, of which the ends of one and the start of the other are coupled
        let entries = [(1, 0), (2, 0), (2, 1), (3, 0), (4, 0), (4, 3), (3, 2)];
        let pattern = Pattern::new(5, entries);
        assert_eq!(pattern.blocks()[0].kind, pattern::Kind::General);
        assert!(pattern.has(2, 3) && !pattern.has(4, 1) && pattern.find(4, 1).is_some());
        check(5, &entries);
    }

    #[test]
    fn trees_equal_single_rows_bit_for_bit() {
        let (size, entries) = two_trees();
        let pattern = Pattern::new(size, entries.iter().copied());
        let value = |i: usize, j: usize| match i == j {
            true => 40.0 + i as f64,
            false => ((i * 7 + j * 3) as f64).sin(),
        };
        for block in pattern.blocks() {
            let mut kept = vec![0.0; block.len];
            let mut packed = vec![0.0; tri(block.size, 0)];
            let rows = || (0..block.size).flat_map(|i| (0..=i).map(move |j| (i, j)));
            let place = |i, j| Some(pattern.find(block.first + i, block.first + j)? - block.offset);
            for (i, j) in rows() {
                if let Some(at) = place(i, j) {
                    (kept[at], packed[tri(i, j)]) = (value(i, j), value(i, j));
                }
            }
            let b: Vec<f64> = (0..block.size).map(|k| k as f64 + 0.3).collect();
            let (mut x, mut y) = (b.clone(), b);
            tree::solve(&pattern, block, &mut kept, &mut x);
            solve_by_rows(&pattern, block, &mut packed, &mut y);
            assert_eq!(x, y);
            for (i, j) in rows() {
                if let Some(at) = place(i, j) {
                    assert_eq!(kept[at], packed[tri(i, j)], "({i}, {j})");
                }
            }
        }
    }

    #[test]
    fn tiles_of_general_blocks_equal_single_rows_bit_for_bit() {
        let mut general = 0;
        for size in 2..=40 {
            // paths of a tree, and couplings between branches
            let entries = (1..size).flat_map(|k: usize| {
                [
                    (k, k / 2),
                    (k, k * 3 % 7 % k),
                    (k, (k - 1).saturating_sub(k % 2)),
                ]
            });
            let pattern = Pattern::new(size, entries);
            for block in pattern.blocks() {
                if block.kind != Kind::General {
                    continue;
                }
                general += 1;
                let mut a = vec![0.0; block.len];
                for k in 0..block.size {
                    a[tri(k, k)] = 60.0 + k as f64;
                    for i in (0..k).filter(|&i| pattern.has(block.first + k, block.first + i)) {
                        a[tri(k, i)] = ((k * 7 + i * 3) as f64).sin();
                    }
                }
                let b: Vec<f64> = (0..block.size).map(|k| k as f64 - 3.7).collect();
                let (mut by_rows, mut x, mut y) = (a.clone(), b.clone(), b);
                general::solve(&pattern, block, &mut a, &mut x);
                solve_by_rows(&pattern, block, &mut by_rows, &mut y);
                assert_eq!((a, x), (by_rows, y), "{size} rows");
            }
        }
        assert!(general > 20, "{general} general blocks");
    }

    #[test]
    fn unrolled_equals_single_rows_bit_for_bit() {
        for size in 1..=dense::LARGEST {
            let entries = full(size);
            let pattern = Pattern::new(size, entries.iter().copied());
            let mut a: Vec<f64> = (0..pattern.len()).map(|k| (k as f64 * 0.7).sin()).collect();
            for k in 0..size {
                a[pattern.at(k, k)] = 10.0;
            }
            let block = &pattern.blocks()[0];
            assert_eq!(block.kind, Kind::Dense);
            let (mut unrolled, mut looped) = (a.clone(), a.clone());
            let b: Vec<f64> = (0..size).map(|k| k as f64 + 0.3).collect();
            let (mut x, mut y) = (b.clone(), b);
            tree::solve(&pattern, block, &mut unrolled, &mut x);
            solve_by_rows(&pattern, block, &mut looped, &mut y);
            assert_eq!(unrolled, looped);
            assert_eq!(x, y);
            let (mut p, mut q) = (vec![0.0; size], vec![0.0; size]);
            dense::multiply(size, &a, &x, &mut p);
            general::multiply(&pattern, block, &a, &x, &mut q);
            assert_eq!(p, q);
        }
    }
}
