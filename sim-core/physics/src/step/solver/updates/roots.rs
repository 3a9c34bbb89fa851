//! W of a contact as a sum of products of vectors.

use super::super::contacts::{ContactsOf, only};
use crate::constants::contact::{Cone, row};
use crate::lane::{Cx, Num};

/// W of a contact as a sum of products: the normal row first, then directions of friction.
///
/// ```text
/// elliptic:     s = Σ slope(k) J(k) over friction        v(0) = J(0) - slope(0) s        v(k) = J(k) - slope(k) s
/// pyramidal:    v(0) = J(0)                              v(k) = μ J(k) + slope(k) J(0),  μ = slope(0)
/// ```
pub(super) struct Roots<F, const N: usize> {
    pub weights: [F; N],
    slopes: [F; N],
}

impl<F: Num, const N: usize> Roots<F, N> {
    /// Of the piece that a contact is on in the model, whose W is taken at a residual; `stiff` is D of each direction.
    #[inline(always)]
    pub fn of_contact<C: Cx<F = F>>(
        cx: &mut C,
        t: &ContactsOf<C>,
        r: C::I,
        jar: [F; N],
        stiff: [F; N],
    ) -> Self {
        let mu = cx.load(t.memory.rows, r, row::MU);
        match t.cone {
            Cone::Elliptic => {
                let soft = cx.load(t.memory.rows, r, row::SOFT);
                let state = cx.load(t.memory.rows, r, row::STATE);
                let across = stiff[0] * F::k(t.impratio);
                Roots::elliptic(jar, state, [stiff[0], across, soft, mu])
            }
            Cone::Pyramidal => Roots::pyramidal(jar, stiff, mu),
        }
    }

    /// Of an elliptic cone. Where it sticks (`state` 1), W is `stiff` along the normal and `across` in each direction of friction. Where
    /// it slides (2), W is soft (1, -μ d)(1, -μ d)ᵀ + turn (1 - d dᵀ) with the slip direction d, as in `cones::elliptic`.
    #[inline(always)]
    pub fn elliptic(jar: [F; N], state: F, [stiff, across, soft, mu]: [F; 4]) -> Self {
        let (zero, half, one) = (F::c(0.0), F::c(0.5), F::c(1.0));
        let slides = F::c(1.5).lt(state);
        let sticks = half.lt(state) & !slides;
        // slip t, and the push of a contact that slides, -soft (jar₀ - μ t)
        let mut square = zero;
        for x in &jar[1..] {
            square = x.fma(*x, square);
        }
        let slip = square.sqrt();
        let inverse = one.div(F::select(zero.lt(slip), slip, one));
        let push = -(soft * mu.fnma(slip, jar[0]));
        let turn = (push * mu) * inverse;
        // by the piece: sticking, sliding, separated
        let friction = F::select(sticks, across, F::select(slides, turn, zero));
        let mut weights = [friction; N];
        weights[0] = F::select(sticks, stiff, F::select(slides, soft, zero));
        let mut slopes = [F::select(slides, mu, zero); N];
        for k in 1..N {
            slopes[k] = F::select(slides, jar[k] * inverse, zero);
        }
        Roots { weights, slopes }
    }

    /// Of a pyramid at a residual; `stiff` is that of the edges of each direction of friction.
    ///
    /// Two edges J(0) ± μ J(k) that both push add up to 2 D J(0) J(0)ᵀ and 2 D μ² J(k) J(k)ᵀ.
    #[inline(always)]
    pub fn pyramidal(jar: [F; N], stiff: [F; N], mu: F) -> Self {
        let (zero, one) = (F::c(0.0), F::c(1.0));
        let mut roots = Roots {
            weights: [zero; N],
            slopes: [mu; N],
        };
        for k in 1..N {
            // 1 for an edge that pushes
            let side = mu * jar[k];
            let first = F::select(zero.lt(-(stiff[k] * (jar[0] + side))), one, zero);
            let second = F::select(zero.lt(-(stiff[k] * (jar[0] - side))), one, zero);
            roots.weights[0] = roots.weights[0] + F::c(2.0) * stiff[k] * (first * second);
            roots.weights[k] = stiff[k] * (first + second);
            roots.slopes[k] = first - second;
        }
        roots
    }

    /// In the active worlds, 0 elsewhere.
    #[inline(always)]
    pub fn only<C: Cx<F = F>>(self, cx: &mut C) -> Self {
        Roots {
            weights: only(cx, self.weights),
            slopes: only(cx, self.slopes),
        }
    }

    /// The vectors in a column of J.
    #[inline(always)]
    pub fn vectors(&self, cone: Cone, column: [F; N]) -> [F; N] {
        let mut v = column;
        match cone {
            Cone::Elliptic => {
                let mut slip = F::c(0.0);
                for k in 1..N {
                    slip = self.slopes[k].fma(column[k], slip);
                }
                for k in 0..N {
                    v[k] = self.slopes[k].fnma(slip, column[k]);
                }
            }
            Cone::Pyramidal => {
                for k in 1..N {
                    v[k] = self.slopes[k].fma(column[0], self.slopes[0] * column[k]);
                }
            }
        }
        v
    }
}
