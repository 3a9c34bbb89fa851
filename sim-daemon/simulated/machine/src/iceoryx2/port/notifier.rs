//! Ports that wake.

use std::marker::PhantomData;
use std::sync::Arc;

pub use ::iceoryx2::port::notifier::{NotifierCreateError, NotifierNotifyError};

use super::loan::tagged;
use crate::iceoryx2::Types;
use crate::iceoryx2::bag::Role;
use crate::iceoryx2::membership::{Port, ServiceHandle};
use crate::iceoryx2::service::Service;
use crate::thread;
use crate::world::{World, step, with};

/// A port that wakes those who sleep.
#[derive(Debug)]
pub struct Notifier<S: Service> {
    port: Arc<Port>,
    service: Types<S>,
}

impl<S: Service> Notifier<S> {
    pub(crate) fn new(service: &Arc<ServiceHandle>) -> Result<Notifier<S>, NotifierCreateError> {
        let port = tagged(service, Role::Notifier)
            .map_err(|_| NotifierCreateError::UnableToCreatePortTag)?;
        match port.register(port.entry(0, 0)) {
            true => Ok(Notifier {
                port: Arc::new(port),
                service: PhantomData,
            }),
            false => Err(NotifierCreateError::ExceedsMaxSupportedNotifiers),
        }
    }

    /// Wakes all who listen; returns how many.
    ///
    /// # Errors
    /// None here.
    pub fn notify(&self) -> Result<usize, NotifierNotifyError> {
        step("notifies");
        let (count, woken) = with(|world| world.notify(self.port.service_id, &self.port));
        woken.into_iter().for_each(thread::wake);
        Ok(count)
    }
}

impl World {
    fn notify(&mut self, service: u128, port: &Port) -> (usize, Vec<thread::ThreadId>) {
        let listeners = self.wires.services.get(&service);
        let listeners = listeners.map_or(Vec::new(), |service| {
            service.entries(Role::Listener).to_vec()
        });
        let (mut count, mut woken) = (0, Vec::new());
        for listener in listeners {
            // a socket without a name, or without an owner, is heard by nobody
            let names = &port.node.names;
            let lives = self.wires.nodes.get(&listener.node);
            if !lives.is_some_and(|node| node.lives)
                || !self.files.exists(&names.event(listener.port))
            {
                continue;
            }
            count += 1;
            if self.rng.u32(0..1_000_000) < self.dropping {
                self.line(|| "a notification is lost".to_owned());
                continue;
            }
            if let Some(event) = self.wires.events.get_mut(&listener.port) {
                event.pending += 1;
                woken.append(&mut event.waiting);
            }
        }
        (count, woken)
    }
}
