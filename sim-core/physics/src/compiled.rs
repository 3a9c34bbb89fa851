//! The stages of a step as functions of an instruction set.
//!
//! A crate of its own compiles them for each kind of number (`sim-core/stages`): it takes a minute, and so they are compiled
//! at once, and again only when the text changes.

use crate::arrays::Block;
use crate::constants::Constants;
use crate::lane::Num;
use crate::step::Stage;

/// A stage on a block, compiled for an instruction set: a function of its own, so that registers are given out for one page
/// of equations and a profile names it.
///
/// # Safety
/// The processor has the instructions that it was compiled for.
pub type RunStage<F> = unsafe fn(&Constants<<F as Num>::Real>, &mut Block<F, F>, &mut [F]);

/// Every stage, by its number in [`Stage::ALL`].
pub type Stages<F> = [RunStage<F>; Stage::ALL.len()];

/// Defines `STAGES` of a number, compiled for instructions of x86-64; elsewhere for what the target has, since another text
/// would take as long to compile as the others.
#[macro_export]
macro_rules! compiled {
    ($number:ty, $features:literal) => {
        use $crate::arrays::Block;
        use $crate::compiled::Stages;
        use $crate::constants::Constants;
        use $crate::lane::{Num, memory::Cpu};

        #[cfg_attr(target_arch = "x86_64", target_feature(enable = $features))]
        unsafe fn stage<const STAGE: usize>(
            constants: &Constants<<$number as Num>::Real>,
            block: &mut Block<$number, $number>,
            memory: &mut [$number],
        ) {
            // made here, so that the compiler sees that every world is active: what is set outside of
            // blocks and loops is then a plain store, which the next load need not wait for
            let mut machine = Cpu::new(memory, &constants.contacts.tables);
            $crate::step::run::<_, STAGE>(&mut machine, constants, block);
        }

        /// Every stage, by its number.
        // a constant would be compiled by whoever uses it
        pub static STAGES: Stages<$number> = $crate::every_stage!(stage);
    };
}
