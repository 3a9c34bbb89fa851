//! Faults of one world, as bits of its `status`; 0 = none.

/// Positions or velocities were no longer finite: the world is frozen at the state before that frame until it is reset.
pub const NOT_FINITE: u32 = 1;
/// A position or velocity was beyond the bounds of the run: the world is frozen likewise.
pub const OUT_OF_BOUNDS: u32 = 8;
/// What freezes a world.
pub const FROZEN: u32 = NOT_FINITE | OUT_OF_BOUNDS;
/// The constraint solver used up its iterations in some substep of the last frame.
pub const NOT_CONVERGED: u32 = 2;
/// More contacts were found in some substep of the last frame than there is room for.
pub const CONTACTS_LEFT_OUT: u32 = 4;
