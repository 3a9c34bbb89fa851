//! Paths as a scene file writes them: relative to the file.

use std::path::{Component, Path, PathBuf};

/// The way from `folder` to `path`, both absolute or relative to the working directory.
///
/// Symbolic links are not followed, so the result is right where `..` is.
pub(crate) fn relative_to(folder: &Path, path: &Path) -> PathBuf {
    let (from, to) = (lexical(folder), lexical(path));
    let shared = from
        .components()
        .zip(to.components())
        .take_while(|(a, b)| a == b)
        .count();
    // with nothing but the root in common the way leads through all of the file system
    if shared <= 1 {
        return to;
    }
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(to.components().skip(shared)).collect()
}

/// Absolute, without `.` and `..`.
fn lexical(path: &Path) -> PathBuf {
    // the folder of `robot.urdf` is the empty path, which has no absolute form
    let path = Path::new(".").join(path);
    let absolute = std::path::absolute(&path).unwrap_or(path);
    let mut clean = PathBuf::new();
    for component in absolute.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                clean.pop();
            }
            component => clean.push(component),
        }
    }
    clean
}
