//! Kinds of services. Here they differ by name only.

use crate::iceoryx2::service::Service;

/// Services whose ports stay on one thread.
#[derive(Debug, Clone)]
pub struct OneThread;

/// Services whose ports and samples go to any thread.
#[derive(Debug, Clone)]
pub struct AnyThread;

impl Service for OneThread {}
impl Service for AnyThread {}
