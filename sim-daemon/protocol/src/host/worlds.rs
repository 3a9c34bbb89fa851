//! What a host and the daemon's loop ask of each other.

use super::lease::FrameMemory;
use crate::memory::service::OneThread;

/// The daemon uses its services from one thread.
pub(super) type S = OneThread;

/// What a host asks for: frames, and for observers the state behind them.
pub trait Worlds {
    /// Writes the arena of a frame, which lies in the memory of a lease, or in the daemon's own; returns whether there is something to
    /// be seen and recorded in it.
    fn frame(&mut self, arena: &mut [u64], memory: Option<&FrameMemory>) -> bool;
    /// The slot of device memory that has the last frame too, and the value of the timeline of frames when it is written.
    fn on_device(&mut self) -> Option<(usize, u64)> {
        None
    }
    /// Writes the state of the worlds that observers see, [`crate::Description::watch_state_bytes`] of it; returns whether there is one.
    fn state(&mut self, to: &mut [u8]) -> bool;
}

/// What [`super::Host::wait`] has found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// A command, in [`super::Host::inbox`]; it wants [`super::Host::answer`] or [`super::Host::refuse`].
    Command,
    /// No command came until the next frame was due: one without a client is in [`super::Host::inbox`]; it wants
    /// [`super::Host::advance`].
    Late,
    /// An observer wants to see the present state: [`super::Host::show`].
    Observe,
    /// The holder of the lease wants device memory: [`super::Host::deliver`].
    DeviceMemory,
    /// A lease has ended, and somebody owns pages of its [`FrameMemory`]: they are to be let go of before the next wait.
    LeaseEnded,
    /// A recorder wants the state of all worlds to begin with: [`super::Host::record_state`].
    Record,
    /// Somebody asked the daemon to end.
    End,
}
