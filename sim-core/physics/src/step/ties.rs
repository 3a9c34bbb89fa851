//! Rows of ties: Jacobian, stiffness D and reference acceleration (MuJoCo: `mj_instantiateEqual`, `mj_instantiateLimit`,
//! `mj_instantiateFriction`).
//!
//! ```text
//! lengths    r = l₁ - o₁ - p(l₂ - o₂)      J = ∂l₁ - p' ∂l₂
//! angle      r = max - |θ|                 J = -θ/|θ|                            θ: rotation vector of the ball
//! frames     r = x₁ - x₂                   J = J₁ - J₂                           of points
//!            r = s v, (v, w) = q₂⁻¹ q₁     J = ½ s (w a + a × v), a = R₂ᵀ (ω₁ - ω₂)
//! ```
//!
//! The rows of one pair of frames have the impedance of the length of r.

use super::constraint::impedance;
use super::contact_rows::swing;
use super::kinematics::read_quat;
use super::sites;
use super::{BlockOf, ConstantsOf, Stage};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::mujoco::Term;
use crate::constants::site::Mount;
use crate::constants::ties::{Frames, Lengths, Measure, Tie, TieLaw};
use crate::lane::{Cx, Num, Real};
use crate::math::quat;
use crate::math::spatial::Spatial;
use crate::math::vec3::{Mat3, Vec3};

/// Most rows of a tie.
const ROWS_MAX: usize = 6;

/// Constraint rows of ties.
pub struct Ties;

impl Stage for Ties {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Motion,
        A::EfcD,
        A::EfcAref,
    ];
    const WRITES: &'static [A] = &[A::EfcD, A::EfcAref, A::RowJacobian];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.mujoco.ties.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let mut row = m.joint_rows();
        for tie in &m.mujoco.ties {
            let found = measure(cx, m, b, tie);
            write_rows(cx, b, tie, row, &found);
            row += tie.rows;
        }
    }
}

/// What a tie measures now.
struct Found<F> {
    /// Of each row.
    position: [F; ROWS_MAX],
    /// What MuJoCo's J q̈ has beyond ours.
    beyond: [F; ROWS_MAX],
}

impl<F: Num> Found<F> {
    #[inline(always)]
    fn at(positions: &[F]) -> Found<F> {
        let mut position = [F::c(0.0); ROWS_MAX];
        position[..positions.len()].copy_from_slice(positions);
        Found {
            position,
            beyond: [F::c(0.0); ROWS_MAX],
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
) -> Found<C::F> {
    let jacobian = tie.jacobian(0).start..tie.jacobian(tie.rows - 1).end;
    b.work.row_jacobian[jacobian].fill(C::F::c(0.0));
    match &tie.measure {
        Measure::Lengths(lengths) => Found::at(&[of_lengths(cx, m, b, tie, lengths)]),
        Measure::Angle(coord, _) => {
            let turn = quat::log(read_quat(cx, &b.joint_q, *coord));
            let angle = turn.dot(turn).sqrt();
            // at rest MuJoCo's axis is x
            let still = angle.lt(C::F::c(1e-15));
            let inverse = C::F::c(1.0).div(C::F::select(still, C::F::c(1.0), angle));
            for i in 0..3 {
                let rest = C::F::c(if i == 0 { 1.0 } else { 0.0 });
                let axis = C::F::select(still, rest, turn[i] * inverse);
                b.work.row_jacobian[tie.first + i] = axis;
            }
            Found::at(&[angle])
        }
        Measure::Free(body) => {
            of_free(m, &mut b.work, tie, *body);
            Found::at(&[])
        }
        Measure::Frames(frames) => of_frames(cx, m, b, tie, frames),
    }
}

/// Σ c q
#[inline(always)]
pub(super) fn length<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    terms: &[Term<<C::F as Num>::Real>],
) -> C::F {
    let mut length = C::F::c(0.0);
    for term in terms {
        let q = cx.get(&b.joint_q[m.dofs[term.dof].coord]);
        length = q.fma(C::F::k(term.coefficient), length);
    }
    length
}

#[inline(always)]
fn of_lengths<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    tie: &Tie<<C::F as Num>::Real>,
    lengths: &Lengths<<C::F as Num>::Real>,
) -> C::F {
    let [first, second] = lengths.offsets.map(C::F::k);
    let own = length(cx, m, b, &lengths.first) - first;
    let other = length(cx, m, b, &lengths.second) - second;
    // p and p' by Horner's rule
    let (mut value, mut slope) = (C::F::c(0.0), C::F::c(0.0));
    for coefficient in lengths.polynomial.iter().rev() {
        slope = slope.fma(other, value);
        value = value.fma(other, C::F::k(*coefficient));
    }
    let mut add = |dof: usize, x: C::F| {
        let column = tie.dofs.iter().position(|&own| own == dof);
        let place = tie.first + column.unwrap_or_default();
        b.work.row_jacobian[place] = b.work.row_jacobian[place] + x;
    };
    for term in &lengths.first {
        add(term.dof, C::F::k(term.coefficient));
    }
    for term in &lengths.second {
        add(term.dof, -(slope * C::F::k(term.coefficient)));
    }
    own - value
}

/// MuJoCo's velocities of a free body from ours.
#[inline(always)]
fn of_free<F: Num>(m: &Constants<F::Real>, w: &mut Workspace<F>, tie: &Tie<F::Real>, body: usize) {
    debug_assert_eq!(tie.dofs[0], m.bodies[body].dof);
    // the frame's origin is kept relative to the centre of mass
    let (arm, rotation) = (w.origin[body], w.rotation[body]);
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
}

/// Where a frame is, and how it is turned.
struct Placed<F> {
    /// From the reference point of its tree [m].
    point: Vec3<F>,
    /// In the world [m].
    reference: Vec3<F>,
    /// By columns [–].
    rotation: Mat3<F>,
}

#[inline(always)]
fn placed<F: Num>(w: &Workspace<F>, mount: &Mount<F::Real>) -> Placed<F> {
    let own = Mat3::constant(mount.rotation);
    Placed {
        point: sites::position(w, mount),
        reference: sites::reference(w, mount),
        rotation: match mount.body {
            Some(body) => {
                let carrier = &w.rotation[body];
                Mat3([carrier * own[0], carrier * own[1], carrier * own[2]])
            }
            None => own,
        },
    }
}

#[inline(always)]
fn of_frames<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    tie: &Tie<<C::F as Num>::Real>,
    frames: &Frames<<C::F as Num>::Real>,
) -> Found<C::F> {
    let mounts = [&frames.first, &frames.second];
    let [first, second] = mounts.map(|mount| placed(&b.work, mount));
    let apart = (first.point - second.point) + (first.reference - second.reference);
    let mut found = Found::at(&apart.0);
    for (mount, sign) in mounts.into_iter().zip([1.0, -1.0]) {
        let Some(tree) = mount.body.and(mount.tree) else {
            continue;
        };
        if let Some(swing) = swing(cx, m, b, tree) {
            for i in 0..3 {
                found.beyond[i] = swing[i].fma(C::F::c(sign), found.beyond[i]);
            }
        }
    }
    let turned = frames.torque_scale.map(|scale| {
        let between = between(&first.rotation, &second.rotation);
        let scale = C::F::k(scale);
        for i in 0..3 {
            found.position[3 + i] = between[i] * scale;
        }
        (scale * C::F::c(0.5), between)
    });
    let w = &mut b.work;
    for (column, &dof) in tie.dofs.iter().enumerate() {
        let Spatial([linear, angular]) = w.motion[dof];
        let moves = |mount: &Mount<<C::F as Num>::Real>| carries(m, mount.body, dof);
        let mut axis = Vec3::zero();
        for (mount, point, sign) in [
            (mounts[0], first.point, 1.0),
            (mounts[1], second.point, -1.0),
        ] {
            if !moves(mount) {
                continue;
            }
            let sign = C::F::c(sign);
            let moved = angular.cross_add(point, linear);
            for i in 0..3 {
                let place = tie.jacobian(i).start + column;
                w.row_jacobian[place] = moved[i].fma(sign, w.row_jacobian[place]);
            }
            axis = angular.scale_add(sign, axis);
        }
        if let Some((scale, [x, y, z, real])) = turned {
            let axis = second.rotation.transpose_mul(axis);
            let rate = axis.cross_add(Vec3([x, y, z]), axis * real) * scale;
            for i in 0..3 {
                w.row_jacobian[tie.jacobian(3 + i).start + column] = rate[i];
            }
        }
    }
    found
}

/// Does a dof move a body?
fn carries<R>(m: &Constants<R>, body: Option<usize>, dof: usize) -> bool {
    let mut next = body;
    while let Some(body) = next {
        if m.bodies[body].dofs().contains(&dof) {
            return true;
        }
        next = m.bodies[body].parent;
    }
    false
}

/// The rotation from `b` to `a` in the axes of `b`, as a quaternion (x, y, z, w).
///
/// Of the four ways to divide by one of its entries, the one with the largest is taken (Shepperd 1978).
#[inline(always)]
fn between<F: Num>(a: &Mat3<F>, b: &Mat3<F>) -> [F; 4] {
    let r = |i: usize, j: usize| b[i].dot(a[j]);
    let (one, two) = (F::c(1.0), F::c(2.0));
    let [xx, yy, zz] = [r(0, 0), r(1, 1), r(2, 2)];
    let sums = [r(2, 1) + r(1, 2), r(0, 2) + r(2, 0), r(1, 0) + r(0, 1)];
    let turns = [r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)];
    // four times the square of each entry, and the products of one with the others
    let ways = [
        ((xx - yy) - zz, [None, Some(sums[2]), Some(sums[1]), Some(turns[0])]),
        ((yy - zz) - xx, [Some(sums[2]), None, Some(sums[0]), Some(turns[1])]),
        ((zz - xx) - yy, [Some(sums[1]), Some(sums[0]), None, Some(turns[2])]),
        ((xx + yy) + zz, [Some(turns[0]), Some(turns[1]), Some(turns[2]), None]),
    ];
    let mut best = ways[3].0;
    let mut quat = [F::c(0.0); 4];
    for (k, (square, products)) in ways.into_iter().rev().enumerate() {
        let largest = (square + one).max(F::c(0.0)).sqrt();
        let safe = largest.max(F::c(1e-6));
        let scale = one.div(two * safe);
        let better = best.lt(square);
        for i in 0..4 {
            let entry = match products[i] {
                None => largest * F::c(0.5),
                Some(product) => product * scale,
            };
            quat[i] = match k {
                0 => entry,
                _ => F::select(better, entry, quat[i]),
            };
        }
        best = best.max(square);
    }
    quat
}

/// Writes D and aref of the rows of a tie, and gives the Jacobian of a range the sign of the bound that is nearer.
#[inline(always)]
fn write_rows<C: Cx>(
    cx: &mut C,
    b: &mut BlockOf<C>,
    tie: &Tie<<C::F as Num>::Real>,
    row: usize,
    found: &Found<C::F>,
) {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let mut position = found.position;
    let mut active = None;
    if let TieLaw::Range([lower, upper]) = tie.law {
        let (above, below) = (position[0] - C::F::k(lower), C::F::k(upper) - position[0]);
        let side = C::F::select(above.lt(below), one, -one);
        for entry in &mut b.work.row_jacobian[tie.jacobian(0)] {
            *entry = *entry * side;
        }
        position[0] = above.min(below);
        active = Some(position[0].lt(zero));
    }
    let mut size = position[0];
    if tie.rows > 1 {
        let mut square = zero;
        for x in &position[..tie.rows] {
            square = x.fma(*x, square);
        }
        size = square.sqrt();
    }
    let d = impedance(&tie.soft.impedance, size);
    for k in 0..tie.rows {
        let mut velocity = zero;
        for (entry, &dof) in b.work.row_jacobian[tie.jacobian(k)].iter().zip(&tie.dofs) {
            velocity = entry.fma(cx.get(&b.joint_qd[dof]), velocity);
        }
        let inverse_weight = match k {
            0..3 => tie.soft.inverse_weight,
            _ => tie.turning_weight,
        };
        let mut weight = d.div((one - d) * C::F::k(inverse_weight));
        let spring = C::F::k(tie.soft.stiffness) * d * position[k];
        let mut aref = found.beyond[k] - velocity.fma(C::F::k(tie.soft.damping), spring);
        if let Some(active) = active {
            weight = C::F::select(active, weight, zero);
            aref = C::F::select(active, aref, zero);
        }
        cx.set(&mut b.efc_weight[row + k], weight);
        cx.set(&mut b.efc_aref[row + k], aref);
    }
}
