//! Services that wake.

use std::marker::PhantomData;

use ::iceoryx2::prelude::AttributeSpecifier;
pub use ::iceoryx2::service::builder::event::{EventCreateError, EventOpenError};

use super::{Base, errors};
use crate::iceoryx2::Types;
use crate::iceoryx2::bag::{Pattern, Role};
use crate::iceoryx2::service::Service;
use crate::iceoryx2::service::port_factory::event::PortFactory;

errors!(
    EventOpenError,
    EventCreateError,
    IncompatibleMessagingPattern
);

/// For such a service.
#[derive(Debug)]
pub struct Builder<S: Service> {
    base: Base,
    service: Types<S>,
}

impl<S: Service> Builder<S> {
    pub(crate) fn new(mut base: Base) -> Builder<S> {
        base.settings.pattern = Pattern::Event;
        base.settings.nodes_max = 36;
        base.settings.ports_max = [(Role::Listener, 16), (Role::Notifier, 16)].into();
        Builder {
            base,
            service: PhantomData,
        }
    }

    /// Listeners at most.
    #[must_use]
    pub fn max_listeners(mut self, most: usize) -> Builder<S> {
        self.base.settings.ports_max.insert(Role::Listener, most);
        self
    }

    /// Notifiers at most.
    #[must_use]
    pub fn max_notifiers(mut self, most: usize) -> Builder<S> {
        self.base.settings.ports_max.insert(Role::Notifier, most);
        self
    }

    /// Nodes at most.
    #[must_use]
    pub fn max_nodes(mut self, most: usize) -> Builder<S> {
        self.base.settings.nodes_max = most;
        self
    }

    /// Events are all one here.
    #[must_use]
    pub fn event_id_max_value(self, _most: usize) -> Builder<S> {
        self
    }

    /// Creates it.
    ///
    /// # Errors
    /// It is there, or the system refuses.
    pub fn create(self) -> Result<PortFactory<S>, EventCreateError> {
        self.create_with_attributes(&AttributeSpecifier::new())
    }

    /// Creates it, with attributes.
    ///
    /// # Errors
    /// As [`Builder::create`].
    pub fn create_with_attributes(
        mut self,
        attributes: &AttributeSpecifier,
    ) -> Result<PortFactory<S>, EventCreateError> {
        self.base.settings.attributes = attributes.attributes().clone();
        let made = self
            .base
            .create()
            .map_err(|failure| Create::from(failure).0)?;
        Ok(PortFactory::new(made))
    }

    /// Opens it.
    ///
    /// # Errors
    /// It is not there, too many have it open, or the system refuses.
    pub fn open(self) -> Result<PortFactory<S>, EventOpenError> {
        let opened = self.base.open().map_err(|failure| Open::from(failure).0)?;
        Ok(PortFactory::new(opened.0))
    }
}
