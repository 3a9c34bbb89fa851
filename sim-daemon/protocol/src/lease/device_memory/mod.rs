//! Device memory that a daemon gives to the holder of its lease. On Linux, descriptors cross by a Unix socket, since samples carry none.
//!
//! ```text
//! client   connects to <session>.socket, writes the number of its lease, asks for the memory by a control request
//! daemon   takes the connections that wait, checks user and lease, makes the memory
//! daemon   sends a line of JSON with the descriptors, or with the reason why there are none, and closes
//! ```
//! The daemon waits for no client. It closes a connection that has not named a lease when the request comes.

#[cfg(any(simulated, not(target_os = "linux")))]
mod absent;
#[cfg(all(not(simulated), target_os = "linux"))]
mod sockets;

#[cfg(any(simulated, not(target_os = "linux")))]
pub(crate) use absent::{Door, Visitor, deliver, receive, visit};
use serde::{Deserialize, Serialize};
#[cfg(all(not(simulated), target_os = "linux"))]
pub(crate) use sockets::{Door, Visitor, deliver, receive, visit};

/// A descriptor of the driver, which the importing process takes over.
#[cfg(unix)]
pub type Descriptor = std::os::fd::OwnedFd;
/// No driver of other systems gives any.
#[cfg(not(unix))]
pub type Descriptor = std::convert::Infallible;

/// The number of a descriptor, whose owner closes it from now on.
pub fn into_number(descriptor: Descriptor) -> i32 {
    #[cfg(unix)]
    return std::os::fd::IntoRawFd::into_raw_fd(descriptor);
    #[cfg(not(unix))]
    match descriptor {}
}

/// Memory on the card of a daemon, for one lease: slots of frames, then an array per command.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceMemory {
    /// Identifies the card across APIs: 16 bytes as hexadecimal digits.
    pub uuid: String,
    /// Size of the allocation [bytes].
    pub allocated: u64,
    /// Whether the allocation belongs to one buffer alone, which an import must say.
    pub dedicated: bool,
    /// Number of slots.
    pub slots: usize,
    /// Distance of neighbouring slots [bytes].
    pub stride: u64,
    /// Where each field begins in a slot, in the order of the description [bytes].
    pub offsets: Vec<u64>,
    /// The commands that may be left here.
    pub commands: Vec<DeviceCommand>,
    /// Why both processes order their work by waiting on the host; none where timelines order it on the card.
    pub host_order: Option<String>,
}

/// Where a command is left: `(worlds, columns)` of float32, world-major.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceCommand {
    /// Name, such as `joint_f`.
    pub name: String,
    /// Columns per world.
    pub columns: usize,
    /// First byte in the memory.
    pub offset: u64,
}

/// Device memory with its descriptors: that of the memory, then those of the timelines of done frames and of ready commands, if any.
pub type Delivery = (DeviceMemory, Vec<Descriptor>);
