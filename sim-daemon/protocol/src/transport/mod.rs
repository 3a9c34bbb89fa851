//! The services of one daemon and their limits, said once for both sides. Only this folder knows iceoryx2's builders.

mod attached;
pub(crate) mod budget;
mod control;
pub(crate) mod unreached;

use std::fmt::Debug;
use std::path::Path;

use attached::holders;

use crate::doors::fs;
use crate::doors::iceoryx2::config::Config;
use crate::doors::iceoryx2::port::listener::Listener;
use crate::doors::iceoryx2::port::notifier::Notifier;
use crate::doors::iceoryx2::port::publisher::Publisher;
use crate::doors::iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use crate::doors::iceoryx2::prelude::*;
use crate::doors::iceoryx2::service::builder::event::EventOpenError;
use crate::doors::iceoryx2::service::port_factory::{event, publish_subscribe};
use crate::doors::sync::Once;
pub(crate) use control::{
    Asked, ControlService, Requester, Responder, create_control, is_present, requester, responder,
};

use crate::memory::descriptors;
use crate::memory::port::Port;
use crate::memory::problem::{self, Problem};
use crate::{ALIGNMENT, CommandHeader, FrameHeader, JournalHeader, Line, ProtocolError};

/// Clients that may observe at once.
pub(crate) const OBSERVERS_MAX: usize = 32;
/// Clients that may be attached at once: as many again as observers, so that these never keep a controller or a tool out.
const CLIENTS_MAX: usize = 2 * OBSERVERS_MAX;
/// Shared memory of a client without its commands, rounded up [bytes].
const NODE_BYTES: u64 = 512 << 10;

/// Frames on their way out: from the daemon.
pub(crate) type FramePublisher<S> = Port<Publisher<S, [Line], FrameHeader>>;
/// Frames on their way in: at a client.
pub(crate) type FrameSubscriber<S> = Port<Subscriber<S, [Line], FrameHeader>>;
/// Commands on their way out: from a client.
pub(crate) type CommandPublisher<S> = Port<Publisher<S, [Line], CommandHeader>>;
/// Commands on their way in: at the daemon.
pub(crate) type CommandSubscriber<S> = Port<Subscriber<S, [Line], CommandHeader>>;
/// Entries of a journal on their way out: from the daemon.
pub(crate) type JournalPublisher<S> = Port<Publisher<S, [Line], JournalHeader>>;
/// Entries of a journal on their way in: at a recorder.
pub(crate) type JournalSubscriber<S> = Port<Subscriber<S, [Line], JournalHeader>>;
/// A service that wakes.
pub(crate) type EventService<S> = Port<event::PortFactory<S>>;
/// The end of such a service that sleeps.
pub(crate) type Sleeper<S> = Port<Listener<S>>;
/// The end of such a service that wakes.
pub(crate) type Waker<S> = Port<Notifier<S>>;
/// Service that carries the entries of a journal.
pub(crate) type JournalService<S> = Port<publish_subscribe::PortFactory<S, [Line], JournalHeader>>;
/// Service that carries frames.
pub(crate) type FrameService<S> = Port<publish_subscribe::PortFactory<S, [Line], FrameHeader>>;
/// Service that carries commands.
pub(crate) type CommandService<S> = Port<publish_subscribe::PortFactory<S, [Line], CommandHeader>>;

/// A node: one process's membership in the transport of one daemon.
pub(crate) fn node<S: Service>(
    config: &Config,
    role: &str,
) -> Result<Port<Node<S>>, ProtocolError> {
    static QUIET: Once = Once::new();
    // our errors say it better; the transport's own log goes to stderr when IOX2_LOG_LEVEL asks for it
    QUIET.call_once(|| set_log_level_from_env_or(LogLevel::Fatal));
    descriptors::make_room();
    // past the end, what the transport writes beside its memory is lost without a word
    if let Some(Problem::Full {
        folder,
        free,
        needed,
    }) = problem::no_room(NODE_BYTES)
    {
        return Err(ProtocolError::SharedMemory {
            path: folder,
            free,
            needed,
            what: format!("a {role}"),
        });
    }
    let name =
        NodeName::new(role).map_err(|error| ProtocolError::transport("name a node", error))?;
    let node = NodeBuilder::new()
        .name(&name)
        .config(config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<S>()
        .map_err(|error| ProtocolError::transport("create a node", error))?;
    close_folders(config);
    Ok(Port::new(config, node))
}

/// Takes from others what the transport's own folders of nodes leave them; the folder around them lets nobody in anyway.
fn close_folders(config: &Config) {
    let nodes = fs::read_dir(Path::new(config.global.node_dir().as_str()));
    for node in nodes.into_iter().flatten().flatten() {
        // the mode of a monitor's file says whether its process has finished it
        if node.file_type().is_ok_and(|kind| kind.is_dir()) {
            // a node that ends meanwhile takes its folder with it
            crate::doors::system::files::close_to_others(&node.path());
        }
    }
}

fn service_name(name: &str) -> Result<ServiceName, ProtocolError> {
    ServiceName::new(name)
        .map_err(|error| ProtocolError::transport(format!("name service {name}"), error))
}

/// Facts that the handshake compares, as attributes of the wake-up service: it has no types that could differ.
pub(crate) mod handshake {
    pub(crate) const PROTOCOL: &str = "protocol";
    pub(crate) const SCHEMA: &str = "schema";
    pub(crate) const WORLDS: &str = "worlds";
    pub(crate) const DOFS: &str = "dofs";
}

/// Number of frame slots that the controller's service has for `frames_held`.
pub(crate) fn frame_slots(frames_held: usize) -> usize {
    BUFFER + borrowed(frames_held) + LOANS
}

/// Number of frame slots that the observers' service has.
pub(crate) fn watch_slots(frames_held: usize) -> usize {
    OBSERVERS_MAX * (BUFFER + borrowed(frames_held)) + 1 + LOANS
}

/// Number of command slots of a lease.
pub(crate) const COMMAND_SLOTS: usize = COMMAND_BUFFER + 1 + LOANS;

const BUFFER: usize = 1;
const COMMAND_BUFFER: usize = 2;
const LOANS: usize = 1;

/// The frames held, and one that is looked at before it is handed out or dropped.
fn borrowed(frames_held: usize) -> usize {
    frames_held + 1
}

/// Service of frames for the controller of lease `epoch`.
pub(crate) fn create_frames<S: Service>(
    node: &Node<S>,
    epoch: u64,
    frames_held: usize,
) -> Result<FrameService<S>, ProtocolError> {
    create_lines(node, &format!("obs/{epoch}"), BUFFER, borrowed(frames_held))
}

/// Opens what [`create_frames`] created.
pub(crate) fn open_frames<S: Service>(
    node: &Node<S>,
    epoch: u64,
) -> Result<FrameService<S>, ProtocolError> {
    open_lines(node, &format!("obs/{epoch}"))
}

/// Opens a service of lines with a header.
fn open_lines<S: Service, H: Debug + ZeroCopySend>(
    node: &Node<S>,
    name: &str,
) -> Result<Port<publish_subscribe::PortFactory<S, [Line], H>>, ProtocolError> {
    node.service_builder(&service_name(name)?)
        .publish_subscribe::<[Line]>()
        .user_header::<H>()
        .open()
        .map(|service| Port::new(node.config(), service))
        .map_err(|error| ProtocolError::transport(format!("open service {name}"), error))
}

/// Service of lines with a header from one to one, in which the oldest goes when `depth` wait.
fn create_lines<S: Service, H: Debug + ZeroCopySend>(
    node: &Node<S>,
    name: &str,
    depth: usize,
    held: usize,
) -> Result<Port<publish_subscribe::PortFactory<S, [Line], H>>, ProtocolError> {
    node.service_builder(&service_name(name)?)
        .publish_subscribe::<[Line]>()
        .user_header::<H>()
        .enable_safe_overflow(true)
        .subscriber_max_buffer_size(depth)
        .subscriber_max_borrowed_samples(held)
        .history_size(0)
        .max_publishers(1)
        .max_subscribers(1)
        .max_nodes(4)
        .create()
        .map(|service| Port::new(node.config(), service))
        .map_err(|error| ProtocolError::transport(format!("create service {name}"), error))
}

/// The end of a service that sends up to so many lines at once; `what` it sends is for messages.
fn publisher<S: Service, H: Debug + Default + ZeroCopySend>(
    service: &Port<publish_subscribe::PortFactory<S, [Line], H>>,
    lines: usize,
    what: &str,
) -> Result<Port<Publisher<S, [Line], H>>, ProtocolError> {
    unreached::reaching(|| {
        service
            .publisher_builder()
            .initial_max_slice_len(lines)
            .max_loaned_samples(LOANS)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .set_degradation_handler(unreached::receivers())
            .create()
            .map(|port| Port::with_owner(service.owner(), port))
            .map_err(|error| ProtocolError::transport(format!("create a {what} publisher"), error))
    })
}

/// Service of frames for observers.
pub(crate) fn create_watch<S: Service>(
    node: &Node<S>,
    frames_held: usize,
) -> Result<FrameService<S>, ProtocolError> {
    node.service_builder(&service_name("watch")?)
        .publish_subscribe::<[Line]>()
        .user_header::<FrameHeader>()
        .enable_safe_overflow(true)
        .subscriber_max_buffer_size(BUFFER)
        .subscriber_max_borrowed_samples(borrowed(frames_held))
        .history_size(1)
        .max_publishers(1)
        .max_subscribers(OBSERVERS_MAX)
        .max_nodes(CLIENTS_MAX + 1)
        .create()
        .map(|service| Port::new(node.config(), service))
        .map_err(|error| ProtocolError::transport("create service watch", error))
}

/// Opens what [`create_watch`] created.
pub(crate) fn open_watch<S: Service>(node: &Node<S>) -> Result<FrameService<S>, ProtocolError> {
    open_lines(node, "watch")
}

/// How many observe the worlds.
pub(crate) fn watchers<S: Service>(node: &Node<S>) -> Result<usize, ProtocolError> {
    Ok(open_watch(node)?.dynamic_config().number_of_subscribers())
}

/// The end of a service of frames that sends.
pub(crate) fn frame_publisher<S: Service>(
    service: &FrameService<S>,
    bytes: usize,
) -> Result<FramePublisher<S>, ProtocolError> {
    publisher(service, bytes / ALIGNMENT, "frame")
}

/// The end of a service of frames that receives.
pub(crate) fn frame_subscriber<S: Service>(
    service: &FrameService<S>,
) -> Result<FrameSubscriber<S>, ProtocolError> {
    unreached::reaching(|| {
        service
            .subscriber_builder()
            .buffer_size(BUFFER)
            .history_request(0)
            .set_degradation_handler(unreached::senders())
            .create()
            .map(|port| Port::with_owner(service.owner(), port))
            .map_err(|error| ProtocolError::transport("create a frame subscriber", error))
    })
}

/// Service of commands of lease `epoch`: one publisher, which is what makes it a lease.
pub(crate) fn create_commands<S: Service>(
    node: &Node<S>,
    epoch: u64,
) -> Result<CommandService<S>, ProtocolError> {
    create_lines(node, &format!("act/{epoch}"), COMMAND_BUFFER, 1)
}

/// Opens what [`create_commands`] created.
pub(crate) fn open_commands<S: Service>(
    node: &Node<S>,
    epoch: u64,
) -> Result<CommandService<S>, ProtocolError> {
    open_lines(node, &format!("act/{epoch}"))
}

/// The end of the observers' service that receives; the daemon's name is for the error when there are too many of them.
pub(crate) fn watch_subscriber<S: Service>(
    node: &Node<S>,
    name: &str,
) -> Result<FrameSubscriber<S>, ProtocolError> {
    let service = open_watch(node)?;
    unreached::reaching(|| {
        let subscriber = service
            .subscriber_builder()
            .buffer_size(BUFFER)
            // the newest frame at once
            .history_request(1)
            .set_degradation_handler(unreached::senders())
            .create();
        match subscriber {
            Ok(port) => Ok(Port::with_owner(service.owner(), port)),
            Err(SubscriberCreateError::ExceedsMaxSupportedSubscribers) => {
                Err(ProtocolError::TooManyClients {
                    name: name.to_owned(),
                    what: "observers",
                    max: OBSERVERS_MAX,
                    holders: String::new(),
                })
            }
            Err(error) => Err(ProtocolError::transport("create a frame subscriber", error)),
        }
    })
}

/// The end of a service of commands that sends.
pub(crate) fn command_publisher<S: Service>(
    service: &CommandService<S>,
    bytes: usize,
) -> Result<CommandPublisher<S>, ProtocolError> {
    publisher(service, bytes / ALIGNMENT, "command")
}

/// The end of a service of commands that receives.
pub(crate) fn command_subscriber<S: Service>(
    service: &CommandService<S>,
) -> Result<CommandSubscriber<S>, ProtocolError> {
    unreached::reaching(|| {
        service
            .subscriber_builder()
            .set_degradation_handler(unreached::senders())
            .create()
            .map(|port| Port::with_owner(service.owner(), port))
            .map_err(|error| ProtocolError::transport("create a command subscriber", error))
    })
}

/// Number of slots of a journal in which `depth` entries may wait.
pub(crate) fn journal_slots(depth: usize) -> usize {
    depth + 1 + LOANS
}

/// Service of the entries of journal `number`, in which the oldest goes when `depth` wait.
pub(crate) fn create_journal<S: Service>(
    node: &Node<S>,
    number: u64,
    depth: usize,
) -> Result<JournalService<S>, ProtocolError> {
    create_lines(node, &format!("journal/{number}"), depth, 1)
}

/// Opens what [`create_journal`] created.
pub(crate) fn open_journal<S: Service>(
    node: &Node<S>,
    number: u64,
) -> Result<JournalService<S>, ProtocolError> {
    open_lines(node, &format!("journal/{number}"))
}

/// The end of a journal that sends; `bytes` are those of the largest entry.
pub(crate) fn journal_publisher<S: Service>(
    service: &JournalService<S>,
    bytes: usize,
) -> Result<JournalPublisher<S>, ProtocolError> {
    publisher(service, bytes.div_ceil(ALIGNMENT), "journal")
}

/// The end of a journal that receives.
pub(crate) fn journal_subscriber<S: Service>(
    service: &JournalService<S>,
) -> Result<JournalSubscriber<S>, ProtocolError> {
    unreached::reaching(|| {
        service
            .subscriber_builder()
            .set_degradation_handler(unreached::senders())
            .create()
            .map(|port| Port::with_owner(service.owner(), port))
            .map_err(|error| ProtocolError::transport("create a journal subscriber", error))
    })
}

/// Creates an event service; `attributes` are the handshake's facts.
pub(crate) fn create_event<S: Service>(
    node: &Node<S>,
    name: &str,
    attributes: &[(&str, String)],
) -> Result<EventService<S>, ProtocolError> {
    let failed = |error: &dyn std::fmt::Debug| {
        ProtocolError::transport(format!("create event {name}"), error)
    };
    let mut specifier = AttributeSpecifier::new();
    for (key, value) in attributes {
        let key = (*key).try_into().map_err(|error| failed(&error))?;
        let value = value.as_str().try_into().map_err(|error| failed(&error))?;
        specifier = specifier
            .define(&key, &value)
            .map_err(|error| failed(&error))?;
    }
    node.service_builder(&service_name(name)?)
        .event()
        .max_listeners(CLIENTS_MAX)
        .max_notifiers(CLIENTS_MAX + 1)
        .max_nodes(CLIENTS_MAX + 1)
        .event_id_max_value(1)
        .create_with_attributes(&specifier)
        .map(|service| Port::new(node.config(), service))
        .map_err(|error| failed(&error))
}

/// Opens what [`create_event`] created.
pub(crate) fn open_event<S: Service>(
    node: &Node<S>,
    name: &str,
) -> Result<EventService<S>, ProtocolError> {
    node.service_builder(&service_name(name)?)
        .event()
        .open()
        .map(|service| Port::new(node.config(), service))
        .map_err(|error| ProtocolError::transport(format!("open event {name}"), error))
}

/// Opens the event service that every client needs; the daemon's name is for the error when there are too many of them.
pub(crate) fn open_wake<S: Service>(
    node: &Node<S>,
    name: &str,
) -> Result<EventService<S>, ProtocolError> {
    let service = node.service_builder(&service_name("wake")?).event().open();
    let service = service.map(|service| Port::new(node.config(), service));
    service.map_err(|error| match error {
        EventOpenError::ExceedsMaxNumberOfNodes => ProtocolError::TooManyClients {
            name: name.to_owned(),
            what: "clients",
            max: CLIENTS_MAX,
            holders: holders(node),
        },
        error => ProtocolError::transport("open event wake", error),
    })
}

/// An attribute of an event service.
pub(crate) fn attribute<S: Service>(service: &EventService<S>, key: &str) -> String {
    let entry = service
        .attributes()
        .iter()
        .find(|attribute| attribute.key().as_bytes() == key.as_bytes());
    entry.map_or_else(
        || "absent".to_owned(),
        |attribute| attribute.value().to_string(),
    )
}

/// Creates a listener.
pub(crate) fn listener<S: Service>(service: &EventService<S>) -> Result<Sleeper<S>, ProtocolError> {
    service
        .listener_builder()
        .create()
        .map(|port| Port::with_owner(service.owner(), port))
        .map_err(|error| ProtocolError::transport("create a listener", error))
}

/// Creates a notifier.
pub(crate) fn notifier<S: Service>(service: &EventService<S>) -> Result<Waker<S>, ProtocolError> {
    service
        .notifier_builder()
        .create()
        .map(|port| Port::with_owner(service.owner(), port))
        .map_err(|error| ProtocolError::transport("create a notifier", error))
}
