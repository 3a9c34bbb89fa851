//! What surfaces that touch do beside pushing and rubbing: they may move along themselves, and adhere.

use crate::constants::contact::{Contacts, adhesion, row};
use crate::lane::{Cx, MaskOf, Num};
use crate::math::vec3::{Vec3, load_vec3};

/// How a contact adheres.
pub(super) struct Pull<C: Cx> {
    /// Where it does.
    pub adheres: MaskOf<C>,
    /// What each row of the normal force has of the force of adhesion [N].
    pub share: C::F,
}

impl<C: Cx> Pull<C> {
    /// Reads that of a pair; none where no pair adheres. `is_near` holds where the contact is not in the gap.
    #[inline(always)]
    pub fn read(
        cx: &mut C,
        t: &Contacts<<C::F as Num>::Real>,
        pair: C::F,
        is_near: MaskOf<C>,
    ) -> Option<Pull<C>> {
        if t.adhesion.rows == 0 {
            return None;
        }
        let force = cx.pick(t.adhesion, pair, adhesion::FORCE);
        // in the gap, a contact has no friction
        let near = cx.pick(t.adhesion, pair, adhesion::ROW);
        let in_gap = cx.pick(t.adhesion, pair, adhesion::ROW_IN_GAP);
        // without friction, a pyramid has four edges that coincide
        Some(Pull {
            adheres: C::F::c(0.0).lt(force),
            share: C::F::select(is_near, near, in_gap),
        })
    }
}

/// How fast the second surface of a contact moves beside its body, less the first.
pub(super) struct SurfaceMotion<F> {
    /// At the contact's point [m/s].
    pub velocity: Vec3<F>,
    /// About the normal [rad/s].
    pub spin: F,
}

impl<F: Num> SurfaceMotion<F> {
    /// Reads what the narrow phase left of it; none where no surface moves.
    #[inline(always)]
    pub fn read<C: Cx<F = F>>(
        cx: &mut C,
        t: &Contacts<F::Real>,
        r: C::I,
    ) -> Option<SurfaceMotion<F>> {
        if t.surface_velocities.rows == 0 {
            return None;
        }
        // of surfaces alone: that of the bodies is J q̇
        let mut velocity = load_vec3(cx, t.memory.rows, r, row::SURFACE_VELOCITY);
        // worlds without the contact have what is left of another one
        for x in velocity.iter_mut() {
            *x = cx.or_nothing(*x);
        }
        // friction of torsion follows the spin along the normal alone
        let spin = cx.load(t.memory.rows, r, row::SURFACE_SPIN);
        let spin = cx.or_nothing(spin);
        Some(SurfaceMotion { velocity, spin })
    }
}
