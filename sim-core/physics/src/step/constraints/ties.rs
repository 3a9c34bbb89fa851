//! Rows of ties: Jacobian, stiffness D and reference acceleration (MuJoCo: `mj_instantiateEqual`, `mj_instantiateLimit`,
//! `mj_instantiateFriction`).
//!
//! ```text
//! lengths    r = l₁ - o₁ - p(l₂ - o₂)      J = ∂l₁ - p' ∂l₂
//! angle      r = max - |θ|                 J = -θ/|θ|                            θ: rotation vector of the ball
//! ```
//!
//! Those of frames are in [`super::tied_frames`]. The rows of one pair of frames have the impedance of the length of r.

use super::joint_rows::impedance;
use super::tied_frames::of_frames;
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::params::Param;
use crate::constants::ties::{Lengths, Measure, Tie, TieLaw};
use crate::lane::{Cx, Num, Real};
use crate::math::quat;
use crate::math::spatial::ANGULAR;
use crate::math::vec3::Vec3;
use crate::step::lengths::{length, moments, swing};
use crate::step::params::moved_by;
use crate::step::tree::bias::accelerations_at_rest;
use crate::step::tree::kinematics::read_quat;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Most rows of a tie.
const ROWS_MAX: usize = 6;

/// Largest D of a row in `f32` [kg or kg·m²].
///
/// Where a body's inverse weight is 0, as that of a body whose centre of mass is on its hinge, MuJoCo's is 1e15.
const WEIGHT_MAX: f64 = 1e8;

/// Constraint rows of ties.
pub struct Ties;

impl Stage for Ties {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::EqActive,
        A::Params,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Arm,
        A::Motion,
        A::Velocity,
        A::TenLength,
        A::TenMoment,
        A::TenSwing,
        A::EfcD,
        A::EfcAref,
    ];
    const WRITES: &'static [A] = &[A::EfcD, A::EfcAref, A::RowJacobian];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.ties.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let mut row = m.joint_rows();
        let of_frames = |tie: &Tie<_>| matches!(tie.measure, Measure::Frames(_));
        // J̇ q̇ of frames needs the accelerations of bodies at q̈ = 0, without gravity
        if m.ties.iter().any(of_frames) {
            accelerations_at_rest(cx, m, b, Vec3::zero());
        }
        // rows of ties come after those of joints
        for tie in &m.ties {
            let measured = measure(cx, m, b, tie);
            write_rows(cx, b, tie, row, &measured);
            row += tie.rows;
        }
    }
}

/// What a tie measures now.
pub(in crate::step) struct Measured<F> {
    /// Of each row.
    pub position: [F; ROWS_MAX],
    /// J̇ q̇
    pub swing: [F; ROWS_MAX],
}

impl<F: Num> Measured<F> {
    #[inline(always)]
    pub(in crate::step) fn at(positions: &[F]) -> Measured<F> {
        let mut position = [F::c(0.0); ROWS_MAX];
        position[..positions.len()].copy_from_slice(positions);
        Measured {
            position,
            swing: [F::c(0.0); ROWS_MAX],
        }
    }
}

/// Writes the Jacobian of a tie, and returns its positions.
#[inline(always)]
fn measure<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    tie: &Tie<<C::F as Num>::Real>,
) -> Measured<C::F> {
    // a dof that has no part in a measure keeps 0
    let jacobian = tie.jacobian(0).start..tie.jacobian(tie.rows - 1).end;
    b.work.row_jacobian[jacobian].fill(C::F::c(0.0));
    match &tie.measure {
        Measure::Lengths(lengths) => {
            let mut measured = of_lengths(cx, m, b, tie, lengths);
            // dry friction acts at every length
            if let TieLaw::Friction(_) = tie.law {
                measured.position[0] = C::F::c(0.0);
            }
            measured
        }
        Measure::Angle(coord, _) => {
            // |θ| and its axis, to which `write_rows` gives the sign of the bound
            let turn = quat::log(read_quat(cx, &b.joint_q, *coord));
            let angle = turn.dot(turn).sqrt();
            // at rest MuJoCo's axis is x
            let still = angle.lt(C::F::c(1e-15));
            // a select: lanes at rest divide by 1
            let inverse = C::F::c(1.0).div(C::F::select(still, C::F::c(1.0), angle));
            for i in 0..3 {
                let rest = C::F::c(if i == 0 { 1.0 } else { 0.0 });
                let axis = C::F::select(still, rest, turn[i] * inverse);
                b.work.row_jacobian[tie.first + i] = axis;
            }
            Measured::at(&[angle])
        }
        Measure::Free(body) => of_free(m, &mut b.work, tie, *body),
        Measure::Frames(frames) => of_frames::<C>(m, b, tie, frames),
    }
}

/// o₁ and o₂, of each world where the references of joints vary.
#[inline(always)]
fn offsets<F: Num>(m: &Constants<F::Real>, params: &[F], lengths: &Lengths<F::Real>) -> [F; 2] {
    let mut offsets = lengths.offsets.map(F::k);
    for (offset, dof) in offsets.iter_mut().zip(lengths.referred) {
        if let Some(dof) = dof
            && let Some(moved) = moved_by(m, params, Param::JointRef, dof)
        {
            *offset = *offset + moved;
        }
    }
    offsets
}

#[inline(always)]
fn of_lengths<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    tie: &Tie<<C::F as Num>::Real>,
    lengths: &Lengths<<C::F as Num>::Real>,
) -> Measured<C::F> {
    let [first, second] = offsets(m, &b.params, lengths);
    // l₁ - o₁ and l₂ - o₂
    let first_change = length(cx, m, b, &lengths.first) - first;
    let second_change = length(cx, m, b, &lengths.second) - second;
    // p and p' by Horner's rule
    let (mut value, mut slope) = (C::F::c(0.0), C::F::c(0.0));
    for coefficient in lengths.polynomial.iter().rev() {
        slope = slope.fma(second_change, value);
        value = value.fma(second_change, C::F::k(*coefficient));
    }
    // a dof may be in both lengths, so entries are added up
    let w = &mut b.work;
    let (jacobian, ten_moment) = (&mut w.row_jacobian, &w.ten_moment);
    let mut add = |dof: usize, x: C::F| {
        let column = tie.dofs.iter().position(|&tied| tied == dof);
        let entry = &mut jacobian[tie.first + column.unwrap_or_default()];
        *entry = *entry + x;
    };
    // J = ∂l₁ - p' ∂l₂, and its J̇ q̇
    moments::<C>(m, ten_moment, &lengths.first, |dof, moment| {
        add(dof, moment)
    });
    moments::<C>(m, ten_moment, &lengths.second, |dof, moment| {
        add(dof, -(slope * moment))
    });
    let mut measured = Measured::at(&[first_change - value]);
    measured.swing[0] = slope.fnma(swing(w, &lengths.second), swing(w, &lengths.first));
    measured
}

/// MuJoCo's velocities of a free body from ours, and the acceleration of its frame's origin that our J q̈ lacks.
#[inline(always)]
fn of_free<F: Num>(
    m: &Constants<F::Real>,
    w: &mut Workspace<F>,
    tie: &Tie<F::Real>,
    body: usize,
) -> Measured<F> {
    debug_assert_eq!(tie.dofs[0], m.bodies[body].dof);
    // the frame's origin is kept relative to the centre of mass
    let (arm, rotation) = (w.origin[body], w.rotation[body]);
    // rows of v' = v + ω × o, then of ω' = Rᵀ ω
    for i in 0..3 {
        let mut axis = Vec3::zero();
        axis[i] = F::c(1.0);
        let swing = arm.cross(axis);
        let (linear, angular) = (tie.jacobian(i).start, tie.jacobian(3 + i).start);
        w.row_jacobian[linear + i] = F::c(1.0);
        for k in 0..3 {
            w.row_jacobian[linear + 3 + k] = swing[k];
            w.row_jacobian[angular + 3 + k] = rotation[i][k];
        }
    }
    // J̇ q̇ = ω × (ω × o) of the origin, and 0 of the rotation
    let omega = w.velocity[body][ANGULAR];
    let mut measured = Measured::at(&[]);
    measured.swing[..3].copy_from_slice(&*omega.cross(omega.cross(arm)));
    measured
}

/// Writes D and aref of the rows of a tie, and gives the Jacobian of a range the sign of the bound that is nearer.
#[inline(always)]
fn write_rows<C: Cx>(
    cx: &mut C,
    b: &mut BlockOf<C>,
    tie: &Tie<<C::F as Num>::Real>,
    row: usize,
    measured: &Measured<C::F>,
) {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let (mut position, mut swing) = (measured.position, measured.swing);
    // in which worlds it acts: an equality that is on, dry friction always, a range past a bound
    let active = match tie.law {
        TieLaw::Equality(place) => Some(C::F::c(0.5).lt(b.eq_active[place])),
        TieLaw::Friction(_) => None,
        TieLaw::Range([lower, upper]) => {
            // r is the distance to the nearer bound, and J its derivative
            let (above, below) = (position[0] - C::F::k(lower), C::F::k(upper) - position[0]);
            let side = C::F::select(above.lt(below), one, -one);
            for entry in &mut b.work.row_jacobian[tie.jacobian(0)] {
                *entry = *entry * side;
            }
            position[0] = above.min(below);
            swing[0] = swing[0] * side;
            Some(position[0].lt(zero))
        }
    };
    // several rows have the impedance of |r|
    let mut size = position[0];
    if tie.rows > 1 {
        let mut square = zero;
        for x in &position[..tie.rows] {
            square = x.fma(*x, square);
        }
        size = square.sqrt();
    }
    let d = impedance(&tie.soft.impedance, size);
    // v = J q̇
    for k in 0..tie.rows {
        let mut velocity = zero;
        for (entry, &dof) in b.work.row_jacobian[tie.jacobian(k)].iter().zip(&tie.dofs) {
            velocity = entry.fma(cx.get(&b.joint_qd[dof]), velocity);
        }
        // D = d / ((1 - d) w), with the w of translations or of rotations
        let inverse_weight = match k {
            0..3 => tie.soft.inverse_weight,
            _ => tie.turning_weight,
        };
        let mut weight = d.div((one - d) * C::F::k(inverse_weight));
        if !<<C::F as Num>::Real as Real>::DOUBLE {
            weight = weight.min(C::F::c(WEIGHT_MAX));
        }
        // aref = -b v - k d r - J̇ q̇
        let spring = C::F::k(tie.soft.stiffness) * d * position[k];
        let mut aref = -velocity.fma(C::F::k(tie.soft.damping), spring) - swing[k];
        // a select: the tie may act in other worlds of the block
        if let Some(active) = active {
            weight = C::F::select(active, weight, zero);
            aref = C::F::select(active, aref, zero);
        }
        cx.set(&mut b.efc_weight[row + k], weight);
        cx.set(&mut b.efc_aref[row + k], aref);
    }
}
