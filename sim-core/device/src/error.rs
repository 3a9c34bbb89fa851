//! Errors between this process and an accelerator.

use std::time::Duration;
use thiserror::Error;

/// Errors of this crate. Each names the culprit and, where there is one, the cure.
#[derive(Clone, Debug, Error)]
pub enum DeviceError {
    /// No driver offers an adapter.
    #[error(
        "no adapter found: install a Vulkan driver (software: `apt-get install mesa-vulkan-drivers libvulkan1`; NVIDIA's is not found without `libvulkan1 libegl1 libgl1`)"
    )]
    NoAdapter,
    /// None of the adapters is the requested one.
    #[error("no adapter {wanted}; there are: {present}")]
    UnknownAdapter {
        /// The choice, as text.
        wanted: String,
        /// Indices and names of the adapters.
        present: String,
    },
    /// The driver refused to make a device.
    #[error("adapter `{adapter}` cannot be opened: {reason}")]
    Open {
        /// Name of the adapter.
        adapter: String,
        /// The driver's message.
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
    /// The driver refuses to import host memory.
    #[error("host memory cannot be imported: {reason}")]
    Import {
        /// The driver's message.
        reason: String,
    },
    /// The driver does not export memory or semaphores to other processes.
    #[error("device memory cannot be shared with another process: {reason}")]
    Export {
        /// What is missing.
        reason: String,
    },
    /// A program is wrong, or needs more than the adapter has.
    #[error("program `{label}` does not compile: {reason}")]
    Compile {
        /// Name of the program.
        label: String,
        /// Location and reason.
        reason: String,
    },
    /// The driver took too long to compile a program. Its thread is abandoned.
    #[error(
        "program `{label}` did not compile within {limit:?}: the driver may hang; use another adapter"
    )]
    CompileTimeout {
        /// Name of the program.
        label: String,
        /// The limit that was given.
        limit: Duration,
    },
    /// A command names ranges, bindings or buffers that do not exist or do not fit together.
    #[error("command on `{label}`: {reason}")]
    Command {
        /// Name of the program or of the buffer.
        label: String,
        /// What is wrong.
        reason: String,
    },
    /// A view of a staging buffer is held, or another run uses it, while a batch needs it.
    #[error("staging buffer `{label}` is in use: drop its views before `run`")]
    Busy {
        /// Name of the buffer.
        label: String,
    },
    /// The device is lost, with the contents of its memory.
    #[error("device lost: {reason}; open it again")]
    Lost {
        /// The driver's message.
        reason: String,
    },
    /// The driver or wgpu reports an error that this crate should have prevented.
    #[error("unexpected answer of the driver: {reason}")]
    Driver {
        /// Its message.
        reason: String,
    },
}
