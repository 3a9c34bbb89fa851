//! Armature and damping of free joints of MuJoCo models.
//!
//! They belong to MuJoCo's velocities ([`super::generalized`]): of the frame's origin o from the centre of mass, and about the
//! body's axes. With v' = T v and a' = T a + c:
//!
//! ```text
//! v' = v + ω × o     ω' = Rᵀ ω     c = (ω × (ω × o), 0)     Tᵀ (f, n) = (f, o × f + R n)
//! M += Tᵀ A T        smooth -= Tᵀ (A c + D T v)
//! ```
//!
//! D may grow with the entries of v' ([`crate::step::forces::curves`]): in the force with v', below with its derivative.
//! A step that is implicit in damping solves (M + h TᵀDT) a = τ + Jᵀf - h TᵀD c. For a free body that carries nothing,
//! `implicitfast` adds h N, the change of its bias force with the velocity in MuJoCo's coordinates. With mass m, first moment
//! p, second moment I and S(α) = ω × (α × r) + α × (ω × r), r = -o:
//!
//! ```text
//! N α = (α × (ω × p) + ω × (α × p) + m S(α),  α × I ω + ω × I α + p × S(α))
//! ```

use crate::arrays::{Block, Workspace};
use crate::constants::Constants;
use crate::constants::params::Param;
use crate::lane::{Cx, Num};
use crate::math::spatial::Inertia;
use crate::math::vec3::Vec3;
use crate::step::forces::curves;
use crate::step::{BlockOf, ConstantsOf, param};

/// Armature or damping of the dofs of a free body, linear and angular, in MuJoCo's velocities.
#[inline(always)]
fn of_dofs<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    which: Param,
    body: usize,
) -> [Vec3<F>; 2] {
    let first = m.bodies[body].dof;
    let mut both = [Vec3::zero(); 2];
    for i in 0..6 {
        let dof = &m.dofs[first + i];
        let fixed = match which {
            Param::JointArmature => dof.armature,
            _ => dof.damping,
        };
        // dofs 0 to 2 are linear, 3 to 5 angular
        both[i / 3][i % 3] = param(m, params, which, first + i, fixed);
    }
    both
}

#[inline(always)]
fn scaled<F: Num>(a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
    Vec3([a[0] * b[0], a[1] * b[1], a[2] * b[2]])
}

/// Subtracts Tᵀ (f, n) from the entries of a body in a vector of dofs.
#[inline(always)]
pub(in crate::step) fn subtract<F: Num>(
    to: &mut [F],
    [force, torque]: [Vec3<F>; 2],
    rotation: crate::math::vec3::Mat3<F>,
    origin: Vec3<F>,
) {
    // Tᵀ (f, n) = (f, o × f + R n)
    let turn = origin.cross_add(force, rotation * torque);
    for i in 0..3 {
        to[i] = to[i] - force[i];
        to[3 + i] = to[3 + i] - turn[i];
    }
}

/// The angular velocity of a free body.
#[inline(always)]
fn spin<C: Cx>(cx: &C, b: &BlockOf<C>, dof: usize) -> Vec3<C::F> {
    let mut spin = Vec3::zero();
    for i in 0..3 {
        spin[i] = cx.get(&b.joint_qd[dof + 3 + i]);
    }
    spin
}

/// Subtracts the damping of free joints.
#[inline(always)]
pub(in crate::step) fn add_damping_forces<C: Cx>(
    cx: &C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    to: &mut [C::F],
) {
    for &body in &m.free_joints {
        let first = m.bodies[body].dof;
        let (rotation, origin) = (b.work.rotation[body], b.work.origin[body]);
        // v' = v + ω × o, the velocity of the frame's origin
        let spin = spin(cx, b, first);
        let mut velocity = Vec3::zero();
        for i in 0..3 {
            velocity[i] = cx.get(&b.joint_qd[first + i]);
        }
        let velocity = spin.cross_add(origin, velocity);
        // D v', the angular part in the body's axes
        let turning = rotation.transpose_mul(spin);
        let [mut linear, mut angular] = of_dofs(m, &b.params, Param::JointDamping, body);
        // d + a |v'| + b v'²
        for i in 0..3 {
            let slide = m.dofs[first + i].damping_curve;
            let turn = m.dofs[first + 3 + i].damping_curve;
            linear[i] = curves::curved(linear[i], slide, velocity[i].abs());
            angular[i] = curves::curved(angular[i], turn, turning[i].abs());
        }
        let force = scaled(linear, velocity);
        let torque = scaled(angular, turning);
        subtract(&mut to[first..first + 6], [force, torque], rotation, origin);
    }
}

/// Subtracts what their armature needs for the part of MuJoCo's acceleration that ours does not have, times a factor.
#[inline(always)]
pub(in crate::step) fn add_swing_forces<C: Cx>(
    cx: &C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    times: f64,
    to: &mut [C::F],
) {
    for &body in &m.free_joints {
        let first = m.bodies[body].dof;
        let (rotation, origin) = (b.work.rotation[body], b.work.origin[body]);
        // A c with c = (ω × (ω × o), 0): the angular part of armature has no share
        let spin = spin(cx, b, first);
        let swing = spin.cross(spin.cross(origin));
        let [armature, _] = of_dofs(m, &b.params, Param::JointArmature, body);
        let force = [scaled(armature, swing) * C::F::c(times), Vec3::zero()];
        subtract(&mut to[first..first + 6], force, rotation, origin);
    }
}

/// Adds Tᵀ X T to the mass matrix, X a diagonal in MuJoCo's velocities: armature, or h times damping.
#[inline(always)]
fn add_block<F: Num>(
    m: &Constants<F::Real>,
    w: &mut Workspace<F>,
    body: usize,
    [linear, angular]: [Vec3<F>; 2],
) {
    let first = m.bodies[body].dof;
    let (rotation, origin) = (w.rotation[body], w.origin[body]);
    for j in 0..3 {
        let mut axis = Vec3::zero();
        axis[j] = F::c(1.0);
        // what a rotation about this axis adds to the velocity of the frame's origin
        let moved = scaled(linear, axis.cross(origin));
        let turned = scaled(
            angular,
            Vec3([rotation[0][j], rotation[1][j], rotation[2][j]]),
        );
        // angular rows of this column: o × X (axis × o) + R X Rᵀ axis
        let torque = origin.cross_add(moved, rotation * turned);
        // linear block X, then the row of dof 3 + j: the matrix keeps its lower triangle
        let diagonal = m.pattern.at(first + j, first + j);
        w.mass_matrix[diagonal] = w.mass_matrix[diagonal] + linear[j];
        for i in 0..3 {
            let place = m.pattern.at(first + 3 + j, first + i);
            w.mass_matrix[place] = w.mass_matrix[place] + moved[i];
        }
        for i in 0..j + 1 {
            let place = m.pattern.at(first + 3 + j, first + 3 + i);
            w.mass_matrix[place] = w.mass_matrix[place] + torque[i];
        }
    }
}

/// Adds Tᵀ A T to the mass matrix.
#[inline(always)]
pub(in crate::step) fn add_armature<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    w: &mut Workspace<F>,
) {
    for &body in &m.free_joints {
        let armature = of_dofs(m, params, Param::JointArmature, body);
        add_block(m, w, body, armature);
    }
}

/// Adds Tᵀ A T a to the forces that accelerations need, `missing`.
#[inline(always)]
pub(in crate::step) fn add_armature_forces<C: Cx>(cx: &C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for &body in &m.free_joints {
        let first = m.bodies[body].dof;
        let (mut linear, mut angular) = (Vec3::zero(), Vec3::zero());
        for i in 0..3 {
            linear[i] = cx.get(&b.joint_qdd[first + i]);
            angular[i] = cx.get(&b.joint_qdd[first + 3 + i]);
        }
        // `inverse_dynamics` has no use of the robot's reference point, and the frame's origin from it
        let rotation = b.work.rotation[body];
        let origin = -(rotation * Vec3::constant(m.bodies[body].center));
        // A T a, negative because `subtract` adds it then
        let [slide, turn] = of_dofs(m, &b.params, Param::JointArmature, body);
        let force = scaled(slide, angular.cross_add(origin, linear)) * C::F::c(-1.0);
        let torque = scaled(turn, rotation.transpose_mul(angular)) * C::F::c(-1.0);
        let to = &mut b.work.missing[first..first + 6];
        subtract(to, [force, torque], rotation, origin);
    }
}

/// Adds h Tᵀ D T to the mass matrix, and subtracts h Tᵀ D c from the right-hand side, `acceleration`.
#[inline(always)]
pub(in crate::step) fn add_damping<C: Cx>(cx: &C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let dt = C::F::k(m.dt);
    for &body in &m.free_joints {
        let first = m.bodies[body].dof;
        let [mut linear, mut angular] = of_dofs(m, &b.params, Param::JointDamping, body);
        let spin = spin(cx, b, first);
        let (rotation, origin) = (b.work.rotation[body], b.work.origin[body]);
        // D as the derivative of D v', at v' = v + ω × o and ω' = Rᵀ ω
        let (turning, swing) = (rotation.transpose_mul(spin), spin.cross(origin));
        for i in 0..3 {
            let velocity = cx.get(&b.joint_qd[first + i]) + swing[i];
            let slide = m.dofs[first + i].damping_curve;
            let turn = m.dofs[first + 3 + i].damping_curve;
            linear[i] = curves::slope(linear[i], slide, velocity);
            angular[i] = curves::slope(angular[i], turn, turning[i]);
        }
        // h D, whose Tᵀ D T is no diagonal
        let damping = [linear * dt, angular * dt];
        let w = &mut b.work;
        // on the left h Tᵀ D T, on the right -h Tᵀ D c
        add_block(m, w, body, damping);
        let force = scaled(damping[0], spin.cross(spin.cross(origin)));
        let to = &mut w.acceleration[first..first + 6];
        subtract(to, [force, Vec3::zero()], rotation, origin);
    }
}

/// The system (H + h N) a = b of a free body. H is its block of the mass matrix; b, in column 6, its part of `acceleration`.
#[inline(always)]
pub(in crate::step) fn system<C: Cx>(
    cx: &C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    body: usize,
) -> [[C::F; 7]; 6] {
    let (first, dt) = (m.bodies[body].dof, C::F::k(m.dt));
    let spin = spin(cx, b, first);
    let w = &b.work;
    let zero = C::F::c(0.0);
    // six rows, and the right-hand side
    let mut system = [[zero; 7]; 6];
    // H is symmetric, and its lower triangle is kept
    for i in 0..6 {
        for j in 0..6 {
            let (row, column) = (first + i.max(j), first + i.min(j));
            system[i][j] = w.mass_matrix[m.pattern.at(row, column)];
        }
        system[i][6] = w.acceleration[first + i];
    }
    // h N: the bias force changes with the angular velocity alone, in columns 3 to 5
    for j in 0..3 {
        let mut axis = Vec3::zero();
        axis[j] = C::F::c(1.0);
        let [force, torque] = bias_change(&w.inertia[body], w.origin[body], spin, axis);
        for i in 0..3 {
            system[i][3 + j] = dt.fma(force[i], system[i][3 + j]);
            system[3 + i][3 + j] = dt.fma(torque[i], system[3 + i][3 + j]);
        }
    }
    system
}

/// Solves the system of a free body; leaves a in `minimum`.
#[inline(always)]
pub(in crate::step) fn solve<C: Cx>(
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    body: usize,
    mut system: [[C::F; 7]; 6],
) {
    // Gauss' elimination, then back substitution from the last row
    let first = m.bodies[body].dof;
    let solution = &mut b.work.minimum[first..first + 6];
    eliminate(&mut system);
    for i in (0..6).rev() {
        let mut x = system[i][6];
        for j in i + 1..6 {
            x = system[i][j].fnma(solution[j], x);
        }
        solution[i] = x.div(system[i][i]);
    }
}

/// N α of a free body.
#[inline(always)]
fn bias_change<F: Num>(
    inertia: &Inertia<F>,
    origin: Vec3<F>,
    spin: Vec3<F>,
    turn: Vec3<F>,
) -> [Vec3<F>; 2] {
    let moment = inertia.first_moment();
    // r, from the frame's origin to the centre of mass, and p the first moment about the reference point
    let arm = -origin;
    // S(α) = α × (ω × r) + ω × (α × r)
    let swing = turn.cross_add(spin.cross(arm), spin.cross(turn.cross(arm)));
    // α × (ω × p) + ω × (α × p)
    let pull = turn.cross_add(spin.cross(moment), spin.cross(turn.cross(moment)));
    // α × I ω + ω × I α
    let gyration = spin.cross(inertia.second_moment(turn));
    let gyration = turn.cross_add(inertia.second_moment(spin), gyration);
    [
        swing.scale_add(inertia[0], pull),
        moment.cross_add(swing, gyration),
    ]
}

/// Gauss' elimination without pivots: the system is that of a positive definite matrix, and a step's change of it.
#[inline(always)]
fn eliminate<F: Num>(system: &mut [[F; 7]; 6]) {
    for p in 0..6 {
        // row -= row(p) / pivot × row p of the system
        let pivot = system[p];
        let inverse = F::c(1.0).div(pivot[p]);
        for row in &mut system[p + 1..] {
            let factor = row[p] * inverse;
            // column p stays as it is below the pivot: nothing reads it again
            for (x, above) in row.iter_mut().zip(pivot).skip(p + 1) {
                *x = factor.fnma(above, *x);
            }
        }
    }
}

/// Puts what [`solve`] found in the place of the accelerations.
#[inline(always)]
pub(in crate::step) fn take<F: Num, V>(m: &Constants<F::Real>, b: &mut Block<F, V>, body: usize) {
    let dofs = m.bodies[body].dofs();
    let w = &mut b.work;
    w.acceleration[dofs.clone()].copy_from_slice(&w.minimum[dofs]);
}
