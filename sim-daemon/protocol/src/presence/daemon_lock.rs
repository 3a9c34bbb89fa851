//! The lock of a daemon's name, and cleaning up after a daemon that died.

use std::io::ErrorKind::NotFound;
use std::io::Write;
use std::path::Path;
use std::time::Duration;

use crate::doors::exists;
use crate::doors::fs::{self, File};
use crate::doors::sync::{Arc, Mutex, PoisonError, Weak};
use crate::doors::system::files::{self, private, shared_memory};
use crate::doors::time::Instant;
use crate::presence::paths::{
    DaemonPaths, Presence, STARTING, default_root, names_with_lock, private_folder,
};
use crate::{PROTOCOL_VERSION, ProtocolError};

/// Clients and sweepers hold a lock for microseconds; if it is held longer, a daemon holds it.
const LOOK_MAX: Duration = Duration::from_millis(500);
/// A daemon has made the mark of its folder this long after the folder.
const START_MAX: Duration = Duration::from_secs(60);
/// How often the files of a daemon that still makes some are removed.
const REMOVALS: usize = 100;
/// File in the transport's folder that names root and daemon, and is locked as long as the daemon lives.
const PLACE: &str = "place";

/// Folders that the transport would make itself, readable to the group.
const TRANSPORT_FOLDERS: [&str; 2] = ["nodes", "services"];

/// The lock of a name. Holding it is being the daemon; dropping it removes what is left of the daemon's files.
#[derive(Debug)]
pub struct DaemonLock {
    paths: DaemonPaths,
    file: Arc<File>,
    /// The lock that a sweeper finds when our root folder is gone.
    mark: Option<File>,
    /// Whether its files are ours still: who removes them holds this.
    is_held: Arc<Mutex<bool>>,
}

/// The files of a [`DaemonLock`], for code that ends the process without dropping it.
#[derive(Debug, Clone)]
pub struct Remains {
    paths: DaemonPaths,
    file: Weak<File>,
    is_held: Arc<Mutex<bool>>,
}

impl DaemonLock {
    /// Takes the lock and removes what a killed predecessor left.
    ///
    /// # Errors
    /// [`ProtocolError::NameTaken`] when a daemon runs under the name; [`ProtocolError::Root`].
    pub fn take(paths: &DaemonPaths) -> Result<DaemonLock, ProtocolError> {
        let start = Instant::now();
        loop {
            if let Some(mut daemon_lock) = DaemonLock::try_take(paths)? {
                // a request of a run that was killed
                let _ = fs::remove_file(paths.stop_path());
                daemon_lock.say(STARTING)?;
                remove_shared_files(paths, None);
                daemon_lock.mark = Some(mark(paths)?);
                return Ok(daemon_lock);
            }
            let pid = match paths.presence()? {
                Presence::Running(beacon) => Some(beacon.pid),
                Presence::Starting => None,
                // a folder such as /proc/self is there, and takes no file
                _ if start.elapsed() > LOOK_MAX && !paths.takes_files() => {
                    return Err(ProtocolError::Root {
                        path: paths.root().to_owned(),
                        problem: "no file can be made in it".to_owned(),
                    });
                }
                _ if start.elapsed() > LOOK_MAX => None,
                _ => {
                    crate::doors::thread::sleep(Duration::from_millis(2));
                    continue;
                }
            };
            let name = paths.name().to_owned();
            return Err(ProtocolError::NameTaken { name, pid });
        }
    }

    /// Takes the lock if nobody has it.
    fn try_take(paths: &DaemonPaths) -> Result<Option<DaemonLock>, ProtocolError> {
        let path = paths.lock_path();
        let root_error = |error: std::io::Error| ProtocolError::root(&path, &error);
        let opened = private().create(true).truncate(false).open(&path);
        let file = match opened {
            // the last daemon there took the folder with it
            Err(error) if error.kind() == NotFound => {
                private_folder(paths.root())?;
                return Ok(None);
            }
            opened => opened.map_err(root_error)?,
        };
        // the file may have been removed between open and lock: then the lock is on nothing
        if !files::try_lock(&file).map_err(root_error)?
            || !files::is_at(&file, &path).map_err(root_error)?
        {
            return Ok(None);
        }
        // after a logout, a daemon whose lock file is gone holds only its mark
        let mark = paths.shared_folder().join(PLACE);
        match is_marked(&mark) {
            Ok(false) => {}
            Ok(true) => {
                let _ = fs::remove_file(&path);
                return Ok(None);
            }
            Err(error) => {
                let _ = fs::remove_file(&path);
                return Err(ProtocolError::root(&mark, &error));
            }
        }
        // clients of a dead predecessor see that it is gone as soon as the line is
        file.set_len(0).map_err(root_error)?;
        Ok(Some(DaemonLock {
            paths: paths.clone(),
            file: Arc::new(file),
            mark: None,
            is_held: Arc::new(Mutex::new(true)),
        }))
    }

    /// Tells clients who we are; until then they see [`Presence::Starting`]. A daemon of several `groups` has a lock for
    /// each besides its own.
    ///
    /// # Errors
    /// [`ProtocolError::Root`] when the lock file cannot be written.
    pub fn announce(&mut self, session: u64, groups: usize) -> Result<(), ProtocolError> {
        let pid = crate::doors::process::id();
        let groups = match groups {
            1 => String::new(),
            _ => format!(" {groups}"),
        };
        let line = format!("tightloop {PROTOCOL_VERSION} {pid} {session:016x}{groups}\n");
        self.say(&line)
    }

    /// Writes the line that clients read, which is longer than the one before.
    fn say(&mut self, line: &str) -> Result<(), ProtocolError> {
        files::write_at(&self.file, line.as_bytes(), 0)
            .map_err(|error| ProtocolError::root(&self.paths.lock_path(), &error))
    }

    /// Takes that line back: clients see that the daemon is gone before any of its files is, and find no run that ends.
    pub(crate) fn withdraw(&self) {
        // where that fails, they see it when the lock is free
        let _ = self.file.set_len(0);
    }

    /// Where this is.
    pub fn paths(&self) -> &DaemonPaths {
        &self.paths
    }

    /// What would be left of it.
    pub fn remains(&self) -> Remains {
        Remains {
            paths: self.paths.clone(),
            file: Arc::downgrade(&self.file),
            is_held: Arc::clone(&self.is_held),
        }
    }
}

impl Drop for DaemonLock {
    fn drop(&mut self) {
        let mut is_held = self.is_held.lock().unwrap_or_else(PoisonError::into_inner);
        if std::mem::take(&mut *is_held) {
            self.withdraw();
            remove_shared_files(&self.paths, self.mark.take());
            remove_named_files(&self.paths, &self.file);
        }
    }
}

impl Remains {
    /// Where they are.
    pub fn paths(&self) -> &DaemonPaths {
        &self.paths
    }

    /// Removes the files of a daemon that is about to end. Once its lock was dropped, the name may be another daemon's, and
    /// nothing is removed.
    pub fn remove(&self) {
        let mut is_held = self.is_held.lock().unwrap_or_else(PoisonError::into_inner);
        if !std::mem::take(&mut *is_held) {
            return;
        }
        let Some(file) = self.file.upgrade() else {
            return;
        };
        // as `DaemonLock::withdraw`
        let _ = file.set_len(0);
        // after a logout, the next daemon may have the name as soon as the mark is gone
        let is_named = files::is_at(&file, &self.paths.lock_path()).unwrap_or(true);
        // other threads of ours may be making files
        for _ in 0..REMOVALS {
            remove_shared_files(&self.paths, None);
            if !is_named || !exists(&self.paths.shared_folder()) {
                break;
            }
        }
        remove_named_files(&self.paths, &file);
    }
}

/// Whether a daemon holds the mark at this path. A mark that cannot be opened may have a daemon, too.
fn is_marked(mark: &Path) -> std::io::Result<bool> {
    match private().open(mark) {
        Err(error) if error.kind() == NotFound => Ok(false),
        opened => Ok(!files::try_lock_shared(&opened?)?),
    }
}

/// Removes the files under the daemon's root, unless another daemon has them after a logout.
fn remove_named_files(paths: &DaemonPaths, lock: &File) {
    let path = paths.lock_path();
    if files::is_at(lock, &path).unwrap_or(true) {
        let _ = fs::remove_file(paths.stop_path());
        // the file goes before the lock does, so nobody can lock a file that is about to go
        let _ = fs::remove_file(path);
    }
    remove_own_root(paths.root());
}

/// Our own folder in shared memory goes with the last daemon; any other is the user's.
pub(crate) fn remove_own_root(root: &Path) {
    if root.starts_with(shared_memory()) && root == default_root() {
        let _ = fs::remove_dir(root);
    }
}

/// Removes the files of a name in shared memory. Only the lock's holder may. Failures are left to the next start, which
/// finds what is left by the mark: that goes last. Some systems keep a folder as long as a file in it is open.
fn remove_shared_files(paths: &DaemonPaths, mark: Option<File>) {
    let folder = paths.shared_folder();
    let remove = |entry: fs::DirEntry| match entry.file_type()?.is_dir() {
        true => fs::remove_dir_all(entry.path()),
        false => fs::remove_file(entry.path()),
    };
    if let Ok(entries) = fs::read_dir(&folder) {
        let others = entries.flatten().filter(|entry| entry.file_name() != PLACE);
        // a client that closes removes its own files at the same time
        let failures = others.filter_map(|entry| remove(entry).err());
        // all are tried, also behind one that stays
        if failures.filter(|error| error.kind() != NotFound).count() == 0 {
            let _ = fs::remove_file(folder.join(PLACE));
        }
    }
    drop(mark);
    // without a descriptor, what is empty can be removed still
    for name in TRANSPORT_FOLDERS {
        let _ = fs::remove_dir(folder.join(name));
    }
    let _ = fs::remove_dir(&folder);
}

/// Makes the transport's folder with its mark.
fn mark(paths: &DaemonPaths) -> Result<File, ProtocolError> {
    let folder = private_folder(&paths.shared_folder())?;
    for name in TRANSPORT_FOLDERS {
        private_folder(&folder.join(name))?;
    }
    let (new, path) = (folder.join("place.new"), folder.join(PLACE));
    let write = || {
        let mut file = private().create_new(true).open(&new)?;
        file.write_all(&files::path_to_bytes(paths.root()))?;
        file.write_all(b"\n")?;
        file.write_all(paths.name().as_bytes())?;
        // nobody sees it before it is locked
        if !files::try_lock(&file)? {
            return Err(std::io::ErrorKind::WouldBlock.into());
        }
        fs::rename(&new, &path)?;
        Ok(file)
    };
    write().map_err(|error| ProtocolError::root(&path, &error))
}

/// Removes what a dead daemon left, its groups included. Returns whether there is nothing left, that is, false while one runs.
///
/// # Errors
/// [`ProtocolError::BadName`], [`ProtocolError::Root`].
pub fn cleanup_after_death(root: Option<&Path>, name: &str) -> Result<bool, ProtocolError> {
    let paths = DaemonPaths::new(root, name)?;
    let start = Instant::now();
    loop {
        if let Some(daemon_lock) = DaemonLock::try_take(&paths)? {
            for group in names_with_lock(root)? {
                if group.is_group() && group.daemon()? == paths {
                    drop(DaemonLock::try_take(&group)?);
                }
            }
            drop(daemon_lock); // which has cleaned
            return Ok(true);
        }
        // a client's look at the lock is no daemon, nor is somebody else's sweep: that one we wait for
        let runs = matches!(paths.presence()?, Presence::Running(_) | Presence::Starting);
        if runs || start.elapsed() > LOOK_MAX {
            return Ok(false);
        }
        crate::doors::thread::yield_now();
    }
}

/// Removes what dead daemons of any name left, under `root` and wherever else this user had daemons; every start of a daemon
/// does this.
///
/// # Errors
/// [`ProtocolError::Root`].
pub fn sweep(root: Option<&Path>) -> Result<(), ProtocolError> {
    for paths in names_with_lock(root)? {
        if matches!(paths.presence(), Ok(Presence::Absent)) {
            // what fails is left to the next sweep
            drop(DaemonLock::try_take(&paths));
        }
    }
    let Ok(entries) = fs::read_dir(shared_memory()) else {
        return Ok(());
    };
    for folder in entries.flatten() {
        let is_ours = |metadata: &fs::Metadata| metadata.is_dir() && files::is_own(metadata);
        if folder.metadata().is_ok_and(|metadata| is_ours(&metadata))
            && folder.file_name().as_encoded_bytes().starts_with(b"tl")
        {
            sweep_folder(&folder.path());
        }
    }
    Ok(())
}

/// Removes a dead daemon's files, found by the mark in its transport folder. What fails is left to the next sweep.
fn sweep_folder(folder: &Path) {
    let Ok(bytes) = fs::read(folder.join(PLACE)) else {
        return sweep_remains(folder);
    };
    let Some(end) = bytes.iter().position(|&byte| byte == b'\n') else {
        return;
    };
    let (Some(root), Ok(mark), Ok(name)) = (
        files::path_from_bytes(&bytes[..end]),
        private().open(folder.join(PLACE)),
        str::from_utf8(&bytes[end + 1..]),
    ) else {
        return;
    };
    // a daemon whose root folder somebody removed still lives
    if !files::try_lock(&mark).is_ok_and(|taken| taken) {
        return;
    }
    drop(mark);
    let had_root = exists(&root);
    let Ok(paths) = DaemonPaths::new(Some(&root), name) else {
        return;
    };
    if paths.shared_folder() == folder {
        drop(DaemonLock::try_take(&paths));
    }
    if !had_root {
        let _ = fs::remove_dir(&root);
    }
}

/// Removes a folder without a mark: its daemon could not remove it whole, for example since it had too many open files.
fn sweep_remains(folder: &Path) {
    let is_named = folder.file_name().is_some_and(|name| {
        let digits = name
            .as_encoded_bytes()
            .strip_prefix(b"tl")
            .unwrap_or_default();
        digits.len() == 16 && digits.iter().all(u8::is_ascii_hexdigit)
    });
    // one that starts makes its mark at once
    let modified = fs::symlink_metadata(folder.join(PLACE))
        .is_err_and(|error| error.kind() == NotFound)
        .then(|| fs::metadata(folder).and_then(|status| status.modified()));
    let is_old = modified
        .is_some_and(|time| time.is_ok_and(|time| time.elapsed().is_ok_and(|age| age > START_MAX)));
    if is_named && is_old {
        let _ = fs::remove_dir_all(folder);
    }
}

#[cfg(all(test, not(simulated)))]
mod tests;
