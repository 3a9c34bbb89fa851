//! Ports that send samples.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::sync::Arc;

pub use ::iceoryx2::port::publisher::PublisherCreateError;
use ::iceoryx2::prelude::ZeroCopySend;

use super::LoanError;
use super::loan::{Loan, Slots, meet, open_outlet, tagged, update};
use super::update_connections::{ConnectionFailure, UpdateConnections};
use crate::iceoryx2::Types;
use crate::iceoryx2::bag::Role;
use crate::iceoryx2::identifiers::UniquePublisherId;
use crate::iceoryx2::membership::Port;
use crate::iceoryx2::sample::SampleMutUninit;
use crate::iceoryx2::service::Service;
use crate::iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use crate::world::{is_on, with};
use std::mem::MaybeUninit;

/// A port that sends.
#[derive(Debug)]
pub struct Publisher<S: Service, P: Debug + ?Sized, H: Debug + ZeroCopySend> {
    port: Arc<Port>,
    types: Types<(S, Box<P>, H)>,
}

impl<S, T, H> Publisher<S, [T], H>
where
    S: Service,
    T: Debug + ZeroCopySend + 'static,
    H: Debug + ZeroCopySend,
{
    pub(crate) fn new(
        factory: &PortFactory<S, [T], H>,
        length_max: usize,
        loans_max: usize,
    ) -> Result<Self, PublisherCreateError> {
        let settings = &factory.settings;
        let lane = settings.lanes[0];
        let subscribers = settings.ports_max.get(&Role::Subscriber).copied();
        let count =
            subscribers.unwrap_or(1) * (lane.buffer + lane.borrowed) + settings.history + loans_max;
        let slots = Slots {
            loans_max,
            history: settings.history,
            ..Slots::sized::<T, H>(count, length_max)
        };
        let port = tagged(&factory.service, Role::Publisher)
            .map_err(|_| PublisherCreateError::UnableToCreatePortTag)?;
        open_outlet(&port, slots).map_err(|_| PublisherCreateError::UnableToCreateDataSegment)?;
        let entry = port.entry(0, 0);
        let port = meet(port, entry).ok_or(PublisherCreateError::ExceedsMaxSupportedPublishers)?;
        Ok(Publisher {
            port,
            types: PhantomData,
        })
    }

    /// A slot to write to.
    ///
    /// # Errors
    /// Too many are loaned or held by others, or it is too long.
    pub fn loan_slice_uninit(
        &self,
        length: usize,
    ) -> Result<SampleMutUninit<S, [MaybeUninit<T>], H>, LoanError>
    where
        H: Default,
    {
        Loan::new(&self.port, length, H::default()).map(SampleMutUninit::new)
    }
}

impl<S: Service, P: Debug + ?Sized, H: Debug + ZeroCopySend> Publisher<S, P, H> {
    /// Its number.
    pub fn id(&self) -> UniquePublisherId {
        UniquePublisherId(self.port.id)
    }
}

impl<S: Service, P: Debug + ?Sized, H: Debug + ZeroCopySend> UpdateConnections
    for Publisher<S, P, H>
{
    fn update_connections(&self) -> Result<(), ConnectionFailure> {
        update(&self.port);
        Ok(())
    }
}

impl<S: Service, P: Debug + ?Sized, H: Debug + ZeroCopySend> Drop for Publisher<S, P, H> {
    fn drop(&mut self) {
        if is_on() {
            with(|world| {
                if let Some(outlet) = world.wires.outlets.get_mut(&self.port.id) {
                    outlet.is_active = false;
                }
            });
            self.port.deregister();
        }
    }
}
