//! Steps that the daemon makes itself: no command came and the worlds keep their pace, or a command asks for several.

use super::inbox::Inbox;
use super::journal::Occasion;
use super::state::{State, header};
use super::worlds::Worlds;
use crate::doors::time::Instant;
use crate::wire::command::{Command, Values};
use crate::{CommandHeader, Op};

impl State {
    /// Advances the worlds by the step in the inbox, which no client sent.
    pub(super) fn advance(&mut self, arena: &mut [u64], worlds: &mut impl Worlds) {
        self.make_frame(arena, worlds, false);
    }

    /// Advances the worlds by the step in the inbox, which a command asked for.
    pub(super) fn carry_out(&mut self, arena: &mut [u64], worlds: &mut impl Worlds) {
        self.make_frame(arena, worlds, true);
    }

    /// `is_asked` where the frame is due for a client, and not late.
    fn make_frame(&mut self, arena: &mut [u64], worlds: &mut impl Worlds, is_asked: bool) {
        let started = Instant::now();
        let is_good = worlds.frame(arena, None);
        self.frames += 1;
        self.observers.changed();
        let busy_ns = started.elapsed().as_nanos() as u64;
        if is_asked {
            self.pacer.hold();
        }
        let now = Instant::now();
        self.pacer.leave(now, busy_ns, is_asked);
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

    /// Exchanges the inbox for another one, and keeps the command in it.
    pub(super) fn put_aside(&mut self) {
        let spare = self.aside.take();
        let spare = spare.unwrap_or_else(|| Inbox::for_commands_of(&self.description));
        self.aside = Some(std::mem::replace(&mut self.inbox, spare));
    }

    /// Puts a step into the inbox for the client whose command was put aside.
    pub(super) fn put_step(&mut self, commands: &[Command<'_>]) -> Result<(), String> {
        let asked = self.aside.as_ref().map(|inbox| *inbox.header());
        let header = asked.unwrap_or_default();
        self.inbox
            .put(&self.description, header, Op::Step, commands)
    }

    /// Exchanges the inboxes again.
    pub(super) fn take_back(&mut self) {
        if let Some(inbox) = &mut self.aside {
            std::mem::swap(inbox, &mut self.inbox);
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
