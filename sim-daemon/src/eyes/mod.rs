//! Cameras: what they see of each world, as fields of frames.
//!
//! fields (their names and kinds), chance (what is random of a camera), parts and paint (what there is to see) → sight (the
//! cameras that were asked for) → images (where they are in a frame) → drawing, part by part of the worlds

mod chance;
mod drawing;
mod fields;
mod images;
mod memory;
mod paint;
mod part;
mod parts;
mod sight;

pub(crate) use drawing::Eyes;
pub use fields::FrameFields;
pub(crate) use fields::known;
pub(crate) use images::Images;
pub(crate) use sight::Sight;
