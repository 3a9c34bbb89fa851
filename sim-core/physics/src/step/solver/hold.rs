//! Contacts that slide, of which the model of an iteration assumes that they stick.
//!
//! The cost of friction has a kink where a contact stops: there its force reverses. A step of Newton's method that would reverse the
//! slip sees no kink, and the line search stops it there. The next steps go back and forth between the kinks of several contacts, and
//! each is a hundredth of what the model wants. benches/NOTES.md has the iterations of such worlds.
//!
//! So the model has the sticking piece of such a contact: in the first iteration of each one that slides, later of those whose slip the
//! last step would have reversed. The line search knows the true cost. A searched step that leads uphill is not taken, and the next
//! model is that of Newton's method. The last iteration holds nothing.
//!
//! In `f64`, the reference, no contact is held: MuJoCo holds none.

use super::contacts::ContactsOf;
use crate::constants::contact::{Cone, row};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::step::ConstantsOf;

/// The worlds in which contacts may be held.
pub(super) struct Hold<C: Cx> {
    /// In their first iteration: all that slide.
    first: MaskOf<C>,
    /// Whose last step was searched: those that it would have reversed.
    searched: MaskOf<C>,
}

impl<C: Cx> Clone for Hold<C> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<C: Cx> Copy for Hold<C> {}

impl<C: Cx> Hold<C> {
    /// None where the cost has no such kinks, and in `f64`.
    #[inline(always)]
    pub fn new(m: &ConstantsOf<C>, first: MaskOf<C>, searched: MaskOf<C>) -> Option<Hold<C>> {
        let has_kinks = m.contacts.cone == Cone::Elliptic;
        let is_reference = <<C::F as Num>::Real as Real>::DOUBLE;
        (has_kinks && !is_reference).then_some(Hold { first, searched })
    }

    /// The worlds in which a contact is held, if it slides. Its row is that of the last line search.
    #[inline(always)]
    pub fn of_contact(&self, cx: &mut C, t: &ContactsOf<C>, r: C::I) -> MaskOf<C> {
        // only friction has this kink; STATE 2 is the sliding piece
        let rubs = C::F::c(0.0).lt(cx.load(t.memory.rows, r, row::MU));
        let slid = C::F::c(1.5).lt(cx.load(t.memory.rows, r, row::STATE));
        let [square, mixed, _] = cx.load3(t.memory.rows, r, row::SQUARES);
        // slip before the step · slip after the whole step
        let reverses = (square + mixed).lt(C::F::c(0.0));
        rubs & (self.first | (self.searched & slid & reverses))
    }
}
