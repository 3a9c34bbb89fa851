//! The service `control`: requests of clients, and the daemon's responses.

use super::{CLIENTS_MAX, service_name, unreached};
use crate::ProtocolError;
use crate::doors::iceoryx2::active_request::ActiveRequest;
use crate::doors::iceoryx2::identifiers::UniqueClientId;
use crate::doors::iceoryx2::port::client::Client as ControlClient;
use crate::doors::iceoryx2::port::server::Server;
use crate::doors::iceoryx2::prelude::*;
use crate::doors::iceoryx2::service::port_factory::request_response;
use crate::memory::port::Port;
use crate::wire::control::{REQUEST_MAX, RESPONSE_MAX};

/// Control requests of one client that may be unread: two heartbeats, a release, and one that is waited for.
const CONTROL_ACTIVE: usize = 4;

/// Service that carries requests and their answers.
pub(crate) type ControlService<S> = Port<request_response::PortFactory<S, [u8], (), [u8], ()>>;
/// Requests from a client.
pub(crate) type Requester<S> = Port<ControlClient<S, [u8], (), [u8], ()>>;
/// Requests at the daemon.
pub(crate) type Responder<S> = Port<Server<S, [u8], (), [u8], ()>>;
/// A request that awaits its answer, at the daemon.
pub(crate) type Asked<S> = ActiveRequest<S, [u8], (), [u8], ()>;

/// Creates the control service.
pub(crate) fn create_control<S: Service>(
    node: &Node<S>,
) -> Result<ControlService<S>, ProtocolError> {
    node.service_builder(&service_name("control")?)
        .request_response::<[u8], [u8]>()
        .max_clients(CLIENTS_MAX)
        .max_servers(1)
        .max_nodes(CLIENTS_MAX + 1)
        .max_active_requests_per_client(CONTROL_ACTIVE)
        .max_loaned_requests(1)
        .max_response_buffer_size(1)
        .max_borrowed_responses_per_pending_response(1)
        .enable_fire_and_forget_requests(true)
        .create()
        .map(|service| Port::new(node.config(), service))
        .map_err(|error| ProtocolError::transport("create service control", error))
}

/// Whether a client of the control service is there, which one that was killed is until it is cleaned up.
pub(crate) fn is_present<S: Service>(service: &ControlService<S>, client: UniqueClientId) -> bool {
    let mut present = false;
    service.dynamic_config().list_clients(|details| {
        present |= details.client_id == client;
        match present {
            true => CallbackProgression::Stop,
            false => CallbackProgression::Continue,
        }
    });
    present
}

/// The daemon's end of the control service.
pub(crate) fn responder<S: Service>(
    service: &ControlService<S>,
) -> Result<Responder<S>, ProtocolError> {
    service
        .server_builder()
        .initial_max_slice_len(RESPONSE_MAX)
        .max_loaned_responses_per_request(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .set_request_degradation_handler(unreached::senders())
        .set_response_degradation_handler(unreached::receivers())
        .create()
        .map(|port| Port::with_owner(service.owner(), port))
        .map_err(|error| ProtocolError::transport("create the control server", error))
}

/// A client's end of the control service.
pub(crate) fn requester<S: Service>(node: &Node<S>) -> Result<Requester<S>, ProtocolError> {
    let service = node
        .service_builder(&service_name("control")?)
        .request_response::<[u8], [u8]>()
        .open()
        .map_err(|error| ProtocolError::transport("open service control", error))?;
    unreached::reaching(|| {
        service
            .client_builder()
            .initial_max_slice_len(REQUEST_MAX)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .set_request_degradation_handler(unreached::receivers())
            .set_response_degradation_handler(unreached::senders())
            .create()
            .map(|port| Port::new(node.config(), port))
            .map_err(|error| ProtocolError::transport("create a control client", error))
    })
}
