//! The cost along a segment, and its exact minimum.

use super::super::ConstantsOf;
use super::rows::{dry_friction, equality, one_sided};
use crate::lane::{Cx, Num, Real};
use crate::model::constants::Constants;
use crate::{break_if, times};

/// The cost along a segment.
pub(super) struct Line<'a, F> {
    /// Slope of the smooth part at α = 0.
    pub start: F,
    /// Its curvature.
    pub curvature: F,
    /// D of each row.
    pub weight: &'a [F],
    /// J a - aref of each row.
    pub jar: &'a [F],
    /// Its change over the whole segment.
    pub jv: &'a [F],
}

/// First and second derivative of the cost along a line, and the size of the terms they sum.
pub(super) struct Derivative<F> {
    pub slope: F,
    pub curvature: F,
    pub size: F,
}

impl<F: Num> Line<'_, F> {
    #[inline(always)]
    pub fn derivative(&self, m: &Constants<F::Real>, alpha: F) -> Derivative<F> {
        let smooth = self.curvature * alpha;
        let mut d = Derivative {
            slope: self.start + smooth,
            curvature: self.curvature,
            size: self.start.abs() + smooth.abs(),
        };
        let (frictions, limits) = (m.equalities.len(), m.equalities.len() + m.frictions.len());
        for r in 0..m.rows() {
            let (jv, weight) = (self.jv[r], self.weight[r]);
            let jar = alpha.fma(jv, self.jar[r]);
            let law = if r < frictions {
                equality(jar, weight)
            } else if r < limits {
                let friction = &m.frictions[r - frictions];
                dry_friction(jar, weight, F::k(friction.zone), F::k(friction.loss))
            } else {
                one_sided(jar, weight)
            };
            let power = law.force * jv;
            d.slope = d.slope - power;
            d.size = d.size + power.abs();
            d.curvature = (law.stiffness * jv).fma(jv, d.curvature);
        }
        d
    }
}

/// Safeguarded Newton on p'(α) = 0: the exact minimum on the segment, and beyond it.
#[inline(always)]
pub(super) fn search<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    line: &Line<'_, C::F>,
    length: &mut C::V,
) {
    let zero = C::F::c(0.0);
    let resolution = C::F::c(4.0 * <<C::F as Num>::Real as Real>::EPSILON);
    let mut low = cx.var(zero);
    let mut high = cx.var(C::F::c(1.0e10));
    times!(cx, m.solver.ls_iterations, {
        let alpha = cx.get(length);
        let d = line.derivative(m, alpha);
        let below = C::F::select(d.slope.lt(zero), alpha, cx.get(&low));
        let above = C::F::select(d.slope.lt(zero), cx.get(&high), alpha);
        let found = d.slope.abs().lt(d.size * resolution);
        break_if!(cx, C::F::or(found, (above - below).lt(above * resolution)));
        cx.set(&mut low, below);
        cx.set(&mut high, above);
        let newton = alpha - d.slope.div(d.curvature);
        let inside = C::F::and(below.lt(newton), newton.lt(above));
        let middle = C::F::c(0.5) * (below + above);
        cx.set(length, C::F::select(inside, newton, middle));
    });
}
