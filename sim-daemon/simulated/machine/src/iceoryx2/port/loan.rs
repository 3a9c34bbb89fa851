//! Slots that are written to, and samples that are read.

use std::sync::Arc;

use super::{LoanError, ReceiveError};
use crate::iceoryx2::bag::{Entry, Role};
use crate::iceoryx2::connect::{self, refresh};
use crate::iceoryx2::membership::{self, Port, Refused, ServiceHandle};
use crate::iceoryx2::queue::{End, Inlet, Outlet, Received, TooMany};
use crate::iceoryx2::slot::{ALIGNMENT, Slot};
use crate::iceoryx2::wires::Parcel;
use crate::world::{is_on, me, step, with};

/// What iceoryx2 puts before a payload, beside the user's header [bytes].
const HEAD: usize = 64;
/// Pages of a segment that its owner takes where the reader takes the rest: the ends [bytes].
const ENDS: u64 = 2 << 20;

/// Slots of a port.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slots {
    pub(crate) count: usize,
    pub(crate) loans_max: usize,
    pub(crate) length_max: usize,
    /// Room for the header and for the payload of each [bytes].
    pub(crate) bytes: (usize, usize),
    pub(crate) history: usize,
}

impl Slots {
    /// With so many entries of a type, and a header.
    pub(crate) fn sized<T, H>(count: usize, length_max: usize) -> Slots {
        Slots {
            count,
            loans_max: count,
            length_max,
            bytes: (size_of::<H>(), length_max * size_of::<T>()),
            history: 0,
        }
    }
}

/// Makes the memory of a port that sends.
pub(crate) fn open_outlet(port: &Port, slots: Slots) -> Result<(), Refused> {
    let path = port.node.names.data(port.id);
    let (head, bytes) = slots.bytes;
    let slot = (head.max(1).next_multiple_of(ALIGNMENT) + HEAD + bytes).next_multiple_of(ALIGNMENT);
    let bytes = (slots.count * slot) as u64;
    crate::world::system_call("makes a segment").map_err(|_| Refused)?;
    let made = with(|world| {
        let held = match world.wires.reserving.contains(&me()) {
            true => bytes.min(ENDS),
            false => bytes,
        };
        world.files.put_in_part(&path, bytes, held)
    });
    made.map_err(|_| Refused)?;
    with(|world| {
        let place = (port.node.id, port.service_id, port.role);
        let names = port.node.names.clone();
        let mut outlet = Outlet::new(place, names, slots.count, slots.history);
        outlet.loans_max = slots.loans_max;
        outlet.length_max = slots.length_max;
        outlet.slot_bytes = slots.bytes;
        outlet.handler = world.wires.handlers.remove(&(me(), End::Sender));
        world.wires.outlets.insert(port.id, outlet);
        world.wires.segments.insert(port.id);
    });
    Ok(())
}

/// Makes what a port needs that receives.
pub(crate) fn open_inlet(port: &Port, entry: Entry) {
    with(|world| {
        let place = (port.node.id, port.service_id, port.role);
        let mut inlet = Inlet::new(place, port.node.names.clone(), entry);
        inlet.handler = world.wires.handlers.remove(&(me(), End::Receiver));
        world.wires.inlets.insert(port.id, inlet);
    });
}

/// Makes a port, lets it meet those who are there, and registers it; `None` if there are too many.
pub(crate) fn meet(port: Port, entry: Entry) -> Option<Arc<Port>> {
    refresh(port.id, true);
    match port.register(entry) {
        true => Some(Arc::new(port)),
        false => None,
    }
}

/// A port with a tag.
pub(crate) fn tagged(service: &Arc<ServiceHandle>, role: Role) -> Result<Port, Refused> {
    membership::Port::tagged(service, role)
}

/// Looks who is there.
pub(crate) fn update(port: &Port) {
    step("looks at a list of ports");
    refresh(port.id, false);
}

/// A slot that is written to.
#[derive(Debug)]
pub(crate) struct Loan {
    pub(crate) port: Arc<Port>,
    pub(crate) parcel: Parcel,
}

impl Loan {
    /// Loans a slot for so many entries, with such a header.
    pub(crate) fn new<H>(port: &Arc<Port>, length: usize, header: H) -> Result<Loan, LoanError> {
        step("loans a slot");
        let parcel = with(|world| {
            let Some(outlet) = world.wires.outlets.get(&port.id) else {
                return Err(LoanError::InternalFailure);
            };
            if length > outlet.length_max {
                return Err(LoanError::ExceedsMaxLoanSize);
            }
            if outlet.loans >= outlet.loans_max {
                return Err(LoanError::ExceedsMaxLoans);
            }
            world.loan(port.id).ok_or(LoanError::OutOfMemory)
        })?;
        parcel.slot.set_length(length);
        // SAFETY: the slot has room for it.
        unsafe { parcel.slot.header().write(header) };
        Ok(Loan {
            port: Arc::clone(port),
            parcel,
        })
    }

    pub(crate) fn slot(&self) -> &Slot {
        &self.parcel.slot
    }

    /// Sends it; returns to how many.
    pub(crate) fn deliver(&self, channel: usize, only: Option<u128>) -> usize {
        with(|world| world.deliver(self.port.id, &self.parcel, channel, only))
    }

    /// The header.
    pub(crate) fn header<H>(&self) -> &H {
        // SAFETY: it was written when the slot was loaned, and lives as long as the slot.
        unsafe { self.slot().header().as_ref() }
    }

    pub(crate) fn header_mut<H>(&mut self) -> &mut H {
        // SAFETY: as above; nobody else writes to a slot that is loaned.
        unsafe { self.slot().header().as_mut() }
    }

    /// The payload, whose bits are whatever they are.
    pub(crate) fn payload<T>(&self) -> &[T] {
        // SAFETY: the slot is that long, initialised, and of types that any bits are good for, or written by now.
        unsafe { self.slot().payload(self.slot().length()).as_ref() }
    }

    pub(crate) fn payload_mut<T>(&mut self) -> &mut [T] {
        // SAFETY: as above; nobody else writes to a slot that is loaned.
        unsafe { self.slot().payload(self.slot().length()).as_mut() }
    }
}

impl Drop for Loan {
    fn drop(&mut self) {
        if is_on() {
            with(|world| world.give_back(self.port.id, self.parcel.index));
        }
    }
}

/// A sample that is read.
#[derive(Debug)]
pub(crate) struct Borrow {
    pub(crate) port: Arc<Port>,
    pub(crate) received: Received,
    length: usize,
}

impl Borrow {
    /// Receives from a channel.
    pub(crate) fn receive(
        port: &Arc<Port>,
        channel: usize,
    ) -> Result<Option<Borrow>, ReceiveError> {
        step("receives");
        refresh(port.id, false);
        let (received, empty) = with(|world| world.take(port.id, channel))
            .map_err(|TooMany| ReceiveError::ExceedsMaxBorrows)?;
        let borrow = received.map(|received| Borrow {
            port: Arc::clone(port),
            length: received.parcel.slot.length(),
            received,
        });
        empty
            .iter()
            .for_each(|link| connect::unlink(port.id, *link));
        Ok(borrow)
    }

    pub(crate) fn slot(&self) -> &Slot {
        &self.received.parcel.slot
    }

    pub(crate) fn header<H>(&self) -> &H {
        // SAFETY: its sender wrote it.
        unsafe { self.slot().header().as_ref() }
    }

    pub(crate) fn payload<T>(&self) -> &[T] {
        // SAFETY: its sender wrote it, and types were compared when the service was opened.
        unsafe { self.slot().payload(self.length).as_ref() }
    }
}

impl Drop for Borrow {
    fn drop(&mut self) {
        if is_on() {
            step("gives a sample back");
            with(|world| world.put_back(self.port.id, &self.received));
        }
    }
}
