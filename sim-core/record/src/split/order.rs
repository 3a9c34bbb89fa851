//! What is dispatched, in which order, and how large kernels may be.

use super::cost::Prices;

/// How much kernels may cost, in units of a simple statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// A kernel that costs more is cut, if its statements allow it.
    pub kernel: usize,
    /// A loop that costs more is cut inside. Each of its kernels is then dispatched once per iteration, for a list of the worlds
    /// that are still in the loop.
    pub repeated: usize,
    /// Cost of one more kernel inside such a loop, since it is dispatched once per iteration.
    pub repeated_dispatch: usize,
    /// Cost of one more kernel elsewhere.
    pub dispatch: usize,
    /// Cost of statements.
    pub prices: Prices,
}

/// A dispatch, or a repetition of dispatches.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// The kernel of this number.
    Kernel(usize),
    /// The parts, repeated. A world that has left the loop does nothing in the remaining iterations.
    Repeat {
        /// Most iterations.
        iterations: usize,
        /// What is dispatched in an iteration.
        parts: Vec<Part>,
        /// A field that is 0 in the worlds that are still in the loop.
        exited: Option<u32>,
    },
}
