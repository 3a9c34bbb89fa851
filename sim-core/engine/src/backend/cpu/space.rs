//! What a block of worlds works in.

use sim_physics::arrays::Block;
use sim_physics::constants::Constants;
use sim_physics::lane::Lane;

/// A block and its memory of contacts.
pub(super) struct Space<F: Lane> {
    /// Boxed, so that blocks change places by their pointers.
    pub block: Box<Block<F, F>>,
    /// Scratch memory of the execution context.
    pub memory: Vec<F>,
}

impl<F: Lane> Space<F> {
    pub fn new(m: &Constants<F::Real>) -> Self {
        Space {
            block: Box::new(Block::new(m, F::default())),
            memory: vec![F::default(); m.contacts.memory.len],
        }
    }
}
