//! What crosses between a daemon and its clients: headers, field tables, commands, control messages and the description.

pub(crate) mod command;
pub(crate) mod control;
pub(crate) mod description;
pub mod hash;
pub mod header;
pub(crate) mod journal_header;
pub mod table;
pub(crate) mod timing;
