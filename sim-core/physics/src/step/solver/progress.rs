//! Progress of Newton's method: which worlds search the segment, and which have arrived.

use super::hold::Hold;
use super::line::Line;
use super::rows::{Acting, Jacobian, changes, residual};
use super::{UNKNOWN, contacts};
use crate::arrays::Pause;
use crate::constants::contact::{Cone, row};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::step::{BlockOf, ConstantsOf};

/// State between iterations. Cells are 1 for yes, 0 for no.
pub(super) struct Progress<C: Cx> {
    /// Did every row keep its piece in the last iteration? Then the next whole step ends the solve.
    calm: C::V,
    /// Has the world not arrived?
    busy: C::V,
    /// Iterations done [–].
    iteration: C::V,
    /// Gain of the last search [J/s²].
    last_gain: C::V,
    /// Was the last step searched, and taken?
    searched: C::V,
}

/// Rows between a and a⁺.
pub(super) struct Pieces<C: Cx> {
    /// Is some row on another piece of its cost?
    changed: MaskOf<C>,
    /// No contact slides and no dry friction reverses: whole steps would overshoot there, possibly without end.
    straight: MaskOf<C>,
}

/// What an iteration does in each world.
pub(super) struct Plan<C: Cx> {
    changed: MaskOf<C>,
    /// After the first iteration.
    later: MaskOf<C>,
    /// No row changed its piece, and what bodies in contact may still gain is below the tolerance.
    quiet: MaskOf<C>,
    /// Searches the segment instead of taking the whole step.
    pub searches: MaskOf<C>,
}

/// The result of a search.
pub(super) struct SearchResult<C: Cx> {
    /// α of the next accelerations a + α (a⁺ - a); 0 where the step is not taken [–].
    pub length: C::V,
    /// 1 where no further step can help.
    pub settled: C::V,
}

/// A gain above this share of the last iteration's is not the convergence of Newton's method [–].
const STALLED: f64 = 0.25;
/// A gain that does not shrink counts as noise up to this many times [`Line::noise`] [–]. In 327 states of random piles, both
/// cones, accelerations are then off by at most 3e-4 in `f32`; with 10,000 times by 2e-3.
const DOUBTED: f64 = 100.0;
/// Of the tolerance, how much the next step of Newton's method may be expected to gain where it is not taken [–]. The expectation
/// fails where a contact is about to change its piece. Of 65,000 solves of a quadruped that puts down its feet, two were off with 1,
/// one by 15 rad/s² in a joint; none with 0.1.
const EXPECTED: f64 = 0.01;

/// An impratio above which the edges of pyramids may be too stiff for whole steps [–]. RL libraries have 1 to 10, where whole
/// steps end sooner; at 1000 they go back and forth between pieces.
const STIFF: f64 = 10.0;
/// Relative error of a step that is solved for in a system so many times as stiff as bodies are heavy, over that and the rounding
/// of a scalar [–]. An estimate on the safe side: dozens of roundings meet in an entry of the system.
const SOLVED: f64 = 30.0;

/// Iterations that take the whole step without a line search, which costs as much as two iterations.
///
/// Newton's method on a piecewise quadratic mostly ends in two or three iterations. A world that needs more searches. The
/// reference always searches, since MuJoCo does.
fn trusted_iterations<F: Num>() -> f64 {
    if F::Real::DOUBLE { -1.0 } else { 2.5 }
}

impl<C: Cx> Pieces<C> {
    /// Residuals at a⁺, and how their rows differ from those at a.
    #[inline(always)]
    pub fn compare<const TURNS: bool>(
        cx: &mut C,
        m: &ConstantsOf<C>,
        b: &mut BlockOf<C>,
        acting: Acting,
        corrects: Option<MaskOf<C>>,
    ) -> Pieces<C> {
        let (w, half) = (&mut b.work, C::F::c(0.5));
        // jar at a⁺
        residual(
            m,
            Jacobian::new(acting, &w.limit_side, &w.row_jacobian),
            &w.row_aref,
            &w.minimum,
            &mut w.jar_minimum,
        );
        // joint rows and ties: how many are on another piece, and how many frictions reverse
        let [sum, turned] = changes(
            m,
            &b.params,
            acting,
            [&w.row_weight, &w.jar, &w.jar_minimum],
        );
        let (mut moved, mut curved) = (cx.var(sum), cx.var(turned));
        // contacts: one that slides counts as changed, since its cost is not quadratic
        if corrects.is_some() {
            contacts::residual::<_, TURNS>(cx, &m.contacts, &w.minimum, row::AHEAD);
            contacts::changes::<_, TURNS>(cx, &m.contacts, &mut moved, &mut curved);
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
        // with rows a million times as stiff as M a step has its first digits only: one more iteration finds the rest
        let polished = match corrects {
            Some(corrects) => C::F::select(corrects, zero, one),
            None => one,
        };
        Progress {
            calm: cx.var(polished),
            busy: cx.var(C::F::select(acts, one, zero)),
            iteration: cx.var(zero),
            last_gain: cx.var(C::F::c(2.0 * UNKNOWN)),
            searched: cx.var(zero),
        }
    }

    /// As it was saved, where a solve goes on.
    #[inline(always)]
    pub fn load(cx: &mut C, saved: &[C::V]) -> Progress<C> {
        let mut part = |k: usize| {
            let value = cx.get(&saved[k]);
            cx.var(value)
        };
        Progress {
            calm: part(0),
            busy: part(Pause::BUSY),
            iteration: part(Pause::ITERATION),
            last_gain: part(3),
            searched: part(4),
        }
    }

    /// Saves it, where a solve pauses: in the order of the fields, see [`Pause::BUSY`].
    #[inline(always)]
    pub fn save(&self, cx: &mut C, saved: &mut [C::V]) {
        let parts = [
            &self.calm,
            &self.busy,
            &self.iteration,
            &self.last_gain,
            &self.searched,
        ];
        for (cell, part) in saved.iter_mut().zip(parts) {
            let value = cx.get(part);
            cx.put(cell, value);
        }
    }

    /// The worlds that have neither arrived nor used up their iterations.
    #[inline(always)]
    pub fn goes_on(&self, cx: &mut C, m: &ConstantsOf<C>) -> MaskOf<C> {
        let half = C::F::c(0.5);
        let end = C::F::c(m.solver.iterations as f64 - 0.5);
        half.lt(cx.get(&self.busy)) & cx.get(&self.iteration).lt(end)
    }

    /// Which contacts the next model holds: none in the last iteration, whose step may not be taken then.
    #[inline(always)]
    pub fn hold(&self, cx: &mut C, m: &ConstantsOf<C>) -> Option<Hold<C>> {
        let half = C::F::c(0.5);
        let iteration = cx.get(&self.iteration);
        let is_last = C::F::c(m.solver.iterations as f64 - 1.5).lt(iteration);
        let searched = half.lt(cx.get(&self.searched));
        // all that slide in the first iteration; after a search those whose slip its whole step would have reversed
        Hold::new(m, iteration.lt(half) & !is_last, searched & !is_last)
    }

    /// Whole step or search: the whole step is exact where no row changes its piece.
    #[inline(always)]
    pub fn plan(
        &self,
        cx: &mut C,
        m: &ConstantsOf<C>,
        pieces: &Pieces<C>,
        (gain, stiffening): (C::F, C::F),
        corrects: Option<MaskOf<C>>,
    ) -> Plan<C> {
        let (half, one) = (C::F::c(0.5), C::F::c(1.0));
        let changed = pieces.changed;
        let later = half.lt(cx.get(&self.iteration));
        let early = cx
            .get(&self.iteration)
            .lt(C::F::c(trusted_iterations::<C::F>()));
        // a whole step saves the line search: early iterations take it unless a contact slides or a friction reverses
        let mut trusted = early & pieces.straight;
        // the edges of a pyramid may be too stiff for the factorisation
        if let (Some(corrects), Cone::Pyramidal) = (corrects, m.contacts.cone)
            && m.contacts.impratio.to_f64() > STIFF
        {
            trusted = trusted & !corrects;
        }
        // on straight pieces the step is exact but for its rounding;
        // inverse dynamics will correct that, if the model needs it
        let rounding = match m.solver.refinements {
            0 => stiffening * C::F::c(SOLVED * <<C::F as Num>::Real as Real>::EPSILON),
            _ => C::F::c(0.0),
        };
        let left = match <<C::F as Num>::Real as Real>::DOUBLE {
            // the reference goes on, as MuJoCo does
            true => gain,
            false => C::F::select(pieces.straight, gain * (rounding * rounding).min(one), gain),
        };
        // no row leaves its piece, and the gain that is left is below the tolerance
        let quiet = !changed & left.lt(C::F::k(m.solver.tolerance));
        // the first step is exact if no row changed its piece; any other one is searched unless trusted or quiet
        Plan {
            changed,
            later,
            quiet,
            searches: (changed | later) & !trusted & !quiet,
        }
    }

    /// Whether a search settles the world.
    ///
    /// The model predicts a gain of ½ |p'(0)|. Below the tolerance the step is not taken, except the first (as in MuJoCo). Below
    /// the rounding of the gain it is the last step. In `f32` it is also the last where the gain of the next step would be far below
    /// the tolerance: gains of Newton's method shrink with the square. Where contacts are held, the gain is another model's, and
    /// settles nothing.
    #[inline(always)]
    pub fn judge(
        &mut self,
        cx: &mut C,
        m: &ConstantsOf<C>,
        line: &Line<'_, C::F>,
        result: &mut SearchResult<C>,
        plan: &Plan<C>,
        corrects: Option<MaskOf<C>>,
    ) {
        let (zero, half, one) = (C::F::c(0.0), C::F::c(0.5), C::F::c(1.0));
        let tolerance = C::F::k(m.solver.tolerance);
        // the model gains ½ |p'(0)|: too little for another step, unless contacts are held
        let gain = half * line.descent;
        let is_newtons_model = line.held.lt(half);
        let small = is_newtons_model & plan.later & gain.lt(tolerance);
        // the last step where rounding alone would predict as much
        let mut last = gain.lt(line.noise);
        if let Some(corrects) = corrects {
            let before = cx.get(&self.last_gain);
            // a gain that does not shrink and is near rounding is rounding
            let stalls = (C::F::c(STALLED) * before).lt(gain);
            let is_small = gain.lt(line.noise * C::F::c(DOUBTED));
            let mut ends = stalls & is_small;
            // Newton's gains shrink with the square: the next one is about gain² / before, if this step has α ≈ 1
            if !<<C::F as Num>::Real as Real>::DOUBLE {
                let next = gain * gain;
                let is_enough = next.lt(tolerance * C::F::c(EXPECTED) * before);
                let off = (cx.get(&result.length) - one).abs();
                let is_newtons = off.lt(C::F::c(0.25)) & before.lt(C::F::c(UNKNOWN));
                ends = ends | (is_enough & is_newtons);
            }
            // a model with held contacts settles nothing, and is no measure of the next gain
            last = is_newtons_model & (last | (corrects & ends));
            let unknown = C::F::c(2.0 * UNKNOWN);
            let known = C::F::select(is_newtons_model, gain, unknown);
            cx.set(&mut self.last_gain, known);
        }
        // both settle the world; a step that gains less than the tolerance is not taken: α = 0
        cx.set(&mut result.settled, C::F::select(small | last, one, zero));
        let alpha = cx.get(&result.length);
        cx.set(&mut result.length, C::F::select(small, zero, alpha));
    }

    /// The worlds that have arrived: no row changed its piece, or the search settled.
    #[inline(always)]
    pub fn note(
        &mut self,
        cx: &mut C,
        plan: &Plan<C>,
        result: &SearchResult<C>,
        corrects: Option<MaskOf<C>>,
    ) -> MaskOf<C> {
        let (zero, half, one) = (C::F::c(0.0), C::F::c(0.5), C::F::c(1.0));
        // no change of piece ends a solve; worlds with contacts need two such iterations in succession, or a quiet one
        let is_calm = half.lt(cx.get(&self.calm)) | plan.quiet;
        let ends = !plan.changed & is_calm;
        let done = ends | half.lt(cx.get(&result.settled));
        if let Some(corrects) = corrects {
            let again = corrects & plan.changed;
            cx.set(&mut self.calm, C::F::select(again, zero, one));
        }
        cx.set(&mut self.busy, C::F::select(done, zero, one));
        // a searched step that was taken: the next model holds contacts by its slips
        let moves = plan.searches & zero.lt(cx.get(&result.length));
        cx.set(&mut self.searched, C::F::select(moves, one, zero));
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
