//! The services of one lease, at the daemon.

use std::time::Duration;

use super::worlds::S;
use crate::doors::iceoryx2::identifiers::UniqueClientId;
use crate::doors::iceoryx2::port::update_connections::UpdateConnections;
use crate::doors::iceoryx2::prelude::{Node, PortFactory};
use crate::doors::sync::{Arc, Weak};
use crate::doors::time::Instant;
use crate::memory::mapping::{self, Pages};
use crate::transport::budget::slot_bytes;
use crate::transport::{
    self, CommandService, CommandSubscriber, ControlService, FramePublisher, Waker,
};
use crate::{ProtocolError, Table};

/// A holder whose heartbeats stopped for this long loses the lease when somebody else asks for it.
const SILENCE_MAX: Duration = Duration::from_secs(2);
/// A holder that was granted the lease and did not open its services within this time is gone.
const JOIN_MAX: Duration = Duration::from_millis(800);

/// The shared memory that the frames of a lease lie in.
#[derive(Debug, Default)]
pub struct FrameMemory(Vec<Weak<Pages>>);

impl FrameMemory {
    /// The pages that an arena lies in, which stay mapped as long as they are owned. Who owns them lets go of them at
    /// [`super::Next::LeaseEnded`]: until then there may be no room for another lease.
    pub fn pages(&self, arena: &[u64]) -> Option<Arc<Pages>> {
        let mut pages = self.0.iter().filter_map(Weak::upgrade);
        pages.find(|pages| pages.hold(arena))
    }

    /// Whether somebody owns some of it.
    pub(super) fn is_owned(&self) -> bool {
        self.0.iter().any(|pages| pages.strong_count() > 0)
    }
}

/// One lease: free until somebody is granted it.
#[derive(Debug)]
pub(super) struct Lease {
    pub(super) epoch: u64,
    pub(super) holder: Option<Holder>,
    pub(super) last_seq: u64,
    pub(super) subscriber: CommandSubscriber<S>,
    pub(super) publisher: FramePublisher<S>,
    pub(super) memory: FrameMemory,
    pub(super) notifier: Waker<S>,
    commands: CommandService<S>,
}

/// Who holds a lease.
#[derive(Debug)]
pub(super) struct Holder {
    pub(super) pid: u32,
    /// Of the control service: the one that asked.
    client: UniqueClientId,
    pub(super) since: Instant,
    pub(super) beat: Instant,
    joined: bool,
}

impl Lease {
    /// Creates the services of lease `epoch` and takes the memory of its frames.
    pub(super) fn open(
        node: &Node<S>,
        epoch: u64,
        frame: &Table,
        frames_held: usize,
    ) -> Result<Lease, ProtocolError> {
        let frames = transport::create_frames(node, epoch, frames_held)?;
        let (publisher, pages) =
            mapping::noted(|| transport::frame_publisher(&frames, slot_bytes(frame)));
        let publisher = publisher?;
        let notifier = transport::notifier(&transport::create_event(
            node,
            &format!("obs/{epoch}"),
            &[],
        )?)?;
        let commands = transport::create_commands(node, epoch)?;
        let subscriber = transport::command_subscriber(&commands)?;
        Ok(Lease {
            epoch,
            holder: None,
            last_seq: 0,
            subscriber,
            publisher,
            memory: FrameMemory(pages),
            notifier,
            commands,
        })
    }

    pub(super) fn grant(&mut self, pid: u32, client: UniqueClientId) {
        let now = Instant::now();
        self.holder = Some(Holder {
            pid,
            client,
            since: now,
            beat: now,
            joined: false,
        });
    }

    /// Notes that the holder opened its services; it may be gone again before anybody looked.
    pub(super) fn joined(&mut self) {
        if let Some(holder) = &mut self.holder {
            holder.joined = true;
        }
    }

    /// Whether the holder is gone: its publisher went, by release or because a dead process was cleaned up, or will never come.
    pub(super) fn is_over(&mut self, control: &ControlService<S>) -> bool {
        let Some(holder) = &mut self.holder else {
            return false;
        };
        // first: a daemon that is stopped here sees a holder that came meanwhile
        let is_missed = !holder.joined
            && (holder.since.elapsed() > JOIN_MAX
                || !transport::is_present(control, holder.client));
        let publishers = self.commands.dynamic_config().number_of_publishers();
        holder.joined |= publishers > 0;
        publishers == 0 && (holder.joined || is_missed)
    }

    /// The holder's process, unless it is gone.
    pub(super) fn present_holder(&mut self, control: &ControlService<S>) -> Option<u32> {
        if self.is_over(control) {
            return None;
        }
        self.holder.as_ref().map(|holder| holder.pid)
    }

    /// Whether the holder had been silent for too long when a look around began: the heartbeats that came after that may
    /// wait unread.
    pub(super) fn is_silent(&self, polled: Instant) -> bool {
        self.holder
            .as_ref()
            .is_some_and(|holder| polled.duration_since(holder.beat) > SILENCE_MAX)
    }

    /// Leaves out a time until `now` in which the daemon looked at no heartbeats.
    pub(super) fn leave_out(&mut self, gap: Duration, now: Instant) {
        if let Some(holder) = &mut self.holder {
            // one that was read at the end of that time is no later than now
            holder.beat = (holder.beat + gap).min(now);
        }
    }

    /// Lets go of the slots of dead processes, and meets new ones.
    pub(super) fn refresh(&self) {
        // a client that cannot be reached is one that went: the next look at `is_over` tells
        let _ = self.publisher.update_connections();
    }
}
