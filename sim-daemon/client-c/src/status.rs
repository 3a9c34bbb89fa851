//! What a call came to: a status, and the sentence of the last error of each thread.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use sim_protocol::ProtocolError;

/// What a call came to. Numbers keep their meaning; later versions may add some.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Done.
    Ok = 0,
    /// An argument is NULL, misaligned, too long or not UTF-8; the sentence names it.
    BadArgument = 1,
    /// The client was detached before, or the frame dropped.
    StaleHandle = 2,
    /// Header and library are of different versions.
    ApiVersion = 3,
    /// A bug of this library. Nothing else is affected.
    Internal = 4,
    /// The name cannot be one of a daemon.
    BadName = 10,
    /// The folder of lock files cannot be used.
    Root = 11,
    /// No daemon of this name runs.
    NoDaemon = 12,
    /// The daemon has groups; attach to one of them.
    Grouped = 13,
    /// Daemon and client speak different versions of the protocol.
    ProtocolVersion = 14,
    /// Handshake and description of the daemon do not agree.
    Handshake = 15,
    /// The daemon has as many clients as it can have.
    TooManyClients = 16,
    /// Something holds the daemon's name and does not run: no daemon, or one that is still starting.
    Silent = 17,
    /// No field or input has this name; the sentence lists those that are there.
    UnknownName = 20,
    /// An array has the wrong number of entries.
    Shape = 21,
    /// The daemon refused the command; no world was touched.
    Refused = 30,
    /// As many frames are held as there are slots; drop one.
    FramesHeld = 31,
    /// A step was sent and its frame not received; call tl_recv first.
    StepInFlight = 32,
    /// tl_recv without tl_send.
    NothingSent = 33,
    /// The process forked; attach again in the child.
    Forked = 34,
    /// tl_interrupt ended the wait. The command may have been carried out.
    Interrupted = 35,
    /// The daemon lives and did not answer in time.
    Timeout = 36,
    /// The daemon ended; its state is lost.
    DaemonLost = 40,
    /// Another daemon has the name now; attach again.
    DaemonRestarted = 41,
    /// Another client controls the worlds.
    LeaseHeld = 42,
    /// Another client took control meanwhile.
    LeaseLost = 43,
    /// Another program changed the daemon's shared memory.
    Damaged = 44,
    /// What the daemon sent makes no sense.
    Malformed = 45,
    /// Shared memory or memory is too small.
    Memory = 50,
    /// The process has too many files open.
    Descriptors = 51,
    /// The transport failed.
    Transport = 52,
    /// Any other error; the sentence says which.
    Other = 99,
}

/// Why a call failed.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) status: Status,
    pub(crate) sentence: String,
}

impl Failure {
    pub(crate) fn new(status: Status, sentence: impl Into<String>) -> Failure {
        let sentence = sentence.into();
        Failure { status, sentence }
    }
}

impl From<ProtocolError> for Failure {
    fn from(error: ProtocolError) -> Failure {
        Failure::new(status_of(&error), error.to_string())
    }
}

fn status_of(error: &ProtocolError) -> Status {
    use ProtocolError as E;
    match error {
        E::BadName { .. } => Status::BadName,
        E::Root { .. } => Status::Root,
        E::NoDaemon { .. } => Status::NoDaemon,
        E::Grouped { .. } => Status::Grouped,
        E::ProtocolVersion { .. } => Status::ProtocolVersion,
        E::Handshake { .. } => Status::Handshake,
        E::TooManyClients { .. } => Status::TooManyClients,
        E::Silent { .. } | E::Starting { .. } => Status::Silent,
        E::NotAnInput { .. } | E::NoField { .. } => Status::UnknownName,
        E::Shape { .. } => Status::Shape,
        E::CommandRefused { .. } => Status::Refused,
        E::FramesHeld { .. } => Status::FramesHeld,
        E::StepInFlight => Status::StepInFlight,
        E::NothingSent => Status::NothingSent,
        E::Forked { .. } => Status::Forked,
        E::Interrupted => Status::Interrupted,
        E::Timeout { .. } => Status::Timeout,
        E::DaemonLost { .. } => Status::DaemonLost,
        E::DaemonRestarted { .. } => Status::DaemonRestarted,
        E::LeaseHeld { .. } => Status::LeaseHeld,
        E::LeaseLost { .. } => Status::LeaseLost,
        E::Damaged { .. } => Status::Damaged,
        E::Malformed { .. } => Status::Malformed,
        E::SharedMemory { .. } | E::Memory { .. } => Status::Memory,
        E::Descriptors { .. } => Status::Descriptors,
        E::Transport { .. } | E::Unreached { .. } => Status::Transport,
        _ => Status::Other,
    }
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Runs a call. Errors and panics leave their sentence for [`tl_last_error`].
pub(crate) fn call(body: impl FnOnce() -> Result<(), Failure>) -> Status {
    let failure = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return Status::Ok,
        Ok(Err(failure)) => failure,
        Err(panic) => Failure::new(Status::Internal, bug(panic.as_ref())),
    };
    let sentence = CString::new(failure.sentence.replace('\0', "\u{fffd}")).unwrap_or_default();
    // a thread that ends has nobody left to read it
    let _ = LAST.try_with(|last| last.replace(sentence));
    failure.status
}

/// The sentence of a panic.
fn bug(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    let text = text.unwrap_or("no message");
    format!("a bug of the client library: {text}; report it with these words")
}

/// The sentence of the last call of this thread that failed; empty before the first one. Valid until the next one fails.
#[unsafe(no_mangle)]
pub extern "C" fn tl_last_error() -> *const c_char {
    let text = LAST.try_with(|last| last.borrow().as_ptr());
    text.unwrap_or(c"".as_ptr())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last() -> String {
        LAST.with(|last| last.borrow().to_str().unwrap().to_owned())
    }

    #[test]
    fn a_panic_ends_at_the_border_with_its_message() {
        assert_eq!(call(|| panic!("seven of {}", 8)), Status::Internal);
        assert!(last().contains("seven of 8"), "{}", last());
    }

    #[test]
    fn each_thread_has_its_own_last_error_and_success_keeps_it() {
        let fail = |text: &str| call(|| Err(Failure::new(Status::Other, text)));
        assert_eq!(fail("here\0"), Status::Other);
        std::thread::spawn(move || {
            assert_eq!(last(), "");
            fail("there");
            assert_eq!(last(), "there");
        })
        .join()
        .unwrap();
        assert_eq!(call(|| Ok(())), Status::Ok);
        assert_eq!(last(), "here\u{fffd}");
    }
}
