//! What a stage declares, and the list of all.

use crate::arrays::{Array, Block};
use crate::constants::Constants;
use crate::lane::{Cx, Num, Real};

/// The constants that an execution context reads.
pub type ConstantsOf<C> = Constants<<<C as Cx>::F as Num>::Real>;
/// The block that an execution context works on.
pub type BlockOf<C> = Block<<C as Cx>::F, <C as Cx>::V>;

/// A stage of a step. Its functions are inlined into the one that is compiled for the stage, see [`crate::compiled`].
pub trait Stage {
    /// Arrays that it reads, those included that it writes in part.
    const READS: &'static [Array];
    /// Arrays that it writes.
    const WRITES: &'static [Array];
    /// Arrays for whose sake an evaluation runs it.
    const COMPLETES: &'static [Array] = Self::WRITES;

    /// Arrays from which it goes on where it paused, see [`crate::arrays::Pause`]; none for a stage that never does.
    const RESUMES: &'static [Array] = &[];

    /// Has the model anything for it to do?
    fn is_needed<R: Real>(_m: &Constants<R>) -> bool {
        true
    }

    /// Runs the stage on a block.
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>);
}

/// What runs a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Runs {
    /// Either; of a step with several evaluations of its forces, the first alone.
    Once,
    /// Either, and in a step each evaluation of its forces.
    Both,
    /// A step: it moves the state.
    Step,
    /// A step by Runge-Kutta: between its evaluations of the forces.
    RungeKutta,
    /// An evaluation of outputs, which leaves the state as it is.
    Evaluation,
}

impl Runs {
    /// Whether it changes the state.
    pub fn moves(self) -> bool {
        matches!(self, Runs::Step | Runs::RungeKutta)
    }

    /// Whether it runs before the state moves, in a step as well as in an evaluation of outputs.
    pub fn is_shared(self) -> bool {
        matches!(self, Runs::Once | Runs::Both)
    }
}

/// A row of the list of stages.
#[derive(Clone, Copy, Debug)]
pub struct StageRow {
    /// Its name, for timers, profiles and reports.
    pub name: &'static str,
    /// [`Stage::READS`]
    pub reads: &'static [Array],
    /// [`Stage::WRITES`]
    pub writes: &'static [Array],
    /// [`Stage::COMPLETES`]
    pub completes: &'static [Array],
    /// [`Stage::RESUMES`]
    pub resumes: &'static [Array],
    /// What runs it.
    pub runs: Runs,
}

/// The place of a stage in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StageId(usize);

/// Rows of `every_stage!`.
#[macro_export]
#[doc(hidden)]
macro_rules! stage_rows {
    (() $($name:ident [$($page:tt)*] $runs:ident;)*) => {
        [$($crate::step::StageRow {
            name: stringify!($name),
            reads: <$crate::step::$($page)* as $crate::step::Stage>::READS,
            writes: <$crate::step::$($page)* as $crate::step::Stage>::WRITES,
            completes: <$crate::step::$($page)* as $crate::step::Stage>::COMPLETES,
            resumes: <$crate::step::$($page)* as $crate::step::Stage>::RESUMES,
            runs: $crate::step::Runs::$runs,
        }),*]
    };
}

/// A function that is generic over a stage and perhaps more, for each row of `every_stage!`.
#[macro_export]
#[doc(hidden)]
macro_rules! stage_functions {
    (($function:ident) $($name:ident [$($page:tt)*] $runs:ident;)*) => {
        [$($function::<$crate::step::$($page)*>),*]
    };
    (($function:ident, $more:ty) $($name:ident [$($page:tt)*] $runs:ident;)*) => {
        [$($function::<$crate::step::$($page)*, $more>),*]
    };
}

/// How many stages there are.
const COUNT: usize = ROWS.len();
static ROWS: &[StageRow] = &crate::every_stage!(stage_rows());

impl StageId {
    /// How many stages there are.
    pub const COUNT: usize = COUNT;

    /// Every stage, in the order of a step.
    pub fn all() -> impl Iterator<Item = StageId> {
        (0..COUNT).map(StageId)
    }

    /// The stage of this name.
    pub fn named(name: &str) -> Option<StageId> {
        StageId::all().find(|stage| stage.row().name == name)
    }

    /// Its row of the list.
    pub fn row(self) -> &'static StageRow {
        &ROWS[self.0]
    }

    /// [`StageRow::name`]
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// [`StageRow::reads`]
    pub fn reads(self) -> &'static [Array] {
        self.row().reads
    }

    /// [`StageRow::writes`]
    pub fn writes(self) -> &'static [Array] {
        self.row().writes
    }

    /// [`StageRow::resumes`]
    pub fn resumes(self) -> &'static [Array] {
        self.row().resumes
    }

    /// Its place in the list, and in tables of its compiled functions.
    pub fn index(self) -> usize {
        self.0
    }

    /// Has the model anything for it to do?
    pub fn is_needed<R: Real>(self, m: &Constants<R>) -> bool {
        // stages are types without values: a table of their functions, by place in the list
        let needed: [fn(&Constants<R>) -> bool; COUNT] =
            crate::every_stage!(stage_functions(needed, R));
        needed[self.0](m)
    }
}

fn needed<S: Stage, R: Real>(m: &Constants<R>) -> bool {
    S::is_needed(m)
}
