//! Ports that ask.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::sync::Arc;

use ::iceoryx2::prelude::ZeroCopySend;

use super::loan::{Loan, Slots, meet, open_inlet, open_outlet, tagged};
use super::{LoanError, SendError};
use crate::iceoryx2::RequestTypes;
use crate::iceoryx2::bag::Role;
use crate::iceoryx2::identifiers::UniqueClientId;
use crate::iceoryx2::membership::Port;
use crate::iceoryx2::request_mut::{Request, RequestMutUninit};
use crate::iceoryx2::service::Service;
use crate::iceoryx2::service::port_factory::request_response::{ClientCreateError, PortFactory};
use crate::world::with;

/// A request that is written to.
type Loaned<S, Q, QH, R, RH> = RequestMutUninit<S, [MaybeUninit<Q>], QH, [R], RH>;

/// Why a request was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestSendError {
    /// Too many answers are awaited.
    ExceedsMaxActiveRequests,
    /// It could not be sent.
    SendError(SendError),
}

/// A port that asks.
#[derive(Debug)]
pub struct Client<S, Q, QH, R, RH>
where
    S: Service,
    Q: Debug + ?Sized,
    QH: Debug + ZeroCopySend,
    R: Debug + ?Sized,
    RH: Debug + ZeroCopySend,
{
    port: Arc<Port>,
    loaned_max: usize,
    active_max: usize,
    types: RequestTypes<S, Q, QH, R, RH>,
}

impl<S, Q, QH, R, RH> Client<S, [Q], QH, [R], RH>
where
    S: Service,
    Q: Debug + ZeroCopySend + 'static,
    QH: Debug + ZeroCopySend,
    R: Debug + ZeroCopySend + 'static,
    RH: Debug + ZeroCopySend,
{
    pub(crate) fn new(
        factory: &PortFactory<S, [Q], QH, [R], RH>,
        length_max: usize,
    ) -> Result<Self, ClientCreateError> {
        let settings = &factory.settings;
        let channels = settings.lanes[1].channels;
        let slots = Slots::sized::<Q, QH>(channels, length_max);
        let port = tagged(&factory.service, Role::Client)
            .map_err(|_| ClientCreateError::UnableToCreatePortTag)?;
        open_outlet(&port, slots).map_err(|_| ClientCreateError::UnableToCreateDataSegment)?;
        with(|world| {
            if let Some(outlet) = world.wires.outlets.get_mut(&port.id) {
                outlet.requests.channels = (0..channels).collect();
            }
        });
        let entry = port.entry(settings.lanes[1].buffer, 0);
        open_inlet(&port, entry);
        let port = meet(port, entry).ok_or(ClientCreateError::ExceedsMaxSupportedClients)?;
        Ok(Client {
            port,
            loaned_max: settings.requests.loaned,
            active_max: settings.requests.active,
            types: PhantomData,
        })
    }

    /// Its number.
    pub fn id(&self) -> UniqueClientId {
        UniqueClientId(self.port.id)
    }

    /// A request to write to.
    ///
    /// # Errors
    /// Too many are written to, or it is too long.
    pub fn loan_slice_uninit(&self, length: usize) -> Result<Loaned<S, Q, QH, R, RH>, LoanError>
    where
        QH: Default,
    {
        let loaned = with(|world| {
            let outlet = world.wires.outlets.get(&self.port.id);
            outlet.map_or(usize::MAX, |outlet| outlet.requests.loaned)
        });
        if loaned >= self.loaned_max {
            return Err(LoanError::ExceedsMaxLoans);
        }
        let loan = Loan::new(&self.port, length, QH::default())?;
        let request = Request::new(loan, self.active_max).ok_or(LoanError::ExceedsMaxLoans)?;
        Ok(RequestMutUninit::new(request))
    }
}
