//! Images of cameras in many worlds: rays against the shapes of a model, on the CPU.
//!
//! scene (what is seen, per body) → image (tiles, and what each may see) → tree, field and solids (where rays meet it) →
//! shown (colours, and what light falls on them), shade (the pixels), with shadow (which points of a tile, in the frame of
//! the light, see it)
//!
//! An image depends on its world alone: its bits are the same for any number of worlds and threads.

mod camera;
mod field;
mod image;
mod light;
mod lit;
mod normals;
mod paint;
mod parallel;
mod placed;
mod scene;
mod shade;
mod shadow;
mod shown;
mod solids;
mod tile;
mod tree;
mod vector;

pub use camera::Camera;
pub use image::{Draw, Image, Scratch, draw};
pub use light::KeyLight;
pub use paint::Paint;
pub use scene::{Look, NOTHING, Part, Scene};
pub use vector::Frame;
