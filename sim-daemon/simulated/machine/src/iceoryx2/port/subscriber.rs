//! Ports that receive samples.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::sync::Arc;

pub use ::iceoryx2::port::subscriber::SubscriberCreateError;
use ::iceoryx2::prelude::ZeroCopySend;

use super::ReceiveError;
use super::loan::{Borrow, meet, open_inlet, tagged, update};
use super::update_connections::{ConnectionFailure, UpdateConnections};
use crate::iceoryx2::Types;
use crate::iceoryx2::bag::Role;
use crate::iceoryx2::identifiers::UniqueSubscriberId;
use crate::iceoryx2::membership::Port;
use crate::iceoryx2::sample::Sample;
use crate::iceoryx2::service::Service;
use crate::iceoryx2::service::port_factory::publish_subscribe::PortFactory;

/// A port that receives.
#[derive(Debug)]
pub struct Subscriber<S: Service, P: Debug + ?Sized, H: Debug + ZeroCopySend> {
    port: Arc<Port>,
    buffer: usize,
    types: Types<(S, Box<P>, H)>,
}

impl<S: Service, P: Debug + ?Sized, H: Debug + ZeroCopySend> Subscriber<S, P, H> {
    pub(crate) fn new(
        factory: &PortFactory<S, P, H>,
        buffer: Option<usize>,
        history: Option<usize>,
    ) -> Result<Self, SubscriberCreateError> {
        let settings = &factory.settings;
        let most = settings.lanes[0].buffer;
        let port = tagged(&factory.service, Role::Subscriber)
            .map_err(|_| SubscriberCreateError::UnableToCreatePortTag)?;
        let buffer = buffer.unwrap_or(most);
        if buffer > most {
            return Err(SubscriberCreateError::BufferSizeExceedsMaxSupportedBufferSizeOfService);
        }
        let history = history.unwrap_or(settings.history.min(buffer));
        if history > settings.history {
            return Err(SubscriberCreateError::HistoryRequestExceedsHistorySizeOfService);
        }
        if history > buffer {
            return Err(SubscriberCreateError::HistoryRequestExceedsBufferSizeOfSubscriber);
        }
        let entry = port.entry(buffer, history);
        open_inlet(&port, entry);
        let port =
            meet(port, entry).ok_or(SubscriberCreateError::ExceedsMaxSupportedSubscribers)?;
        Ok(Subscriber {
            port,
            buffer,
            types: PhantomData,
        })
    }

    /// Its number.
    pub fn id(&self) -> UniqueSubscriberId {
        UniqueSubscriberId(self.port.id)
    }

    /// Samples that wait at most.
    pub fn buffer_size(&self) -> usize {
        self.buffer
    }

    /// The oldest sample that waits.
    ///
    /// # Errors
    /// Too many are held.
    pub fn receive(&self) -> Result<Option<Sample<S, P, H>>, ReceiveError> {
        Ok(Borrow::receive(&self.port, 0)?.map(Sample::new))
    }
}

impl<S: Service, P: Debug + ?Sized, H: Debug + ZeroCopySend> UpdateConnections
    for Subscriber<S, P, H>
{
    fn update_connections(&self) -> Result<(), ConnectionFailure> {
        update(&self.port);
        Ok(())
    }
}

impl<S: Service, P: Debug + ?Sized, H: Debug + ZeroCopySend> Drop for Subscriber<S, P, H> {
    fn drop(&mut self) {
        self.port.deregister();
    }
}
