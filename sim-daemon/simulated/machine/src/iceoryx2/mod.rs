//! The transport: the part of iceoryx2 that the protocol uses, under the same names, in memory of the machine.
//!
//! Every call is a door. Ports, services and nodes are made and removed in the order of iceoryx2 0.10, a door for each file, so
//! that a process that is killed meanwhile leaves the same files behind. Where iceoryx2 reads a file, this does too: who removes
//! one changes what others see.
//!
//! What one process alone knows of its ports is in [`Wires`] as well, and goes with the process.

pub mod active_request;
mod bag;
mod cleanup;
mod connect;
mod degradation;
pub mod identifiers;
mod membership;
mod names;
pub mod node;
pub mod pending_response;
pub mod port;
pub mod prelude;
mod queue;
pub mod request_mut;
pub mod sample;
pub mod service;
mod slot;
mod transfer;
mod wires;

pub(crate) use wires::Wires;

pub use port::listener::FileDescriptorBased;
pub use wires::overwritten;

/// As in iceoryx2: settings, which are plain data.
pub mod config {
    pub use ::iceoryx2::config::Config;
}

/// Samples that are written to.
pub mod sample_mut_uninit {
    pub use super::sample::{SampleMut, SampleMutUninit};
}

/// Samples that can be sent.
pub mod sample_mut {
    pub use super::sample::SampleMut;
}

/// As the crate `iceoryx2_bb_posix`.
pub mod iceoryx2_bb_posix {
    /// What has a descriptor.
    pub mod file_descriptor {
        pub use crate::iceoryx2::FileDescriptorBased;
    }
}

/// Types that a handle is for, and holds nothing of.
pub(crate) type Types<T> = std::marker::PhantomData<fn() -> T>;

/// Those of requests and answers, with their headers.
pub(crate) type RequestTypes<S, Q, QH, R, RH> = Types<(S, Box<Q>, QH, Box<R>, RH)>;

/// A number for texts.
pub(crate) fn hash(texts: &[&str]) -> u64 {
    let bytes = texts
        .iter()
        .flat_map(|text| text.bytes().chain(std::iter::once(0xff)));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
