//! Trouble of one world, as bits of its `status`. 0 = all is well.

/// Positions or velocities were no longer finite: the world is frozen at the state before that frame until it is reset.
pub const NOT_FINITE: u32 = 1;
/// The constraint solver used up its iterations in some substep of the last frame.
pub const NOT_CONVERGED: u32 = 2;
/// More contacts were found in some substep of the last frame than there is room for.
pub const CONTACTS_LEFT_OUT: u32 = 4;
