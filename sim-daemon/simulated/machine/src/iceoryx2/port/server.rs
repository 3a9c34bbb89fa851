//! Ports that answer.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::sync::Arc;

use ::iceoryx2::prelude::ZeroCopySend;

use super::ReceiveError;
use super::loan::{Borrow, Slots, meet, open_inlet, open_outlet, tagged, update};
use super::update_connections::{ConnectionFailure, UpdateConnections};
use crate::iceoryx2::RequestTypes;
use crate::iceoryx2::active_request::ActiveRequest;
use crate::iceoryx2::bag::Role;
use crate::iceoryx2::membership::Port;
use crate::iceoryx2::service::Service;
use crate::iceoryx2::service::port_factory::request_response::{PortFactory, ServerCreateError};
use crate::world::with;

/// A request that waits for its answer, if there is one.
type Active<S, Q, QH, R, RH> = Option<ActiveRequest<S, [Q], QH, [R], RH>>;

/// A port that answers.
#[derive(Debug)]
pub struct Server<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug + ZeroCopySend,
    R: Debug + ?Sized,
    RH: Debug + ZeroCopySend,
{
    port: Arc<Port>,
    loans_max: usize,
    fire_and_forget: bool,
    types: RequestTypes<S, Q, QH, R, RH>,
}

impl<S, Q, QH, R, RH> Server<S, [Q], QH, [R], RH>
where
    S: Service,
    Q: Debug + ZeroCopySend + 'static,
    QH: Debug + ZeroCopySend,
    R: Debug + ZeroCopySend + 'static,
    RH: Debug + ZeroCopySend,
{
    pub(crate) fn new(
        factory: &PortFactory<S, [Q], QH, [R], RH>,
        length_max: usize,
        loans_max: usize,
    ) -> Result<Self, ServerCreateError> {
        let settings = &factory.settings;
        let (active, lane) = (settings.requests.active, settings.lanes[1]);
        let clients = settings.ports_max.get(&Role::Client).copied();
        let requests = clients.unwrap_or(1) * 2 * active;
        let count = requests * (lane.buffer + lane.borrowed + loans_max);
        let slots = Slots::sized::<R, RH>(count, length_max);
        let port = tagged(&factory.service, Role::Server)
            .map_err(|_| ServerCreateError::UnableToCreatePortTag)?;
        let entry = port.entry(active, 0);
        open_inlet(&port, entry);
        open_outlet(&port, slots).map_err(|_| ServerCreateError::UnableToCreateDataSegment)?;
        let port = meet(port, entry).ok_or(ServerCreateError::ExceedsMaxSupportedServers)?;
        Ok(Server {
            port,
            loans_max,
            fire_and_forget: settings.requests.fire_and_forget,
            types: PhantomData,
        })
    }

    /// The next request.
    ///
    /// # Errors
    /// Too many are held.
    pub fn receive(&self) -> Result<Active<S, Q, QH, R, RH>, ReceiveError> {
        loop {
            let Some(borrow) = Borrow::receive(&self.port, 0)? else {
                return Ok(None);
            };
            let client = borrow.received.sender;
            let is_connected = with(|world| {
                let outlet = world.wires.outlets.get(&self.port.id);
                outlet.is_some_and(|outlet| outlet.peers.contains_key(&client))
            });
            let active = ActiveRequest::new(borrow, self.loans_max);
            // as in iceoryx2, requests of clients that are gone are dropped
            if is_connected && (self.fire_and_forget || active.is_connected()) {
                return Ok(Some(active));
            }
        }
    }
}

impl<S, Q, QH, R, RH> UpdateConnections for Server<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug + ZeroCopySend,
    R: Debug + ?Sized,
    RH: Debug + ZeroCopySend,
{
    fn update_connections(&self) -> Result<(), ConnectionFailure> {
        update(&self.port);
        Ok(())
    }
}
