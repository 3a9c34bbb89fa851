//! Laws of the constraint rows of joints, and sums over them (Todorov 2014; MuJoCo: `mj_constraintUpdate`).
//!
//! A row has a cost s of its residual jar = J a - aref, piecewise quadratic: force -s', stiffness s''. Rows are in MuJoCo's
//! order: equalities, frictions, limits. J has one or two entries per row, so no row is stored. Rows of ties follow.

use super::ties;
use crate::arrays::Workspace;
use crate::constants::params::Param;
use crate::constants::{Constants, Friction};
use crate::lane::{Cx, Num};
use crate::step::param;
use std::ops::Range;

/// What is known of J at run time only.
#[derive(Clone, Copy)]
pub(super) struct Jacobian<'a, F> {
    /// The limits that act; others add nothing, and have no row.
    pub acting: Acting,
    /// Sign of each limit.
    pub side: &'a [F],
    /// Entries of the rows of ties.
    pub ties: &'a [F],
}

impl<'a, F> Jacobian<'a, F> {
    #[inline(always)]
    pub(super) fn new(acting: Acting, side: &'a [F], ties: &'a [F]) -> Jacobian<'a, F> {
        Jacobian { acting, side, ties }
    }
}

/// The groups of limits of which one acts in some world of a block: most joints of most worlds are inside their range. With at
/// most 64 limits each is a group of its own.
#[derive(Clone, Copy)]
pub(super) struct Acting {
    /// A bit for each group of limits.
    groups: u64,
    /// Limits of a group, which follow each other.
    size: usize,
    /// Limits in all.
    len: usize,
}

impl Acting {
    /// From the weights of all rows, 0 where a limit does not act. A backend that cannot know has all of them.
    #[inline(always)]
    pub fn find<C: Cx>(cx: &mut C, m: &Constants<<C::F as Num>::Real>, weight: &[C::F]) -> Acting {
        // at most 64 groups, a bit each
        let limits = &weight[m.equalities.len() + m.frictions.len()..m.joint_rows()];
        let size = limits.len().div_ceil(u64::BITS as usize).max(1);
        let mut groups = 0;
        // a group acts if one of its limits has D > 0 in some world of the block
        for (k, group) in limits.chunks(size).enumerate() {
            let mut stiffest = C::F::c(0.0);
            for weight in group {
                stiffest = stiffest.max(*weight);
            }
            if cx.anywhere(C::F::c(0.0).lt(stiffest)) {
                groups |= 1 << k;
            }
        }
        Acting {
            groups,
            size,
            len: limits.len(),
        }
    }

    /// Runs of limits that follow each other, in rising order.
    #[inline(always)]
    pub fn runs(self) -> Runs {
        Runs(self)
    }
}

/// See [`Acting::runs`].
pub(super) struct Runs(Acting);

impl Iterator for Runs {
    type Item = Range<usize>;

    #[inline(always)]
    fn next(&mut self) -> Option<Range<usize>> {
        let Acting { groups, size, len } = &mut self.0;
        if *groups == 0 {
            return None;
        }
        // the lowest run of groups that act
        let first = groups.trailing_zeros() as usize;
        let end = first + (*groups >> first).trailing_ones() as usize;
        // the carry takes the run with it
        *groups &= groups.wrapping_add(1 << first);
        Some(first * *size..(end * *size).min(*len))
    }
}

/// The law of a row at a residual `jar`: force -s', stiffness s'', and which piece of s it is on.
pub(super) struct Law<F> {
    /// [N·m or N]
    pub force: F,
    /// [kg·m² or kg]
    pub stiffness: F,
    /// 0, or ± 1 on the other pieces.
    pub state: F,
}

/// s = ½ D jar²
#[inline(always)]
pub(super) fn equality<F: Num>(jar: F, weight: F) -> Law<F> {
    Law {
        force: -(weight * jar),
        stiffness: weight,
        state: F::c(0.0),
    }
}

/// s = ½ D jar² within the zone R × loss, beyond it a line of slope ± loss (Huber 1964).
#[inline(always)]
pub(super) fn dry_friction<F: Num>(jar: F, weight: F, zone: F, loss: F) -> Law<F> {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    // beyond the zone the force is at its bound, against jar
    let (below, above) = (jar.lt(-zone), zone.lt(jar));
    let slides = below | above;
    let bound = F::select(below, loss, -loss);
    Law {
        force: F::select(slides, bound, -(weight * jar)),
        stiffness: F::select(slides, zero, weight),
        state: F::select(below, -one, F::select(above, one, zero)),
    }
}

/// Zone and loss of a dry friction, which may vary from world to world.
#[inline(always)]
pub(super) fn bounds<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    friction: &Friction<F::Real>,
) -> [F; 2] {
    if m.varying.first(Param::JointFriction).is_none() {
        return [F::k(friction.zone), F::k(friction.loss)];
    }
    // a loss that varies moves the edge of the zone, R × loss
    let loss = param(m, params, Param::JointFriction, friction.dof, friction.loss);
    [loss * F::k(friction.regularizer), loss]
}

/// The cost of [`dry_friction`] (Huber 1964): quadratic inside the zone, linear outside.
#[inline(always)]
pub(super) fn dry_cost<F: Num>(jar: F, weight: F, zone: F, loss: F) -> F {
    let (half, size) = (F::c(0.5), jar.abs());
    // both pieces have the cost ½ loss × zone at the edge of the zone
    let inside = half * weight * jar * jar;
    let outside = loss * half.fnma(zone, size);
    F::select(zone.lt(size), outside, inside)
}

/// s = ½ D jar² where jar < 0, else 0. A row of weight 0 is never active.
#[inline(always)]
pub(super) fn one_sided<F: Num>(jar: F, weight: F) -> Law<F> {
    let zero = F::c(0.0);
    let push = -(weight * jar);
    let active = zero.lt(push);
    Law {
        force: F::select(active, push, zero),
        stiffness: F::select(active, weight, zero),
        state: F::select(active, F::c(1.0), zero),
    }
}

/// jar = J a - aref
#[inline(always)]
pub(super) fn residual<F: Num>(
    m: &Constants<F::Real>,
    jacobian: Jacobian<'_, F>,
    aref: &[F],
    a: &[F],
    jar: &mut [F],
) {
    let mut r = 0;
    // J = (1, -ratio) of an equality, J = 1 of a friction
    for e in &m.equalities {
        jar[r] = F::k(e.multiplier).fnma(a[e.leader], a[e.follower]) - aref[r];
        r += 1;
    }
    for f in &m.frictions {
        jar[r] = a[f.dof] - aref[r];
        r += 1;
    }
    // J = ± 1 of the limits that act; the others keep what they had, and are not read
    for run in jacobian.acting.runs() {
        let limits = m.limits[run.clone()]
            .iter()
            .zip(&jacobian.side[run.clone()]);
        let rows = r + run.start..r + run.end;
        let rows = jar[rows.clone()].iter_mut().zip(&aref[rows]);
        for ((jar, aref), (l, side)) in rows.zip(limits) {
            *jar = side.fma(a[l.dof], -*aref);
        }
    }
    ties::residual(m, jacobian.ties, aref, a, jar);
}

/// J s = jar(a⁺) - jar(a) of the rows that act, in the place of jar(a⁺).
#[inline(always)]
pub(super) fn along_step<F: Num>(
    m: &Constants<F::Real>,
    acting: Acting,
    jar: &[F],
    jar_minimum: &mut [F],
) {
    let first = m.equalities.len() + m.frictions.len();
    for r in 0..first {
        jar_minimum[r] = jar_minimum[r] - jar[r];
    }
    // of limits that do not act both are undefined
    for run in acting.runs() {
        for r in first + run.start..first + run.end {
            jar_minimum[r] = jar_minimum[r] - jar[r];
        }
    }
    for r in m.joint_rows()..m.rows() {
        jar_minimum[r] = jar_minimum[r] - jar[r];
    }
}

/// f + W J a, or f alone where the solver `corrects`.
#[inline(always)]
pub(super) fn pull<F: Num>(law: &Law<F>, jar: F, aref: F, corrects: Option<F::Mask>) -> F {
    // J a = jar + aref
    let whole = law.stiffness.fma(jar + aref, law.force);
    match corrects {
        Some(corrects) => F::select(corrects, law.force, whole),
        None => whole,
    }
}

/// Adds Jᵀ W J to `hessian`, and Jᵀ (f + W J a) to the right-hand side in `minimum`, or Jᵀ f in the worlds where the solver
/// `corrects`.
#[inline(always)]
pub(super) fn assemble<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    w: &mut Workspace<F>,
    acting: Acting,
    corrects: Option<F::Mask>,
) {
    let (hessian, rhs) = (&mut w.hessian, &mut w.minimum);
    let (side, weight, aref, jar) = (&w.limit_side, &w.row_weight, &w.row_aref, &w.jar);
    let mut r = 0;
    // J = (1, -ratio): four entries of the Hessian
    for e in &m.equalities {
        let law = equality(jar[r], weight[r]);
        let pull = pull(&law, jar[r], aref[r], corrects);
        let (f, l, ratio) = (e.follower, e.leader, F::k(e.multiplier));
        let shared = law.stiffness * ratio;
        let (at_follower, at_leader) = (m.pattern.at(f, f), m.pattern.at(l, l));
        hessian[at_follower] = hessian[at_follower] + law.stiffness;
        hessian[at_leader] = shared.fma(ratio, hessian[at_leader]);
        let coupling = m.pattern.at(f.max(l), f.min(l));
        hessian[coupling] = hessian[coupling] - shared;
        rhs[f] = rhs[f] + pull;
        rhs[l] = ratio.fnma(pull, rhs[l]);
        r += 1;
    }
    // J = 1 or ± 1: the diagonal alone
    for f in &m.frictions {
        let [zone, loss] = bounds(m, params, f);
        let law = dry_friction(jar[r], weight[r], zone, loss);
        let diagonal = m.pattern.at(f.dof, f.dof);
        hessian[diagonal] = hessian[diagonal] + law.stiffness;
        rhs[f.dof] = rhs[f.dof] + pull(&law, jar[r], aref[r], corrects);
        r += 1;
    }
    // limits that act: J = ± 1 cancels in Jᵀ W J
    for run in acting.runs() {
        let limits = m.limits[run.clone()].iter().zip(&side[run.clone()]);
        for ((l, side), r) in limits.zip(r + run.start..) {
            let law = one_sided(jar[r], weight[r]);
            let diagonal = m.pattern.at(l.dof, l.dof);
            hessian[diagonal] = hessian[diagonal] + law.stiffness;
            let pull = pull(&law, jar[r], aref[r], corrects);
            rhs[l.dof] = side.fma(pull, rhs[l.dof]);
        }
    }
    let of_rows = [weight, jar, aref].map(Vec::as_slice);
    ties::assemble(m, &w.row_jacobian, of_rows, hessian, rhs, corrects);
}

/// The count of rows on another piece of their cost, and of dry frictions that slide the other way.
#[inline(always)]
pub(super) fn changes<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    acting: Acting,
    [weight, jar, other]: [&[F]; 3],
) -> [F; 2] {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let (mut sum, mut turned) = (zero, zero);
    // equalities have one piece only
    let mut r = m.equalities.len();
    for f in &m.frictions {
        let [zone, loss] = bounds(m, params, f);
        let before = dry_friction(jar[r], weight[r], zone, loss).state;
        let after = dry_friction(other[r], weight[r], zone, loss).state;
        // from one bound to the other the state changes by 2
        let moved = (before - after).abs();
        sum = sum + moved;
        turned = turned + F::select(one.lt(moved), one, zero);
        r += 1;
    }
    // a limit changes when it begins or ends to push
    for run in acting.runs() {
        let rows = r + run.start..r + run.end;
        let places = jar[rows.clone()].iter().zip(&other[rows.clone()]);
        for ((jar, other), weight) in places.zip(&weight[rows]) {
            let before = one_sided(*jar, *weight).state;
            let after = one_sided(*other, *weight).state;
            sum = sum + (before - after).abs();
        }
    }
    r = m.joint_rows();
    // ties: a friction that reverses changes its state by 2, as above
    for tie in &m.ties {
        for _ in 0..tie.rows {
            let before = ties::law(&tie.law, jar[r], weight[r]).state;
            let after = ties::law(&tie.law, other[r], weight[r]).state;
            let moved = (before - after).abs();
            sum = sum + moved;
            turned = turned + F::select(one.lt(moved), one, zero);
            r += 1;
        }
    }
    [sum, turned]
}

/// Writes the force of every row, and adds Jᵀ f to `joint`.
#[inline(always)]
pub(super) fn forces<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    jacobian: Jacobian<'_, F>,
    [weight, jar]: [&[F]; 2],
    force: &mut [F],
    joint: &mut [F],
) {
    let mut r = 0;
    // equalities: J = (1, -ratio)
    for e in &m.equalities {
        force[r] = equality(jar[r], weight[r]).force;
        joint[e.follower] = joint[e.follower] + force[r];
        joint[e.leader] = F::k(e.multiplier).fnma(force[r], joint[e.leader]);
        r += 1;
    }
    // frictions: J = 1
    for f in &m.frictions {
        let [zone, loss] = bounds(m, params, f);
        force[r] = dry_friction(jar[r], weight[r], zone, loss).force;
        joint[f.dof] = joint[f.dof] + force[r];
        r += 1;
    }
    // 0 for all limits, since those that act in no world have no row
    for force in &mut force[r..m.joint_rows()] {
        *force = F::c(0.0);
    }
    // limits that act: J = ± 1
    for run in jacobian.acting.runs() {
        let limits = m.limits[run.clone()]
            .iter()
            .zip(&jacobian.side[run.clone()]);
        for ((l, side), r) in limits.zip(r + run.start..) {
            force[r] = one_sided(jar[r], weight[r]).force;
            joint[l.dof] = side.fma(force[r], joint[l.dof]);
        }
    }
    ties::forces(m, jacobian.ties, [weight, jar], force, joint);
}

/// Σ s(jar)
#[inline(always)]
pub(super) fn cost<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    acting: Acting,
    [weight, jar]: [&[F]; 2],
) -> F {
    let half = F::c(0.5);
    let mut sum = F::c(0.0);
    let mut r = 0;
    // ½ D jar² of equalities, Huber's cost of frictions
    for _ in &m.equalities {
        sum = (half * weight[r] * jar[r]).fma(jar[r], sum);
        r += 1;
    }
    for f in &m.frictions {
        let [zone, loss] = bounds(m, params, f);
        sum = sum + dry_cost(jar[r], weight[r], zone, loss);
        r += 1;
    }
    for r in acting.runs().flatten().map(|l| r + l) {
        // ½ D jar² = -½ f jar where active
        let push = one_sided(jar[r], weight[r]).force;
        sum = (half * push).fnma(jar[r], sum);
    }
    // ties follow all limits, those without a row included
    r = m.joint_rows();
    for tie in &m.ties {
        for _ in 0..tie.rows {
            sum = sum + ties::cost(&tie.law, jar[r], weight[r]);
            r += 1;
        }
    }
    sum
}
