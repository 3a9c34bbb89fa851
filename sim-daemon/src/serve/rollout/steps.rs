//! Who makes the steps of a rollout: a host for its clients, and tests of any question without one.

use sim_protocol::host::{Host, Inbox, Worlds};
use sim_protocol::{Command, Description};

use crate::export::snapshot;

/// What a rollout needs of a host; the methods are the host's.
pub(crate) trait Steps {
    fn description(&self) -> &Description;
    fn inbox(&self) -> &Inbox;
    fn put_aside(&mut self);
    fn put_step(&mut self, commands: &[Command<'_>]) -> Result<(), String>;
    fn carry_out(&mut self, arena: &mut [u64], worlds: &mut impl Worlds) -> bool;
    fn take_back(&mut self);

    /// Refuses an answer that needs too many bytes.
    fn check_room(&self, needed: u64) -> Result<(), String> {
        snapshot::check_room(needed)
    }
}

impl Steps for Host {
    fn description(&self) -> &Description {
        self.description()
    }

    fn inbox(&self) -> &Inbox {
        self.inbox()
    }

    fn put_aside(&mut self) {
        self.put_aside();
    }

    fn put_step(&mut self, commands: &[Command<'_>]) -> Result<(), String> {
        self.put_step(commands)
    }

    fn carry_out(&mut self, arena: &mut [u64], worlds: &mut impl Worlds) -> bool {
        self.carry_out(arena, worlds)
    }

    fn take_back(&mut self) {
        self.take_back();
    }
}
