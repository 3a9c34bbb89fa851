//! Many worlds: the table of arrays, their layout in a frame, and one block of worlds at work.

mod define;
mod element;
mod fields;
mod layout;
mod pause;
pub mod status;
mod table;

pub use crate::constants::Sizes;
pub use define::Flat;
pub use fields::{Axis, Command, Dtype, FieldDtype, FieldRow, Group, Keeper, Takes};
pub use layout::{Layout, Slot};
pub use pause::Pause;
pub use table::{Array, Block, Field, Source, Workspace, Writer};
