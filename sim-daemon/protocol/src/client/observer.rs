//! The observing end of a client: newest frames, nothing asked of the daemon.

use std::ops::ControlFlow;
use std::time::Duration;

use crate::doors::sync::Arc;
use crate::doors::time::Instant;
use crate::lease::answer::check_table;
use crate::memory::frame::{Alive, FrameSample};
use crate::memory::guard::guarded;
use crate::memory::loaned;
use crate::memory::port::Port;
use crate::presence::connection::{Connection, S, damaged, intact, intact_there, malformed};
use crate::presence::liveness::Reach;
use crate::transport::{self, FrameSubscriber, Sleeper};
use crate::waiting::SLICE;
use crate::waiting::hook::Hook;
use crate::waiting::park::park;
use crate::{Description, Frame, ProtocolError, Table};

/// A subscription to the observers' service.
#[derive(Debug)]
pub(crate) struct Observer {
    connection: Arc<Connection>,
    description: Arc<Description>,
    table: Option<Arc<Table>>,
    frames: Arc<Alive>,
    subscriber: Arc<FrameSubscriber<S>>,
    reach: Reach,
    listener: Sleeper<S>,
}

impl Observer {
    pub(crate) fn open(
        connection: &Arc<Connection>,
        description: &Arc<Description>,
        hook: Hook<'_>,
    ) -> Result<Observer, ProtocolError> {
        let (subscriber, listener) = connection.ports(hook, |node| {
            let listener = transport::listener(&transport::open_event(node, "watch")?)?;
            let name = connection.peer.paths.name();
            Ok((transport::watch_subscriber(node, name)?, listener))
        })?;
        // a daemon that sleeps shows a new observer its present state when it looks around
        connection.notify();
        Ok(Observer {
            connection: Arc::clone(connection),
            description: Arc::clone(description),
            table: None,
            frames: Alive::new(),
            reach: connection.peer.reach(subscriber.id().value()),
            subscriber: Arc::new(subscriber),
            listener,
        })
    }

    pub(crate) fn latest(&mut self) -> Result<Option<Frame>, ProtocolError> {
        self.frames.check(self.description.frames_held)?;
        let Some(sample) = self.receive()? else {
            self.connection.peer.check()?;
            intact_there(&self.connection.peer)?;
            let reach = std::slice::from_ref(&self.reach);
            self.connection.peer.check_reach(reach)?;
            return Ok(None);
        };
        let peer = &self.connection.peer;
        intact(peer)?;
        let (header, payload) =
            loaned::received(&sample).ok_or_else(|| damaged(peer, "read a frame"))?;
        if header.session != self.connection.peer.beacon.session
            || header.schema != self.description.schema
        {
            return Err(malformed("the head of a frame: another session or schema"));
        }
        let table = check_table(&mut self.table, payload, header.rows)?;
        let base = payload.as_ptr() as usize;
        let reader = Arc::clone(&self.subscriber);
        let frame = Frame::new((header, base), sample, table, &self.frames, reader);
        Ok(Some(frame))
    }

    /// The newest sample; older ones are dropped.
    fn receive(&self) -> Result<Option<FrameSample>, ProtocolError> {
        let mut newest = None;
        let peer = &self.connection.peer;
        while let Some(sample) = guarded(|| self.subscriber.receive())
            .ok_or_else(|| damaged(peer, "receive a frame"))?
            .map_err(|error| ProtocolError::transport("receive a frame", error))?
        {
            drop(newest.replace(Port::with_owner(self.subscriber.owner(), sample)));
        }
        Ok(newest)
    }

    pub(crate) fn wait_newer(
        &mut self,
        timeout: Option<Duration>,
        hook: Hook<'_>,
    ) -> Result<Option<Frame>, ProtocolError> {
        let start = Instant::now();
        loop {
            if let Some(frame) = self.latest()? {
                return Ok(Some(frame));
            }
            let left = timeout.map_or(SLICE, |timeout| {
                timeout.saturating_sub(start.elapsed()).min(SLICE)
            });
            if left.is_zero() {
                return Ok(None);
            }
            if let ControlFlow::Break(()) = hook() {
                return Err(ProtocolError::Interrupted);
            }
            guarded(|| park(&self.listener, left))
                .ok_or_else(|| damaged(&self.connection.peer, "wait for a frame"))??;
        }
    }
}
