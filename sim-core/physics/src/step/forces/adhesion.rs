//! Actuators that pull a body to what it touches (MuJoCo: `mj_transmission`, `mjTRN_BODY`).
//!
//! ```text
//! moment = -1/n Σ J                over the n contacts of the body; J: row of the contact's normal
//! l = 0      v = moment · q̇      smooth += clamp(Σ momentᵀ force)
//! ```
//!
//! Contacts of the body's own shapes count, also those in the gap, which exert no force. Without contacts the moment is 0.
//! The forces themselves are those of [`super::actuators`]; their sum over all actuators ends here.

use super::actuators::end_sum;
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::row;
use crate::each;
use crate::lane::{Cx, Num, Real};
use crate::step::constraints::contact_rows::class_list;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Forces of actuators along contacts.
pub struct Adhesion;

impl Stage for Adhesion {
    const READS: &'static [A] = &[
        A::JointQd,
        A::ActuatorForce,
        A::ActuatorVelocity,
        A::QfrcActuator,
        A::QfrcGravcomp,
        A::SmoothForce,
        A::ContactRows,
    ];
    const WRITES: &'static [A] = &[A::ActuatorVelocity, A::QfrcActuator, A::SmoothForce];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.actuators.adhesions.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for adhesion in &m.actuators.adhesions {
            let count = sum_normals(cx, m, b, adhesion.body);
            // -1/n, where a sum without contacts is 0 whatever it is divided by
            let share = -C::F::c(1.0).div(count.max(C::F::c(1.0)));
            let force = b.work.actuator_force[adhesion.actuator];
            // Jᵀ force, and v = moment · q̇
            let mut velocity = C::F::c(0.0);
            for (dof, sum) in b.adhesion_moment.iter().enumerate() {
                let moment = share * cx.get(sum);
                let joint = &mut b.work.qfrc_actuator[dof];
                *joint = force.fma(moment, *joint);
                velocity = cx.get(&b.joint_qd[dof]).fma(moment, velocity);
            }
            b.work.actuator_velocity[adhesion.actuator] = velocity;
        }
        end_sum(m, &mut b.work);
    }
}

/// Writes Σ J of the contacts of a body, and returns how many there are.
#[inline(always)]
fn sum_normals<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>, body: usize) -> C::F {
    let (zero, one, half) = (C::F::c(0.0), C::F::c(1.0), C::F::c(0.5));
    for cell in &mut b.adhesion_moment {
        cx.set(cell, zero);
    }
    let mut count = cx.var(zero);
    let t = &m.contacts;
    for (number, class) in t.classes.iter().enumerate() {
        // MuJoCo has no contact between bodies that nothing moves, such as a mocap body and the ground
        if class.columns.is_empty() {
            continue;
        }
        // only classes with a contact of the body, which is one of those that they act on
        let bodies = t.bodies.of_classes.get(number);
        let place = bodies.and_then(|bodies| bodies.iter().position(|&other| other == body));
        let Some(place) = place else { continue };
        // counted from 1, as in the table of pairs
        let slot = C::F::c((place + 1) as f64);
        let list = class_list(cx, t, number);
        each!(cx, r in list, {
            // either side of the pair may be of the body: a swap turns both the normal and the row's sides
            let pair = cx.load(t.memory.rows, r, row::PAIR);
            let first = cx.pick(t.bodies.of_pair, pair, 0);
            let second = cx.pick(t.bodies.of_pair, pair, 1);
            let nearest = (first - slot).abs().min((second - slot).abs());
            let counts = C::F::select(nearest.lt(half), one, zero);
            let more = cx.get(&count) + counts;
            cx.set(&mut count, more);
            // Σ J: of three rows per column, the first is the normal's
            for (c, column) in class.columns.iter().enumerate() {
                let normal = cx.load(t.memory.rows, r, row::JACOBIAN + 3 * c);
                let cell = &mut b.adhesion_moment[column.dof];
                let sum = cx.get(cell) + counts * normal;
                cx.set(cell, sum);
            }
        });
    }
    cx.get(&count)
}
