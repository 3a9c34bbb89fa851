//! Device memory that a client in another process maps: frames and commands then stay on the card.

use super::{BackendError, Input};
use sim_device::Descriptor;
use std::time::Duration;

/// Memory that a client maps. It begins with slots of frames, each laid out as an arena; an array per command follows.
pub struct SharedMemory {
    /// What the client imports.
    pub memory: Descriptor,
    /// Size of the allocation [bytes].
    pub allocated: u64,
    /// Whether the allocation belongs to one buffer alone, which an import must say.
    pub dedicated: bool,
    /// Timelines of done frames and of ready commands; a reason where the driver exports none. Work is then ordered by waiting on the
    /// host.
    pub timelines: Result<[Descriptor; 2], String>,
    /// Identifies the card across APIs.
    pub uuid: [u8; 16],
    /// Number of slots.
    pub slots: usize,
    /// Distance of neighbouring slots [bytes].
    pub stride: u64,
    /// The commands that a client may leave here.
    pub commands: Vec<SharedCommand>,
}

/// Where a client leaves a command: `(worlds, columns)` in `f32`, world-major.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SharedCommand {
    /// The command.
    pub input: Input,
    /// Its columns.
    pub columns: usize,
    /// Its first byte in the memory.
    pub offset: u64,
}

/// A backend whose memory clients can map. A command is named by its place in [`SharedMemory::commands`].
pub trait Sharing {
    /// Makes the memory, and forgets an earlier one.
    ///
    /// # Errors
    /// The driver exports no memory, or has no room.
    fn share(&mut self, slots: usize) -> Result<SharedMemory, BackendError>;
    /// Names of the commands that may be left in the memory; none without memory.
    fn names(&self) -> Vec<&'static str>;
    /// Gives an arena a slot of its own, to which each frame that is written into the arena goes too. Without shared memory, or
    /// once all slots are given away, it does nothing.
    fn assign_slot(&mut self, arena: &[u64]);
    /// The slot of the last frame, and the value that the timeline of frames has when it is done; none if it went to no slot.
    fn slot_shown(&self) -> Option<(usize, u64)>;
    /// Waits until the client's timeline has a value; false if it has not in time. True at once where there are no timelines.
    ///
    /// # Errors
    /// The device is lost.
    fn await_client(&mut self, value: u64, timeout: Duration) -> Result<bool, BackendError>;
    /// True if all values of these commands are finite and free bodies have no targets. The client's timeline has the value.
    ///
    /// # Errors
    /// The device is lost.
    fn accepts(&mut self, commands: &[usize], value: u64) -> Result<bool, BackendError>;
    /// Takes these commands, in all worlds, with the next frame.
    fn stage_shared(&mut self, commands: &[usize]);
    /// The values of a command, `(worlds, columns)`.
    ///
    /// # Errors
    /// The device is lost.
    fn read_shared(&mut self, command: usize) -> Result<Vec<f32>, BackendError>;
}
