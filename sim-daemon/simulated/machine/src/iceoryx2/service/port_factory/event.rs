//! A service that wakes.

use std::marker::PhantomData;
use std::sync::Arc;

use ::iceoryx2::prelude::{AttributeSet, ServiceName};

use crate::iceoryx2::Types;
use crate::iceoryx2::bag::Role;
use crate::iceoryx2::membership::{Dynamic, ServiceHandle};
use crate::iceoryx2::port::listener::{Listener, ListenerCreateError};
use crate::iceoryx2::port::notifier::{Notifier, NotifierCreateError};
use crate::iceoryx2::service::Service;

/// A service that is open.
#[derive(Debug)]
pub struct PortFactory<S: Service> {
    service: Arc<ServiceHandle>,
    there: DynamicConfig,
    kind: Types<S>,
}

/// Who is there.
#[derive(Debug)]
pub struct DynamicConfig(Dynamic);

impl DynamicConfig {
    /// How many listen.
    pub fn number_of_listeners(&self) -> usize {
        self.0.entries(Role::Listener).len()
    }

    /// How many notify.
    pub fn number_of_notifiers(&self) -> usize {
        self.0.entries(Role::Notifier).len()
    }
}

impl<S: Service> PortFactory<S> {
    pub(crate) fn new(service: ServiceHandle) -> PortFactory<S> {
        PortFactory {
            there: DynamicConfig(Dynamic::new(service.id)),
            service: Arc::new(service),
            kind: PhantomData,
        }
    }

    /// For a listener.
    pub fn listener_builder(&self) -> ListenerBuilder<'_, S> {
        ListenerBuilder(self)
    }

    /// For a notifier.
    pub fn notifier_builder(&self) -> NotifierBuilder<'_, S> {
        NotifierBuilder(self)
    }
}

impl<S: Service> super::PortFactory for PortFactory<S> {
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

/// Makes a listener.
#[derive(Debug)]
pub struct ListenerBuilder<'a, S: Service>(&'a PortFactory<S>);

impl<S: Service> ListenerBuilder<'_, S> {
    /// Makes it.
    ///
    /// # Errors
    /// Too many are there, or the system refuses.
    pub fn create(self) -> Result<Listener<S>, ListenerCreateError> {
        Listener::new(&self.0.service)
    }
}

/// Makes a notifier.
#[derive(Debug)]
pub struct NotifierBuilder<'a, S: Service>(&'a PortFactory<S>);

impl<S: Service> NotifierBuilder<'_, S> {
    /// Makes it.
    ///
    /// # Errors
    /// Too many are there, or the system refuses.
    pub fn create(self) -> Result<Notifier<S>, NotifierCreateError> {
        Notifier::new(&self.0.service)
    }
}
