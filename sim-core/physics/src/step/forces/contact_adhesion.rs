//! Contacts that pull, since their shapes adhere (MuJoCo: `adhesion` of geoms and pairs).
//!
//! ```text
//! smooth -= Σ F Jᵀ        over all contacts, also those in the gap; F: force of adhesion, J: row of the contact's normal
//! f = f' - F              net force along the normal, where f' ≥ 0 is that of the solver
//! ```
//!
//! The reference acceleration of the normal has R F more ([`crate::step::constraints::contact_rows`]). So f' has F more than
//! without adhesion, and bodies rest as deep. Friction is bounded by μ f' = μ (f + F). A contact breaks where f' would be negative.

use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::{adhesion, row};
use crate::each;
use crate::lane::{Cx, Num, Real};
use crate::step::constraints::contact_rows::class_list;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Forces by which contacts pull.
pub struct Pull;

impl Stage for Pull {
    const READS: &'static [A] = &[A::SmoothForce, A::ContactRows];
    const WRITES: &'static [A] = &[A::SmoothForce];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        m.contacts.adhesion.rows > 0
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        sum_pulls(cx, m, b);
        // smooth -= Σ F Jᵀ
        for (force, sum) in b.work.smooth_force.iter_mut().zip(&b.adhesion_moment) {
            *force = *force - cx.get(sum);
        }
    }
}

/// The same as passive forces, for output.
pub struct PassivePull;

impl Stage for PassivePull {
    const READS: &'static [A] = &[A::PassiveForce, A::ContactRows];
    const WRITES: &'static [A] = &[A::PassiveForce];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        m.contacts.adhesion.rows > 0
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        sum_pulls(cx, m, b);
        // MuJoCo's `qfrc_passive` contains `qfrc_adhesion`
        for (force, sum) in b.work.passive_force.iter_mut().zip(&b.adhesion_moment) {
            *force = *force - cx.get(sum);
        }
    }
}

/// Writes Σ F Jᵀ of all contacts.
#[inline(always)]
fn sum_pulls<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let t = &m.contacts;
    // the stage of actuators that adhere may have left its own sums
    for cell in &mut b.adhesion_moment {
        cx.set(cell, C::F::c(0.0));
    }
    for (number, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, number);
        each!(cx, r in list, {
            let pair = cx.load(t.memory.rows, r, row::PAIR);
            // 0 for pairs that do not adhere
            let pull = cx.pick(t.adhesion, pair, adhesion::FORCE);
            // of three rows per column, the first is the normal's
            for (c, column) in class.columns.iter().enumerate() {
                let normal = cx.load(t.memory.rows, r, row::JACOBIAN + 3 * c);
                let cell = &mut b.adhesion_moment[column.dof];
                let sum = cx.get(cell) + pull * normal;
                cx.set(cell, sum);
            }
        });
    }
}

/// Forces between shapes: those of the solver less those of adhesion.
pub struct NetForces;

impl Stage for NetForces {
    const READS: &'static [A] = &[A::ContactRows, A::ContactForces];
    const WRITES: &'static [A] = &[A::ContactForces];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        m.contacts.adhesion.rows > 0
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, _: &mut BlockOf<C>) {
        let t = &m.contacts;
        for number in 0..t.classes.len() {
            let list = class_list(cx, t, number);
            each!(cx, r in list, {
                let pair = cx.load(t.memory.rows, r, row::PAIR);
                let pull = cx.pick(t.adhesion, pair, adhesion::FORCE);
                // worlds without the contact keep no force, as the solver left them
                let net = cx.load(t.memory.rows, r, row::FORCE) - pull;
                // outputs and sensors then read the net force alone
                let net = cx.only(net);
                cx.fill(t.memory.rows, r, row::FORCE, net);
            });
        }
    }
}
