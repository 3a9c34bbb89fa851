//! Subtrees of MuJoCo models, for output: centres of mass, and velocities about them (MuJoCo: `mj_comPos`, `mj_comVel`).
//!
//! ```text
//! M(b) = m(b) + Σ M(child)        M c(b) = m(b) x(b) + Σ M c(child)       x: the body's own centre of mass
//! cvel(b) = (ω, v + ω × c(root))                                          v at the reference point of the tree
//! ```
//!
//! Centres are kept from the reference point of each body's tree, so they keep their digits far from the origin.

use super::sites::reference;
use crate::arrays::{Array as A, Block};
use crate::constants::Constants;
use crate::constants::outputs::OutputBody;
use crate::lane::{Cx, Num, Real};
use crate::math::spatial::{ANGULAR, LINEAR, Spatial};
use crate::math::vec3::Vec3;
use crate::step::{BlockOf, ConstantsOf, Stage, masses};

/// Mass below which a subtree's centre is that of its body (MuJoCo: `mjMINVAL`) [kg].
const MASS_MIN: f64 = 1e-15;

/// Centres of mass of subtrees, and velocities about them.
pub struct Subtrees;

impl Stage for Subtrees {
    const READS: &'static [A] = &[A::Params, A::Rotation, A::Origin, A::Reference, A::Velocity];
    const WRITES: &'static [A] = &[A::SubtreeCenter, A::SubtreeMass, A::SubtreeCom, A::Cvel];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.outputs.bodies.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let bodies = &m.outputs.bodies;
        // first moments, until the subtree is complete
        for (k, body) in bodies.iter().enumerate() {
            let mass = masses::mass(m, &b.params, body.link, body.mass);
            b.work.subtree_mass[k] = mass;
            b.work.subtree_center[k] = masses::position(m, b, body) * mass;
        }
        // children before parents: when a body is reached, M c and M have its whole subtree
        for (k, body) in bodies.iter().enumerate().rev() {
            let body_center = masses::position(m, b, body);
            let w = &mut b.work;
            let (moment, mass) = (w.subtree_center[k], w.subtree_mass[k]);
            // c = M c / M, or the centre of the body itself if the subtree has no mass
            let is_light = mass.lt(C::F::c(MASS_MIN));
            let inverse = C::F::c(1.0).div(mass.max(C::F::c(MASS_MIN)));
            for i in 0..3 {
                w.subtree_center[k][i] =
                    C::F::select(is_light, body_center[i], moment[i] * inverse);
            }
            w.subtree_com[k] = w.subtree_center[k] + reference(w, &body.frame);
            if body.parent != k {
                // the parent adds M c, from the reference point of its own tree, and M
                let above = &bodies[body.parent].frame;
                let mut moment = moment;
                if above.tree != body.frame.tree {
                    let apart = reference(w, &body.frame) - reference(w, above);
                    moment = apart.scale_add(mass, moment);
                }
                let parent = body.parent;
                w.subtree_center[parent] = w.subtree_center[parent] + moment;
                w.subtree_mass[parent] = w.subtree_mass[parent] + mass;
            }
        }
        for (k, body) in bodies.iter().enumerate() {
            // MuJoCo has the angular part first
            let Spatial([linear, angular]) = com_velocity(m, b, k, body);
            let (Vec3([x, y, z]), Vec3([u, v, w])) = (angular, linear);
            b.work.cvel[k] = [x, y, z, u, v, w];
        }
    }
}

/// Velocity of the point of body `k` at the centre of mass of its tree, and the angular one.
#[inline(always)]
fn com_velocity<F: Num, V>(
    m: &Constants<F::Real>,
    b: &Block<F, V>,
    k: usize,
    body: &OutputBody<F::Real>,
) -> Spatial<F> {
    debug_assert!(body.root <= k);
    let w = &b.work;
    match body.frame.body {
        Some(carrier) => {
            // v + ω × c(root) and ω
            let velocity = w.velocity[carrier];
            let center = root_center(m, b, body);
            Spatial([
                velocity[ANGULAR].cross_add(center, velocity[LINEAR]),
                velocity[ANGULAR],
            ])
        }
        None => Spatial::zero(),
    }
}

/// Centre of mass of a body's tree, from the reference point of the body's own one.
#[inline(always)]
pub(in crate::step) fn root_center<F: Num, V>(
    m: &Constants<F::Real>,
    b: &Block<F, V>,
    body: &OutputBody<F::Real>,
) -> Vec3<F> {
    let w = &b.work;
    let root = &m.outputs.bodies[body.root];
    let center = w.subtree_center[body.root];
    // within a tree no reference point enters
    if root.frame.tree == body.frame.tree {
        return center;
    }
    center + (reference(w, &root.frame) - reference(w, &body.frame))
}
