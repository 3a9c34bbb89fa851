//! Energy of a world, for output (MuJoCo: `mj_energyVel`, `mj_energyPos`).
//!
//! ```text
//! E_kin = ½ q̇ᵀ M q̇          E_pot = - Σ g · m c + Σ ½ k (q - rest)²       c a body's centre of mass in the world
//! ```
//!
//! A spring whose stiffness is a polynomial has the energy of [`crate::step::forces::curves`]. After the mass matrix, a root's inertia is that of its whole tree: its first moment h = m (c - point) has all bodies.
//! What stands still has no part in either, as where MuJoCo fuses static bodies.

use crate::arrays::Array as A;
use crate::lane::{Cx, Num, Real};
use crate::math::factor::multiply;
use crate::step::forces::curves;
use crate::step::forces::springs::{joint_stretch, pose_stretch, stretch};
use crate::step::{BlockOf, ConstantsOf, Stage, gravity};

/// Kinetic and potential energy, for output.
pub struct Energy;

impl Stage for Energy {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::MassMatrix,
        A::Inertia,
        A::Reference,
        A::Arm,
        A::TenLength,
        A::PlasticRest,
        A::Params,
    ];
    const WRITES: &'static [A] = &[A::KineticEnergy, A::PotentialEnergy];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let gravity = gravity(m, &b.params);
        let (w, zero) = (&mut b.work, C::F::c(0.0));
        // E_kin = ½ q̇ᵀ (M q̇), with q̇ in `start` and M q̇ in `joint_force`
        for (x, qd) in w.start.iter_mut().zip(&b.joint_qd) {
            *x = cx.get(qd);
        }
        multiply(&m.pattern, &w.mass_matrix, &w.start, &mut w.joint_force);
        let mut kinetic = zero;
        for (qd, momentum) in w.start.iter().zip(&w.joint_force) {
            kinetic = qd.fma(*momentum, kinetic);
        }
        w.kinetic_energy[0] = kinetic * C::F::c(0.5);

        // -g · Σ m c from the roots alone: h + m point is the first moment of all bodies below, about the origin
        let mut potential = zero;
        for (k, body) in m.bodies.iter().enumerate() {
            if body.parent.is_none() {
                let inertia = &w.inertia[k];
                let point = w.reference[body.tree] + w.arm[k];
                let moment = point.scale_add(inertia[0], inertia.first_moment());
                potential = potential - gravity.dot(moment);
            }
        }
        // ½ k (q - rest)² of springs of joints
        for spring in &m.springs.joints {
            let stretch = joint_stretch(cx, m, b, spring);
            let half = curves::energy(spring.stiffness, spring.curve, stretch);
            potential = (stretch * half).fma(stretch, potential);
        }
        // ½ k x² of tendons, with x the length outside of their two rests
        for tendon in &m.springs.tendons {
            let stretch = stretch(cx, m, b, tendon);
            let half = curves::energy(tendon.stiffness, tendon.stiffness_curve, stretch);
            potential = (stretch * half).fma(stretch, potential);
        }
        // ½ k |x|² of balls and free joints, of the displacement and of the rotation vector
        for spring in &m.springs.poses {
            for stretch in pose_stretch(cx, m, b, spring) {
                let square = stretch.dot(stretch);
                let mut half = C::F::c(0.5 * spring.stiffness.to_f64());
                // ½ k + ⅓ a |x| + ¼ b |x|²
                if curves::bends(spring.curve) {
                    half = curves::energy(spring.stiffness, spring.curve, square.sqrt());
                }
                potential = half.fma(square, potential);
            }
        }
        b.work.potential_energy[0] = potential;
    }
}
