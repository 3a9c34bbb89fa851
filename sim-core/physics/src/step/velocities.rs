//! Link velocities in the world, for output.
//!
//! ```text
//! v(c) = v + ω × c        c the link's centre of mass, v the velocity at the reference point
//! ```

use crate::arrays::Workspace;
use crate::constants::Constants;
use crate::lane::Num;
use crate::math::spatial::{ANGULAR, LINEAR};
use crate::math::vec3::{constant, cross_add, transform_add, zero};

#[inline(always)]
pub(super) fn body_qd<F: Num>(m: &Constants<F::Real>, w: &mut Workspace<F>) {
    for (k, frame) in m.frames.iter().enumerate() {
        let center = constant(frame.center);
        let Some(body) = frame.body else {
            w.link_center[k] = center;
            w.body_qd[k] = [zero(), zero()];
            continue;
        };
        let center = transform_add(&w.rotation[body], center, w.origin[body]);
        let velocity = w.velocity[body];
        let moved = cross_add(velocity[ANGULAR], center, velocity[LINEAR]);
        w.link_center[k] = center;
        w.body_qd[k] = [moved, velocity[ANGULAR]];
    }
}
