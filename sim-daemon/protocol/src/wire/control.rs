//! Control messages: small, rare, as JSON over request-response. What moves the worlds travels as commands instead, so
//! that it keeps its order.

use serde::{Deserialize, Serialize};

use crate::wire::timing::Timing;

/// Longest request as JSON [bytes].
pub(crate) const REQUEST_MAX: usize = 512;

/// Longest response as JSON [bytes].
pub(crate) const RESPONSE_MAX: usize = 2048;

/// From client to daemon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Request {
    /// Who are you?
    Describe,
    /// Who is in control?
    Controller,
    /// Let me control; `pid` is mine.
    Acquire {
        /// Process of the client.
        pid: u32,
    },
    /// I no longer want control.
    Release {
        /// The lease.
        epoch: u64,
    },
    /// The holder of the lease is alive and running.
    Heartbeat {
        /// The lease.
        epoch: u64,
    },
    /// Let frames and commands of my lease stay on the card. I have connected to the socket, where the answer goes.
    DeviceMemory {
        /// The lease.
        epoch: u64,
    },
    /// Let me record what you do, in a journal of my own.
    Journal {
        /// Fields whose arrays come with each entry: a bit each, in the order of the frame.
        observed: u64,
    },
    /// How do frames keep their pace? And count anew, if `clear`.
    Timing {
        /// Forget what was measured, once it is answered.
        clear: bool,
    },
    /// End the daemon.
    Shutdown,
}

/// From daemon to client.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Response {
    /// Answer to [`Request::Describe`]: the description is in the daemon's folder.
    Described,
    /// Answer to [`Request::Controller`].
    Controller {
        /// Process in control, if any.
        pid: Option<u32>,
        /// Its lease; earlier daemons do not tell it.
        epoch: Option<u64>,
    },
    /// Control is yours, through the services of this epoch.
    Granted {
        /// The lease.
        epoch: u64,
    },
    /// Somebody else is in control.
    Held {
        /// Who.
        pid: u32,
    },
    /// The slots for a new lease, or a journal, do not fit.
    NoMemory {
        /// Bytes free.
        free: u64,
        /// Bytes needed.
        needed: u64,
    },
    /// A journal is yours to open.
    Journal {
        /// Its number.
        journal: u64,
        /// The port that sends, as its higher and lower half. Its memory is the recorder's to take: that takes a while.
        port: [u64; 2],
    },
    /// Answer to [`Request::Release`]: whether that lease is the present one.
    Lease {
        /// False when the lease was lost before.
        valid: bool,
    },
    /// Answer to [`Request::DeviceMemory`]: the rest comes by the socket.
    BySocket,
    /// Answer to [`Request::Timing`].
    Timing(Timing),
    /// Answer to [`Request::Shutdown`].
    Ending,
    /// The request could not be read, or not be met.
    Refused {
        /// One sentence.
        reason: String,
    },
}
