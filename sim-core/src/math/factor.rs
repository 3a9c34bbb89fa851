//! Sparse symmetric factor A = Lᵀ D L, and solve (Featherstone 2008, section 6.5).
//!
//! Elimination runs from the last dof to the first, so that a tree makes no fill.
//! The pattern is fixed when the model is compiled; numbers are packed lower triangles.

use crate::lane::Num;

/// Place of entry (row, column) with column ≤ row in a packed lower triangle.
#[inline(always)]
pub const fn tri(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// Which entries left of the diagonal may differ from zero, fill included. Columns rise in a row.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pattern {
    starts: Vec<usize>,
    columns: Vec<usize>,
}

impl Pattern {
    /// The pattern of a matrix with these off-diagonal entries (either triangle), with its fill.
    pub fn new(size: usize, entries: impl IntoIterator<Item = (usize, usize)>) -> Pattern {
        let mut rows = vec![std::collections::BTreeSet::new(); size];
        for (a, b) in entries {
            assert!(a < size && b < size, "entry ({a}, {b}) of a pattern of {size}");
            if a != b {
                rows[a.max(b)].insert(a.min(b));
            }
        }
        for k in (0..size).rev() {
            let row: Vec<usize> = rows[k].iter().copied().collect();
            for (n, &i) in row.iter().enumerate() {
                rows[i].extend(&row[..n]);
            }
        }
        let mut pattern = Pattern { starts: vec![0], columns: Vec::new() };
        for row in rows {
            pattern.columns.extend(row);
            pattern.starts.push(pattern.columns.len());
        }
        pattern
    }

    /// Number of rows.
    #[inline(always)]
    pub fn size(&self) -> usize {
        self.starts.len() - 1
    }

    /// Columns of a row left of the diagonal, rising.
    #[inline(always)]
    pub fn row(&self, k: usize) -> &[usize] {
        &self.columns[self.starts[k]..self.starts[k + 1]]
    }
}

/// Replaces A by its factor: L below the diagonal, 1/D on it.
#[inline(always)]
pub fn factor<F: Num>(pattern: &Pattern, a: &mut [F]) {
    let one = F::c(1.0);
    for k in (0..pattern.size()).rev() {
        let inverse = one.div(a[tri(k, k)]);
        let row = pattern.row(k);
        for n in (0..row.len()).rev() {
            let i = row[n];
            let l = a[tri(k, i)] * inverse;
            for &j in &row[..=n] {
                a[tri(i, j)] = l.fnma(a[tri(k, j)], a[tri(i, j)]);
            }
            a[tri(k, i)] = l;
        }
        a[tri(k, k)] = inverse;
    }
}

/// Replaces x by A⁻¹ x, from the factor.
#[inline(always)]
pub fn solve<F: Num>(pattern: &Pattern, factor: &[F], x: &mut [F]) {
    for k in (0..pattern.size()).rev() {
        let xk = x[k];
        for &i in pattern.row(k) {
            x[i] = factor[tri(k, i)].fnma(xk, x[i]);
        }
    }
    for k in 0..pattern.size() {
        let mut xk = x[k] * factor[tri(k, k)];
        for &i in pattern.row(k) {
            xk = factor[tri(k, i)].fnma(x[i], xk);
        }
        x[k] = xk;
    }
}

/// y = A x for a packed symmetric A.
#[inline(always)]
pub fn multiply<F: Num>(pattern: &Pattern, a: &[F], x: &[F], y: &mut [F]) {
    for k in 0..pattern.size() {
        let mut yk = a[tri(k, k)] * x[k];
        for &i in pattern.row(k) {
            let e = a[tri(k, i)];
            yk = e.fma(x[i], yk);
            y[i] = e.fma(x[k], y[i]);
        }
        y[k] = yk;
    }
}
