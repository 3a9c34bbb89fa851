//! Names the code that makes meshes, so that meshes kept by other code are not used.

use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash as _, Hasher as _};
use std::path::{Path, PathBuf};

fn main() {
    let mut hasher = DefaultHasher::new();
    // the lock file has the versions of the libraries; a package without one is built with others
    let mut paths = files(Path::new("src/geometry"));
    paths.push(PathBuf::from("../../Cargo.lock"));
    for path in paths.iter().filter(|path| path.exists()) {
        println!("cargo::rerun-if-changed={}", path.display());
        path.hash(&mut hasher);
        fs::read(path)
            .expect("a source file is readable")
            .hash(&mut hasher);
    }
    // a new file
    println!("cargo::rerun-if-changed=src/geometry");
    let version = std::env::var("CARGO_PKG_VERSION").expect("cargo sets it");
    println!(
        "cargo::rustc-env=TIGHTLOOP_GEOMETRY_CODE={version}-{:016x}",
        hasher.finish()
    );
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).expect("a source folder is readable") {
        let path = entry.expect("a source folder is readable").path();
        match path.is_dir() {
            true => paths.extend(files(&path)),
            false => paths.push(path),
        }
    }
    paths.sort();
    paths
}
