//! What a client does whose frames and commands stay on the daemon's card.

use crate::lease::device_memory::Delivery;
use crate::waiting::hook::Hook;
use crate::wire::command::{Call, Command, OnDevice};
use crate::{Client, Frame, Op, ProtocolError};

impl Client {
    /// As [`Client::step`], with commands that the client left in device memory besides those of `commands`.
    ///
    /// # Errors
    /// As [`Client::step`].
    pub fn step_on_device(
        &self,
        commands: &[Command<'_>],
        on_device: OnDevice,
        hook: Hook<'_>,
    ) -> Result<Frame, ProtocolError> {
        let call = Call {
            on_device: Some(on_device),
            ..Call::new(Op::Step, commands, None)
        };
        self.run(&call, hook)
    }

    /// As [`Client::send`], with commands that the client left in device memory besides those of `commands`.
    ///
    /// # Errors
    /// As [`Client::send`].
    pub fn send_on_device(
        &self,
        commands: &[Command<'_>],
        on_device: OnDevice,
        hook: Hook<'_>,
    ) -> Result<(), ProtocolError> {
        let call = Call {
            on_device: Some(on_device),
            ..Call::new(Op::Step, commands, None)
        };
        self.with_controller(hook, |controller, hook| controller.send(&call, hook))
    }

    /// Lets frames stay on the daemon's card too, until the lease ends: the header of each frame then names the slot that has it.
    /// The slot is as valid as the frame. Earlier memory of this lease is no longer written.
    ///
    /// # Errors
    /// [`ProtocolError::NotShared`] where the worlds are on the CPU, or the driver exports no memory; as [`Client::acquire`].
    pub fn device_memory(&self, hook: Hook<'_>) -> Result<Delivery, ProtocolError> {
        self.with_controller(hook, |controller, hook| controller.device_memory(hook))
    }

    /// Waits for the answer to a command that an interrupted call left: until then the daemon may read device memory.
    ///
    /// # Errors
    /// [`ProtocolError::StepInFlight`]; otherwise as [`Client::acquire`].
    pub fn land(&self, hook: Hook<'_>) -> Result<(), ProtocolError> {
        self.with_controller(hook, |controller, hook| controller.land(hook))
    }
}
