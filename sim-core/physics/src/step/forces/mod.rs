//! Forces of joints and links.
//!
//! | file | what it computes |
//! |---|---|
//! | `command` | commands of this substep: delay and noise |
//! | `actuation` | drives: PD gains and effort limits |
//! | `actuators`, `transmission` | actuators: activation, gain, bias, and the lengths along which they act |
//! | `adhesion` | actuators that pull bodies to what they touch |
//! | `contact_adhesion` | contacts that pull, since their shapes adhere |
//! | `damping` | damping of actuators and tendons in an implicit step |
//! | `delays` | earlier controls that actuators follow |
//! | `motors` | DC motors: voltage, current, cogging |
//! | `muscles` | gain, bias and activation of muscles |
//! | `plasticity` | springs whose rest follows where they are stretched too far |
//! | `springs` | springs and dampers of joints and tendons |
//! | `curves` | their stiffness and damping where these are polynomials |
//! | `fluid`, `ellipsoid_fluid` | forces of the medium: on links, on geoms that count as ellipsoids |
//! | `gravity_compensation` | links that are held against gravity |
//! | `link_forces` | forces on links, as forces on joints |

pub mod actuation;
pub mod actuators;
pub mod adhesion;
pub mod command;
pub mod contact_adhesion;
pub(in crate::step) mod curves;
pub mod damping;
pub mod delays;
pub mod ellipsoid_fluid;
pub mod fluid;
pub mod gravity_compensation;
pub mod link_forces;
mod motors;
mod muscles;
pub(in crate::step) mod plasticity;
pub mod springs;
pub mod transmission;
