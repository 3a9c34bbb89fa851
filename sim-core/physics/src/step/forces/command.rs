//! Commands as they act: delayed by the world's delay, and with the noise of the frame.
//!
//! ```text
//! applied(s) = command of the last frame that began at s - delay or before + noise        s counts substeps
//! ```

use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::params::Param;
use crate::lane::{Cx, Num, Real};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Commands as they act in this substep.
pub struct Commands;

impl Stage for Commands {
    const READS: &'static [A] = &[
        A::JointF,
        A::JointTargetQ,
        A::JointTargetQd,
        A::Params,
        A::Substep,
        A::CommandHistory,
        A::CommandNoise,
    ];
    const WRITES: &'static [A] = &[A::Substep, A::Applied];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        m.alters_commands()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        delay_commands(cx, m, b);
    }
}

/// A command. Its value is its place in `applied`, in a frame of the history and in the noise.
#[derive(Clone, Copy)]
pub(in crate::step) enum Kind {
    Force,
    Position,
    Velocity,
}

/// Writes `applied`, and counts the substep.
#[inline(always)]
fn delay_commands<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let n = m.dofs.len();
    let applied = &mut b.work.applied;
    // the commands of this frame, kind by kind
    applied[..n].copy_from_slice(&b.joint_f);
    applied[n..2 * n].copy_from_slice(&b.joint_target_q);
    applied[2 * n..].copy_from_slice(&b.joint_target_qd);
    let delay = m.varying.first(Param::CommandDelay);
    if let Some(delay) = delay.filter(|_| m.delay.frames > 0) {
        let substep = cx.get(&b.substep[0]);
        // a command is due if its frame began at least delay - s substeps before this one
        let late = b.params[delay] - substep;
        // the last command first: an earlier one replaces it where it is not due
        for (age, sent) in b.command_history.chunks_exact(3 * n).enumerate() {
            // due: the frame after it is not due yet
            let is_due = C::F::c((age * m.delay.substeps) as f64).lt(late);
            for (applied, sent) in applied.iter_mut().zip(sent) {
                *applied = C::F::select(is_due, *sent, *applied);
            }
        }
        // s of the next substep
        cx.set(&mut b.substep[0], substep + C::F::c(1.0));
    }
    // the noise of a frame is the same in all of its substeps
    for (applied, noise) in applied.iter_mut().zip(&b.command_noise) {
        *applied = *applied + *noise;
    }
}

/// The command of dof `j` as it acts in this substep.
#[inline(always)]
pub(in crate::step) fn command_of<C: Cx>(
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    command: Kind,
    j: usize,
) -> C::F {
    // without delay and noise there is no copy: the command acts as it was sent
    if m.alters_commands() {
        return b.work.applied[command as usize * m.dofs.len() + j];
    }
    match command {
        Kind::Force => b.joint_f[j],
        Kind::Position => b.joint_target_q[j],
        Kind::Velocity => b.joint_target_qd[j],
    }
}
