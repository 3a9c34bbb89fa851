//! Many worlds: the table of fields, their layout in a frame, and one block of worlds at work.

mod block;
mod fields;
mod layout;
pub mod status;

pub use crate::constants::Sizes;
pub use block::{Block, Numbers, Slot as WorkSlot, Workspace};
pub use fields::{Axis, Dtype, Field, FieldDtype, FieldRow, Group};
pub use layout::{Layout, Slot};
