//! Descriptions that are refused: by name, in time and in little memory.

mod folder;
mod generated;
mod measure;
mod mutated;
