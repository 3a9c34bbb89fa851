//! Paths of meshes in a URDF file, resolved to files.

use std::path::{Component, Path, PathBuf};

use crate::files::percent_decoded;

/// What a mesh path led to.
pub(super) enum Found {
    /// The file.
    File(PathBuf),
    /// The file, in a folder that stands for a package of another name.
    Renamed {
        /// The file.
        path: PathBuf,
        /// The package that the path names.
        package: String,
        /// The folder taken for it.
        home: PathBuf,
    },
    /// No file at any of these places.
    Missing(Vec<PathBuf>),
    /// A path that is not followed, and why.
    Refused(&'static str),
}

/// Resolves a path of a URDF file that lies in `folder`.
///
/// `package://name/rest` or `model://name/rest`, with any number of slashes, is looked for in each package folder, then in
/// the folders above the file that bear or hold that name; `rest` stays inside. Copies of a package often bear another name:
/// where none of those is found, the file's own folder and the one above it stand for the package. A relative path is looked
/// for from the file's folder and may climb, but only within what belongs to the robot: the nearest folder above the file
/// with a `package.xml`, else the folder above the file's own (files lie in `urdf/` beside `meshes/`), and any package
/// folder that holds the file. An absolute path, plain or `file://`, says openly where it leads and is taken as it is; only
/// regular files of a mesh format are ever opened. Symbolic links are followed wherever they lead: a URDF file cannot make
/// one, and workspaces are installed as links to their sources.
///
/// A path that leads to no file is tried as Windows and addresses of the web write it: with backslashes, and with `%20` for
/// a blank.
pub(super) fn resolve(uri: &str, folder: &Path, package_dirs: &[PathBuf]) -> Found {
    let written = resolve_as_written(uri, folder, package_dirs);
    if !matches!(written, Found::Missing(_)) {
        return written;
    }
    let slashes = uri.trim().replace('\\', "/");
    let decoded = percent_decoded(&slashes);
    let others = [Some(slashes), decoded].into_iter().flatten();
    let mut others = others
        .filter(|other| other != uri)
        .map(|other| resolve_as_written(&other, folder, package_dirs));
    others
        .find(|other| matches!(other, Found::File(_) | Found::Renamed { .. }))
        .unwrap_or(written)
}

fn resolve_as_written(uri: &str, folder: &Path, package_dirs: &[PathBuf]) -> Found {
    let (scheme, rest) = split_scheme(uri);
    let candidates = if let Some("package" | "model") = scheme.as_deref() {
        // writers of URDF put paths together with more slashes than one
        let rest = rest.trim_start_matches('/');
        let (package, rest) = rest.split_once('/').unwrap_or((rest, ""));
        let rest = rest.trim_start_matches('/');
        if escapes(Path::new(rest)) || package == ".." {
            return Found::Refused("it leaves its package by `..`; keep it inside");
        }
        let candidates = package_candidates(package, rest, folder, package_dirs);
        if let Some(renamed) = renamed(package, rest, folder).filter(|_| !any_file(&candidates)) {
            return renamed;
        }
        candidates
    } else {
        let path = match scheme.as_deref() {
            None => Path::new(rest),
            Some("file") => Path::new(of_this_computer(rest)),
            Some(_) => return Found::Refused("it must be package://, model://, file:// or a path"),
        };
        if path.is_relative() && leaves_robot(path, folder, package_dirs) {
            return Found::Refused(
                "it leaves the robot's folder by `..`; give a folder above both in package_dirs, or an absolute path",
            );
        }
        vec![folder.join(path)]
    };
    match candidates.iter().find(|candidate| candidate.is_file()) {
        Some(file) => Found::File(file.clone()),
        None => Found::Missing(candidates),
    }
}

/// The scheme of a path in small letters, and what follows its colon and two slashes. `file:` and `package:` may have one
/// slash, as in RFC 8089.
fn split_scheme(uri: &str) -> (Option<String>, &str) {
    let none = (None, uri);
    let Some((scheme, rest)) = uri.split_once(':') else {
        return none;
    };
    let scheme = scheme.trim_start().to_ascii_lowercase();
    let known = matches!(scheme.as_str(), "file" | "package" | "model");
    match rest.strip_prefix("//") {
        Some(rest) => (Some(scheme), rest),
        None if known && rest.starts_with('/') => (Some(scheme), rest),
        None => none,
    }
}

/// The path of a `file://` address, without the host where that is this computer.
fn of_this_computer(rest: &str) -> &str {
    match rest.strip_prefix("localhost") {
        Some(path) if path.starts_with('/') => path,
        _ => rest,
    }
}

fn any_file(candidates: &[PathBuf]) -> bool {
    candidates.iter().any(|candidate| candidate.is_file())
}

/// A file of a package in a folder with another name, or of a path without a package, such as `package://wheel.obj`.
fn renamed(package: &str, rest: &str, folder: &Path) -> Option<Found> {
    let inside = if rest.is_empty() { package } else { rest };
    let folder = absolute(folder);
    let homes = [Some(folder.as_path()), folder.parent()];
    let home = homes
        .into_iter()
        .flatten()
        .find(|home| home.join(inside).is_file())?;
    Some(Found::Renamed {
        path: home.join(inside),
        package: package.to_owned(),
        home: home.to_owned(),
    })
}

/// Whether a relative path climbs out of every folder that belongs to the robot.
fn leaves_robot(path: &Path, folder: &Path, package_dirs: &[PathBuf]) -> bool {
    if !escapes(path) {
        return false;
    }
    let folder = absolute(folder);
    let target = absolute(&folder.join(path));
    let package = folder
        .ancestors()
        .find(|above| above.join("package.xml").is_file())
        .or(folder.parent());
    let given = package_dirs.iter().map(|dir| absolute(dir));
    let mut homes = given
        .filter(|dir| folder.starts_with(dir))
        .chain(package.map(Path::to_owned));
    !homes.any(|home| target.starts_with(home))
}

/// The absolute path, with `.` and `..` resolved as text.
fn absolute(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in std::path::absolute(path)
        .unwrap_or_else(|_| path.to_owned())
        .components()
    {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            part => plain.push(part),
        }
    }
    plain
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
    let folder = absolute(folder);
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
