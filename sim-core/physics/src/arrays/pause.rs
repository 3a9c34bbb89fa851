//! The solver may pause when few worlds of a block are left, so that others fill the register.

/// What a call of such a stage does. By default all of its work, as on backends that gather no worlds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pause {
    /// It goes on from the arrays of `Stage::RESUMES`, instead of beginning.
    pub resumes: bool,
    /// It pauses once no more worlds than this go on; with 0 this alone never pauses it [–].
    pub few: usize,
    /// Its iterations alone: it pauses when they end, too.
    pub iterates: bool,
    /// Set by the stage: it paused.
    pub paused: bool,
}

impl Pause {
    /// In what the solver saves: 1 where the world has not arrived.
    pub const BUSY: usize = 1;
    /// In what the solver saves: iterations done [–].
    pub const ITERATION: usize = 2;
}
