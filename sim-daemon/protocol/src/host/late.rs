//! Steps that no client asked for: the worlds keep their pace though no command came.

use std::time::Instant;

use super::journal::Occasion;
use super::state::{State, header};
use super::worlds::Worlds;
use crate::wire::command::{Command, Values};
use crate::{CommandHeader, Op};

impl State {
    /// Advances the worlds by the step in the inbox, which no client sent.
    pub(super) fn advance(&mut self, arena: &mut [u64], worlds: &mut impl Worlds) {
        let started = Instant::now();
        let is_good = worlds.frame(arena, None);
        self.frames += 1;
        self.observers.changed();
        let now = Instant::now();
        let busy_ns = now.duration_since(started).as_nanos() as u64;
        self.pacer.leave(now, busy_ns, false);
        if is_good && self.observers.is_due() {
            let head = header(&self.description, &self.frame, self.frames);
            self.observers.show(now, head, &self.frame, arena, worlds);
        }
        if is_good && self.journals.are_read() {
            let occasion = Occasion {
                description: &self.description,
                inbox: &self.inbox,
                table: &self.frame,
            };
            self.journals.entry(&occasion, Some(arena));
        }
    }

    /// Puts a step into the inbox that no client sent: it keeps all commands, or sets zeros where the worlds are to stop.
    pub(super) fn give_up(&mut self) {
        let worlds = self.description.worlds.max(1);
        let zeros = self.pacer.give_up().iter().map(|(field, values)| Command {
            field,
            columns: 0..values.len() / worlds,
            values: Values::F32(values),
        });
        let commands: Vec<_> = zeros.collect();
        let header = CommandHeader::default();
        let put = self
            .inbox
            .put(&self.description, header, Op::Step, &commands);
        debug_assert_eq!(put, Ok(()), "zeros of the right shapes");
    }
}
