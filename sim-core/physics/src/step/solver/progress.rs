//! How Newton's method goes on: which worlds search the segment, and which have arrived.

use super::line::Line;
use super::rows::{changes, residual};
use super::{UNKNOWN, contacts};
use crate::constants::contact::{Cone, row};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::step::{BlockOf, ConstantsOf};

/// What one iteration leaves for the next. Cells are 1 for yes, 0 for no.
pub(super) struct Progress<C: Cx> {
    /// Did the last iteration leave every row that touches on its piece? Then the next whole step ends.
    calm: C::V,
    /// Has the world not arrived?
    busy: C::V,
    /// Iterations done [–].
    iteration: C::V,
    /// Gain of the last search [J/s²].
    last_gain: C::V,
}

/// What rows do between a and a⁺.
pub(super) struct Pieces<C: Cx> {
    /// Is some row on another piece of its cost?
    changed: MaskOf<C>,
    /// No contact slides and no dry friction turns: there a whole step overshoots, and may do so for ever.
    straight: MaskOf<C>,
}

/// What an iteration does.
pub(super) struct Plan<C: Cx> {
    changed: MaskOf<C>,
    /// After the first iteration.
    later: MaskOf<C>,
    /// What bodies that touch would gain by one more iteration is less than the tolerance already.
    quiet: MaskOf<C>,
    /// Searches the segment instead of taking the whole step.
    pub searches: MaskOf<C>,
}

/// What a search found.
pub(super) struct Found<C: Cx> {
    /// α of the next accelerations a + α (a⁺ - a); 0 where the step is not taken [–].
    pub length: C::V,
    /// 1 where no step can help any more.
    pub settled: C::V,
}

/// A gain above this share of the last iteration's is no progress of Newton's method [–].
const STALLED: f64 = 0.25;
/// Without progress, a gain up to this many times [`Line::noise`] is taken for noise [–]. Of 327 states of random piles,
/// both cones, no acceleration is then off by more than 3e-4 in `f32`, where 10,000 times leave 2e-3.
const DOUBTED: f64 = 100.0;

/// Iterations that take the whole step without a line search, which costs as much as two iterations.
///
/// Newton's method on a piecewise quadratic mostly ends by itself in two or three; a world that goes
/// on after these searches. The reference always searches, since MuJoCo does.
fn trusted_iterations<F: Num>() -> f64 {
    if F::Real::DOUBLE { -1.0 } else { 2.5 }
}

impl<C: Cx> Pieces<C> {
    /// Residuals at a⁺, and how their rows differ from those at a.
    #[inline(always)]
    pub fn compare(
        cx: &mut C,
        m: &ConstantsOf<C>,
        b: &mut BlockOf<C>,
        corrects: Option<MaskOf<C>>,
    ) -> Pieces<C> {
        let (w, half) = (&mut b.work, C::F::c(0.5));
        residual(
            m,
            &w.limit_side,
            &w.row_aref,
            &w.minimum,
            &mut w.jar_minimum,
        );
        let [sum, turned] = changes(m, &b.params, &w.row_weight, &w.jar, &w.jar_minimum);
        let (mut moved, mut curved) = (cx.var(sum), cx.var(turned));
        if corrects.is_some() {
            contacts::residual(cx, &m.contacts, &w.minimum, row::AHEAD);
            contacts::changes(cx, &m.contacts, &mut moved, &mut curved);
        }
        Pieces {
            changed: half.lt(cx.get(&moved)),
            straight: cx.get(&curved).lt(half),
        }
    }
}

impl<C: Cx> Progress<C> {
    /// Before the first iteration.
    #[inline(always)]
    pub fn new(cx: &mut C, acts: MaskOf<C>, corrects: Option<MaskOf<C>>) -> Progress<C> {
        let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
        // a factor of rows a million times as stiff as M leaves a step its first digits only: one more iteration finds the rest
        let polished = match corrects {
            Some(corrects) => C::F::select(corrects, zero, one),
            None => one,
        };
        Progress {
            calm: cx.var(polished),
            busy: cx.var(C::F::select(acts, one, zero)),
            iteration: cx.var(zero),
            last_gain: cx.var(C::F::c(2.0 * UNKNOWN)),
        }
    }

    /// Whole step or search: the whole step is exact where no row changes its piece.
    #[inline(always)]
    pub fn plan(
        &self,
        cx: &mut C,
        m: &ConstantsOf<C>,
        pieces: &Pieces<C>,
        gain: C::F,
        corrects: Option<MaskOf<C>>,
    ) -> Plan<C> {
        let half = C::F::c(0.5);
        let changed = pieces.changed;
        let later = half.lt(cx.get(&self.iteration));
        let early = cx
            .get(&self.iteration)
            .lt(C::F::c(trusted_iterations::<C::F>()));
        let mut trusted = early & pieces.straight;
        // and where a pyramid's edges are too stiff for their factor
        if let (Some(corrects), Cone::Pyramidal) = (corrects, m.contacts.cone) {
            trusted = trusted & !corrects;
        }
        let quiet = !changed & gain.lt(C::F::k(m.solver.tolerance));
        Plan {
            changed,
            later,
            quiet,
            searches: (changed | later) & !trusted & !quiet,
        }
    }

    /// Whether a search settles the world.
    ///
    /// The model promises a gain of ½ |p'(0)|. Below the tolerance the step is not taken, as in MuJoCo, but for the first;
    /// below what rounding makes it is the last that can help. In `f32` it is the last too if Newton's next one, of which
    /// the gain shrinks with the square, would be below the tolerance.
    #[inline(always)]
    pub fn judge(
        &mut self,
        cx: &mut C,
        m: &ConstantsOf<C>,
        line: &Line<'_, C::F>,
        found: &mut Found<C>,
        plan: &Plan<C>,
        corrects: Option<MaskOf<C>>,
    ) {
        let (zero, half, one) = (C::F::c(0.0), C::F::c(0.5), C::F::c(1.0));
        let tolerance = C::F::k(m.solver.tolerance);
        let gain = half * line.descent;
        let small = plan.later & gain.lt(tolerance);
        let mut last = gain.lt(line.noise);
        if let Some(corrects) = corrects {
            let before = cx.get(&self.last_gain);
            // Newton's gains shrink fast; one that does not, and is hardly more than rounding, is rounding
            let stalls = (C::F::c(STALLED) * before).lt(gain);
            let is_small = gain.lt(line.noise * C::F::c(DOUBTED));
            let mut ends = stalls & is_small;
            if !<<C::F as Num>::Real as Real>::DOUBLE {
                let next = gain * gain;
                let is_enough = next.lt(tolerance * before);
                let off = (cx.get(&found.length) - one).abs();
                let is_newtons = off.lt(C::F::c(0.25)) & before.lt(C::F::c(UNKNOWN));
                ends = ends | (is_enough & is_newtons);
            }
            last = last | (corrects & ends);
            cx.set(&mut self.last_gain, gain);
        }
        cx.set(&mut found.settled, C::F::select(small | last, one, zero));
        let alpha = cx.get(&found.length);
        cx.set(&mut found.length, C::F::select(small, zero, alpha));
    }

    /// The worlds that have arrived: no row changed its piece, or the search settled.
    #[inline(always)]
    pub fn note(
        &mut self,
        cx: &mut C,
        plan: &Plan<C>,
        found: &Found<C>,
        corrects: Option<MaskOf<C>>,
    ) -> MaskOf<C> {
        let (zero, half, one) = (C::F::c(0.0), C::F::c(0.5), C::F::c(1.0));
        let is_calm = half.lt(cx.get(&self.calm)) | plan.quiet;
        let ends = !plan.changed & is_calm;
        let done = ends | half.lt(cx.get(&found.settled));
        if let Some(corrects) = corrects {
            let again = corrects & plan.changed;
            cx.set(&mut self.calm, C::F::select(again, zero, one));
        }
        cx.set(&mut self.busy, C::F::select(done, zero, one));
        done
    }

    /// Counts an iteration.
    #[inline(always)]
    pub fn count(&mut self, cx: &mut C) {
        let done = cx.get(&self.iteration) + C::F::c(1.0);
        cx.set(&mut self.iteration, done);
    }

    /// Marks the worlds that used up their iterations.
    #[inline(always)]
    pub fn report(&self, cx: &mut C, b: &mut BlockOf<C>) {
        let unconverged = cx.get(&b.unconverged[0]).max(cx.get(&self.busy));
        cx.set(&mut b.unconverged[0], unconverged);
    }
}
