//! Readers of bytes from outside, each as a function of any bytes: fuzz targets call one, `tests/corpora.rs` calls all.
//!
//! A reader returns, or panics where it broke a promise. What it refuses is no fault. A panic, a hang, a stack overflow
//! and memory far beyond the bytes given are faults, which the limits of a run find.

pub mod compiler;
mod files;
pub mod mesh;
pub mod mujoco;
pub mod policy;
pub mod protocol;
pub mod urdf;

/// A reader of any bytes.
pub type Reader = fn(&[u8]);

/// Each reader by the name of its fuzz target, which is that of its corpus, too.
pub const READERS: [(&str, Reader); 15] = [
    ("beacon", protocol::beacon),
    ("command", protocol::command),
    ("control", protocol::control),
    ("description", protocol::description),
    ("journal", protocol::journal),
    ("table", protocol::table),
    ("program", compiler::program),
    ("onnx", policy::onnx),
    ("urdf", urdf::urdf),
    ("mesh_stl", mesh::stl),
    ("mesh_obj", mesh::obj),
    ("mesh_dae", mesh::dae),
    ("mesh_gltf", mesh::gltf),
    ("mujoco_file", mujoco::file),
    ("mujoco_arrays", mujoco::arrays),
];
