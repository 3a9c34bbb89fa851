//! The stages of a step as functions of an instruction set.
//!
//! A crate of its own compiles them for each kind of scalar (`sim-core/stages`): it takes a minute, so the crates are
//! compiled side by side, and again only when the physics changes.

use crate::arrays::Block;
use crate::constants::Constants;
use crate::lane::Num;
use crate::step::StageId;

/// A stage on a block, compiled for an instruction set: a function of its own, so that registers are given out for one page
/// of equations and a profile names it.
///
/// # Safety
/// The processor has the instructions that it was compiled for.
pub type RunStage<F> = unsafe fn(&Constants<<F as Num>::Real>, &mut Block<F, F>, &mut [F]);

/// Every stage, by [`StageId::index`].
pub type Stages<F> = [RunStage<F>; StageId::COUNT];

/// Defines `STAGES` of a scalar, compiled for instructions of x86-64; elsewhere for what the target has, since one more
/// instance would take as long to compile as the others.
#[macro_export]
macro_rules! compiled {
    ($scalar:ty, $features:literal) => {
        $crate::every_stage!(compiled_stages($scalar, $features));
    };
}

/// A function named after each row of `every_stage!`, and the table of them.
#[macro_export]
#[doc(hidden)]
macro_rules! compiled_stages {
    (($scalar:ty, $features:literal) $($name:ident [$($page:tt)*] $runs:ident;)*) => {
        use $crate::arrays::Block;
        use $crate::compiled::Stages;
        use $crate::constants::Constants;
        use $crate::lane::{Num, memory::Cpu};
        use $crate::step::Stage;

        $(
            #[cfg_attr(target_arch = "x86_64", target_feature(enable = $features))]
            unsafe fn $name(
                constants: &Constants<<$scalar as Num>::Real>,
                block: &mut Block<$scalar, $scalar>,
                memory: &mut [$scalar],
            ) {
                // made here, so that the compiler sees that every world is active: what is set outside of
                // blocks and loops is then a plain store, which the next load need not wait for
                let mut cx = Cpu::new(memory, &constants.contacts.tables);
                <$crate::step::$($page)* as Stage>::run(&mut cx, constants, block);
            }
        )*

        /// Every stage, by its place in the list.
        // a constant would be compiled in every crate that uses it
        pub static STAGES: Stages<$scalar> = [$($name),*];
    };
}
