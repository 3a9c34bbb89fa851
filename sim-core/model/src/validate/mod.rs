//! Checks of a description: everything a model relies on, refused by name.

mod cameras;
mod fault;
mod joint;
mod robot;
mod scene;
mod sensors;
mod shape;
mod tree;

pub(crate) use fault::{Culprit, Fault};
pub use scene::check_counts;
pub(crate) use shape::{collision_name, shape_sizes};
