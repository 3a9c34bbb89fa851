//! Requests that are written to.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::mem::MaybeUninit;

use ::iceoryx2::prelude::ZeroCopySend;

use super::connect::refresh;
use super::pending_response::PendingResponse;
use super::port::Loan;
use super::port::client::RequestSendError;
use super::queue::RequestCounts;
use super::service::Service;
use crate::iceoryx2::RequestTypes;
use crate::world::{World, is_on, step, with};

/// A request, from its loan until nobody awaits its answer.
#[derive(Debug)]
pub(crate) struct Request {
    pub(crate) loan: Loan,
    pub(crate) channel: usize,
    pub(crate) number: u64,
    active_max: usize,
    is_sent: bool,
}

impl World {
    fn counts(&mut self, port: u128) -> Option<&mut RequestCounts> {
        let outlet = self.wires.outlets.get_mut(&port)?;
        Some(&mut outlet.requests)
    }

    /// Sets the state of a channel of all senders that a client hears.
    fn set_channel(&mut self, port: u128, channel: usize, change: impl Fn(&mut u64)) {
        let links = self.wires.inlets.get(&port).into_iter();
        let links = links.flat_map(|inlet| inlet.links.values());
        let connections: Vec<u64> = links.map(|link| link.connection).collect();
        for id in connections {
            if let Some(connection) = self.wires.connections.get_mut(&id) {
                change(&mut connection.channels[channel].state);
            }
        }
    }
}

impl Request {
    /// Gives a loan a channel for its answer.
    pub(crate) fn new(loan: Loan, active_max: usize) -> Option<Request> {
        let (channel, number) = with(|world| {
            let counts = world.counts(loan.port.id)?;
            let channel = counts.channels.pop_front()?;
            counts.loaned += 1;
            counts.last += 1;
            Some((channel, counts.last))
        })?;
        loan.slot().set_request(channel, number);
        Some(Request {
            loan,
            channel,
            number,
            active_max,
            is_sent: false,
        })
    }

    /// Sends it; returns to how many.
    fn send(&mut self) -> Result<usize, RequestSendError> {
        step("sends a request");
        let port = self.loan.port.id;
        let active = with(|world| {
            world
                .counts(port)
                .map_or(usize::MAX, |counts| counts.active)
        });
        if active >= self.active_max {
            return Err(RequestSendError::ExceedsMaxActiveRequests);
        }
        refresh(port, false);
        let count = with(|world| {
            world.set_channel(port, self.channel, |state| *state = self.number);
            world.deliver(port, &self.loan.parcel, 0, None)
        });
        with(|world| {
            if let Some(counts) = world.counts(port) {
                counts.active += 1;
                counts.loaned -= 1;
            }
        });
        self.is_sent = true;
        Ok(count)
    }

    /// Nobody awaits its answer any more.
    pub(crate) fn close(&self) {
        if !is_on() {
            return;
        }
        with(|world| {
            if let Some(counts) = world.counts(self.loan.port.id) {
                counts.active -= 1;
            }
            world.set_channel(self.loan.port.id, self.channel, |state| {
                if *state == self.number {
                    *state = 0;
                }
            });
        });
    }
}

impl Drop for Request {
    fn drop(&mut self) {
        if !is_on() {
            return;
        }
        with(|world| {
            if let Some(counts) = world.counts(self.loan.port.id) {
                counts.channels.push_back(self.channel);
                counts.loaned -= usize::from(!self.is_sent);
            }
        });
    }
}

/// A request that is written to.
#[derive(Debug)]
pub struct RequestMutUninit<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    request: Request,
    types: RequestTypes<S, Q, QH, R, RH>,
}

/// A request that can be sent.
#[derive(Debug)]
pub struct RequestMut<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    request: Request,
    types: RequestTypes<S, Q, QH, R, RH>,
}

impl<S, Q, QH, R, RH> RequestMutUninit<S, [MaybeUninit<Q>], QH, R, RH>
where
    S: Service,
    Q: Debug + ZeroCopySend,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    pub(crate) fn new(request: Request) -> Self {
        RequestMutUninit {
            request,
            types: PhantomData,
        }
    }

    /// Its payload.
    pub fn payload_mut(&mut self) -> &mut [MaybeUninit<Q>] {
        self.request.loan.payload_mut()
    }

    /// Writes it.
    pub fn write_from_slice(mut self, values: &[Q]) -> RequestMut<S, [Q], QH, R, RH>
    where
        Q: Copy,
    {
        self.payload_mut().write_copy_of_slice(values);
        RequestMut {
            request: self.request,
            types: PhantomData,
        }
    }
}

impl<S, Q, QH, R, RH> RequestMut<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    /// Sends it.
    ///
    /// # Errors
    /// Too many answers are awaited.
    pub fn send(mut self) -> Result<PendingResponse<S, Q, QH, R, RH>, RequestSendError> {
        let count = self.request.send()?;
        Ok(PendingResponse::new(self.request, count))
    }
}
