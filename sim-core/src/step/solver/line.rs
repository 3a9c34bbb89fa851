//! The cost along a segment, and its exact minimum.

use super::super::ConstantsOf;
use super::contacts;
use super::rows::{Law, dry_friction, equality, one_sided};
use crate::lane::{Cx, Num, Real};
use crate::model::constants::Constants;
use crate::{break_if, times};

/// The cost p along the segment from `a` (α = 0) to the minimum of its quadratic model (α = 1).
///
/// ```text
/// p'(α) = -(1 - α) d + Σ (f(model) - f) jv        d = -p'(0) = sᵀ M s + Σ W jv²
/// ```
///
/// Rows that stay on their piece of cost follow the model, and add nothing.
pub(super) struct Line<'a, F> {
    /// -p'(0), what the model says of the gain at α = 1, twice.
    pub descent: F,
    /// The gain that rounding alone may promise.
    ///
    /// Of a correction: ½ gᵀ H⁻¹ g of a gradient g that is but the rounding of jar in Jᵀ W jar and of τ, hence at most about
    /// ε² (Σ W (|J a| + |aref|)² + |τ a|). Else, where each round solves for the whole minimum, the rounding of p'.
    pub noise: F,
    weight: &'a [F],
    jar: &'a [F],
    jv: &'a [F],
}

/// First and second derivative of the cost along a line, and the size of the terms of the first.
struct Derivative<F> {
    slope: F,
    curvature: F,
    size: F,
}

impl<'a, F: Num> Line<'a, F> {
    /// `curvature` is sᵀ M s; `jar` and its change `jv` over the segment are `(rows)`, `power` is |τ a|.
    ///
    /// Turns what contacts have ahead into its change.
    #[inline(always)]
    pub fn new<C: Cx<F = F>>(
        cx: &mut C,
        m: &Constants<F::Real>,
        curvature: F,
        weight: &'a [F],
        jar: &'a [F],
        jv: &'a [F],
        aref: &[F],
        power: F,
    ) -> Self {
        let corrects = !m.contacts.classes.is_empty();
        let epsilon = F::c(<F::Real as Real>::EPSILON);
        let mut descent = curvature;
        let mut terms = if corrects { power } else { curvature };
        for r in 0..m.rows() {
            let law = law(m, r, jar[r], weight[r]);
            descent = (law.stiffness * jv[r]).fma(jv[r], descent);
            terms = if corrects {
                let rounded = (jar[r] + aref[r]).abs() + aref[r].abs();
                (law.stiffness * rounded).fma(rounded, terms)
            } else {
                terms + (law.force * jv[r]).abs()
            };
        }
        let (mut descent, mut terms) = (cx.var(descent), cx.var(terms));
        contacts::begin_line(cx, &m.contacts, &mut descent, &mut terms);
        let rounding = if corrects { epsilon * epsilon } else { epsilon };
        Line {
            descent: cx.get(&descent),
            noise: cx.get(&terms) * rounding,
            weight,
            jar,
            jv,
        }
    }

    #[inline(always)]
    fn derivative<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        m: &Constants<F::Real>,
        alpha: F,
    ) -> Derivative<F> {
        let rest = F::c(1.0) - alpha;
        let slope = -(rest * self.descent);
        let mut d = Derivative {
            slope,
            curvature: self.descent,
            size: slope.abs(),
        };
        // equalities have one piece only
        for r in m.equalities.len()..m.rows() {
            let (jv, weight) = (self.jv[r], self.weight[r]);
            let start = law(m, r, self.jar[r], weight);
            let here = law(m, r, alpha.fma(jv, self.jar[r]), weight);
            let model = (start.stiffness * alpha).fnma(jv, start.force);
            // exactly nothing where the piece is the same, whatever rounding says
            let moved = F::c(0.5).lt((here.state - start.state).abs());
            let power = F::select(moved, (model - here.force) * jv, F::c(0.0));
            d.slope = d.slope + power;
            d.size = d.size + power.abs();
            d.curvature = ((here.stiffness - start.stiffness) * jv).fma(jv, d.curvature);
        }
        let mut slope = cx.var(d.slope);
        let mut curvature = cx.var(d.curvature);
        let mut size = cx.var(d.size);
        let t = &m.contacts;
        contacts::derivative(cx, t, alpha, &mut slope, &mut curvature, &mut size);
        Derivative {
            slope: cx.get(&slope),
            curvature: cx.get(&curvature),
            size: cx.get(&size),
        }
    }
}

/// The law of a row by its number.
#[inline(always)]
fn law<F: Num>(m: &Constants<F::Real>, r: usize, jar: F, weight: F) -> Law<F> {
    let frictions = m.equalities.len();
    let limits = frictions + m.frictions.len();
    if r < frictions {
        equality(jar, weight)
    } else if r < limits {
        let friction = &m.frictions[r - frictions];
        dry_friction(jar, weight, F::k(friction.zone), F::k(friction.loss))
    } else {
        one_sided(jar, weight)
    }
}

/// Slope over that at the start below which a search ends in `f32`: MuJoCo's `ls_tolerance`. The next round finds the rest.
const SLACK: f64 = 0.01;

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
    let slack = if <<C::F as Num>::Real as Real>::DOUBLE {
        0.0
    } else {
        SLACK
    };
    let mut low = cx.var(zero);
    let mut high = cx.var(C::F::c(1.0e10));
    times!(cx, m.solver.ls_iterations, {
        let alpha = cx.get(length);
        let d = line.derivative(cx, m, alpha);
        let below = C::F::select(d.slope.lt(zero), alpha, cx.get(&low));
        let above = C::F::select(d.slope.lt(zero), cx.get(&high), alpha);
        let close = (d.size * resolution).max(line.descent * C::F::c(slack));
        let found = C::F::not(close.lt(d.slope.abs()));
        break_if!(cx, C::F::or(found, (above - below).lt(above * resolution)));
        cx.set(&mut low, below);
        cx.set(&mut high, above);
        let newton = alpha - d.slope.div(d.curvature);
        let inside = C::F::and(below.lt(newton), newton.lt(above));
        let middle = C::F::c(0.5) * (below + above);
        cx.set(length, C::F::select(inside, newton, middle));
    });
}
