//! Samples.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::mem::MaybeUninit;

use ::iceoryx2::prelude::ZeroCopySend;

use super::connect::refresh;
use super::identifiers::UniquePublisherId;
use super::port::{Borrow, Loan, SendError};
use super::service::Service;
use crate::iceoryx2::Types;
use crate::world::{step, with};

/// A sample that was received. It stays as it is as long as the port that received it is there.
#[derive(Debug)]
pub struct Sample<S: Service, P: Debug + ?Sized, H: ZeroCopySend> {
    borrow: Borrow,
    types: Types<(S, Box<P>, H)>,
}

impl<S: Service, P: Debug + ?Sized, H: ZeroCopySend> Sample<S, P, H> {
    pub(crate) fn new(borrow: Borrow) -> Sample<S, P, H> {
        Sample {
            borrow,
            types: PhantomData,
        }
    }

    /// Its header.
    pub fn user_header(&self) -> &H {
        self.borrow.header()
    }

    /// Who sent it.
    pub fn origin(&self) -> UniquePublisherId {
        UniquePublisherId(self.borrow.received.sender)
    }
}

impl<S: Service, T: Debug + ZeroCopySend, H: ZeroCopySend> Sample<S, [T], H> {
    /// Its payload.
    pub fn payload(&self) -> &[T] {
        self.borrow.payload()
    }
}

/// A sample that is written to.
#[derive(Debug)]
pub struct SampleMutUninit<S: Service, P: Debug + ?Sized, H: ZeroCopySend> {
    loan: Loan,
    types: Types<(S, Box<P>, H)>,
}

/// A sample that can be sent.
#[derive(Debug)]
pub struct SampleMut<S: Service, P: Debug + ?Sized, H: ZeroCopySend> {
    loan: Loan,
    types: Types<(S, Box<P>, H)>,
}

impl<S: Service, P: Debug + ?Sized, H: ZeroCopySend> SampleMutUninit<S, P, H> {
    pub(crate) fn new(loan: Loan) -> Self {
        SampleMutUninit {
            loan,
            types: PhantomData,
        }
    }

    /// Its header.
    pub fn user_header(&self) -> &H {
        self.loan.header()
    }

    /// The same, to write to.
    pub fn user_header_mut(&mut self) -> &mut H {
        self.loan.header_mut()
    }
}

impl<S: Service, T: Debug + ZeroCopySend, H: ZeroCopySend> SampleMutUninit<S, [MaybeUninit<T>], H> {
    /// Its payload: whatever was in the slot before.
    pub fn payload(&self) -> &[MaybeUninit<T>] {
        self.loan.payload()
    }

    /// The same, to write to.
    pub fn payload_mut(&mut self) -> &mut [MaybeUninit<T>] {
        self.loan.payload_mut()
    }

    /// As it is.
    ///
    /// # Safety
    /// It was written, or any bits are good.
    pub unsafe fn assume_init(self) -> SampleMut<S, [T], H> {
        SampleMut {
            loan: self.loan,
            types: PhantomData,
        }
    }

    /// Writes it.
    pub fn write_from_slice(mut self, values: &[T]) -> SampleMut<S, [T], H>
    where
        T: Copy,
    {
        self.payload_mut().write_copy_of_slice(values);
        SampleMut {
            loan: self.loan,
            types: PhantomData,
        }
    }
}

impl<S: Service, P: Debug + ?Sized, H: ZeroCopySend> SampleMut<S, P, H> {
    /// Its header.
    pub fn user_header(&self) -> &H {
        self.loan.header()
    }

    /// The same, to write to.
    pub fn user_header_mut(&mut self) -> &mut H {
        self.loan.header_mut()
    }

    /// Sends it; returns to how many.
    ///
    /// # Errors
    /// The port is gone.
    pub fn send(self) -> Result<usize, SendError> {
        step("sends a sample");
        let port = self.loan.port.id;
        let is_active = with(|world| {
            let outlet = world.wires.outlets.get(&port);
            outlet.is_some_and(|outlet| outlet.is_active)
        });
        if !is_active {
            return Err(SendError::ConnectionBrokenSinceSenderNoLongerExists);
        }
        refresh(port, false);
        Ok(self.loan.deliver(0, None))
    }
}

impl<S: Service, T: Debug + ZeroCopySend, H: ZeroCopySend> SampleMut<S, [T], H> {
    /// Its payload.
    pub fn payload(&self) -> &[T] {
        self.loan.payload()
    }

    /// The same, to write to.
    pub fn payload_mut(&mut self) -> &mut [T] {
        self.loan.payload_mut()
    }
}
