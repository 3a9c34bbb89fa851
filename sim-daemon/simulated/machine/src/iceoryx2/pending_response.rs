//! Answers that are awaited, and those that came.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::sync::Arc;

use ::iceoryx2::prelude::ZeroCopySend;

use super::port::{Borrow, ReceiveError};
use super::request_mut::Request;
use super::service::Service;
use crate::iceoryx2::{RequestTypes, Types};

/// A request that was sent. Dropped, its answer is awaited no more.
#[derive(Debug)]
pub struct PendingResponse<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    request: Request,
    count: usize,
    types: RequestTypes<S, Q, QH, R, RH>,
}

impl<S, Q, QH, R, RH> PendingResponse<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    pub(crate) fn new(request: Request, count: usize) -> Self {
        PendingResponse {
            request,
            count,
            types: PhantomData,
        }
    }

    /// How many got it.
    pub fn number_of_server_connections(&self) -> usize {
        self.count
    }

    /// An answer, if one came.
    ///
    /// # Errors
    /// Too many are held.
    pub fn receive(&self) -> Result<Option<Response<S, R, RH>>, ReceiveError> {
        let port = Arc::clone(&self.request.loan.port);
        loop {
            let Some(borrow) = Borrow::receive(&port, self.request.channel)? else {
                return Ok(None);
            };
            // another request had the channel before
            if borrow.slot().request().1 == self.request.number {
                return Ok(Some(Response {
                    borrow,
                    types: PhantomData,
                }));
            }
        }
    }
}

impl<S, Q, QH, R, RH> Drop for PendingResponse<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug,
    R: Debug + ?Sized,
    RH: Debug,
{
    fn drop(&mut self) {
        self.request.close();
    }
}

/// An answer.
#[derive(Debug)]
pub struct Response<S: Service, R: Debug + ?Sized, RH: Debug> {
    borrow: Borrow,
    types: Types<(S, Box<R>, RH)>,
}

impl<S: Service, R: Debug + ZeroCopySend, RH: Debug> Response<S, [R], RH> {
    /// Its payload.
    pub fn payload(&self) -> &[R] {
        self.borrow.payload()
    }
}
