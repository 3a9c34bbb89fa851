//! URDF files: text to `Robot`. What is ignored or mended is noted; everything else that is wrong is refused by name.
//!
//! A file is read in one pass: `source` makes the text fit for a strict XML parser, `xml` parses it, `scan` walks it along
//! `table` and checks every `value`, urdf-rs reads the robot from the scanned `element`s, and `reader` makes a `Robot` of it.
//!
//! Decisions where files in the wild differ:
//!
//! - An absent `effort` or `velocity` is no limit.
//! - A revolute or prismatic joint with neither `lower` nor `upper`, or with both the same, is unlimited, as in MuJoCo.
//! - With only one of them the other is 0, as URDF has it.
//!
//! A note reports each of these decisions.

mod element;
mod ignored;
mod joints;
mod links;
mod load;
mod markup;
mod mesh;
mod mistakes;
mod options;
mod reader;
mod scan;
mod source;
mod table;
mod value;
mod visual;
mod xacro;
mod xml;

pub use options::UrdfOptions;
