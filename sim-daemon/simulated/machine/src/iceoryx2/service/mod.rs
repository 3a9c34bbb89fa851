//! Services.

use std::fmt::Debug;

pub mod builder;
pub mod port_factory;

/// A kind of service.
pub trait Service: Debug + Clone + Send + Sync + 'static {}
