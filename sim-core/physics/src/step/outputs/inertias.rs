//! Inertias of bodies of MuJoCo models about the centre of mass of their tree, for output (MuJoCo: `mj_comPos`).
//!
//! ```text
//! cinert = (R I Rᵀ + m (|d|² 1 - d dᵀ), m d, m)        d: from the tree's centre of mass to the body's own
//! ```

use super::subtrees::root_center;
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::Vec3;
use crate::step::{BlockOf, ConstantsOf, Stage, masses};

/// Inertias of bodies.
pub struct Inertias;

impl Stage for Inertias {
    const READS: &'static [A] = &[
        A::Params,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::SubtreeCenter,
    ];
    const WRITES: &'static [A] = &[A::Cinert];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.outputs.bodies.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
        let axis = |i: usize| {
            let mut axis = Vec3([zero; 3]);
            axis[i] = one;
            axis
        };
        let bodies = &m.outputs.bodies;
        for (k, body) in bodies.iter().enumerate() {
            // the world body of a model has no inertia
            if body.parent == k {
                b.work.cinert[k] = [zero; 10];
                continue;
            }
            let mass = masses::mass(m, &b.params, body.link, body.mass);
            // d, the columns of R I Rᵀ, and m d
            let d = masses::position(m, b, body) - root_center(m, b, body);
            let x = masses::inertia_times(m, b, body, axis(0));
            let y = masses::inertia_times(m, b, body, axis(1));
            let z = masses::inertia_times(m, b, body, axis(2));
            let moment = d * mass;
            // parallel axis theorem: xx yy zz xy xz yz of R I Rᵀ + m (|d|² 1 - d dᵀ), then m d and m
            b.work.cinert[k] = [
                d[1].fma(moment[1], d[2].fma(moment[2], x[0])),
                d[0].fma(moment[0], d[2].fma(moment[2], y[1])),
                d[0].fma(moment[0], d[1].fma(moment[1], z[2])),
                d[0].fnma(moment[1], x[1]),
                d[0].fnma(moment[2], x[2]),
                d[1].fnma(moment[2], y[2]),
                moment[0],
                moment[1],
                moment[2],
                mass,
            ];
        }
    }
}
