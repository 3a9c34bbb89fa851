//! Controls that act late (MuJoCo documentation, "Delays": `mj_readCtrl`).
//!
//! ```text
//! u(t) = Σ wᵢ ctrl(t - i h),  i = 1, 2, …         wᵢ: weights of a hold, a line or a cubic spline at t - delay
//! ```
//!
//! A step appends its controls at its end, so no delay is shorter than a step. All steps are h long, so the weights are constants.
//! Those at the middle and the end of a step are for Runge-Kutta's evaluations there. Controls are clamped after this sum.
//!
//! MuJoCo compares sums of time steps. Where a delay is a whole number of them, rounding can hold a control for a step longer
//! there; here the number of steps is exact.

use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::lane::{Cx, Num, Real};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Controls that act at the start of the step.
pub struct Delays;

impl Stage for Delays {
    const READS: &'static [A] = &[A::ControlHistory];
    const WRITES: &'static [A] = &[A::DelayedControl];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        m.actuators.delays().next().is_some()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        read(cx, m, b, Moment::Start);
    }
}

/// When in a step controls are read. Its value is its place in [`crate::constants::actuators::ControlDelay::weights`].
#[derive(Clone, Copy)]
pub(in crate::step) enum Moment {
    Start,
    Middle,
    End,
}

/// Writes the controls that act at a moment of the step.
#[inline(always)]
pub(in crate::step) fn read<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    moment: Moment,
) {
    for delay in m.actuators.delays() {
        let mut sum = C::F::c(0.0);
        for (age, &weight) in delay.weights[moment as usize].iter().enumerate() {
            // a held control has all the weight
            if weight.to_f64() != 0.0 {
                let control = cx.get(&b.control_history[delay.first + age]);
                sum = control.fma(C::F::k(weight), sum);
            }
        }
        b.work.delayed_control[delay.place] = sum;
    }
}

/// Appends the controls of the step that ends.
#[inline(always)]
pub(in crate::step) fn append<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for (k, actuator) in m.actuators.all.iter().enumerate() {
        let Some(delay) = &actuator.delay else {
            continue;
        };
        // the oldest one leaves
        for place in (delay.first + 1..delay.first + delay.steps).rev() {
            let younger = cx.get(&b.control_history[place - 1]);
            cx.set(&mut b.control_history[place], younger);
        }
        cx.set(&mut b.control_history[delay.first], b.ctrl[k]);
    }
}
