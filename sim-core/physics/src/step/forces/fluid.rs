//! Forces of the medium around links (MuJoCo documentation, "Computation: fluid forces, inertia model").
//! Links with geoms that count as ellipsoids have other forces: [`super::ellipsoid_fluid`].
//!
//! ```text
//! f(i) = -(cᵥ + dᵥ(i) |v(i)|) v(i)      v: velocity of the centre of mass less the wind, along the axes i of inertia
//! n(i) = -(cₒ + dₒ(i) |ω(i)|) ω(i)
//! ```
//!
//! With the box that has a link's mass and inertia, of sides b, and d their mean: cᵥ = 3π d η, cₒ = π d³ η,
//! dᵥ = ρ bⱼ bₖ / 2, dₒ = ρ bᵢ (bⱼ⁴ + bₖ⁴) / 64. A step with `implicitfast` is implicit in them:
//!
//! ```text
//! M += h Σ Jᵀ B J      B = diag(c + 2 d |v|)      and h Jᵀ B J c less on the right, c as in [`crate::step::tree::free_joints`]
//! ```

use super::{ellipsoid_fluid, link_forces};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::options::Integrator;
use crate::constants::passive::Drag;
use crate::lane::{Cx, Num, Real};
use crate::math::spatial::{ANGULAR, LINEAR};
use crate::math::vec3::Vec3;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Forces of the medium.
pub struct Fluid;

impl Stage for Fluid {
    const READS: &'static [A] = &[
        A::Rotation,
        A::Origin,
        A::Motion,
        A::Velocity,
        A::SmoothForce,
    ];
    const WRITES: &'static [A] = &[A::SmoothForce];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        is_there(m)
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let w = &mut b.work;
        forces(m, w);
        for (smooth, projected) in w.smooth_force.iter_mut().zip(&w.joint_force) {
            *smooth = *smooth + *projected;
        }
    }
}

/// Does a medium act on anything?
#[inline(always)]
pub(in crate::step) fn is_there<R>(m: &Constants<R>) -> bool {
    !m.drags.is_empty() || !m.fluid_geoms.is_empty()
}

/// Writes the forces of the medium to `joint_force`.
#[inline(always)]
pub(in crate::step) fn forces<F: Num>(m: &Constants<F::Real>, w: &mut Workspace<F>) {
    link_forces::clear(w);
    for drag in &m.drags {
        let flow = Flow::around(w, drag);
        let (mut force, mut torque) = (Vec3::zero(), Vec3::zero());
        // f = -(c + d |v|) v and n = -(c + d |ω|) ω, axis by axis
        for i in 0..3 {
            let pull = flow.resistance(drag, LINEAR, i, 1.0) * flow.speed[LINEAR][i];
            let turn = flow.resistance(drag, ANGULAR, i, 1.0) * flow.speed[ANGULAR][i];
            force = flow.axes[i].scale_add(-pull, force);
            torque = flow.axes[i].scale_add(-turn, torque);
        }
        link_forces::add(w, drag.body, flow.point, force, torque);
    }
    ellipsoid_fluid::add_forces(m, w);
    // Σ Jᵀ f over all links
    link_forces::project(m, w);
}

/// How the medium flows around a link.
struct Flow<F> {
    /// Centre of mass from the robot's reference point [m].
    point: Vec3<F>,
    /// Axes of inertia in the world [–].
    axes: [Vec3<F>; 3],
    /// Velocity against the medium, then angular velocity, along these axes [m/s, rad/s].
    speed: [Vec3<F>; 2],
}

impl<F: Num> Flow<F> {
    #[inline(always)]
    fn around(w: &Workspace<F>, drag: &Drag<F::Real>) -> Flow<F> {
        let (rotation, velocity) = (&w.rotation[drag.body], w.velocity[drag.body]);
        // centre of mass p from the reference point, and its velocity v + ω × p - wind
        let point = rotation.mul_add(Vec3::constant(drag.center), w.origin[drag.body]);
        let moved = velocity[ANGULAR].cross_add(point, velocity[LINEAR]);
        let moved = moved - Vec3::constant(drag.wind);
        // both velocities along the axes of inertia
        let (mut axes, mut speed) = ([Vec3::zero(); 3], [Vec3::zero(); 2]);
        for i in 0..3 {
            axes[i] = rotation * Vec3::constant(drag.axes[i]);
            speed[LINEAR][i] = axes[i].dot(moved);
            speed[ANGULAR][i] = axes[i].dot(velocity[ANGULAR]);
        }
        Flow { point, axes, speed }
    }

    /// c + times d |v| along an axis, linear or angular.
    #[inline(always)]
    fn resistance(&self, drag: &Drag<F::Real>, part: usize, i: usize, times: f64) -> F {
        let quadratic = F::c(times) * F::k(drag.quadratic[part][i]);
        quadratic.fma(self.speed[part][i].abs(), F::k(drag.viscous[part]))
    }
}

/// Adds h Jᵀ B J to the mass matrix, and subtracts h Jᵀ B J c from the right-hand side, `acceleration`.
#[inline(always)]
pub(in crate::step) fn add_damping<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    // a step with `implicit` has these as they are, which is not symmetric
    if m.integrator != Integrator::Implicit {
        ellipsoid_fluid::add_damping::<C>(m, b);
    }
    let (w, dt) = (&mut b.work, C::F::k(m.dt));
    for drag in &m.drags {
        let flow = Flow::around(w, drag);
        let tree = m.bodies[drag.body].tree;
        // dofs on the path of the body's last dof to the root: all that move the link
        let last = m.bodies[drag.body].dofs().end - 1;
        let path = m.dofs[last].entries;
        let path = &m.mass_entries[path.0..path.1];
        // a row of J and its damping for each of six directions
        for part in [LINEAR, ANGULAR] {
            for i in 0..3 {
                let axis = flow.axes[i];
                let arm = flow.point.cross(axis);
                for entry in path {
                    let motion = w.motion[entry.other];
                    // a row of J
                    w.step[entry.other] = match part {
                        LINEAR => axis.dot(motion[LINEAR]) + arm.dot(motion[ANGULAR]),
                        _ => axis.dot(motion[ANGULAR]),
                    };
                }
                // h (c + 2 d |v|) = -h ∂f/∂v
                let damping = flow.resistance(drag, part, i, 2.0) * dt;
                // only the acceleration of a free body's frame differs from ours
                let swing = match (part, m.trees[tree].free) {
                    (LINEAR, Some(free)) => {
                        let (spin, origin) = (w.velocity[free][ANGULAR], w.origin[free]);
                        Some(axis.dot(spin.cross(spin.cross(origin))))
                    }
                    _ => None,
                };
                // M += Jᵀ x J, and the right-hand side less Jᵀ x J c
                add_row::<C>(m, w, last, damping, swing);
            }
        }
    }
}

/// Adds Jᵀ x J to the mass matrix, J the row of a body in `step`, and subtracts Jᵀ x c from `acceleration`.
#[inline(always)]
fn add_row<C: Cx>(
    m: &ConstantsOf<C>,
    w: &mut Workspace<C::F>,
    last: usize,
    x: C::F,
    swing: Option<C::F>,
) {
    let entries = |dof: usize| {
        let (start, end) = m.dofs[dof].entries;
        &m.mass_entries[start..end]
    };
    // each pair of dofs once: a dof with those before it on the path
    for row in entries(last) {
        let scaled = w.step[row.other] * x;
        for entry in entries(row.other) {
            let place = &mut w.mass_matrix[entry.place];
            *place = scaled.fma(w.step[entry.other], *place);
        }
        // -Jᵀ x J c, `swing` being J c
        if let Some(swing) = swing {
            let force = &mut w.acceleration[row.other];
            *force = scaled.fnma(swing, *force);
        }
    }
}
