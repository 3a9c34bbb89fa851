//! The worlds as the host asks for them: frames, and the state behind them.

use std::ptr::NonNull;
use std::sync::Arc;

use sim_engine::backend::HostPages;
use sim_engine::simulation::Simulation;
use sim_protocol::host::{FrameMemory, Pages, Worlds};

use crate::export::Advance;
use crate::eyes::Eyes;

/// The worlds, for a frame.
pub(crate) struct Shown<'a> {
    pub(crate) simulation: &'a mut Simulation,
    pub(crate) eyes: &'a mut Eyes,
    pub(crate) advance: Advance,
    /// Whether the frame is the client's, whose images later frames may repeat.
    pub(crate) keeps: bool,
    /// Worlds that observers see.
    pub(crate) watched: usize,
}

impl Worlds for Shown<'_> {
    fn frame(&mut self, arena: &mut [u64], memory: Option<&FrameMemory>) -> bool {
        if let Some(memory) = memory {
            self.simulation
                .import(arena, &|| Some(Arc::new(FramePages(memory.pages(arena)?))));
            if let Some(sharing) = self.simulation.sharing() {
                sharing.assign_slot(arena);
            }
        }
        match self.advance {
            Advance::Step => self.simulation.step(arena),
            Advance::Forward => self.simulation.forward(arena),
        }
        let is_there = self.simulation.lost().is_none();
        if is_there {
            self.eyes.draw(self.simulation, arena, self.keeps);
        }
        is_there
    }

    fn on_device(&mut self) -> Option<(usize, u64)> {
        self.simulation.sharing()?.slot_shown()
    }

    fn state(&mut self, to: &mut [u8]) -> bool {
        self.simulation.snapshot_first(self.watched, to);
        self.simulation.lost().is_none()
    }
}

/// Pages that frames lie in.
struct FramePages(Arc<Pages>);

// SAFETY: a lease's own file is mapped for writing and by whole pages, as long as they are owned.
unsafe impl HostPages for FramePages {
    fn start(&self) -> NonNull<u8> {
        self.0.start()
    }

    fn bytes(&self) -> usize {
        self.0.bytes().next_multiple_of(4096) // no page is smaller
    }
}
