//! Errors as the exceptions of `tightloop.errors`.

use pyo3::prelude::*;
use pyo3::types::PyType;
use sim_protocol::{ProtocolError, RefusalKind};

/// The exception class `tightloop.errors.<class>` with a message.
pub(crate) fn raise(py: Python<'_>, class: &str, message: impl Into<String>) -> PyErr {
    let exception = py
        .import("tightloop.errors")
        .and_then(|errors| errors.getattr(class))
        .and_then(|class| Ok(class.cast_into::<PyType>()?));
    match exception {
        Ok(class) => PyErr::from_type(class, (message.into(),)),
        Err(error) => error,
    }
}

/// A protocol error as the exception that a Python caller expects.
pub(crate) fn protocol(py: Python<'_>, error: &ProtocolError) -> PyErr {
    raise(py, class(error), error.to_string())
}

/// The name of that exception.
pub(crate) fn class(error: &ProtocolError) -> &'static str {
    use ProtocolError::*;
    match error {
        BadName { .. } | Grouped { .. } => "ArgumentError",
        NoDaemon { .. } => "UnknownDaemon",
        ProtocolVersion { .. } | Handshake { .. } | Malformed { .. } => "ProtocolMismatch",
        DaemonLost { .. } => "DaemonLost",
        DaemonRestarted { .. } => "DaemonRestarted",
        LeaseHeld { .. } => "LeaseHeld",
        LeaseLost { .. } => "LeaseLost",
        CallInProgress => "CallInProgress",
        FramesHeld { .. } => "FramesHeld",
        NoField { .. } => "UnknownField",
        CommandRefused {
            kind: RefusalKind::Snapshot,
            ..
        } => "SnapshotError",
        NotAnInput { .. } | Shape { .. } | CommandRefused { .. } | StepInFlight | NothingSent => {
            "CommandRefused"
        }
        SharedMemory { .. } | Memory { .. } | Descriptors { .. } => "ResourceError",
        NotShared { .. } => "GpuMemoryError",
        Starting { .. } => "UnknownDaemon",
        Timeout { .. } | Silent { .. } => "WaitTimeout",
        Root { .. } | NameTaken { .. } => "LaunchError",
        _ => "TransportError",
    }
}
