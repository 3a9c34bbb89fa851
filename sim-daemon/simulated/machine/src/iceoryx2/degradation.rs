//! What a port does when it cannot meet another one: it asks the program, and goes on without.

use std::fmt;
use std::rc::Rc;

pub use ::iceoryx2::port::{DegradationAction, DegradationCause, DegradationFn, DegradationInfo};

use super::queue::End;
use crate::world::{me, with};

/// What the program does then.
#[derive(Clone)]
pub(crate) struct Handler(Rc<dyn DegradationFn>);

impl fmt::Debug for Handler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Handler")
    }
}

/// Sets it for the port that the calling thread makes next, at an end of its connections.
pub(crate) fn set(end: End, handler: impl DegradationFn + 'static) {
    let handler = Handler(Rc::new(handler));
    with(|world| world.wires.handlers.insert((me(), end), handler));
}

/// A port could not join a connection.
pub(crate) fn degrade(service: u128, (sender, receiver): (u128, u128), end: End) {
    let handler = with(|world| {
        let wires = &world.wires;
        match end {
            End::Sender => wires.outlets.get(&sender)?.handler.clone(),
            End::Receiver => wires.inlets.get(&receiver)?.handler.clone(),
        }
    });
    let info = DegradationInfo {
        service_id: service,
        sender_port_id: sender,
        receiver_port_id: receiver,
    };
    if let Some(Handler(handler)) = handler {
        // the program never asks for more than to go on
        let _ = handler(DegradationCause::FailedToEstablishConnection, &info);
    }
}
