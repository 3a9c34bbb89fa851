//! Meshes: files, mass properties, hulls.

mod files;
mod formats;
mod hulls;
mod mass;
mod refused;
