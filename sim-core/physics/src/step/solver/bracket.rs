//! MuJoCo's line search: Newton's method from the start of a line until the slope changes its sign, then a bracket.
//!
//! A bracket has two ends, one on each side of the minimum. Each iteration tries three points: the middle, and where Newton's
//! method leads from each end. One of them with a slope below the bound is the answer. Otherwise each end moves to the point
//! on its side with the smaller slope. Where no end moves, rounding is reached and the middle is the answer (MuJoCo
//! documentation, "Computation: solvers"; the details are found by experiment with MuJoCo 3.17).

use super::contact_line::{self, Island};
use super::rows::{Acting, Law, bounds, dry_cost, dry_friction, equality, one_sided};
use super::ties;
use crate::arrays::Workspace;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::step::ConstantsOf;
use crate::{break_if, times, when};

/// Roundings in the slope at the start of a line, in units of the size of its terms: a smaller slope is no descent [–].
const ROUNDINGS: f64 = 8.0;

/// A line through the cost: accelerations `start` + α `step`, residuals `jar` + α `jar_minimum`.
pub(super) struct Segment<'a, F: Num> {
    pub params: &'a [F],
    pub w: &'a Workspace<F>,
    pub acting: Acting,
    /// The island that the line moves.
    pub island: Island<'a, F>,
    /// First and second derivative of ½ (a - M⁻¹ τ)ᵀ M (a - M⁻¹ τ) at the start.
    pub gauss: [F; 2],
    /// The size of the slope below which the search ends.
    pub bound: F,
}

/// Sums over constraint rows at a point of the line.
struct Sums<F> {
    cost: F,
    slope: F,
    curvature: F,
    /// Size of the terms of the slope.
    size: F,
}

impl<F: Num> Sums<F> {
    fn add(&mut self, law: &Law<F>, jv: F, costs: [F; 2]) {
        // s(α) - s(0); p' = -f jv, p'' = W jv², and |f jv|, whose rounding p' has
        self.cost = self.cost + (costs[1] - costs[0]);
        self.slope = law.force.fnma(jv, self.slope);
        self.curvature = (law.stiffness * jv).fma(jv, self.curvature);
        self.size = self.size + (law.force * jv).abs();
    }
}

/// A point of the line.
struct Point<C: Cx> {
    alpha: C::V,
    /// Less that at the start.
    cost: C::V,
    slope: C::V,
    curvature: C::V,
    /// Size of the terms of the slope.
    size: C::V,
}

impl<C: Cx> Point<C> {
    fn copy(&self, cx: &mut C) -> Point<C> {
        let [alpha, cost, slope, curvature, size] = self.values(cx).map(|x| cx.var(x));
        Point {
            alpha,
            cost,
            slope,
            curvature,
            size,
        }
    }

    fn values(&self, cx: &C) -> [C::F; 5] {
        let derivatives = [&self.slope, &self.curvature, &self.size].map(|cell| cx.get(cell));
        let [slope, curvature, size] = derivatives;
        [
            cx.get(&self.alpha),
            cx.get(&self.cost),
            slope,
            curvature,
            size,
        ]
    }

    fn set(&mut self, cx: &mut C, values: [C::F; 5]) {
        let [alpha, cost, slope, curvature, size] = values;
        cx.set(&mut self.size, size);
        cx.set(&mut self.alpha, alpha);
        cx.set(&mut self.cost, cost);
        cx.set(&mut self.slope, slope);
        cx.set(&mut self.curvature, curvature);
    }

    /// Where Newton's method leads.
    fn newton(&self, cx: &C) -> C::F {
        cx.get(&self.alpha) - cx.get(&self.slope).div(cx.get(&self.curvature))
    }

    /// Moves an end of a bracket to the candidate on its side whose slope is the smallest. Returns where it moved.
    fn advance(&mut self, cx: &mut C, candidates: [&Point<C>; 3]) -> MaskOf<C> {
        let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
        let mut moved = zero;
        for candidate in candidates {
            // on the same side of the minimum, and nearer to it
            let (slope, candidate_slope) = (cx.get(&self.slope), cx.get(&candidate.slope));
            let rises = slope.lt(zero) & candidate_slope.lt(zero) & slope.lt(candidate_slope);
            let falls = zero.lt(slope) & zero.lt(candidate_slope) & candidate_slope.lt(slope);
            let takes = rises | falls;
            let (before, after) = (self.values(cx), candidate.values(cx));
            let next = [0, 1, 2, 3, 4].map(|i| C::F::select(takes, after[i], before[i]));
            self.set(cx, next);
            moved = C::F::select(takes, one, moved);
        }
        C::F::c(0.5).lt(moved)
    }
}

/// What a search found.
pub(super) struct Answer<C: Cx> {
    /// α of the next accelerations; 0 where no point costs less than the start.
    pub alpha: C::V,
    /// Its cost less that at the start.
    pub cost: C::V,
    ended: C::V,
}

impl<C: Cx> Answer<C> {
    /// Ends the search at a point in the worlds of the mask.
    fn take(&mut self, cx: &mut C, at: MaskOf<C>, point: &Point<C>) {
        let [alpha, cost, ..] = point.values(cx);
        let (alpha_before, cost_before) = (cx.get(&self.alpha), cx.get(&self.cost));
        cx.set(&mut self.alpha, C::F::select(at, alpha, alpha_before));
        cx.set(&mut self.cost, C::F::select(at, cost, cost_before));
        let ended = cx.get(&self.ended);
        cx.set(&mut self.ended, C::F::select(at, C::F::c(1.0), ended));
    }

    fn has_ended(&self, cx: &C) -> MaskOf<C> {
        C::F::c(0.5).lt(cx.get(&self.ended))
    }
}

/// Evaluations of points of a line, counted as MuJoCo does: `ls_iterations` bounds them, and not iterations.
struct Evaluations<'a, C: Cx> {
    m: &'a ConstantsOf<C>,
    line: &'a Segment<'a, C::F>,
    counts: (&'a mut C::V, &'a mut C::V),
    done: C::V,
}

impl<C: Cx> Evaluations<'_, C> {
    fn point<const TURNS: bool>(&mut self, cx: &mut C, alpha: C::F) -> Point<C> {
        let count = cx.get(&self.done) + C::F::c(1.0);
        cx.set(&mut self.done, count);
        cx.tally(self.counts.0, self.counts.1);
        self.line.point::<C, TURNS>(cx, self.m, alpha)
    }

    fn are_spent(&self, cx: &C) -> MaskOf<C> {
        let most = C::F::c(self.m.solver.ls_iterations as f64 - 0.5);
        most.lt(cx.get(&self.done))
    }

    /// Whether the slope is below the bound, or only rounding is left of it.
    fn is_close(&self, cx: &C, point: &Point<C>) -> MaskOf<C> {
        let bound = self.line.bound.max(cx.get(&point.size) * epsilon::<C>());
        cx.get(&point.slope).abs().lt(bound)
    }
}

fn epsilon<C: Cx>() -> C::F {
    C::F::c(<<C::F as Num>::Real as Real>::EPSILON)
}

/// Searches the line.
pub(super) fn search<'a, C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &'a ConstantsOf<C>,
    line: &'a Segment<'a, C::F>,
    counts: (&'a mut C::V, &'a mut C::V),
) -> Answer<C> {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let mut answer = Answer {
        alpha: cx.var(zero),
        cost: cx.var(zero),
        ended: cx.var(zero),
    };
    let mut evaluations = Evaluations {
        m,
        line,
        counts,
        done: cx.var(zero),
    };
    let start = evaluations.point::<TURNS>(cx, zero);
    // or only rounding is left, which no further iteration brings down
    let rounding = cx.get(&start.size) * epsilon::<C>() * C::F::c(ROUNDINGS);
    let arrived = cx.get(&start.slope).abs().lt(rounding);
    answer.take(cx, arrived, &start);
    // Newton's first point: the answer where its slope is below the bound
    let alpha = start.newton(cx);
    let mut first = evaluations.point::<TURNS>(cx, alpha);
    let close = evaluations.is_close(cx, &first) & !arrived;
    answer.take(cx, close, &first);
    // 1 where the minimum is ahead of the first point, -1 where that overshot
    let ahead = C::F::select(cx.get(&first.slope).lt(zero), one, -one);
    let mut second = first.copy(cx);
    // Newton's method until the slope changes its sign; `second` is the point before `first`
    times!(cx, m.solver.ls_iterations, {
        let crossed = (-line.bound).lt(cx.get(&first.slope) * ahead);
        let spent = evaluations.are_spent(cx);
        break_if!(cx, crossed | spent | answer.has_ended(cx));
        let values = first.values(cx);
        second.set(cx, values);
        let alpha = first.newton(cx);
        let next = evaluations.point::<TURNS>(cx, alpha).values(cx);
        first.set(cx, next);
        let close = evaluations.is_close(cx, &first);
        answer.take(cx, close, &first);
    });
    // evaluations are spent: the last point is the answer
    let ends = evaluations.are_spent(cx) & !answer.has_ended(cx);
    answer.take(cx, ends, &first);
    // the minimum is between the last two points
    let goes_on = !answer.has_ended(cx);
    when!(cx, goes_on, {
        shrink::<C, TURNS>(cx, &mut evaluations, &mut answer, [first, second]);
    });
    answer
}

/// Shrinks a bracket until one of its points is the answer.
fn shrink<C: Cx, const TURNS: bool>(
    cx: &mut C,
    evaluations: &mut Evaluations<'_, C>,
    answer: &mut Answer<C>,
    [mut first, mut second]: [Point<C>; 2],
) {
    let (zero, half, one) = (C::F::c(0.0), C::F::c(0.5), C::F::c(1.0));
    // Newton's method from the second end led to the first one
    let mut from_second = first.copy(cx);
    let alpha = first.newton(cx);
    let mut from_first = evaluations.point::<TURNS>(cx, alpha);
    times!(cx, evaluations.m.solver.ls_iterations, {
        let spent = evaluations.are_spent(cx);
        break_if!(cx, spent | answer.has_ended(cx));
        // the third candidate is the middle
        let alpha = half * (cx.get(&first.alpha) + cx.get(&second.alpha));
        let middle = evaluations.point::<TURNS>(cx, alpha);
        // of the candidates whose slope is below the bound, the one that costs least
        let mut answered = zero;
        for candidate in [&from_first, &from_second, &middle] {
            let costs_less = cx.get(&candidate.cost).lt(cx.get(&answer.cost));
            let better = costs_less | answered.lt(half);
            let takes = evaluations.is_close(cx, candidate) & better;
            answer.take(cx, takes, candidate);
            answered = C::F::select(takes, one, answered);
        }
        break_if!(cx, half.lt(answered));
        // each end moves to the best candidate on its side; both choose among the same three
        let before = from_first.copy(cx);
        let candidates = [&before, &from_second, &middle];
        let first_moved = first.advance(cx, candidates);
        // from an end that moved Newton's method leads to another candidate
        when!(cx, first_moved, {
            let alpha = first.newton(cx);
            let next = evaluations.point::<TURNS>(cx, alpha).values(cx);
            from_first.set(cx, next);
        });
        let second_moved = second.advance(cx, candidates);
        when!(cx, second_moved, {
            let alpha = second.newton(cx);
            let next = evaluations.point::<TURNS>(cx, alpha).values(cx);
            from_second.set(cx, next);
        });
        // no end moves: rounding is reached
        answer.take(cx, !first_moved & !second_moved, &middle);
    });
    // evaluations are spent: the end that costs less, if it costs less than the start
    let open = !answer.has_ended(cx);
    let (cost, other) = (cx.get(&first.cost), cx.get(&second.cost));
    let is_first = !other.lt(cost);
    answer.take(cx, open & is_first & cost.lt(zero), &first);
    answer.take(cx, open & !is_first & other.lt(zero), &second);
}

impl<F: Num> Segment<'_, F> {
    /// The cost and its derivatives at α.
    fn point<C: Cx<F = F>, const TURNS: bool>(
        &self,
        cx: &mut C,
        m: &ConstantsOf<C>,
        alpha: F,
    ) -> Point<C> {
        let half = F::c(0.5);
        let [slope, curvature] = self.gauss;
        // ½ (a - M⁻¹ τ)ᵀ M (a - M⁻¹ τ) less that at α = 0, and its derivatives
        let mut sums = Sums {
            cost: alpha * (half * alpha).fma(curvature, slope),
            slope: alpha.fma(curvature, slope),
            curvature,
            size: slope.abs() + (alpha * curvature).abs(),
        };
        let (jar, weight) = (&self.w.jar, &self.w.row_weight);
        // rows of other islands stay where they are
        let change = |r: usize, dof: usize| {
            let jv = F::select(self.island.has(dof), self.w.jar_minimum[r], F::c(0.0));
            (jv, alpha.fma(jv, jar[r]))
        };
        let mut r = 0;
        // equalities, s = ½ D jar²; both dofs are of one island
        for e in &m.equalities {
            let (jv, there) = change(r, e.follower);
            let costs = [jar[r], there].map(|jar| half * weight[r] * jar * jar);
            sums.add(&equality(there, weight[r]), jv, costs);
            r += 1;
        }
        // dry friction: Huber's cost
        for friction in &m.frictions {
            let (jv, there) = change(r, friction.dof);
            let [zone, loss] = bounds(m, self.params, friction);
            let costs = [jar[r], there].map(|jar| dry_cost(jar, weight[r], zone, loss));
            let law = dry_friction(there, weight[r], zone, loss);
            sums.add(&law, jv, costs);
            r += 1;
        }
        // limits that act somewhere: s = ½ D jar² = -½ f jar where jar < 0
        for limit in self.acting.runs().flatten() {
            let r = r + limit;
            let (jv, there) = change(r, m.limits[limit].dof);
            let costs = [jar[r], there].map(|jar| -(half * one_sided(jar, weight[r]).force * jar));
            sums.add(&one_sided(there, weight[r]), jv, costs);
        }
        // ties: all dofs of one are of one island, so the first one stands for all
        for (r, tie) in (m.joint_rows()..m.rows()).zip(&m.tie_of_row) {
            let tie = &m.ties[*tie];
            let Some(&dof) = tie.dofs.first() else {
                continue;
            };
            let (jv, there) = change(r, dof);
            let costs = [jar[r], there].map(|jar| ties::cost(&tie.law, jar, weight[r]));
            sums.add(&ties::law(&tie.law, there, weight[r]), jv, costs);
        }
        // cells, to which the loops over contacts add
        let all = [sums.cost, sums.slope, sums.curvature, sums.size];
        let mut cells = all.map(|sum| cx.var(sum));
        contact_line::add::<_, TURNS>(cx, &m.contacts, self.island, alpha, &mut cells);
        let [cost, slope, curvature, size] = cells;
        Point {
            alpha: cx.var(alpha),
            cost,
            slope,
            curvature,
            size,
        }
    }
}
