//! The cost along a segment, and its exact minimum.

use super::contacts::{self, LineStart};
use super::own_rows::OwnRow;
use super::rows::{Acting, Law, bounds, dry_friction, equality, one_sided};
use super::ties;
use crate::arrays::Workspace;
use crate::constants::Constants;
use crate::lane::{Cx, Num, Real};
use crate::step::ConstantsOf;
use crate::{break_if, times};

/// The cost p along the segment from `a` (α = 0) to the minimum of its quadratic model (α = 1).
///
/// ```text
/// p'(α) = -(1 - α) d + Σ (f(model) - f) jv        d = -p'(0) = sᵀ M s + Σ W jv²
/// ```
///
/// Rows that stay on their piece of cost follow the model, and add nothing.
pub(super) struct Line<'a, F> {
    /// -p'(0): twice the gain at α = 1 that the model predicts.
    pub descent: F,
    /// The gain that rounding alone may predict.
    ///
    /// For a correction: ½ gᵀ H⁻¹ g of a gradient g that is only the rounding of jar in Jᵀ W jar and of τ, at most about
    /// ε² (Σ W (|J a| + |aref|)² + |τ a|). Where each iteration solves for the whole minimum: the rounding of p'.
    pub noise: F,
    /// p'(0), which is more than the model's where contacts are held.
    slope: F,
    /// Contacts that are held: 0 where the model is that of Newton's method.
    pub held: F,
    /// Has any world of the block contacts?
    touches: bool,
    acting: Acting,
    params: &'a [F],
    weight: &'a [F],
    jar: &'a [F],
    jv: &'a [F],
    /// The rows of joints, where several lanes share a world.
    lane_rows: &'a [OwnRow<F>],
}

/// What the rows add up to at the start of a line. No closure: one that the compiler keeps as a function has none of the
/// vector instructions of its caller.
struct Sums<F> {
    descent: F,
    size: F,
    terms: F,
}

impl<F: Num> Sums<F> {
    #[inline(always)]
    fn add(&mut self, law: Law<F>, jar: F, jv: F, aref: F) {
        // jvᵀ W jv; |f jv|, a term of p'; W (|J a| + |aref|)², for `Line::noise`
        self.descent = (law.stiffness * jv).fma(jv, self.descent);
        self.size = self.size + (law.force * jv).abs();
        let rounded = (jar + aref).abs() + aref.abs();
        self.terms = (law.stiffness * rounded).fma(rounded, self.terms);
    }
}

/// First and second derivative of the cost along a line, and the size of the terms of the first.
struct Derivative<F> {
    slope: F,
    curvature: F,
    size: F,
}

impl<'a, F: Num> Line<'a, F> {
    /// `curvature` is sᵀ M s, `power` is |τ a|, and `jar_minimum` has the change of `jar` over the segment. The worlds that
    /// `corrects` holds in have contacts; of these `AHEAD` becomes the change of `JAR`.
    #[inline(always)]
    #[expect(clippy::too_many_arguments)] // the parts of a line
    pub fn new<C: Cx<F = F>, const TURNS: bool>(
        cx: &mut C,
        m: &Constants<F::Real>,
        params: &'a [F],
        [curvature, power]: [F; 2],
        w: &'a Workspace<F>,
        lane_rows: &'a [OwnRow<F>],
        acting: Acting,
        corrects: Option<F::Mask>,
    ) -> Self {
        let (weight, aref) = (&w.row_weight, &w.row_aref);
        let (jar, jv) = (&w.jar, &w.jar_minimum);
        let epsilon = F::c(<F::Real as Real>::EPSILON);
        // sums over the rows at α = 0, on top of those of the smooth forces
        let mut sums = Sums {
            descent: curvature,
            size: curvature,
            terms: power,
        };
        let (frictions, limits) = (m.equalities.len(), m.equalities.len() + m.frictions.len());
        // joint rows in their order, then ties
        for r in 0..frictions {
            sums.add(equality(jar[r], weight[r]), jar[r], jv[r], aref[r]);
        }
        for (r, friction) in (frictions..limits).zip(&m.frictions) {
            let [zone, loss] = bounds(m, params, friction);
            let law = dry_friction(jar[r], weight[r], zone, loss);
            sums.add(law, jar[r], jv[r], aref[r]);
        }
        for run in acting.runs() {
            for r in limits + run.start..limits + run.end {
                sums.add(one_sided(jar[r], weight[r]), jar[r], jv[r], aref[r]);
            }
        }
        for (r, tie) in (m.joint_rows()..m.rows()).zip(&m.tie_of_row) {
            let law = ties::law(&m.ties[*tie].law, jar[r], weight[r]);
            sums.add(law, jar[r], jv[r], aref[r]);
        }
        let Sums {
            mut descent,
            size,
            terms,
        } = sums;
        // rounding of p'; in worlds that correct, the gain that rounding of the gradient promises
        let mut noise = size * epsilon;
        let (mut more, mut held) = (F::c(0.0), F::c(0.0));
        // contacts add to cells; held ones give the difference of the true slope and the model's
        if let Some(corrects) = corrects {
            let mut start = LineStart {
                descent: cx.var(descent),
                terms: cx.var(terms),
                more: cx.var(more),
                held: cx.var(held),
            };
            contacts::begin_line::<_, TURNS>(cx, &m.contacts, &mut start);
            descent = cx.get(&start.descent);
            noise = F::select(corrects, cx.get(&start.terms) * (epsilon * epsilon), noise);
            (more, held) = (cx.get(&start.more), cx.get(&start.held));
        }
        Line {
            descent,
            noise,
            slope: more - descent,
            held,
            touches: corrects.is_some(),
            acting,
            params,
            weight,
            jar,
            jv,
            lane_rows,
        }
    }

    #[inline(always)]
    fn derivative<C: Cx<F = F>, const TURNS: bool>(
        &self,
        cx: &mut C,
        m: &Constants<F::Real>,
        alpha: F,
    ) -> Derivative<F> {
        // the quadratic model: p' = -(1 - α) d, p'' = d
        let rest = F::c(1.0) - alpha;
        let slope = -(rest * self.descent);
        let mut d = Derivative {
            slope,
            curvature: self.descent,
            size: slope.abs(),
        };
        // equalities have one piece only; of the others those of joints are distinguished once, not row by row
        let (frictions, limits) = (m.equalities.len(), m.equalities.len() + m.frictions.len());
        let (weight, jar, jv) = (self.weight, self.jar, self.jv);
        // lanes that share a world divide the joint rows among them
        let shares = cx.lanes() > 1;
        if shares {
            self.add_lane_rows(cx, alpha, &mut d);
        }
        // what each row that left its piece adds: p' by (f(model) - f) jv, p'' by (W - W(0)) jv²
        for (r, friction) in (frictions..limits).zip(&m.frictions) {
            if shares {
                break;
            }
            let [zone, loss] = bounds(m, self.params, friction);
            let start = dry_friction(jar[r], weight[r], zone, loss);
            let here = dry_friction(alpha.fma(jv[r], jar[r]), weight[r], zone, loss);
            d.add(alpha, jv[r], start, here);
        }
        for run in self.acting.runs() {
            if shares {
                break;
            }
            let rows = limits + run.start..limits + run.end;
            let both = jar[rows.clone()].iter().zip(&jv[rows.clone()]);
            for ((jar, jv), weight) in both.zip(&weight[rows]) {
                let start = one_sided(*jar, *weight);
                let here = one_sided(alpha.fma(*jv, *jar), *weight);
                d.add(alpha, *jv, start, here);
            }
        }
        // all lanes add all ties
        for (r, tie) in (m.joint_rows()..m.rows()).zip(&m.tie_of_row) {
            let law = &m.ties[*tie].law;
            let start = ties::law(law, jar[r], weight[r]);
            let here = ties::law(law, alpha.fma(jv[r], jar[r]), weight[r]);
            d.add(alpha, jv[r], start, here);
        }
        // contacts add to cells
        if self.touches {
            let mut slope = cx.var(d.slope);
            let mut curvature = cx.var(d.curvature);
            let mut size = cx.var(d.size);
            let t = &m.contacts;
            contacts::derivative::<_, TURNS>(cx, t, alpha, &mut slope, &mut curvature, &mut size);
            d = Derivative {
                slope: cx.get(&slope),
                curvature: cx.get(&curvature),
                size: cx.get(&size),
            };
        }
        d
    }
}

impl<F: Num> Line<'_, F> {
    /// Adds the rows of all lanes.
    fn add_lane_rows<C: Cx<F = F>>(&self, cx: &mut C, alpha: F, d: &mut Derivative<F>) {
        let zero = F::c(0.0);
        let mut sum = Derivative {
            slope: zero,
            curvature: zero,
            size: zero,
        };
        // the rows of this lane, then sums over the lanes in a fixed order
        for row in self.lane_rows {
            let here = row.law(alpha);
            let start = Law { ..row.start };
            sum.add(alpha, row.jv, start, here);
        }
        d.slope = d.slope + cx.sum_lanes(sum.slope);
        d.curvature = d.curvature + cx.sum_lanes(sum.curvature);
        d.size = d.size + cx.sum_lanes(sum.size);
    }
}

impl<F: Num> Derivative<F> {
    /// Adds a row whose residual changes by `jv` over the segment, from its laws at the start and here. It adds exactly 0 where
    /// the piece is the same, in spite of rounding.
    #[inline(always)]
    fn add(&mut self, alpha: F, jv: F, start: Law<F>, here: Law<F>) {
        // the model continues the piece of α = 0; a row that is on another one adds the difference of its force
        let model = (start.stiffness * alpha).fnma(jv, start.force);
        let moved = F::c(0.5).lt((here.state - start.state).abs());
        let power = F::select(moved, (model - here.force) * jv, F::c(0.0));
        self.slope = self.slope + power;
        self.size = self.size + power.abs();
        self.curvature = ((here.stiffness - start.stiffness) * jv).fma(jv, self.curvature);
    }
}

/// Slope relative to that at the start below which a search ends in `f32`: the next iteration finds the rest. A search to
/// MuJoCo's `ls_tolerance` of 0.01 takes half as many steps again.
const SLACK: f64 = 0.1;
/// An α beyond any minimum [–].
const FAR: f64 = 1e10;

/// The exact minimum on the segment or beyond it, p'(α) = 0, or 0 where the cost rises.
///
/// It goes by Newton's method while its moves halve. Otherwise it takes the chord of the bracket, with half the slope of an end
/// that stays (Illinois method; Dowell and Jarratt 1971).
#[inline(always)]
pub(super) fn search<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    line: &Line<'_, C::F>,
    length: &mut C::V,
    counts: (&mut C::V, &mut C::V),
) {
    let (zero, half, one) = (C::F::c(0.0), C::F::c(0.5), C::F::c(1.0));
    let resolution = C::F::c(4.0 * <<C::F as Num>::Real as Real>::EPSILON);
    // the reference searches down to rounding
    let slack = if <<C::F as Num>::Real as Real>::DOUBLE {
        0.0
    } else {
        SLACK
    };
    // a bracket with the start below the minimum, and no end above it yet
    let mut low = cx.var(zero);
    let mut low_slope = cx.var(line.slope);
    let mut high = cx.var(C::F::c(FAR));
    let mut high_slope = cx.var(one);
    // -1 after a point below the minimum, 1 after one above it
    let mut side = cx.var(zero);
    let mut last_move = cx.var(one);
    // where the cost rises at once, α = 0
    let climbs = !line.slope.lt(zero);
    let start = C::F::select(climbs, zero, cx.get(length));
    cx.set(length, start);
    times!(cx, m.solver.ls_iterations, {
        cx.tally(counts.0, counts.1);
        let alpha = cx.get(length);
        let d = line.derivative::<C, TURNS>(cx, m, alpha);
        // the sign of the slope decides which end the point replaces
        let falls = d.slope.lt(zero);
        let below = C::F::select(falls, alpha, cx.get(&low));
        let above = C::F::select(falls, cx.get(&high), alpha);
        // arrived where p' is rounding, or small against p'(0); or where the bracket is as narrow as rounding
        let close = (d.size * resolution).max(-line.slope * C::F::c(slack));
        let arrived = climbs | !close.lt(d.slope.abs());
        break_if!(cx, arrived | (above - below).lt(above * resolution));
        cx.set(&mut low, below);
        cx.set(&mut high, above);
        // Illinois method: the slopes at both ends
        let before = cx.get(&side);
        let now = C::F::select(falls, -one, one);
        // an end that stays for the second time has half its slope
        let weight = C::F::select(half.lt(before * now), half, one);
        let below_slope = C::F::select(falls, d.slope, cx.get(&low_slope) * weight);
        let above_slope = C::F::select(falls, cx.get(&high_slope) * weight, d.slope);
        cx.set(&mut side, now);
        cx.set(&mut low_slope, below_slope);
        cx.set(&mut high_slope, above_slope);

        // Newton's point, if it is inside and, once there are two ends, moves at most half as far as the last step
        let newton = alpha - d.slope.div(d.curvature);
        let is_open = C::F::c(0.5 * FAR).lt(above);
        let halves = (newton - alpha).abs().lt(half * cx.get(&last_move));
        let inside = below.lt(newton) & newton.lt(above);
        let is_newton = inside & (is_open | halves);
        // else the chord's zero, or the middle where that is outside
        let rise = above_slope - below_slope;
        let chord = below.fma(above_slope, -(above * below_slope)).div(rise);
        let is_chord = below.lt(chord) & chord.lt(above);
        let middle = half * (below + above);
        let other = C::F::select(is_chord, chord, middle);
        let next = C::F::select(is_newton, newton, other);
        cx.set(&mut last_move, (next - alpha).abs());
        cx.set(length, next);
    });
}
