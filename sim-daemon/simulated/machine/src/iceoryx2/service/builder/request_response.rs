//! Services that carry requests and their answers.

use std::fmt::Debug;
use std::marker::PhantomData;

use ::iceoryx2::prelude::ZeroCopySend;
pub use ::iceoryx2::service::builder::request_response::{
    RequestResponseCreateError, RequestResponseOpenError,
};

use super::{Base, errors, name_of};
use crate::iceoryx2::RequestTypes;
use crate::iceoryx2::bag::{Lane, Pattern, Role};
use crate::iceoryx2::service::Service;
use crate::iceoryx2::service::port_factory::request_response::PortFactory;

errors!(
    RequestResponseOpenError,
    RequestResponseCreateError,
    IncompatibleRequestOrResponseType
);

/// For such a service.
#[derive(Debug)]
pub struct Builder<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    base: Base,
    types: RequestTypes<S, Q, QH, R, RH>,
}

impl<S, Q, QH, R, RH> Builder<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized + 'static,
    QH: Debug + ZeroCopySend,
    R: Debug + ?Sized + 'static,
    RH: Debug + ZeroCopySend,
{
    pub(crate) fn new(mut base: Base) -> Self {
        let settings = &mut base.settings;
        settings.pattern = Pattern::RequestResponse;
        settings.types = vec![
            std::any::type_name::<Q>(),
            name_of::<QH>(),
            std::any::type_name::<R>(),
            name_of::<RH>(),
        ];
        settings.ports_max = [(Role::Client, 8), (Role::Server, 2)].into();
        settings.lanes = [Lane {
            buffer: 2,
            borrowed: 2,
            overflow: true,
            channels: 1,
        }; 2];
        settings.requests.active = 4;
        settings.requests.loaned = 2;
        Builder {
            base,
            types: PhantomData,
        }
    }

    /// Clients at most.
    #[must_use]
    pub fn max_clients(mut self, most: usize) -> Self {
        self.base.settings.ports_max.insert(Role::Client, most);
        self
    }

    /// Servers at most.
    #[must_use]
    pub fn max_servers(mut self, most: usize) -> Self {
        self.base.settings.ports_max.insert(Role::Server, most);
        self
    }

    /// Nodes at most.
    #[must_use]
    pub fn max_nodes(mut self, most: usize) -> Self {
        self.base.settings.nodes_max = most;
        self
    }

    /// Requests of a client that wait, are worked on, or whose answers it awaits.
    #[must_use]
    pub fn max_active_requests_per_client(mut self, most: usize) -> Self {
        self.base.settings.requests.active = most;
        self
    }

    /// Requests that a client writes at once.
    #[must_use]
    pub fn max_loaned_requests(mut self, most: usize) -> Self {
        self.base.settings.requests.loaned = most;
        self
    }

    /// Answers that wait, for each request.
    #[must_use]
    pub fn max_response_buffer_size(mut self, most: usize) -> Self {
        self.base.settings.lanes[1].buffer = most;
        self
    }

    /// Answers that a client holds, for each request.
    #[must_use]
    pub fn max_borrowed_responses_per_pending_response(mut self, most: usize) -> Self {
        self.base.settings.lanes[1].borrowed = most;
        self
    }

    /// Whether requests are served that nobody awaits an answer of.
    #[must_use]
    pub fn enable_fire_and_forget_requests(mut self, enabled: bool) -> Self {
        self.base.settings.requests.fire_and_forget = enabled;
        self
    }

    /// Creates it.
    ///
    /// # Errors
    /// It is there, or the system refuses.
    pub fn create(mut self) -> Result<PortFactory<S, Q, QH, R, RH>, RequestResponseCreateError> {
        let settings = &mut self.base.settings;
        let active = settings.requests.active;
        settings.lanes[0].buffer = active;
        settings.lanes[0].borrowed = active;
        let servers = settings.ports_max.get(&Role::Server).copied();
        settings.lanes[1].channels = servers.unwrap_or(1) * 2 * active + settings.requests.loaned;
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
    pub fn open(self) -> Result<PortFactory<S, Q, QH, R, RH>, RequestResponseOpenError> {
        let (opened, settings) = self.base.open().map_err(|failure| Open::from(failure).0)?;
        Ok(PortFactory::new(opened, settings))
    }
}
