//! Forces of joints and links.
//!
//! | file | what it computes |
//! |---|---|
//! | `command` | commands of this substep: delay and noise |
//! | `actuation` | drives: PD gains and effort limits |
//! | `actuators`, `transmission` | actuators: activation, gain, bias, and the lengths along which they act |
//! | `springs` | springs and dampers of joints and tendons |
//! | `fluid` | drag of the medium |
//! | `gravity_compensation` | links that are held against gravity |
//! | `link_forces` | forces on links, as forces on joints |

pub mod actuation;
pub mod actuators;
pub mod command;
pub mod fluid;
pub mod gravity_compensation;
pub mod link_forces;
pub mod springs;
pub mod transmission;
