//! Descriptions that are refused: by name, in time and in little memory.

mod cases;
mod generated;
mod malformed;
mod measure;
mod mutated;
