//! Services that carry samples.

use std::fmt::Debug;
use std::marker::PhantomData;

use ::iceoryx2::prelude::ZeroCopySend;
pub use ::iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError,
};

use super::{Base, errors, name_of};
use crate::iceoryx2::Types;
use crate::iceoryx2::bag::{Lane, Pattern, Role};
use crate::iceoryx2::service::Service;
use crate::iceoryx2::service::port_factory::publish_subscribe::PortFactory;

errors!(
    PublishSubscribeOpenError,
    PublishSubscribeCreateError,
    IncompatibleTypes
);

/// For such a service.
#[derive(Debug)]
pub struct Builder<S: Service, P: Debug + ?Sized, H: Debug> {
    base: Base,
    types: Types<(S, Box<P>, H)>,
}

impl<S: Service, P: Debug + ?Sized + 'static> Builder<S, P, ()> {
    pub(crate) fn new(mut base: Base) -> Builder<S, P, ()> {
        let settings = &mut base.settings;
        settings.pattern = Pattern::PublishSubscribe;
        settings.types = vec![std::any::type_name::<P>(), name_of::<()>()];
        settings.ports_max = [(Role::Publisher, 2), (Role::Subscriber, 8)].into();
        settings.lanes[0] = Lane {
            buffer: 2,
            borrowed: 2,
            overflow: true,
            channels: 1,
        };
        Builder {
            base,
            types: PhantomData,
        }
    }
}

impl<S: Service, P: Debug + ?Sized + 'static, H: Debug + ZeroCopySend> Builder<S, P, H> {
    /// With such a header beside each payload.
    #[must_use]
    pub fn user_header<N: Debug + ZeroCopySend>(mut self) -> Builder<S, P, N> {
        self.base.settings.types[1] = name_of::<N>();
        Builder {
            base: self.base,
            types: PhantomData,
        }
    }

    /// Whether the oldest sample goes for a new one.
    #[must_use]
    pub fn enable_safe_overflow(mut self, overflow: bool) -> Self {
        self.base.settings.lanes[0].overflow = overflow;
        self
    }

    /// Samples that wait for a subscriber at most.
    #[must_use]
    pub fn subscriber_max_buffer_size(mut self, most: usize) -> Self {
        self.base.settings.lanes[0].buffer = most;
        self
    }

    /// Samples that a subscriber holds at most.
    #[must_use]
    pub fn subscriber_max_borrowed_samples(mut self, most: usize) -> Self {
        self.base.settings.lanes[0].borrowed = most;
        self
    }

    /// Samples that are kept for those who come late.
    #[must_use]
    pub fn history_size(mut self, size: usize) -> Self {
        self.base.settings.history = size;
        self
    }

    /// Publishers at most.
    #[must_use]
    pub fn max_publishers(mut self, most: usize) -> Self {
        self.base.settings.ports_max.insert(Role::Publisher, most);
        self
    }

    /// Subscribers at most.
    #[must_use]
    pub fn max_subscribers(mut self, most: usize) -> Self {
        self.base.settings.ports_max.insert(Role::Subscriber, most);
        self
    }

    /// Nodes at most.
    #[must_use]
    pub fn max_nodes(mut self, most: usize) -> Self {
        self.base.settings.nodes_max = most;
        self
    }

    /// Creates it.
    ///
    /// # Errors
    /// It is there, or the system refuses.
    pub fn create(self) -> Result<PortFactory<S, P, H>, PublishSubscribeCreateError> {
        let made = self
            .base
            .create()
            .map_err(|failure| Create::from(failure).0)?;
        Ok(PortFactory::new(made, self.base.settings))
    }

    /// Opens it.
    ///
    /// # Errors
    /// It is not there, has other types, too many have it open, or the system refuses.
    pub fn open(self) -> Result<PortFactory<S, P, H>, PublishSubscribeOpenError> {
        let (opened, settings) = self.base.open().map_err(|failure| Open::from(failure).0)?;
        Ok(PortFactory::new(opened, settings))
    }
}
