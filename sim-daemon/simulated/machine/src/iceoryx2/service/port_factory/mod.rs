//! Services that are open, and what makes their ports.

pub mod event;
pub mod publish_subscribe;
pub mod request_response;

use std::fmt::Debug;

use ::iceoryx2::prelude::{AttributeSet, ServiceName};

/// What all services have.
pub trait PortFactory: Debug {
    /// Who is there.
    type DynamicConfig;

    /// Its name.
    fn name(&self) -> &ServiceName;
    /// What was said of it when it was created.
    fn attributes(&self) -> &AttributeSet;
    /// Who is there.
    fn dynamic_config(&self) -> &Self::DynamicConfig;
}
