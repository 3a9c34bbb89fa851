//! Ports that sleep.

use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Duration;

pub use ::iceoryx2::port::listener::{ListenerCreateError, ListenerWaitError};

use super::loan::tagged;
use crate::iceoryx2::Types;
use crate::iceoryx2::bag::Role;
use crate::iceoryx2::membership::{Port, ServiceHandle, make};
use crate::iceoryx2::service::Service;
use crate::iceoryx2::wires::Event;
use crate::thread;
use crate::time::now;
use crate::world::{me, step, with};

/// Bytes of the state of a listener.
const STATE: u64 = 4096;
/// Waits of which one ends for nothing.
const SPURIOUS: u32 = 64;

/// A port that sleeps until it is notified.
#[derive(Debug)]
pub struct Listener<S: Service> {
    port: Arc<Port>,
    service: Types<S>,
}

/// What has a descriptor.
pub trait FileDescriptorBased {
    /// It.
    fn file_descriptor(&self) -> Descriptor {
        Descriptor
    }
}

/// A descriptor that the system does not know.
#[derive(Debug)]
pub struct Descriptor;

impl Descriptor {
    /// A number that no open file has.
    ///
    /// # Safety
    /// None is needed here.
    pub unsafe fn native_handle(&self) -> i32 {
        -1
    }
}

impl<S: Service> FileDescriptorBased for Listener<S> {}

impl<S: Service> Listener<S> {
    pub(crate) fn new(service: &Arc<ServiceHandle>) -> Result<Listener<S>, ListenerCreateError> {
        let port = tagged(service, Role::Listener)
            .map_err(|_| ListenerCreateError::UnableToCreatePortTag)?;
        let names = &port.node.names;
        let failed = ListenerCreateError::ResourceCreationFailed;
        make("binds a socket", &names.event(port.id), 0).map_err(|_| failed)?;
        // from here on it is removed with the port
        with(|world| world.wires.events.insert(port.id, Event::default()));
        let path = names.event_state(port.id);
        make("makes the state of a listener", &path, STATE).map_err(|_| failed)?;
        match port.register(port.entry(0, 0)) {
            true => Ok(Listener {
                port: Arc::new(port),
                service: PhantomData,
            }),
            false => Err(ListenerCreateError::ExceedsMaxSupportedListeners),
        }
    }

    /// Takes what was notified.
    ///
    /// # Errors
    /// None here.
    pub fn try_wait(&self, _notified: impl FnMut(u64)) -> Result<u64, ListenerWaitError> {
        step("looks for an event");
        Ok(self.drain())
    }

    /// Waits for a time, and takes what was notified. It may end for nothing.
    ///
    /// # Errors
    /// None here.
    pub fn timed_wait(
        &self,
        _notified: impl FnMut(u64),
        timeout: Duration,
    ) -> Result<u64, ListenerWaitError> {
        step("waits for an event");
        let until = now().saturating_add(timeout.as_nanos() as u64);
        let sleeps = with(|world| {
            let wakes = match world.rng.u32(0..SPURIOUS) {
                0 => world.rng.u64(world.now..=until.max(world.now)),
                _ => world.wakes(until),
            };
            let event = world.wires.events.get_mut(&self.port.id);
            let event = event.filter(|event| event.pending == 0)?;
            event.waiting.push(me());
            Some(wakes)
        });
        if let Some(until) = sleeps {
            thread::block(until);
        }
        Ok(self.drain())
    }

    fn drain(&self) -> u64 {
        with(|world| {
            let event = world.wires.events.get_mut(&self.port.id);
            event.map_or(0, |event| {
                event.waiting.retain(|thread| *thread != me());
                std::mem::take(&mut event.pending)
            })
        })
    }
}

impl<S: Service> Drop for Listener<S> {
    fn drop(&mut self) {
        self.port.deregister();
    }
}
