//! Where a mesh named in a URDF file lies.

use std::path::{Component, Path, PathBuf};

/// What a mesh path led to.
pub(super) enum Found {
    /// The file.
    File(PathBuf),
    /// No file at any of these places.
    Missing(Vec<PathBuf>),
    /// A path that is not followed, and why.
    Refused(&'static str),
}

/// Resolves a path of a URDF file that lies in `folder`.
///
/// `package://name/rest` is looked for in each package folder, then in the folders above the file that bear or hold that
/// name; `file://` and plain paths are taken as they are, relative ones from `folder`.
pub(super) fn resolve(uri: &str, folder: &Path, package_dirs: &[PathBuf]) -> Found {
    let packaged = uri
        .strip_prefix("package://")
        .or_else(|| uri.strip_prefix("model://"));
    let candidates = if let Some(rest) = packaged {
        let (package, rest) = rest.split_once('/').unwrap_or((rest, ""));
        if escapes(Path::new(rest)) || package == ".." {
            return Found::Refused("it leaves its package by `..`; keep it inside");
        }
        package_candidates(package, rest, folder, package_dirs)
    } else if let Some(path) = uri.strip_prefix("file://") {
        vec![folder.join(path)]
    } else if uri.contains("://") {
        return Found::Refused("it must be package://, file:// or a path");
    } else {
        vec![folder.join(uri)]
    };
    match candidates.iter().find(|candidate| candidate.is_file()) {
        Some(file) => Found::File(file.clone()),
        None => Found::Missing(candidates),
    }
}

fn package_candidates(
    package: &str,
    rest: &str,
    folder: &Path,
    package_dirs: &[PathBuf],
) -> Vec<PathBuf> {
    let mut candidates = Vec::new();
    let mut add = |candidate: PathBuf| {
        if !candidates.contains(&candidate) {
            candidates.push(candidate);
        }
    };
    for dir in package_dirs {
        add(dir.join(package).join(rest));
        if dir.file_name().is_some_and(|name| name == package) {
            add(dir.join(rest));
        }
    }
    // a relative folder has no ancestors to walk
    let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    for ancestor in folder.ancestors() {
        if ancestor.file_name().is_some_and(|name| name == package) {
            add(ancestor.join(rest));
        }
        if ancestor.join(package).is_dir() {
            add(ancestor.join(package).join(rest));
        }
    }
    if candidates.is_empty() {
        candidates.push(Path::new(package).join(rest));
    }
    candidates
}

/// Whether a relative path climbs above its start, or is not relative.
fn escapes(path: &Path) -> bool {
    let mut depth = 0_i64;
    path.components().any(|component| {
        match component {
            Component::Normal(_) => depth += 1,
            Component::ParentDir => depth -= 1,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return true,
        }
        depth < 0
    })
}
