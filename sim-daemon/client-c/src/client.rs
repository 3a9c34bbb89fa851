//! Clients: attach, describe, interrupt, detach.

use std::ffi::c_char;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use sim_protocol::{AttachOptions, Client, Command, ProtocolError, keep_waiting};

use crate::description::{Described, DescriptionMemory};
use crate::handle::{Pool, Slot};
use crate::pointers::{Output, Plain, handle, optional, text};
use crate::staged::Staged;
use crate::status::{Failure, Status, call};

/// Version of this header. tl_attach compares it with the library's.
pub const TL_API_VERSION: u32 = 1;

/// A connection to a daemon.
#[derive(Debug)]
pub struct ClientHandle {
    slot: Slot<Arc<State>>,
    is_interrupted: AtomicBool,
}

/// How to attach. Zero is the default of each.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Folder of the daemon's lock file; NULL: $TIGHTLOOP_ROOT, or the folder that `tightloop serve` uses.
    pub root: *const c_char,
    /// How long to wait for a daemon that does not run yet; one that starts already gets 10 s where it is 0 [s].
    pub wait_s: f64,
}

// any pointer and any float
impl Plain for Options {}

/// What is behind a handle while it is attached.
#[derive(Debug)]
pub(crate) struct State {
    pub(crate) client: Client,
    description: DescriptionMemory,
    staged: Mutex<Staged>,
}

static POOL: Pool<ClientHandle> = Pool::new();
const STALE: &str = "client: it was detached before; use a client until tl_detach, and not after";

impl State {
    pub(crate) fn staged(&self) -> MutexGuard<'_, Staged> {
        self.staged.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Steps, or sends a step, with the inputs that were set.
    pub(crate) fn with_inputs<R>(
        &self,
        send: impl FnOnce(&[Command<'_>]) -> Result<R, ProtocolError>,
    ) -> Result<R, Failure> {
        self.client.check_process()?;
        // a step may take long, and other threads may set the inputs of the next one
        let taken = self.staged().take();
        let sent = taken.send(send);
        self.staged().give_back(taken);
        Ok(sent?)
    }
}

impl ClientHandle {
    fn new() -> ClientHandle {
        let (slot, is_interrupted) = (Slot::empty(), AtomicBool::new(false));
        ClientHandle {
            slot,
            is_interrupted,
        }
    }

    /// What is behind it. It stays there for the call, even if another thread detaches.
    pub(crate) fn state(&self) -> Result<Arc<State>, Failure> {
        let state = self.slot.with(STALE, |state| Ok(Arc::clone(state)))?;
        // its locks may be those of threads that a child does not have
        state.client.check_process()?;
        Ok(state)
    }

    /// Runs while a call waits.
    pub(crate) fn poll(&self) -> ControlFlow<()> {
        match self.is_interrupted.swap(false, Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// Attaches to a running daemon. `api_version` is TL_API_VERSION, `options` may be NULL.
///
/// TL_STATUS_NO_DAEMON lists the daemons that run. TL_STATUS_PROTOCOL_VERSION names both versions of the protocol.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_attach(
    api_version: u32,
    name: *const c_char,
    options: *const Options,
    client: *mut *mut ClientHandle,
) -> Status {
    call(|| {
        // SAFETY: the caller's promise.
        let output = unsafe { Output::new(client, std::ptr::null_mut(), "client") }?;
        if api_version != TL_API_VERSION {
            let sentence = format!(
                "tightloop_client.h is version {api_version}, the library is version {TL_API_VERSION}; compile with the \
                 header of the library's release"
            );
            return Err(Failure::new(Status::ApiVersion, sentence));
        }
        // SAFETY: the caller's promise.
        let name = unsafe { text(name, "name") }?;
        let mut how = AttachOptions::default();
        // SAFETY: the caller's promise.
        if let Some(options) = unsafe { optional(options, "options") }? {
            if !options.root.is_null() {
                // SAFETY: the caller's promise.
                let root = unsafe { text(options.root, "options.root") }?;
                how.root = Some(PathBuf::from(root));
            }
            how.wait = Duration::try_from_secs_f64(options.wait_s).map_err(|_| {
                let wait = options.wait_s;
                let sentence = format!("options.wait_s: {wait} s; give 0 or more, and finite");
                Failure::new(Status::BadArgument, sentence)
            })?;
        }
        let attached = Client::attach(name, &how, &mut keep_waiting())?;
        let description = DescriptionMemory::new(attached.description())?;
        let staged = Mutex::new(Staged::new(attached.description()));
        let client = POOL.lend(ClientHandle::new);
        client.is_interrupted.store(false, Ordering::Relaxed);
        client.slot.fill(Arc::new(State {
            client: attached,
            description,
            staged,
        }));
        output.set(std::ptr::from_ref(client).cast_mut());
        Ok(())
    })
}

/// What the daemon reports of itself. The pointers in it are valid until tl_detach.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_describe(
    client: *mut ClientHandle,
    description: *mut Described,
) -> Status {
    call(|| {
        // SAFETY: the caller's promise.
        let (output, client) = unsafe {
            let output = Output::new(description, Described::EMPTY, "description")?;
            (output, handle(client, "client")?)
        };
        let described = |state: &Arc<State>| Ok(state.description.described());
        output.set(client.slot.with(STALE, described)?);
        Ok(())
    })
}

/// Ends the call of this client that waits, or the next one that waits for 50 ms, with TL_STATUS_INTERRUPTED.
///
/// It may be called from a signal handler. NULL does nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_interrupt(client: *mut ClientHandle) {
    // SAFETY: the caller's promise; nothing here takes a lock or memory.
    if let Some(client) = unsafe { client.as_ref() } {
        client.is_interrupted.store(true, Ordering::Relaxed);
    }
}

/// Gives control back and ends the connection. Its frames stay valid. NULL does nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_detach(client: *mut ClientHandle) -> Status {
    call(|| {
        if client.is_null() {
            return Ok(());
        }
        // SAFETY: the caller's promise.
        let client = unsafe { handle(client, "client") }?;
        let state = client.slot.take();
        drop(state.ok_or_else(|| Failure::new(Status::StaleHandle, STALE))?);
        POOL.give_back(client);
        Ok(())
    })
}

/// Version of the protocol that this library speaks. Daemons of another one refuse it.
#[unsafe(no_mangle)]
pub extern "C" fn tl_protocol_version() -> u32 {
    sim_protocol::PROTOCOL_VERSION
}
