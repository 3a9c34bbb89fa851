//! From one lease to the next.

use super::ClientCleanup;
use super::lease::Lease;
use super::state::State;
use super::worlds::S;
use crate::ProtocolError;
use crate::doors::iceoryx2::identifiers::UniqueClientId;
use crate::memory::guard::guarded;
use crate::transport::Asked;
use crate::transport::budget;
use crate::wire::control::Response;

/// A lease that has ended, and the next one, for which there may be no room while somebody owns pages of the last.
#[derive(Default)]
pub(super) struct Handover {
    stage: Stage,
    /// Who wants the next lease, and in which process.
    waiting: Vec<(Asked<S>, u32)>,
}

#[derive(Default, PartialEq)]
enum Stage {
    /// No pages of another lease are owned.
    #[default]
    Over,
    /// The owner does not know yet that the lease has ended.
    Owned,
    /// The owner was notified of it.
    Notified,
}

impl Handover {
    /// Whether the owner of the pages must be notified that their lease has ended.
    pub(super) fn is_due(&self) -> bool {
        self.stage == Stage::Owned
    }

    /// Notes that the owner of the pages is notified: it lets go of them before it waits again.
    pub(super) fn notify(&mut self) {
        self.stage = Stage::Notified;
    }

    /// Keeps a request for a lease until there is room for one.
    pub(super) fn postpone(&mut self, active: Asked<S>, pid: u32) {
        self.waiting.push((active, pid));
    }

    /// The requests that were kept.
    pub(super) fn waiting(&mut self) -> Vec<(Asked<S>, u32)> {
        std::mem::take(&mut self.waiting)
    }
}

impl State {
    /// Ends a lease that is over, makes the next one ready.
    pub(super) fn renew(&mut self) {
        // the old slots go first: there may not be room for both
        let old = self.lease.take();
        self.pacer.rest();
        self.affinity.stay();
        if let Some(mut old) = old {
            let memory = std::mem::take(&mut old.memory);
            guarded(|| drop(old));
            if memory.is_owned() {
                self.handover.stage = Stage::Owned;
            }
        }
        if self.handover.stage == Stage::Over {
            self.open_lease();
        }
    }

    /// Makes a lease ready that had to wait for the owner of pages of the last.
    pub(super) fn hand_over(&mut self) {
        if self.handover.stage == Stage::Notified {
            self.handover.stage = Stage::Over;
            self.open_lease();
        }
    }

    fn open_lease(&mut self) {
        self.epochs += 1;
        // without room now, the next request for a lease tries again and reports why
        let open = || {
            let held = self.description.frames_held;
            Lease::open(&self.node, self.epochs, &self.frame, held)
        };
        self.lease = guarded(open).and_then(Result::ok);
    }

    /// Lets go of everybody who uses memory that makes no sense; they may come again.
    pub(super) fn lose_clients(&mut self) {
        self.journals.lose();
        self.renew();
    }

    /// Grants the lease, or says why not; nothing as long as the last one is handed over.
    pub(super) fn acquire(&mut self, pid: u32, client: UniqueClientId) -> Option<Response> {
        if let Some(lease) = &mut self.lease
            && lease.holder.is_some()
        {
            ClientCleanup::new(&self.node).clean();
            if lease.is_over(&self.control) || lease.is_silent(self.polled) {
                self.renew();
            }
        }
        if self.handover.stage != Stage::Over {
            return None;
        }
        if self.lease.is_none() {
            let needed = budget::lease_bytes(&self.description, &self.frame);
            match budget::check(budget::free(), needed, 0, "a lease") {
                Err(
                    ProtocolError::SharedMemory { free, needed, .. }
                    | ProtocolError::Memory { free, needed, .. },
                ) => {
                    return Some(Response::NoMemory { free, needed });
                }
                Err(error) => {
                    return Some(Response::Refused {
                        reason: error.to_string(),
                    });
                }
                Ok(()) => self.renew(),
            }
        }
        Some(match &mut self.lease {
            None => Response::Refused {
                reason: "the services of a new lease could not be created".to_owned(),
            },
            Some(Lease {
                holder: Some(holder),
                ..
            }) => Response::Held { pid: holder.pid },
            Some(lease) => {
                lease.grant(pid, client);
                Response::Granted { epoch: lease.epoch }
            }
        })
    }
}
