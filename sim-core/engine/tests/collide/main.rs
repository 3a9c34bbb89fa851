//! Contacts of two shapes: closed forms, exact oracles, parry3d, and the same bits whatever the width of a block.

mod capsule_boxes;
mod hulls;
mod lanes;
mod oracle;
mod parry;
mod primitives;
mod resting;
mod shapes;
