//! Link velocities in the world, for output.
//!
//! ```text
//! v(c) = v + ω × c        c the link's centre of mass, v the velocity at the reference point
//! ```

use crate::arrays::Array as A;
use crate::lane::Cx;
use crate::math::spatial::{ANGULAR, LINEAR, Spatial};
use crate::step::masses;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Link velocities for output.
pub struct Velocities;

impl Stage for Velocities {
    const READS: &'static [A] = &[A::Params, A::Rotation, A::Origin, A::Velocity];
    const WRITES: &'static [A] = &[A::LinkCenter, A::BodyQd];

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let w = &mut b.work;
        for (k, frame) in m.frames.iter().enumerate() {
            let center = masses::center_of_frame(m, &b.params, k, frame.center);
            let Some(body) = frame.body else {
                w.link_center[k] = center;
                w.body_qd[k] = Spatial::zero();
                continue;
            };
            // v + ω × c, with c = R p + o from the reference point
            let center = w.rotation[body].mul_add(center, w.origin[body]);
            let velocity = w.velocity[body];
            let moved = velocity[ANGULAR].cross_add(center, velocity[LINEAR]);
            w.link_center[k] = center;
            w.body_qd[k] = Spatial([moved, velocity[ANGULAR]]);
        }
    }
}
