//! What most need.

pub use super::config::Config;
pub use super::node::{Node, NodeBuilder, NodeState};
pub use super::service::Service;
pub use super::service::port_factory::PortFactory;
pub use ::iceoryx2::prelude::{
    AttributeSet, AttributeSpecifier, BackpressureStrategy, CallbackProgression, FileName,
    LogLevel, NodeName, Path, SemanticString, ServiceName, SignalHandlingMode, ZeroCopySend,
    set_log_level, set_log_level_from_env_or,
};
