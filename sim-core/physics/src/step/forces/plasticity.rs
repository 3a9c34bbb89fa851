//! Springs that yield (MuJoCo 4.0: `springyield`). Their rests are state, which a step moves at its end.
//!
//! ```text
//! rest = clamp(rest, q - y, q + y)                 of a joint with the yield y, at the next q
//! rest = rest exp((|v| - y) v / |v|)               of a ball with v = log(rest⁻¹ q), where |v| > y
//! l' = Σ c q,  l + h l̇                             next length of a fixed tendon, of a spatial one
//! rests += x - clamp(x, -y, y)                     of a tendon, with x: how far l' is beyond its two rests
//! ```
//!
//! The shorter rest of a rope, which is 0 below a longer one above 0, stays 0 where the rope is stretched.
//!
//! A spatial tendon is not measured again: l and its moments are those where the step began, and l̇ is by the velocities with
//! which positions went on.

use crate::constants::Body;
use crate::constants::springs::{Plasticity, PoseSpring, Tendon};
use crate::lane::{Cx, Num};
use crate::math::quat::{self, conjugate, mul};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::lengths::{length, moments};
use crate::step::tree::generalized::{free_bodies, halves};
use crate::step::tree::kinematics::read_quat;
use crate::step::{BlockOf, ConstantsOf};

/// Where a spring has no force: as the model has it, or where it came to if it yields.
#[inline(always)]
pub(in crate::step) fn rest<C: Cx, const N: usize>(
    cx: &mut C,
    b: &BlockOf<C>,
    start: [<C::F as Num>::Real; N],
    plasticity: &Option<Plasticity<<C::F as Num>::Real>>,
) -> [C::F; N] {
    let mut rest = [C::F::c(0.0); N];
    for (i, rest) in rest.iter_mut().enumerate() {
        *rest = match plasticity {
            Some(plasticity) => cx.get(&b.plastic_rest[plasticity.place + i]),
            None => C::F::k(start[i]),
        };
    }
    rest
}

/// Moves rests at the end of a step that took its new velocities to the next positions.
#[inline(always)]
pub(in crate::step) fn follow<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    if m.springs.plastic_rests() == 0 {
        return;
    }
    // scratch with an entry per dof, out of the block while that is read; its accelerations are spent
    let mut velocity = std::mem::take(&mut b.work.acceleration);
    if m.springs.yields_along_tendons() {
        new_velocities(cx, m, b, &mut velocity);
    }
    move_rests(cx, m, b, &velocity);
    b.work.acceleration = velocity;
}

/// Moves rests at the end of a Runge-Kutta step. `velocity` is MuJoCo's with which positions went on, and is spent.
#[inline(always)]
pub(in crate::step) fn follow_from_start<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    velocity: &mut [C::F],
) {
    if m.springs.plastic_rests() == 0 {
        return;
    }
    if !m.springs.yields_along_tendons() {
        move_rests(cx, m, b, velocity);
        return;
    }
    for (k, dof) in free_bodies(m) {
        let start = &b.work.rk_q[m.bodies[k].coord + 3..];
        let rotation = quat::matrix([start[0], start[1], start[2], start[3]]);
        turn(&m.bodies[k], &rotation, &mut velocity[dof..dof + 6]);
    }
    // the lengths where the step began, in place of those of its last evaluation
    let w = &mut b.work;
    std::mem::swap(&mut w.ten_length, &mut w.rk_length);
    std::mem::swap(&mut w.ten_moment, &mut w.rk_moment);
    move_rests(cx, m, b, velocity);
    let w = &mut b.work;
    std::mem::swap(&mut w.ten_length, &mut w.rk_length);
    std::mem::swap(&mut w.ten_moment, &mut w.rk_moment);
}

/// Moves rests to within their bounds of the next state. `velocity` is ours, at the poses of the moments.
#[inline(always)]
fn move_rests<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>, velocity: &[C::F]) {
    for spring in &m.springs.joints {
        let Some(Plasticity { place, bound }) = spring.plasticity else {
            continue;
        };
        let q = cx.get(&b.joint_q[m.dofs[spring.dof].coord]);
        let (rest, bound) = (cx.get(&b.plastic_rest[place]), C::F::k(bound));
        let rest = rest.max(q - bound).min(q + bound);
        cx.set(&mut b.plastic_rest[place], rest);
    }
    for spring in &m.springs.poses {
        follow_ball(cx, m, b, spring);
    }
    for tendon in &m.springs.tendons {
        follow_tendon(cx, m, b, tendon, velocity);
    }
}

/// Turns the rest of a ball to within the bound of its next rotation.
#[inline(always)]
fn follow_ball<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    spring: &PoseSpring<<C::F as Num>::Real>,
) {
    let Some(Plasticity { place, bound }) = spring.plasticity else {
        return;
    };
    let body = &m.bodies[spring.body];
    let (here, rest) = (
        read_quat(cx, &b.joint_q, body.coord),
        read_quat(cx, &b.plastic_rest, place),
    );
    // v = log(rest⁻¹ q), and the share of it beyond the bound
    let turn = quat::log(mul(conjugate(rest), here));
    let (angle, bound) = (turn.dot(turn).sqrt(), C::F::k(bound));
    let yields = bound.lt(angle);
    let whole = C::F::select(yields, angle, C::F::c(1.0));
    let turned = quat::turned(rest, turn, (angle - bound).div(whole));
    for i in 0..4 {
        // a rest that stays keeps its bits
        let next = C::F::select(yields, turned[i], rest[i]);
        cx.set(&mut b.plastic_rest[place + i], next);
    }
}

/// Moves the rests of a tendon to within the bound of its next length. `velocity` is ours, at the poses of its moments.
#[inline(always)]
fn follow_tendon<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    tendon: &Tendon<<C::F as Num>::Real>,
    velocity: &[C::F],
) {
    let Some(Plasticity { place, bound }) = tendon.plasticity else {
        return;
    };
    // l' = Σ c q of the next state, or l + h l̇
    let mut next = length(cx, m, b, &tendon.length);
    if tendon.length.tendon.is_some() {
        let mut rate = C::F::c(0.0);
        moments::<C>(m, &b.work.ten_moment, &tendon.length, |dof, moment| {
            rate = velocity[dof].fma(moment, rate);
        });
        next = rate.fma(C::F::k(m.dt), next);
    }
    let [shortest, longest] = rest(cx, b, tendon.rest, &tendon.plasticity);
    // x, and how far it is beyond the bound
    let (zero, bound) = (C::F::c(0.0), C::F::k(bound));
    let stretch = next - next.max(shortest).min(longest);
    let beyond = stretch - stretch.max(-bound).min(bound);
    // the shorter rest of a rope that is stretched stays 0
    let mut kept = C::F::select(zero.lt(beyond), shortest, shortest + beyond);
    kept = C::F::select(zero.lt(longest), kept, shortest + beyond);
    let shorter = C::F::select(zero.lt(shortest.abs()), shortest + beyond, kept);
    cx.set(&mut b.plastic_rest[place], shorter);
    cx.set(&mut b.plastic_rest[place + 1], longest + beyond);
}

/// Writes the velocities of the next state, `(dofs,)`, at the poses of the moments: MuJoCo's ones are equal there.
#[inline(always)]
fn new_velocities<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &BlockOf<C>, to: &mut [C::F]) {
    for (x, cell) in to.iter_mut().zip(&b.joint_qd) {
        *x = cx.get(cell);
    }
    for (k, dof) in free_bodies(m) {
        let body = &m.bodies[k];
        let [linear, spin] = halves(&to[dof..]);
        // v' = v - ω × R c and ω' = Rᵀ ω at the next rotation
        let rotation = quat::matrix(read_quat(cx, &b.joint_q, body.coord + 3));
        let origin = linear - spin.cross(rotation * Vec3::constant(body.center));
        to[dof..dof + 3].copy_from_slice(&origin.0);
        to[dof + 3..dof + 6].copy_from_slice(&rotation.transpose_mul(spin).0);
        turn(body, &b.work.rotation[k], &mut to[dof..dof + 6]);
    }
}

/// Turns MuJoCo's velocity of a free body into ours at a rotation.
#[inline(always)]
fn turn<F: Num>(body: &Body<F::Real>, rotation: &Mat3<F>, velocity: &mut [F]) {
    let [origin, local_spin] = halves(velocity);
    // ω = R ω' and v = v' + ω × R c
    let spin = rotation * local_spin;
    let center = spin.cross_add(rotation * Vec3::constant(body.center), origin);
    velocity[..3].copy_from_slice(&center.0);
    velocity[3..6].copy_from_slice(&spin.0);
}
