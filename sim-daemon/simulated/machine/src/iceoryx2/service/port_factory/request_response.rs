//! A service that carries requests and their answers.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::sync::Arc;

use ::iceoryx2::prelude::{
    AttributeSet, BackpressureStrategy, CallbackProgression, ServiceName, ZeroCopySend,
};
pub use ::iceoryx2::service::port_factory::client::ClientCreateError;
pub use ::iceoryx2::service::port_factory::server::ServerCreateError;

use crate::iceoryx2::RequestTypes;
use crate::iceoryx2::bag::{Role, Settings};
use crate::iceoryx2::degradation::{DegradationFn, set};
use crate::iceoryx2::identifiers::{UniqueClientId, UniqueNodeId};
use crate::iceoryx2::membership::{Dynamic, ServiceHandle};
use crate::iceoryx2::port::client::Client;
use crate::iceoryx2::port::server::Server;
use crate::iceoryx2::queue::End;
use crate::iceoryx2::service::Service;

/// What asks with slices.
type SliceClient<S, Q, QH, R, RH> = Client<S, [Q], QH, [R], RH>;
/// What answers with them.
type SliceServer<S, Q, QH, R, RH> = Server<S, [Q], QH, [R], RH>;

/// A service that is open.
#[derive(Debug)]
pub struct PortFactory<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    pub(crate) service: Arc<ServiceHandle>,
    pub(crate) settings: Settings,
    there: DynamicConfig,
    types: RequestTypes<S, Q, QH, R, RH>,
}

/// Who is there.
#[derive(Debug)]
pub struct DynamicConfig(Dynamic);

/// A client that is there.
#[derive(Debug, Clone, Copy)]
pub struct ClientDetails {
    /// Its number.
    pub client_id: UniqueClientId,
    /// That of its node.
    pub node_id: UniqueNodeId,
}

impl DynamicConfig {
    /// How many ask.
    pub fn number_of_clients(&self) -> usize {
        self.0.entries(Role::Client).len()
    }

    /// How many answer.
    pub fn number_of_servers(&self) -> usize {
        self.0.entries(Role::Server).len()
    }

    /// Those who ask.
    pub fn list_clients(&self, mut callback: impl FnMut(&ClientDetails) -> CallbackProgression) {
        for entry in self.0.entries(Role::Client) {
            let details = ClientDetails {
                client_id: UniqueClientId(entry.port),
                node_id: UniqueNodeId(entry.node),
            };
            if callback(&details) == CallbackProgression::Stop {
                break;
            }
        }
    }
}

impl<S, Q, QH, R, RH> PortFactory<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    pub(crate) fn new(service: ServiceHandle, settings: Settings) -> Self {
        PortFactory {
            there: DynamicConfig(Dynamic::new(service.id)),
            service: Arc::new(service),
            settings,
            types: PhantomData,
        }
    }

    /// For a client.
    pub fn client_builder(&self) -> ClientBuilder<'_, S, Q, QH, R, RH> {
        ClientBuilder {
            factory: self,
            length_max: 1,
        }
    }

    /// For a server.
    pub fn server_builder(&self) -> ServerBuilder<'_, S, Q, QH, R, RH> {
        ServerBuilder {
            factory: self,
            length_max: 1,
            loans_max: 2,
        }
    }
}

impl<S, Q, QH, R, RH> super::PortFactory for PortFactory<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
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

/// Makes a client.
#[derive(Debug)]
pub struct ClientBuilder<'a, S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    factory: &'a PortFactory<S, Q, QH, R, RH>,
    length_max: usize,
}

impl<S, Q, QH, R, RH> ClientBuilder<'_, S, [Q], QH, [R], RH>
where
    S: Service,
    Q: Debug + ZeroCopySend + 'static,
    QH: Debug + ZeroCopySend,
    R: Debug + ZeroCopySend + 'static,
    RH: Debug + ZeroCopySend,
{
    /// What is done where the other side cannot be met by requests.
    #[must_use]
    pub fn set_request_degradation_handler(self, handler: impl DegradationFn + 'static) -> Self {
        set(End::Sender, handler);
        self
    }

    /// What is done where the other side cannot be met by responses.
    #[must_use]
    pub fn set_response_degradation_handler(self, handler: impl DegradationFn + 'static) -> Self {
        set(End::Receiver, handler);
        self
    }

    /// Entries of a request at most.
    #[must_use]
    pub fn initial_max_slice_len(mut self, most: usize) -> Self {
        self.length_max = most;
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
    pub fn create(self) -> Result<SliceClient<S, Q, QH, R, RH>, ClientCreateError> {
        Client::new(self.factory, self.length_max)
    }
}

/// Makes a server.
#[derive(Debug)]
pub struct ServerBuilder<'a, S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    factory: &'a PortFactory<S, Q, QH, R, RH>,
    length_max: usize,
    loans_max: usize,
}

impl<S, Q, QH, R, RH> ServerBuilder<'_, S, [Q], QH, [R], RH>
where
    S: Service,
    Q: Debug + ZeroCopySend + 'static,
    QH: Debug + ZeroCopySend,
    R: Debug + ZeroCopySend + 'static,
    RH: Debug + ZeroCopySend,
{
    /// What is done where the other side cannot be met by requests.
    #[must_use]
    pub fn set_request_degradation_handler(self, handler: impl DegradationFn + 'static) -> Self {
        set(End::Receiver, handler);
        self
    }

    /// What is done where the other side cannot be met by responses.
    #[must_use]
    pub fn set_response_degradation_handler(self, handler: impl DegradationFn + 'static) -> Self {
        set(End::Sender, handler);
        self
    }

    /// Entries of an answer at most.
    #[must_use]
    pub fn initial_max_slice_len(mut self, most: usize) -> Self {
        self.length_max = most;
        self
    }

    /// Answers that are written at once, for each request.
    #[must_use]
    pub fn max_loaned_responses_per_request(mut self, most: usize) -> Self {
        self.loans_max = most;
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
    pub fn create(self) -> Result<SliceServer<S, Q, QH, R, RH>, ServerCreateError> {
        Server::new(self.factory, self.length_max, self.loans_max)
    }
}
