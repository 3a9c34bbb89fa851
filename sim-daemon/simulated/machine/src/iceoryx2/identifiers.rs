//! Numbers of nodes and ports: how many came before in bits 96 to 127, the process in bits 64 to 95.

use std::convert::Infallible;

use ::iceoryx2::prelude::ProcessId;

use super::service::Service;
use crate::world::World;

macro_rules! ids {
    ($($(#[$text:meta])* $name:ident),*) => { $(
        $(#[$text])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub struct $name(pub(crate) u128);

        impl $name {
            /// The number.
            pub fn value(&self) -> u128 {
                self.0
            }
        }
    )* };
}

ids! {
    /// Of a node.
    UniqueNodeId,
    /// Of a service.
    UniqueServiceId,
    /// Of a publisher.
    UniquePublisherId,
    /// Of a subscriber.
    UniqueSubscriberId,
    /// Of a client.
    UniqueClientId,
    /// Of a server.
    UniqueServerId
}

impl UniqueNodeId {
    /// The process that made it.
    ///
    /// # Errors
    /// Never here.
    pub fn pid<S: Service>(&self) -> Result<ProcessId, Infallible> {
        Ok(ProcessId::new((self.0 >> 64) as u32 as i32))
    }
}

impl World {
    /// A number that nobody has had.
    pub(crate) fn unique(&mut self) -> u128 {
        self.wires.last += 1;
        let time = self.now & ((1 << 62) - 1);
        u128::from(self.wires.last) << 96 | u128::from(self.process()) << 64 | u128::from(time)
    }
}
