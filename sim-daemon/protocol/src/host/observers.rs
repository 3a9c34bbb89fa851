//! Observers: at a limited rate they get the first worlds of a frame, with the state from which these could go on.

use std::time::Duration;

use super::worlds::{S, Worlds};
use crate::doors::iceoryx2::port::update_connections::UpdateConnections;
use crate::doors::iceoryx2::prelude::{Node, PortFactory};
use crate::doors::time::Instant;
use crate::memory::guard::guarded;
use crate::memory::loaned;
use crate::transport::budget;
use crate::transport::{self, FramePublisher, FrameService, Waker};
use crate::{ALIGNMENT, Description, FrameHeader, ProtocolError, Table};

/// Observers see a frame that comes this long after the one before, so that of 60 a second they see all, early ones too ...
pub(super) const PERIOD: Duration = Duration::from_millis(15);
/// ... and every other one where they see more worlds than this.
const MANY: usize = 256;
/// To show frames takes about one part in so many of the daemon's time at most ...
const PARTS: u32 = 100;
/// ... unless observers would then see fewer frames than one in this time.
pub(super) const SLOWEST: Duration = Duration::from_millis(250);

/// The observers' service.
pub(super) struct Observers {
    table: Table,
    publisher: FramePublisher<S>,
    service: FrameService<S>,
    notifier: Waker<S>,
    period: Duration,
    count: usize,
    /// The state has changed since they were shown one.
    unseen: bool,
    shown: Instant,
    /// What it takes to show them one, over the last ones.
    cost: Option<Duration>,
}

impl Observers {
    /// Opens the service and takes its memory.
    pub fn open(
        node: &Node<S>,
        description: &Description,
        frame: &Table,
    ) -> Result<Observers, ProtocolError> {
        let table = budget::watch_table(description, frame);
        let service = transport::create_watch(node, description.frames_held)?;
        let publisher = transport::frame_publisher(&service, table.total_bytes())?;
        let notifier = transport::notifier(&transport::create_event(node, "watch", &[])?)?;
        Ok(Observers {
            table,
            publisher,
            service,
            notifier,
            period: match description.watch_worlds {
                ..=MANY => PERIOD,
                _ => 2 * PERIOD,
            },
            count: 0,
            unseen: true,
            shown: Instant::now(),
            cost: None,
        })
    }

    /// There is something new to see.
    pub fn changed(&mut self) {
        self.unseen = true;
    }

    /// There is nothing new to see, after all.
    pub fn unchanged(&mut self) {
        self.unseen = false;
    }

    /// Whether there are observers who have not seen the present state, nor any within the last period.
    pub fn is_due(&self) -> bool {
        let period = self
            .period
            .max(SLOWEST.min(PARTS * self.cost.unwrap_or_default()));
        self.unseen && self.count > 0 && self.shown.elapsed() > period
    }

    /// Sees who is there; a new observer gets the last sample.
    pub fn refresh(&mut self) {
        // an observer that cannot be connected looks again by itself
        let _ = self.publisher.update_connections();
        self.count = self.service.dynamic_config().number_of_subscribers();
    }

    /// Shows the first worlds of an arena, which `frame` describes, and their state; what that takes counts from `began` on.
    pub fn show(
        &mut self,
        began: Instant,
        head: FrameHeader,
        frame: &Table,
        arena: &[u64],
        worlds: &mut impl Worlds,
    ) {
        (self.shown, self.unseen) = (Instant::now(), false);
        let lines = self.table.total_bytes() / ALIGNMENT;
        let Some(Ok(mut loan)) = loaned::loan(&self.publisher, lines) else {
            return; // observers keep every slot: they miss a frame
        };
        let words = loaned::words(loan.payload_mut());
        words[..self.table.words().len()].copy_from_slice(self.table.words());
        let from: &[u8] = bytemuck::cast_slice(arena);
        let before = Table::head_bytes(frame.rows().len());
        let to: &mut [u8] = bytemuck::cast_slice_mut(words);
        for (source, target) in frame.rows().iter().zip(self.table.rows()) {
            // worlds come first in every array, so the first worlds are its first bytes
            to[target.offset..target.offset + target.bytes]
                .copy_from_slice(&from[source.offset - before..][..target.bytes]);
        }
        if let [.., state] = self.table.rows()
            && !worlds.state(&mut to[state.offset..state.offset + state.bytes])
        {
            return; // they were lost meanwhile
        }
        *loan.user_header_mut() = FrameHeader {
            rows: self.table.rows().len() as u32,
            ..head
        };
        // an observer that cannot be reached misses a frame; one that cannot be notified looks by itself after 50 ms
        guarded(|| loaned::send(loan));
        guarded(|| self.notifier.notify());
        // one that took far longer waited for the processor
        let took = began.elapsed();
        self.cost = Some(
            self.cost
                .map_or(took, |cost| (7 * cost + took.min(8 * cost)) / 8),
        );
    }
}
