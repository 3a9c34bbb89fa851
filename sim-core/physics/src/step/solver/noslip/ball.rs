//! The least of a quadratic in a ball (MuJoCo: `mju_QCQP`).
//!
//! ```text
//! ½ yᵀ P y + q · y,  |y| ≤ r:      y = -(P + λ)⁻¹ q      λ ≥ 0 with |y| = r, or 0 where y lies inside
//! ```
//!
//! λ is the root of |y|² - r² by Newton's method: λ += (|y|² - r²) / (2 yᵀ (P + λ)⁻¹ y).

use crate::lane::{Cx, Num};
use crate::{break_if, times};

/// Most iterations, as in MuJoCo.
const ITERATIONS: usize = 20;
/// Least determinant, least pivot of more than three directions, excess of |y|² and step of λ, as in MuJoCo.
const SMALL: f64 = 1e-10;
/// Least |y|² that is scaled to the sphere (MuJoCo: `mjMINVAL`).
const SQUARE_MIN: f64 = 1e-15;

/// A quadratic of up to five directions.
#[derive(Clone, Copy)]
pub(super) struct Problem<F> {
    /// How many directions are in use.
    pub size: usize,
    /// P; the identity for directions that do not exist.
    pub matrix: [[F; 5]; 5],
    /// q.
    pub vector: [F; 5],
    /// 1 for directions that exist, else 0.
    pub exists: [F; 5],
}

impl<F: Num> Problem<F> {
    /// All zero.
    #[inline(always)]
    pub fn empty(size: usize) -> Problem<F> {
        let zero = F::c(0.0);
        Problem {
            size,
            matrix: [[zero; 5]; 5],
            vector: [zero; 5],
            exists: [zero; 5],
        }
    }
}

/// A factor of P + λ: L below the diagonal, 1/D on it.
struct Factor<F: Num> {
    size: usize,
    entries: [[F; 5]; 5],
    singular: F::Mask,
}

impl<F: Num> Factor<F> {
    #[inline(always)]
    fn new(problem: &Problem<F>, shift: F) -> Factor<F> {
        let (zero, one, size) = (F::c(0.0), F::c(1.0), problem.size);
        let mut l = problem.matrix;
        // the determinant and the least pivot, of directions that exist
        let (mut determinant, mut least, mut count) = (one, one, zero);
        for i in 0..size {
            // D(i) = P(i,i) + λ - Σ (L D)(i,k)² / D(k)
            let mut pivot = l[i][i] + shift;
            for k in 0..i {
                pivot = (l[i][k] * l[i][k]).fnma(l[k][k], pivot);
            }
            let has = zero.lt(problem.exists[i]);
            determinant = determinant * F::select(has, pivot, one);
            least = least.min(F::select(has, pivot, one));
            count = count + problem.exists[i];
            // 1/D; singular systems are not used
            let divisor = F::select(zero.lt(pivot), pivot, one);
            let inverse = one.div(divisor);
            // (L D)(j,i) = P(j,i) - Σ (L D)(j,k) L(i,k)
            for j in i + 1..size {
                let mut entry = l[j][i];
                for k in 0..i {
                    entry = (l[j][k] * l[i][k]).fnma(l[k][k], entry);
                }
                l[j][i] = entry;
            }
            l[i][i] = inverse;
        }
        // up to three directions are judged by the determinant
        let small = F::c(SMALL);
        let many = F::c(3.5).lt(count);
        let measure = F::select(many, least, determinant.min(F::c(1.0)));
        Factor {
            size,
            entries: l,
            singular: measure.lt(small) | !zero.lt(least),
        }
    }

    /// Replaces x by (P + λ)⁻¹ x. Below the diagonal are the entries of L D.
    #[inline(always)]
    fn solve(&self, x: &mut [F; 5]) {
        let l = &self.entries;
        // L D z = x, then Lᵀ y = z
        for i in 0..self.size {
            for k in 0..i {
                x[i] = l[i][k].fnma(x[k], x[i]);
            }
            x[i] = x[i] * l[i][i];
        }
        for i in (0..self.size).rev() {
            for k in i + 1..self.size {
                x[i] = (l[k][i] * l[i][i]).fnma(x[k], x[i]);
            }
        }
    }
}

/// The least in a ball of this radius; 0 where P is singular.
#[inline(always)]
pub(super) fn least<C: Cx>(cx: &mut C, problem: &Problem<C::F>, radius: C::F) -> [C::F; 5] {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let small = C::F::c(SMALL);
    let size = problem.size;
    let mut lambda = cx.var(zero);
    // variables of their own: a copy would be the same one where code is recorded
    let mut cells = [
        cx.var(zero),
        cx.var(zero),
        cx.var(zero),
        cx.var(zero),
        cx.var(zero),
    ];
    times!(cx, ITERATIONS, {
        let factor = Factor::new(problem, cx.get(&lambda));
        // y = -(P + λ)⁻¹ q, and how far outside it is
        let mut y = [zero; 5];
        for i in 0..size {
            y[i] = -problem.vector[i];
        }
        factor.solve(&mut y);
        let mut square = zero;
        for i in 0..size {
            y[i] = C::F::select(factor.singular, zero, y[i]);
            square = y[i].fma(y[i], square);
            cx.set(&mut cells[i], y[i]);
        }
        let excess = radius.fnma(radius, square);
        // yᵀ (P + λ)⁻¹ y, and the step of λ
        let mut other = y;
        factor.solve(&mut other);
        let mut bend = zero;
        for i in 0..size {
            bend = other[i].fma(y[i], bend);
        }
        let outside = !excess.lt(small) & !factor.singular & zero.lt(bend);
        let step = excess.div(C::F::select(outside, bend + bend, one));
        let moves = outside & !step.lt(small);
        let next = cx.get(&lambda) + C::F::select(moves, step, zero);
        // a singular system ends at 0, and is not on the sphere
        let next = C::F::select(factor.singular, zero, next);
        cx.set(&mut lambda, next);
        break_if!(cx, !moves);
    });
    // on the sphere exactly, where λ > 0
    let mut y = [zero; 5];
    let mut square = zero;
    for i in 0..size {
        y[i] = cx.get(&cells[i]);
        square = y[i].fma(y[i], square);
    }
    let onto = (radius * radius)
        .div(square.max(C::F::c(SQUARE_MIN)))
        .sqrt();
    let is_on = zero.lt(cx.get(&lambda));
    for x in &mut y[..size] {
        *x = *x * C::F::select(is_on, onto, one);
    }
    y
}
