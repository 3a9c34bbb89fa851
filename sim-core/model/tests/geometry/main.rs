//! Meshes: files, mass properties, hulls.

mod files;
mod formats;
mod hulls;
mod looks;
mod mass;
mod refused;
mod thin;
