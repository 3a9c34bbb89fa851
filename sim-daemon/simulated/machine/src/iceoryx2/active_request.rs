//! Requests that were received, and their answers.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use ::iceoryx2::prelude::ZeroCopySend;

use super::connect::refresh;
use super::identifiers::UniqueClientId;
use super::port::{Borrow, Loan, LoanError, SendError};
use super::service::Service;
use crate::iceoryx2::{RequestTypes, Types};
use crate::world::{World, is_on, step, with};

/// A request. Dropped, it is answered no more.
#[derive(Debug)]
pub struct ActiveRequest<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    // the channel is closed before the request goes back, which nobody can tell from the other order
    close: Close,
    borrow: Borrow,
    loans: Arc<AtomicUsize>,
    loans_max: usize,
    types: RequestTypes<S, Q, QH, R, RH>,
}

/// Closes the channel of an answer.
#[derive(Debug)]
struct Close {
    port: u128,
    client: u128,
    channel: usize,
    number: u64,
}

impl Close {
    fn state<R>(&self, world: &mut World, call: impl FnOnce(&mut u64) -> R) -> Option<R> {
        let outlet = world.wires.outlets.get(&self.port)?;
        let id = outlet.peers.get(&self.client)?;
        let connection = world.wires.connections.get_mut(id)?;
        Some(call(&mut connection.channels.get_mut(self.channel)?.state))
    }
}

impl Drop for Close {
    fn drop(&mut self) {
        if !is_on() {
            return;
        }
        with(|world| {
            self.state(world, |state| {
                if *state == self.number {
                    *state = 0;
                }
            })
        });
    }
}

impl<S, Q, QH, R, RH> ActiveRequest<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    pub(crate) fn new(borrow: Borrow, loans_max: usize) -> Self {
        let (channel, number) = borrow.slot().request();
        ActiveRequest {
            close: Close {
                port: borrow.port.id,
                client: borrow.received.sender,
                channel,
                number,
            },
            borrow,
            loans: Arc::default(),
            loans_max,
            types: PhantomData,
        }
    }

    /// Who asks.
    pub fn origin(&self) -> UniqueClientId {
        UniqueClientId(self.close.client)
    }

    /// Whether its answer is awaited.
    pub fn is_connected(&self) -> bool {
        let number = self.close.number;
        is_on() && with(|world| self.close.state(world, |state| *state == number)).unwrap_or(false)
    }
}

impl<S, Q, QH, R, RH> ActiveRequest<S, [Q], QH, [R], RH>
where
    S: Service,
    Q: Debug + ZeroCopySend,
    QH: Debug,
    R: Debug + ZeroCopySend,
    RH: Debug + Default,
{
    /// Its payload.
    pub fn payload(&self) -> &[Q] {
        self.borrow.payload()
    }

    /// An answer to write to.
    ///
    /// # Errors
    /// Too many are written to, or it is too long.
    pub fn loan_slice_uninit(
        &self,
        length: usize,
    ) -> Result<ResponseMutUninit<S, [MaybeUninit<R>], RH>, LoanError> {
        if self.loans.load(Ordering::Relaxed) >= self.loans_max {
            return Err(LoanError::ExceedsMaxLoans);
        }
        let loan = Loan::new(&self.borrow.port, length, RH::default())?;
        loan.slot()
            .set_request(self.close.channel, self.close.number);
        self.loans.fetch_add(1, Ordering::Relaxed);
        let answer = Answer {
            loan,
            loans: Arc::clone(&self.loans),
            client: self.close.client,
            channel: self.close.channel,
        };
        Ok(ResponseMutUninit {
            answer,
            types: PhantomData,
        })
    }
}

#[derive(Debug)]
struct Answer {
    loan: Loan,
    loans: Arc<AtomicUsize>,
    client: u128,
    channel: usize,
}

impl Drop for Answer {
    fn drop(&mut self) {
        self.loans.fetch_sub(1, Ordering::Relaxed);
    }
}

/// An answer that is written to.
#[derive(Debug)]
pub struct ResponseMutUninit<S: Service, R: Debug + ?Sized, RH: Debug> {
    answer: Answer,
    types: Types<(S, Box<R>, RH)>,
}

/// An answer that can be sent.
#[derive(Debug)]
pub struct ResponseMut<S: Service, R: Debug + ?Sized, RH: Debug> {
    answer: Answer,
    types: Types<(S, Box<R>, RH)>,
}

impl<S: Service, R: Debug + ZeroCopySend, RH: Debug> ResponseMutUninit<S, [MaybeUninit<R>], RH> {
    /// Its payload.
    pub fn payload_mut(&mut self) -> &mut [MaybeUninit<R>] {
        self.answer.loan.payload_mut()
    }

    /// Writes it.
    pub fn write_from_slice(mut self, values: &[R]) -> ResponseMut<S, [R], RH>
    where
        R: Copy,
    {
        self.payload_mut().write_copy_of_slice(values);
        ResponseMut {
            answer: self.answer,
            types: PhantomData,
        }
    }
}

impl<S: Service, R: Debug + ?Sized, RH: Debug> ResponseMut<S, R, RH> {
    /// Sends it, whether or not somebody awaits it.
    ///
    /// # Errors
    /// None here.
    pub fn send(self) -> Result<(), SendError> {
        step("sends an answer");
        refresh(self.answer.loan.port.id, false);
        self.answer
            .loan
            .deliver(self.answer.channel, Some(self.answer.client));
        Ok(())
    }
}
