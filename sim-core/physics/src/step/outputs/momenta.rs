//! Momenta of subtrees of MuJoCo models, for output (MuJoCo: `mj_subtreeVel`).
//!
//! ```text
//! p(b) = m v(x) + Σ p(child)        v(b) = p(b) / M(b)
//! L(b) = R I Rᵀ ω + m (x - c) × (v(x) - v(b)) + Σ (L(child) + M (c(child) - c) × (v(child) - v(b)))
//! ```
//!
//! x is the body's own centre of mass, c that of its subtree.

use super::sites::{reference, velocity};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::lane::{Cx, Num, Real};
use crate::math::spatial::{ANGULAR, LINEAR};
use crate::step::{BlockOf, ConstantsOf, Stage, masses};

/// Mass below which a subtree does not move (MuJoCo: `mjMINVAL`) [kg].
const MASS_MIN: f64 = 1e-15;

/// Momenta of subtrees.
pub struct Momenta;

impl Stage for Momenta {
    const READS: &'static [A] = &[
        A::Params,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Velocity,
        A::SubtreeCenter,
        A::SubtreeMass,
    ];
    const WRITES: &'static [A] = &[A::SubtreeLinvel, A::SubtreeAngmom];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.outputs.bodies.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let bodies = &m.outputs.bodies;
        // momenta, until the subtree is complete
        for (k, body) in bodies.iter().enumerate() {
            let twist = velocity(&b.work, &body.inertial, masses::position(m, b, body));
            b.work.subtree_linvel[k] =
                twist[LINEAR] * masses::mass(m, &b.params, body.link, body.mass);
            // the spin itself turns the body about its centre of mass
            b.work.subtree_angmom[k] = masses::inertia_times(m, b, body, twist[ANGULAR]);
        }
        // p(b) = m v(x) + Σ p(child), children before parents; then v(b) = p(b) / M(b)
        for (k, body) in bodies.iter().enumerate().rev() {
            let momentum = b.work.subtree_linvel[k];
            if body.parent != k {
                let above = b.work.subtree_linvel[body.parent];
                b.work.subtree_linvel[body.parent] = above + momentum;
            }
            // a subtree without mass has p = 0, so any divisor gives v(b) = 0
            let whole = b.work.subtree_mass[k].max(C::F::c(MASS_MIN));
            b.work.subtree_linvel[k] = momentum * C::F::c(1.0).div(whole);
        }
        // L(b), children before parents; velocities of all subtrees are complete by now
        for (k, body) in bodies.iter().enumerate().rev() {
            // (x - c) × m (v(x) - v(b)): the body moves about the centre of mass of its subtree
            let point = masses::position(m, b, body);
            let moving = velocity(&b.work, &body.inertial, point)[LINEAR];
            let mass = masses::mass(m, &b.params, body.link, body.mass);
            let w = &mut b.work;
            let (center, carried) = (w.subtree_center[k], w.subtree_linvel[k]);
            let orbital = (point - center).cross((moving - carried) * mass);
            w.subtree_angmom[k] = w.subtree_angmom[k] + orbital;
            let parent = body.parent;
            // to the parent: L(b) + (c - c(parent)) × M (v(b) - v(parent))
            if parent != k {
                let mut apart = center - w.subtree_center[parent];
                let above = &bodies[parent].frame;
                // centres are kept from the reference point of a tree; between trees add the difference of these
                if above.tree != body.frame.tree {
                    apart = apart + (reference(w, &body.frame) - reference(w, above));
                }
                let relative = (carried - w.subtree_linvel[parent]) * w.subtree_mass[k];
                let whole = w.subtree_angmom[k] + apart.cross(relative);
                w.subtree_angmom[parent] = w.subtree_angmom[parent] + whole;
            }
        }
    }
}
