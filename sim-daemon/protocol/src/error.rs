//! What can go wrong between a client and a daemon, with the culprit and the cure.

use std::io;
use std::path::{Path, PathBuf};

use crate::doors::system::files::{free_bytes, shared_memory};
use crate::doors::system::{open_files, process};
use crate::memory::problem::{FREE_MIN, Problem, folder_cure, other_problem, take_problem};

/// Everything that can go wrong for a client. The daemon's refusals arrive as [`ProtocolError::CommandRefused`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolError {
    /// The name cannot be one of a daemon.
    #[error("daemon name {name:?}: {problem}; use 1 to 64 letters, digits, `-` and `_`")]
    BadName {
        /// What was given.
        name: String,
        /// What is wrong with it.
        problem: &'static str,
    },

    /// The folder that holds the lock files cannot be used.
    #[error("folder {path:?} cannot be used: {problem}; {}", folder_cure(path))]
    Root {
        /// The folder.
        path: PathBuf,
        /// What the system says.
        problem: String,
    },

    /// Nothing with this name runs.
    #[error(
        "no daemon named {name:?} runs under {root:?}; running: {running}; `tightloop serve SCENE --name {name}` starts one"
    )]
    NoDaemon {
        /// The name asked for.
        name: String,
        /// Where it was looked for.
        root: PathBuf,
        /// Names of the running daemons, or "none".
        running: String,
    },

    /// The daemon's worlds are in groups, and one of them is to be named.
    #[error(
        "daemon {name:?} has its worlds in {groups} groups, each with a name of its own; give one of {name}.0 to {name}.{}",
        groups - 1
    )]
    Grouped {
        /// The daemon's name.
        name: String,
        /// How many groups it has.
        groups: usize,
    },

    /// Another daemon has the name.
    #[error("daemon {name:?} is already running{}; choose another name or stop it",
        .pid.map_or_else(String::new, |pid| format!(" (pid {pid})")))]
    NameTaken {
        /// The name.
        name: String,
        /// The process that holds it, where it is known.
        pid: Option<u32>,
    },

    /// Daemon and client speak different versions of this protocol.
    #[error(
        "daemon {name:?} speaks protocol version {daemon}, this client speaks {client}; \
         use the same tightloop release on both sides"
    )]
    ProtocolVersion {
        /// The daemon's name.
        name: String,
        /// The daemon's version.
        daemon: u32,
        /// Ours.
        client: u32,
    },

    /// A fact announced at the handshake and the same fact in the description are not equal.
    #[error(
        "daemon {name:?}: {fact} is {announced} in the handshake and {described} in the description; \
         use the same tightloop release on both sides"
    )]
    Handshake {
        /// The daemon's name.
        name: String,
        /// Which fact.
        fact: &'static str,
        /// Value of the service attribute.
        announced: String,
        /// Value computed here from the description.
        described: String,
    },

    /// The daemon ended or was killed; its state is lost.
    #[error("daemon {name:?} (pid {pid}) is gone and its state is lost; launch a new one")]
    DaemonLost {
        /// The daemon's name.
        name: String,
        /// The process it was.
        pid: u32,
    },

    /// Another daemon now runs under the name.
    #[error("daemon {name:?} was restarted and its former state is lost; attach again")]
    DaemonRestarted {
        /// The daemon's name.
        name: String,
    },

    /// Another client controls the daemon.
    #[error(
        "daemon {name:?} is controlled by process {pid}; wait until it releases or ends, or only observe"
    )]
    LeaseHeld {
        /// The daemon's name.
        name: String,
        /// The controlling process.
        pid: u32,
    },

    /// This client was the controller and no longer is.
    #[error(
        "control of daemon {name:?} was lost (this process did not answer for too long and another client took it); \
         attach again"
    )]
    LeaseLost {
        /// The daemon's name.
        name: String,
    },

    /// As many frames are alive as there are slots for.
    #[error(
        "{held} frames are held and that is the limit; keep copies (`frame.copy()`) or start the daemon \
         with a larger `frames_held`"
    )]
    FramesHeld {
        /// How many.
        held: usize,
    },

    /// The field cannot be commanded or written.
    #[error("{field:?} cannot be {verb}; it is one of: {known}")]
    NotAnInput {
        /// The field asked for.
        field: String,
        /// "commanded" or "written".
        verb: &'static str,
        /// What could be.
        known: String,
    },

    /// The frame does not carry the field.
    #[error(
        "frames carry no field {field:?}; they carry: {known}; ask for it in `fields` at launch"
    )]
    NoField {
        /// The field asked for.
        field: String,
        /// What frames carry.
        known: String,
    },

    /// An array does not have the shape that the field needs.
    #[error("{field}: expected {expected}, got {got}")]
    Shape {
        /// The field.
        field: String,
        /// Shape or range needed.
        expected: String,
        /// Shape or range given.
        got: String,
    },

    /// The daemon did not accept a command; no world was touched.
    #[error("{reason}")]
    CommandRefused {
        /// What kind of refusal it is.
        kind: crate::RefusalKind,
        /// The daemon's sentence: field, world, dof and cure.
        reason: String,
    },

    /// Frames and commands cannot stay on the card.
    #[error("frames and commands cannot stay on the card: {reason}")]
    NotShared {
        /// What is missing.
        reason: String,
    },

    /// A step was sent, and its frame was not received yet; nothing was sent or touched.
    #[error("a step was sent and its frame was not received; call recv first")]
    StepInFlight,

    /// There is no step whose frame could be received.
    #[error("no step was sent whose frame could be received; call send first")]
    NothingSent,

    /// The caller's own code, which ran while a call waited, made another one; nothing was sent or touched.
    #[error(
        "another call of this client is waiting in the same thread, which a signal handler interrupted; set a flag in the \
         handler, and call after the other call has returned"
    )]
    CallInProgress,

    /// The client was copied into a child process.
    #[error(
        "this client of daemon {name:?} belongs to process {pid}, which forked; attach again in this process"
    )]
    Forked {
        /// The daemon's name.
        name: String,
        /// The process that attached.
        pid: u32,
    },

    /// As many clients are attached as there is room for.
    #[error("daemon {name:?} has {max} {what}, which is the limit{holders}; close one of them")]
    TooManyClients {
        /// The daemon's name.
        name: String,
        /// Clients or observers.
        what: &'static str,
        /// The limit.
        max: usize,
        /// The processes that hold them, or nothing where that is unknown.
        holders: String,
    },

    /// Shared memory is too small.
    #[error(
        "{path} has {free} bytes free and {needed} are needed ({what}); use fewer worlds, fewer fields or fewer \
         frames_held, or enlarge it (Docker's default is 64 MB: `docker run --shm-size=8g`)"
    )]
    SharedMemory {
        /// The file system.
        path: String,
        /// Bytes free.
        free: u64,
        /// Bytes needed.
        needed: u64,
        /// What for.
        what: String,
    },

    /// Shared memory and the daemon's own together are more than the machine or its control group has left.
    #[error(
        "{free} bytes of memory are free and {needed} are needed ({what}); use fewer worlds, fewer fields or fewer \
         frames_held"
    )]
    Memory {
        /// Bytes free.
        free: u64,
        /// Bytes needed.
        needed: u64,
        /// What for.
        what: String,
    },

    /// The process has as many files open as it may.
    #[error(
        "{action}: no file can be opened; this process may have {limit} open; raise the limit (`ulimit -n 65536`), or \
         use fewer groups or simulations"
    )]
    Descriptors {
        /// What was tried.
        action: String,
        /// The limit.
        limit: u64,
    },

    /// Another program has changed a file of the daemon.
    #[error("{action}: {path} was changed by another program; end the daemon and launch a new one")]
    Damaged {
        /// What was tried.
        action: String,
        /// The file.
        path: String,
    },

    /// Bytes from the other side make no sense.
    #[error(
        "malformed message from {from}: {problem}; use the same tightloop release on both sides"
    )]
    Malformed {
        /// Which side sent it.
        from: &'static str,
        /// What is wrong.
        problem: String,
    },

    /// A daemon is not ready in time.
    #[error(
        "daemon {name:?} is still starting after a wait of {seconds:.1} s: it reads its scene, builds its worlds or \
         compiles for a GPU; wait longer (`attach(timeout=60)`, `wait_s` in C), or end it with `tightloop stop {name}`"
    )]
    Starting {
        /// The daemon's name.
        name: String,
        /// How long was waited [s].
        seconds: f64,
    },

    /// Something holds a daemon's name and does not become one.
    #[error(
        "something has held {path:?} for {seconds} s without becoming daemon {name:?}; end the process that `fuser {}` shows, or wait if \
         it still starts",
        path.display()
    )]
    Silent {
        /// The daemon's name.
        name: String,
        /// The lock file.
        path: PathBuf,
        /// How long was waited.
        seconds: u64,
    },

    /// The daemon lives but did not answer in time.
    #[error(
        "daemon {name:?} (pid {pid}) did not answer within {seconds} s; is it stopped or overloaded?"
    )]
    Timeout {
        /// The daemon's name.
        name: String,
        /// Its process.
        pid: u32,
        /// How long was waited.
        seconds: f64,
    },

    /// The daemon lives, but none of its messages comes here.
    #[error("daemon {name:?} (pid {pid}) cannot send to this process: {problem}")]
    Unreached {
        /// The daemon's name.
        name: String,
        /// Its process.
        pid: u32,
        /// What the daemon says.
        problem: String,
    },

    /// The caller's interrupt hook asked to stop waiting. The command itself may have been carried out.
    #[error("interrupted while waiting for the daemon")]
    Interrupted,

    /// The transport failed.
    #[error("shared-memory transport in {}: {action}: {problem}", shared_memory())]
    Transport {
        /// What was tried.
        action: String,
        /// What the transport says.
        problem: String,
    },
}

impl ProtocolError {
    /// A transport failure; `problem` is the transport's own error, which often does not know the cause.
    pub fn transport(action: impl Into<String>, problem: impl std::fmt::Debug) -> Self {
        let action = action.into();
        let cause = take_problem().or_else(other_problem);
        let (system, place) = match &cause {
            Some(Problem::System { error, path }) => {
                let place = path.as_ref().map(|path| format!("{path}: "));
                (Some(io::Error::from(*error)), place.unwrap_or_default())
            }
            _ => (None, String::new()),
        };
        match cause {
            Some(Problem::Full {
                folder,
                free,
                needed,
            }) => ProtocolError::SharedMemory {
                path: folder,
                free,
                needed,
                what: action,
            },
            Some(Problem::Damaged { path }) => ProtocolError::Damaged { path, action },
            _ if system.as_ref().is_some_and(open_files::is_exhausted) => {
                ProtocolError::descriptors(action)
            }
            _ => {
                let problem = match (process::missing(), system) {
                    (Some(missing), _) => missing.to_owned(),
                    (None, Some(error)) if error.kind() == io::ErrorKind::OutOfMemory => format!(
                        "this process may have no more memory; raise its limit (`ulimit -v unlimited`), or use fewer \
                         worlds ({error})"
                    ),
                    (None, Some(error)) => format!("{problem:?}, {place}{error}"),
                    (None, None) => format!("{problem:?}"),
                };
                ProtocolError::Transport { action, problem }
            }
        }
    }

    /// A file or folder of the root that the system refuses.
    pub(crate) fn root(path: &Path, error: &std::io::Error) -> Self {
        let action = format!("use {}", path.display());
        match error.kind() {
            io::ErrorKind::StorageFull => ProtocolError::no_file_fits(path, action),
            _ if open_files::is_exhausted(error) => ProtocolError::descriptors(action),
            _ => ProtocolError::Root {
                path: path.to_owned(),
                problem: error.to_string(),
            },
        }
    }

    fn no_file_fits(path: &Path, what: String) -> Self {
        let folder = path.parent().unwrap_or(path);
        let (free, needed) = (free_bytes(folder), FREE_MIN);
        ProtocolError::SharedMemory {
            path: folder.to_string_lossy().into_owned(),
            free,
            needed,
            what,
        }
    }

    pub(crate) fn descriptors(action: String) -> Self {
        let limit = open_files::limit();
        ProtocolError::Descriptors { action, limit }
    }
}
