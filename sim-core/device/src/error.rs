//! What can go wrong between this process and an accelerator.

use std::time::Duration;
use thiserror::Error;

/// Errors of this crate: each names what it is about and, where there is one, the cure.
#[derive(Clone, Debug, Error)]
pub enum DeviceError {
    /// No driver shows an adapter.
    #[error(
        "no adapter found: install a Vulkan driver (software: `apt-get install mesa-vulkan-drivers libvulkan1`)"
    )]
    NoAdapter,
    /// There are adapters, but not the one that was asked for.
    #[error("no adapter {wanted}; there are: {present}")]
    UnknownAdapter {
        /// The choice, in words.
        wanted: String,
        /// Indices and names of the adapters there are.
        present: String,
    },
    /// The driver refused to make a device.
    #[error("adapter `{adapter}` cannot be opened: {reason}")]
    Open {
        /// Name of the adapter.
        adapter: String,
        /// The driver's words.
        reason: String,
    },
    /// A buffer does not fit into memory.
    #[error("out of memory: buffer `{label}` of {bytes} bytes; use fewer worlds")]
    OutOfMemory {
        /// Name of the buffer.
        label: String,
        /// Its size.
        bytes: u64,
    },
    /// Host memory that this driver does not take.
    #[error("host memory cannot be imported: {reason}")]
    Import {
        /// The driver's words.
        reason: String,
    },
    /// A program is wrong, or asks for more than the adapter has.
    #[error("program `{label}` does not compile: {reason}")]
    Compile {
        /// Name of the program.
        label: String,
        /// Where and why.
        reason: String,
    },
    /// A driver took too long over a program. Its thread is left to itself.
    #[error(
        "program `{label}` did not compile within {limit:?}: the driver may hang; use another adapter"
    )]
    CompileTimeout {
        /// Name of the program.
        label: String,
        /// The limit that was given.
        limit: Duration,
    },
    /// A command names ranges, bindings or buffers that do not exist or do not go together.
    #[error("command on `{label}`: {reason}")]
    Command {
        /// Name of the program or of the buffer.
        label: String,
        /// What is wrong.
        reason: String,
    },
    /// A staging buffer is looked at, or run by someone else, while a batch needs it.
    #[error("staging buffer `{label}` is in use: drop its views before `run`")]
    Busy {
        /// Name of the buffer.
        label: String,
    },
    /// The device is gone, with all that its memory held.
    #[error("device lost: {reason}; open it again")]
    Lost {
        /// The driver's words.
        reason: String,
    },
    /// The driver or wgpu reports what this crate should have refused.
    #[error("unexpected answer of the driver: {reason}")]
    Driver {
        /// Its words.
        reason: String,
    },
}
