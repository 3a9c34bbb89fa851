//! A service that carries samples.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::sync::Arc;

use ::iceoryx2::prelude::{AttributeSet, BackpressureStrategy, ServiceName, ZeroCopySend};

use crate::iceoryx2::Types;
use crate::iceoryx2::bag::{Role, Settings};
use crate::iceoryx2::degradation::{DegradationFn, set};
use crate::iceoryx2::membership::{Dynamic, ServiceHandle};
use crate::iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use crate::iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use crate::iceoryx2::queue::End;
use crate::iceoryx2::service::Service;

/// A service that is open.
#[derive(Debug)]
pub struct PortFactory<S: Service, P: Debug + ?Sized, H: Debug> {
    pub(crate) service: Arc<ServiceHandle>,
    pub(crate) settings: Settings,
    there: DynamicConfig,
    types: Types<(S, Box<P>, H)>,
}

/// Who is there.
#[derive(Debug)]
pub struct DynamicConfig(Dynamic);

impl DynamicConfig {
    /// How many send.
    pub fn number_of_publishers(&self) -> usize {
        self.0.entries(Role::Publisher).len()
    }

    /// How many receive.
    pub fn number_of_subscribers(&self) -> usize {
        self.0.entries(Role::Subscriber).len()
    }
}

impl<S: Service, P: Debug + ?Sized, H: Debug> PortFactory<S, P, H> {
    pub(crate) fn new(service: ServiceHandle, settings: Settings) -> PortFactory<S, P, H> {
        PortFactory {
            there: DynamicConfig(Dynamic::new(service.id)),
            service: Arc::new(service),
            settings,
            types: PhantomData,
        }
    }

    /// For a publisher.
    pub fn publisher_builder(&self) -> PublisherBuilder<'_, S, P, H> {
        PublisherBuilder {
            factory: self,
            length_max: 1,
            loans_max: 2,
        }
    }

    /// For a subscriber.
    pub fn subscriber_builder(&self) -> SubscriberBuilder<'_, S, P, H> {
        SubscriberBuilder {
            factory: self,
            buffer: None,
            history: None,
        }
    }
}

impl<S: Service, P: Debug + ?Sized, H: Debug> super::PortFactory for PortFactory<S, P, H> {
    type DynamicConfig = DynamicConfig;

    fn name(&self) -> &ServiceName {
        &self.service.name
    }

    fn attributes(&self) -> &AttributeSet {
        &self.service.attributes
    }

    fn dynamic_config(&self) -> &DynamicConfig {
        &self.there
    }
}

/// Makes a publisher.
#[derive(Debug)]
pub struct PublisherBuilder<'a, S: Service, P: Debug + ?Sized, H: Debug> {
    factory: &'a PortFactory<S, P, H>,
    length_max: usize,
    loans_max: usize,
}

impl<S, T, H> PublisherBuilder<'_, S, [T], H>
where
    S: Service,
    T: Debug + ZeroCopySend + 'static,
    H: Debug + ZeroCopySend,
{
    /// Entries of a payload at most.
    #[must_use]
    pub fn initial_max_slice_len(mut self, most: usize) -> Self {
        self.length_max = most;
        self
    }

    /// Samples that are written at once.
    #[must_use]
    pub fn max_loaned_samples(mut self, most: usize) -> Self {
        self.loans_max = most;
        self
    }

    /// What is done where a subscriber cannot be met.
    #[must_use]
    pub fn set_degradation_handler(self, handler: impl DegradationFn + 'static) -> Self {
        set(End::Sender, handler);
        self
    }

    /// Full buffers never wait here.
    #[must_use]
    pub fn backpressure_strategy(self, _strategy: BackpressureStrategy) -> Self {
        self
    }

    /// Makes it.
    ///
    /// # Errors
    /// Too many are there, or the system refuses.
    pub fn create(self) -> Result<Publisher<S, [T], H>, PublisherCreateError> {
        Publisher::new(self.factory, self.length_max, self.loans_max)
    }
}

/// Makes a subscriber.
#[derive(Debug)]
pub struct SubscriberBuilder<'a, S: Service, P: Debug + ?Sized, H: Debug> {
    factory: &'a PortFactory<S, P, H>,
    buffer: Option<usize>,
    history: Option<usize>,
}

impl<S: Service, P: Debug + ?Sized, H: Debug + ZeroCopySend> SubscriberBuilder<'_, S, P, H> {
    /// What is done where a publisher cannot be met.
    #[must_use]
    pub fn set_degradation_handler(self, handler: impl DegradationFn + 'static) -> Self {
        set(End::Receiver, handler);
        self
    }

    /// Samples that wait at most.
    #[must_use]
    pub fn buffer_size(mut self, size: usize) -> Self {
        self.buffer = Some(size);
        self
    }

    /// Old samples that are wanted.
    #[must_use]
    pub fn history_request(mut self, count: usize) -> Self {
        self.history = Some(count);
        self
    }

    /// Makes it.
    ///
    /// # Errors
    /// Too many are there, more is wanted than the service has, or the system refuses.
    pub fn create(self) -> Result<Subscriber<S, P, H>, SubscriberCreateError> {
        Subscriber::new(self.factory, self.buffer, self.history)
    }
}
