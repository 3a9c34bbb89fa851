//! What a command writes: files that a user names, whole or not at all, and results on standard output.

use std::fs::{self, File, Metadata, OpenOptions};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::terminal::printable;

use sim_system::files;

pub(crate) use sim_system::files::open_to_write as open;

/// Writes a file beside its place and renames it, so that a full disk leaves what was there before.
///
/// A link stays and its target is replaced. A device or a pipe is written to.
///
/// # Errors
/// What the system says.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if there(path)?.is_some_and(|there| !there.is_file()) {
        return open(path, OpenOptions::new().write(true))?.write_all(bytes);
    }
    let mut part = Part::new(path)?;
    part.file.write_all(bytes)?;
    part.keep()
}

/// What is at a path, behind a link.
///
/// # Errors
/// What the system says, where it cannot tell: a guess might replace a device, or what is private by what is not.
pub(crate) fn there(path: &Path) -> io::Result<Option<Metadata>> {
    absent(fs::metadata(path))
}

/// Where a file goes: of a link that leads somewhere, its target.
fn target(place: &Path) -> io::Result<PathBuf> {
    let is_link = absent(fs::symlink_metadata(place))?.is_some_and(|there| there.is_symlink());
    let behind = is_link.then(|| absent(fs::canonicalize(place)));
    Ok(behind
        .transpose()?
        .flatten()
        .unwrap_or_else(|| place.to_owned()))
}

fn absent<T>(found: io::Result<T>) -> io::Result<Option<T>> {
    match found {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        found => found.map(Some),
    }
}

/// A file in the making, beside its place: dropping it removes it, and what was in its place stays.
pub(crate) struct Part {
    file: File,
    path: PathBuf,
    target: PathBuf,
    kept: bool,
}

impl Part {
    /// Makes an empty one with the permissions of what it is to replace. A link stays and its target is replaced.
    ///
    /// # Errors
    /// What the system says.
    pub(crate) fn new(place: &Path) -> io::Result<Part> {
        let target = target(place)?;
        let path = beside(&target);
        let file = File::create_new(&path)?;
        Part::made(file, path, target).with_permissions()
    }

    /// The same under a name that a user knows, such as `run.part.tlrec`: if the process is killed, it stays, and the next one
    /// takes its place.
    ///
    /// # Errors
    /// `ResourceBusy` where another process writes it; what the system says.
    pub(crate) fn named(place: &Path) -> io::Result<Part> {
        let target = target(place)?;
        let mut name = target.file_stem().unwrap_or_default().to_owned();
        name.push(".part");
        if let Some(ending) = target.extension() {
            name.push(".");
            name.push(ending);
        }
        let path = target.with_file_name(name);
        loop {
            match File::create_new(&path) {
                Ok(file) => {
                    let mut part = Part::made(file, path.clone(), target.clone());
                    // who removes it in between has taken it for that of a killed process
                    if files::try_lock(&part.file)? && files::is_at(&part.file, &path)? {
                        return part.with_permissions();
                    }
                    part.kept = true;
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                    let there = fs::symlink_metadata(&path)?;
                    if !there.is_file() || !files::try_lock(&File::open(&path)?)? {
                        return Err(ErrorKind::ResourceBusy.into());
                    }
                    fs::remove_file(&path)?;
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn made(file: File, path: PathBuf, target: PathBuf) -> Part {
        Part {
            file,
            path,
            target,
            kept: false,
        }
    }

    /// First: what it replaces may be private.
    fn with_permissions(self) -> io::Result<Part> {
        if let Some(there) = there(&self.target)? {
            self.file.set_permissions(there.permissions())?;
        }
        Ok(self)
    }

    /// The file to write, for a thread of its own.
    ///
    /// # Errors
    /// What the system says.
    pub(crate) fn file(&self) -> io::Result<File> {
        self.file.try_clone()
    }

    /// Puts it in its place.
    ///
    /// # Errors
    /// What the system says; what was there stays.
    pub(crate) fn keep(mut self) -> io::Result<()> {
        // or a power cut might leave the name with nothing behind it
        self.file.sync_all()?;
        fs::rename(&self.path, &self.target)?;
        self.kept = true;
        Ok(())
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if !self.kept {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// A path in the same folder, of a name that nobody else has.
pub(crate) fn beside(path: &Path) -> PathBuf {
    let number = RandomState::new().build_hasher().finish();
    path.with_file_name(format!(".tightloop-{number:016x}"))
}

/// What `top` begins with to draw anew; no other code reaches a terminal.
const CLEAR: &str = "\x1b[H\x1b[J";

/// Prints a result, with codes for terminals as [`printable`] shows them. Its reader may stop reading.
///
/// # Errors
/// What the system says, such as that the disk behind standard output is full.
pub(crate) fn print(text: &[u8]) -> io::Result<()> {
    let text = String::from_utf8_lossy(text);
    let (clear, rest) = match text.strip_prefix(CLEAR) {
        Some(rest) => (CLEAR, rest),
        None => ("", &*text),
    };
    let text = format!("{clear}{}", printable(rest));
    let mut stdout = io::stdout().lock();
    match stdout
        .write_all(text.as_bytes())
        .and_then(|()| stdout.flush())
    {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    struct Folder(PathBuf);

    impl Folder {
        fn new(test: &str) -> Folder {
            let name = format!("tightloop-output-{test}-{}", std::process::id());
            let path = std::env::temp_dir().join(name);
            fs::create_dir_all(&path).unwrap();
            Folder(path)
        }

        fn names(&self) -> Vec<String> {
            let entries = fs::read_dir(&self.0).unwrap();
            let mut names: Vec<_> = entries
                .map(|entry| entry.unwrap().file_name().into_string().unwrap())
                .collect();
            names.sort();
            names
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_file_is_replaced_as_a_whole_with_its_permissions_and_behind_its_links() {
        let folder = Folder::new("replaced");
        let (file, link) = (folder.0.join("file"), folder.0.join("link"));
        write(&file, b"first").unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).unwrap();
        symlink(&file, &link).unwrap();
        write(&link, b"second").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"second");
        assert_eq!(
            fs::metadata(&file).unwrap().permissions().mode() & 0o777,
            0o640
        );
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(folder.names(), ["file", "link"]);
    }

    #[test]
    fn what_cannot_be_written_leaves_nothing_behind_and_devices_stay() {
        let folder = Folder::new("refused");
        assert!(write(&folder.0.join("missing/file"), b"x").is_err());
        assert!(write(&folder.0, b"x").is_err());
        write(Path::new("/dev/null"), b"x").unwrap();
        assert!(write(Path::new("/dev/full"), b"x").is_err());
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
        assert_eq!(folder.names(), [""; 0]);
    }
}
