//! Meshes: files, mass properties, hulls.

mod files;
mod formats;
mod hulls;
mod kept;
mod looks;
mod mass;
mod oddities;
mod refused;
mod thin;
