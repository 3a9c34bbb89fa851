//! Cleaning up after clients that were killed.

use iceoryx2::config::Config;
use iceoryx2::prelude::{CallbackProgression, Node, NodeState};

use super::worlds::S;

/// Finds dead clients and removes their ports, so that their slots and leases come back. May run on any thread.
#[derive(Debug, Clone)]
pub struct ClientCleanup {
    pub(super) config: Config,
}

impl ClientCleanup {
    /// Looks for dead clients and cleans up after them; returns how many. About 0.3 ms.
    pub fn clean(&self) -> usize {
        let mut cleaned = 0;
        // a list that fails is a list that changes: the next look will do
        let _ = Node::<S>::list(&self.config, |node| {
            if let NodeState::Dead(dead) = node {
                // another thread may be at it already
                cleaned += usize::from(dead.try_remove_stale_resources().is_ok());
            }
            CallbackProgression::Continue
        });
        cleaned
    }
}
