//! Sparse symmetric factor A = Lᵀ D L, and solve (Featherstone 2008, section 6.5).
//!
//! Elimination runs from the last dof to the first, so that a tree makes no fill. The pattern is fixed
//! when the model is compiled: independent parts of the scene are blocks of their own, each a packed
//! lower triangle, or the paths of a tree. Small full blocks, such as an arm, run unrolled ([`dense`]), as
//! do trees ([`tree`]); the others follow the runs of their rows ([`general`]). All do the same operations
//! in the same order.

mod dense;
mod general;
mod pattern;
mod tree;

pub use pattern::Pattern;

use crate::lane::Num;
use pattern::{Block, Kind};

/// Place of entry (row, column) with column ≤ row in a packed lower triangle.
#[inline(always)]
const fn tri(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// Replaces A by its factor: L below the diagonal, 1/D on it.
#[inline(always)]
pub fn factor<F: Num>(pattern: &Pattern, a: &mut [F]) {
    for block in pattern.blocks() {
        let a = block.of_matrix(a);
        match block.kind {
            Kind::Dense => dense::factor(block.size, a),
            Kind::Tree => tree::factor(pattern, block, a),
            Kind::General => general::factor(pattern, block, a),
        }
    }
}

/// Replaces x by A⁻¹ x, from the factor.
#[inline(always)]
pub fn solve<F: Num>(pattern: &Pattern, factor: &[F], x: &mut [F]) {
    for block in pattern.blocks() {
        let (factor, x) = (block.of_matrix_ref(factor), &mut x[block.range()]);
        match block.kind {
            Kind::Dense => dense::solve(block.size, factor, x),
            Kind::Tree => tree::solve(pattern, block, factor, x),
            Kind::General => general::solve(pattern, block, factor, x),
        }
    }
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
        factor(&pattern, &mut a);
        solve(&pattern, &a, &mut b);
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

    #[test]
    fn trees_solve_and_are_kept_without_their_zeros() {
        // a trunk of 3, legs of 2 and 20 on it, and another tree
        let mut entries = full(3);
        let legs = [vec![3, 4], (5..25).collect::<Vec<usize>>()];
        for leg in &legs {
            for (n, &k) in leg.iter().enumerate() {
                entries.extend((0..3).map(|i| (k, i)));
                entries.extend(leg[..n].iter().map(|&i| (k, i)));
            }
        }
        entries.extend([(26, 25), (27, 25)]);
        let pattern = Pattern::new(28, entries.iter().copied());
        assert!(
            pattern
                .blocks()
                .iter()
                .all(|block| block.kind == Kind::Tree)
        );
        assert_eq!(pattern.len(), entries.len() + 28);
        check(28, &entries);
    }

    #[test]
    fn unrolled_equals_general_bit_for_bit() {
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
            dense::factor(size, &mut unrolled);
            general::factor(&pattern, block, &mut looped);
            assert_eq!(unrolled, looped);
            let b: Vec<f64> = (0..size).map(|k| k as f64 + 0.3).collect();
            let (mut x, mut y) = (b.clone(), b);
            dense::solve(size, &unrolled, &mut x);
            general::solve(&pattern, block, &looped, &mut y);
            assert_eq!(x, y);
            let (mut p, mut q) = (vec![0.0; size], vec![0.0; size]);
            dense::multiply(size, &a, &x, &mut p);
            general::multiply(&pattern, block, &a, &x, &mut q);
            assert_eq!(p, q);
        }
    }
}
