//! Pictures of worlds: triangles to pixels on the processor, without a window, a display or a graphics driver.
//!
//! A renderer of our own, because libraries that draw ask for a driver, and a machine that trains often has none that
//! draws. The same scene gives the same bytes, on any number of threads: corners are whole numbers, sums have an order.
//!
//! mesh (what is drawn) → project (where its triangles fall, tile by tile) → tile (who is seen) → shade (in what light),
//! with shadows from a second, smaller picture as the light sees it, and marks (lines and dots) on top.

mod clip;
mod cover;
mod lamps;
mod marks;
mod mesh;
mod normals;
mod outlines;
mod project;
mod rays;
mod renderer;
mod shade;
mod shadow;
mod single;
#[cfg(test)]
mod tests;
mod threads;
mod tile;
pub mod vector;
mod view;

pub use lamps::Lamp;
pub use marks::Line;
pub use mesh::{Mesh, MeshError, Shading};
pub use renderer::{Instance, Renderer, Shot};
pub use view::View;

/// Red, green, blue.
pub type Rgb = [u8; 3];
