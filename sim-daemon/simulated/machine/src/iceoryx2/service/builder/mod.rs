//! Creates and opens services.

pub mod event;
pub mod publish_subscribe;
pub mod request_response;

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Duration;

use ::iceoryx2::prelude::{AttributeSpecifier, ServiceName, ZeroCopySend};

use super::Service;
use crate::iceoryx2::Types;
use crate::iceoryx2::bag::{self, Lane, Pattern, Requests, Settings, Stage, service_hash};
use crate::iceoryx2::connect;
use crate::iceoryx2::membership::{ServiceHandle, make};
use crate::iceoryx2::node::NodeHandle;
use crate::time::Instant;
use crate::world::{World, step, system_call, with};

/// Bytes of a service's settings, and of the list of who is there for each node.
const SETTINGS: u64 = 4096;
const MEMBER: u64 = 512;
/// An opener looks again after that time.
const PAUSE: Duration = Duration::from_millis(10);

/// Why a service cannot be had.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Failure {
    DoesNotExist,
    AlreadyExists,
    ExceedsMaxNumberOfNodes,
    HangsInCreation,
    IsMarkedForDestruction,
    Incompatible,
    UnableToCreateServiceTag,
    Internal,
}

/// For a service of some name.
#[derive(Debug)]
pub struct Builder<S: Service> {
    base: Base,
    service: Types<S>,
}

/// What all patterns have.
#[derive(Debug)]
pub(crate) struct Base {
    node: Arc<NodeHandle>,
    name: ServiceName,
    settings: Settings,
}

impl<S: Service> Builder<S> {
    pub(crate) fn new(node: Arc<NodeHandle>, name: ServiceName) -> Builder<S> {
        let settings = Settings {
            pattern: Pattern::Event,
            types: Vec::new(),
            nodes_max: 20,
            ports_max: BTreeMap::new(),
            lanes: [Lane::default(); 2],
            history: 0,
            requests: Requests::default(),
            attributes: AttributeSpecifier::new().attributes().clone(),
        };
        Builder {
            base: Base {
                node,
                name,
                settings,
            },
            service: PhantomData,
        }
    }

    /// That carries samples.
    pub fn publish_subscribe<P>(self) -> publish_subscribe::Builder<S, P, ()>
    where
        P: Debug + ?Sized + 'static,
    {
        publish_subscribe::Builder::new(self.base)
    }

    /// That carries requests and answers.
    pub fn request_response<Q, R>(self) -> request_response::Builder<S, Q, (), R, ()>
    where
        Q: Debug + ?Sized + 'static,
        R: Debug + ?Sized + 'static,
    {
        request_response::Builder::new(self.base)
    }

    /// That wakes.
    pub fn event(self) -> event::Builder<S> {
        event::Builder::new(self.base)
    }
}

/// The name of a header's type, which both ends must have.
fn name_of<H: ZeroCopySend>() -> &'static str {
    // SAFETY: the types of the protocol say what they are called.
    unsafe { <H as ZeroCopySend>::type_name() }
}

impl Base {
    fn hash(&self) -> String {
        service_hash(self.name.as_str(), self.settings.pattern)
    }

    fn handle(&self, id: u128, settings: &Settings) -> ServiceHandle {
        ServiceHandle {
            id,
            name: self.name,
            hash: self.hash(),
            attributes: settings.attributes.clone(),
            node: Arc::clone(&self.node),
        }
    }

    /// Creates it, in the order of iceoryx2: tag, settings that nobody can read yet, settings, list of who is there.
    pub(crate) fn create(&self) -> Result<ServiceHandle, Failure> {
        let (hash, names, node) = (self.hash(), &self.node.names, self.node.id);
        let (path, tag) = (names.service(&hash), names.service_tag(node, &hash));
        step("looks for a service");
        if with(|world| world.files.exists(&path)) {
            return Err(Failure::AlreadyExists);
        }
        make("makes the tag of a service", &tag, 0)
            .map_err(|_| Failure::UnableToCreateServiceTag)?;
        let made = self.create_tagged(&hash);
        if made.is_err() {
            connect::remove("removes the tag of a service", tag);
        }
        made
    }

    fn create_tagged(&self, hash: &str) -> Result<ServiceHandle, Failure> {
        let (names, node, settings) = (&self.node.names, self.node.id, &self.settings);
        let path = names.service(hash);
        let failed = Failure::Internal;
        system_call("makes the settings of a service").map_err(|_| failed)?;
        let id = with(|world| {
            if world.files.exists(&path) {
                return Err(Failure::AlreadyExists);
            }
            world.files.put(&path, SETTINGS).map_err(|_| failed)?;
            let id = world.unique();
            let service = bag::Service::new(settings.clone());
            world.wires.services.insert(id, service);
            world.wires.settings.insert(path.clone(), id);
            Ok(id)
        })?;
        step("writes the settings of a service");
        with(|world| world.stage(id, Stage::Readable));
        let bytes = SETTINGS + MEMBER * settings.nodes_max as u64;
        if make("makes a service", &names.dynamic(id), bytes).is_err() {
            connect::remove("removes the settings of a service", path);
            return Err(failed);
        }
        with(|world| {
            world.stage(id, Stage::Whole);
            if let Some(service) = world.wires.services.get_mut(&id) {
                service.nodes.push(node);
            }
            world.count(node, id);
        });
        Ok(self.handle(id, settings))
    }

    /// Opens it, once it is complete.
    pub(crate) fn open(&self) -> Result<(ServiceHandle, Settings), Failure> {
        let start = Instant::now();
        // as in the settings' default
        let most = Duration::from_secs(1);
        let (hash, names) = (self.hash(), &self.node.names);
        loop {
            step("looks for a service");
            let settings_there = with(|world| world.look(&names.service(&hash)))?;
            if let Some((id, settings)) = settings_there {
                if !self.is_compatible(&settings) {
                    return Err(Failure::Incompatible);
                }
                if self.join(id, &hash)? {
                    return Ok((self.handle(id, &settings), settings));
                }
            }
            if start.elapsed() > most {
                return Err(Failure::HangsInCreation);
            }
            crate::thread::sleep(PAUSE);
        }
    }

    fn is_compatible(&self, there: &Settings) -> bool {
        there.pattern == self.settings.pattern && there.types == self.settings.types
    }

    /// Joins a service; false where its list of who is there is missing.
    fn join(&self, id: u128, hash: &str) -> Result<bool, Failure> {
        let (names, node) = (&self.node.names, self.node.id);
        let tag = names.service_tag(node, hash);
        let is_tagged = with(|world| world.files.exists(&tag));
        if !is_tagged {
            make("makes the tag of a service", &tag, 0).map_err(|_| Failure::Internal)?;
        }
        let joined = match system_call("opens a service") {
            Ok(()) => with(|world| {
                let is_there = world.files.exists(&names.dynamic(id));
                world.join(node, id, is_there)
            }),
            Err(_) => Err(Failure::Internal),
        };
        if !is_tagged && joined != Ok(true) {
            connect::remove("removes the tag of a service", tag);
        }
        joined
    }
}

impl World {
    fn stage(&mut self, id: u128, stage: Stage) {
        if let Some(service) = self.wires.services.get_mut(&id) {
            service.stage = stage;
        }
    }

    /// The service whose settings are there; nothing while they cannot be read.
    pub(crate) fn look(&self, path: &std::path::Path) -> Result<Option<(u128, Settings)>, Failure> {
        let id = self.wires.settings.get(path);
        let Some(id) = id.filter(|_| self.files.exists(path)) else {
            return Err(Failure::DoesNotExist);
        };
        let there = self.wires.services.get(id);
        let readable = there.filter(|service| service.stage != Stage::Locked);
        Ok(readable.map(|service| (*id, service.settings.clone())))
    }

    /// Once more a node has a service open.
    fn count(&mut self, node: u128, service: u128) {
        if let Some(node) = self.wires.nodes.get_mut(&node) {
            *node.services.entry(service).or_default() += 1;
        }
    }

    fn join(&mut self, node: u128, id: u128, is_there: bool) -> Result<bool, Failure> {
        let Some(service) = self.wires.services.get_mut(&id) else {
            return Ok(false);
        };
        if !is_there || service.stage != Stage::Whole {
            return Ok(false);
        }
        if !service.nodes.contains(&node) {
            if service.locked {
                return Err(Failure::IsMarkedForDestruction);
            }
            if service.nodes.len() >= service.settings.nodes_max {
                return Err(Failure::ExceedsMaxNumberOfNodes);
            }
            service.nodes.push(node);
        }
        self.count(node, id);
        Ok(true)
    }
}

/// The errors of a pattern.
macro_rules! errors {
    ($open:ident, $create:ident, $incompatible:ident) => {
        impl From<super::Failure> for Open {
            fn from(failure: super::Failure) -> Open {
                use super::Failure;
                Open(match failure {
                    Failure::DoesNotExist => $open::DoesNotExist,
                    Failure::ExceedsMaxNumberOfNodes => $open::ExceedsMaxNumberOfNodes,
                    Failure::HangsInCreation => $open::HangsInCreation,
                    Failure::IsMarkedForDestruction => $open::IsMarkedForDestruction,
                    Failure::Incompatible => $open::$incompatible,
                    Failure::UnableToCreateServiceTag => $open::UnableToCreateServiceTag,
                    Failure::AlreadyExists | Failure::Internal => $open::InternalFailure,
                })
            }
        }

        impl From<super::Failure> for Create {
            fn from(failure: super::Failure) -> Create {
                use super::Failure;
                Create(match failure {
                    Failure::AlreadyExists => $create::AlreadyExists,
                    Failure::UnableToCreateServiceTag => $create::UnableToCreateServiceTag,
                    _ => $create::InternalFailure,
                })
            }
        }

        /// An error of iceoryx2's type.
        struct Open($open);
        /// The same.
        struct Create($create);
    };
}
pub(crate) use errors;
