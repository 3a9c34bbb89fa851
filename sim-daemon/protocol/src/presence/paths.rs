//! Paths of a daemon: lock file, transport folder, prefix of its shared memory.
//!
//! ```text
//! ROOT/NAME.lock            held by flock for the daemon's life; one line: protocol version, pid, session, how many groups if any
//! ROOT/NAME.stop            somebody asks the daemon to stop, whatever it does
//! ROOT/NAME.0.lock          of a daemon with groups: likewise for each of them, which has the rest below, too
//! SHARED/tl<hash>/            nodes, services, sockets and shared memory, each session with a prefix of its own;
//!                           `place`, locked too, names ROOT and NAME; hash is over both
//! ```
//! All of it is for one user only: folders have mode 0700 and files 0600, whatever the umask. Under systemd, `RemoveIPC=no` keeps a daemon's files when its user logs out.
//! A process that can take the lock may remove the rest. SHARED is `/dev/shm` on Linux, `/private/var/tmp` on macOS and the user's
//! temporary folder on Windows, whatever ROOT is, since the path of a Unix socket is limited to 107 bytes.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::ProtocolError;
use crate::doors::fs::{self, File, Metadata};
use crate::doors::iceoryx2::config::Config;
use crate::doors::iceoryx2::prelude::{FileName, Path as IoxPath, SemanticString};
use crate::doors::sync::OnceLock;
pub use crate::doors::system::files::shared_memory;
use crate::doors::system::files::{self, exposed, make_private_folder, own_folder_name, private};
use crate::wire::hash::Fnv;

/// The variable that names the folder of a login session.
pub const RUNTIME_FOLDER: &str = "XDG_RUNTIME_DIR";
/// What this process uses as the value of [`RUNTIME_FOLDER`] where that is unset.
static STAND_IN: OnceLock<PathBuf> = OnceLock::new();
/// Most groups that a lock file may tell of: programs ask each of them. A daemon serves 64.
const GROUPS_MAX: usize = 1024;
/// How often a folder is made again that others remove meanwhile.
const TRIES: usize = 1000;

/// A name and the root folder it is looked up in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DaemonPaths {
    root: PathBuf,
    name: String,
    stem: String,
}

/// What the lock file of a daemon says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beacon {
    /// Protocol version.
    pub protocol: u32,
    /// Process.
    pub pid: u32,
    /// Random number of the run.
    pub session: u64,
    /// Groups of worlds that clients attach to, each under a name of its own ([`DaemonPaths::group`]); 1 = there is only the daemon.
    pub groups: usize,
}

/// State of a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presence {
    /// Nobody holds the lock, or there is no lock file.
    Absent,
    /// Somebody holds it and says nothing: for an instant one who looks or cleans up, else no daemon.
    Silent,
    /// A daemon holds it and reads its scene.
    Starting,
    /// A daemon runs.
    Running(Beacon),
}

/// The root folder: `$TIGHTLOOP_ROOT`, else `$XDG_RUNTIME_DIR/tightloop`, else a folder of this user in [`shared_memory`].
pub fn default_root() -> PathBuf {
    // the stand-in is the root folder itself, which was found without it
    let session = variable(RUNTIME_FOLDER).filter(|folder| Some(folder) != STAND_IN.get());
    variable("TIGHTLOOP_ROOT")
        .or_else(|| session.map(|folder| folder.join("tightloop")))
        .unwrap_or_else(|| Path::new(shared_memory()).join(own_folder_name()))
}

/// A value of [`RUNTIME_FOLDER`] for this process, where the variable is unset: the absolute path of the root folder. A
/// process that sets it keeps its [`default_root`].
pub fn stand_in_runtime_folder() -> Option<&'static Path> {
    if variable(RUNTIME_FOLDER).is_some() {
        return None;
    }
    let root = default_root();
    let absolute = std::path::absolute(&root).unwrap_or(root);
    Some(STAND_IN.get_or_init(|| absolute))
}

fn variable(name: &str) -> Option<PathBuf> {
    let value = std::env::var_os(name).filter(|value| !value.is_empty());
    value.map(PathBuf::from)
}

impl DaemonPaths {
    /// The place of `name` under `root`, or under [`default_root`]; `NAME.0` is that of a group.
    ///
    /// # Errors
    /// [`ProtocolError::BadName`]; [`ProtocolError::Root`] when the folder cannot be made or belongs to somebody else.
    pub fn new(root: Option<&Path>, name: &str) -> Result<DaemonPaths, ProtocolError> {
        let bad = |problem| ProtocolError::BadName {
            name: name.to_owned(),
            problem,
        };
        let (daemon, _) = parts(name);
        if daemon.is_empty() {
            return Err(bad("it is empty"));
        }
        if daemon.len() > 64 {
            return Err(bad("it is too long"));
        }
        if !daemon
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_')
        {
            return Err(bad("it has a character that is not allowed"));
        }
        if let Some(problem) = files::transport_problem() {
            return Err(ProtocolError::Root {
                path: shared_memory().into(),
                problem: problem.to_owned(),
            });
        }
        let root = private_folder(&root.map_or_else(default_root, Path::to_owned))?;
        let mut hash = Fnv::new();
        hash.text(&files::folded(&root.to_string_lossy()));
        hash.text(&files::folded(name));
        Ok(DaemonPaths {
            root,
            name: name.to_owned(),
            stem: format!("tl{:016x}", hash.value()),
        })
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it is the place of a group, not of a daemon.
    pub fn is_group(&self) -> bool {
        parts(&self.name).1.is_some()
    }

    /// The place of a group of this daemon.
    ///
    /// # Errors
    /// As of [`DaemonPaths::new`].
    pub fn group(&self, number: usize) -> Result<DaemonPaths, ProtocolError> {
        DaemonPaths::new(Some(&self.root), &format!("{}.{number}", self.name))
    }

    /// The place of the daemon whose group this is; itself if it is none.
    ///
    /// # Errors
    /// As of [`DaemonPaths::new`].
    pub fn daemon(&self) -> Result<DaemonPaths, ProtocolError> {
        DaemonPaths::new(Some(&self.root), parts(&self.name).0)
    }

    /// The root folder, absolute.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The lock file.
    pub fn lock_path(&self) -> PathBuf {
        self.root.join(format!("{}.lock", self.name))
    }

    /// The file by which somebody asks the daemon to stop.
    pub(crate) fn stop_path(&self) -> PathBuf {
        self.root.join(format!("{}.stop", self.name))
    }

    /// Asks the daemon to stop, also one that is too busy to answer.
    ///
    /// # Errors
    /// [`ProtocolError::Root`] when the file cannot be made.
    pub fn ask_to_stop(&self) -> Result<(), ProtocolError> {
        let path = self.stop_path();
        let made = private().create(true).truncate(false).open(&path);
        made.map(drop)
            .map_err(|error| ProtocolError::root(&path, &error))
    }

    /// Whether somebody has asked the daemon to stop.
    pub fn is_asked_to_stop(&self) -> bool {
        fs::symlink_metadata(self.stop_path()).is_ok()
    }

    /// The transport's folder.
    pub(crate) fn shared_folder(&self) -> PathBuf {
        Path::new(shared_memory()).join(&self.stem)
    }

    /// The name of this daemon's folder in [`shared_memory`].
    pub fn stem(&self) -> &str {
        &self.stem
    }

    /// Whether a daemon runs here. Takes no lock for longer than an instant; a few microseconds.
    ///
    /// # Errors
    /// [`ProtocolError::Descriptors`] when this process has none left; [`ProtocolError::Root`] when the lock file cannot be
    /// read.
    pub fn presence(&self) -> Result<Presence, ProtocolError> {
        match self.open_lock()? {
            Some(file) => self.presence_in(&file),
            None => Ok(Presence::Absent),
        }
    }

    /// What an open lock file says, whatever became of its name.
    pub(crate) fn presence_in(&self, lock: &File) -> Result<Presence, ProtocolError> {
        match files::try_lock_shared(lock) {
            Ok(false) => read_beacon(lock).map_err(|error| self.lock_error(&error)),
            Err(error) => Err(self.lock_error(&error)),
            // the file may stay open, so closing it does not give the lock back
            Ok(true) => match files::unlock(lock) {
                Ok(()) => Ok(Presence::Absent),
                Err(error) => Err(self.lock_error(&error)),
            },
        }
    }

    /// The lock file, if there is one.
    pub(crate) fn open_lock(&self) -> Result<Option<File>, ProtocolError> {
        let opened = private().write(false).open(self.lock_path());
        match opened {
            Ok(file) => Ok(Some(file)),
            Err(error)
                if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) =>
            {
                Ok(None)
            }
            Err(error) => Err(self.lock_error(&error)),
        }
    }

    /// Whether a file can be made under the root.
    pub(crate) fn takes_files(&self) -> bool {
        // one that stays, since nobody could remove it, is a lock file that nobody holds to the next sweep
        let file = format!("{}-{}.lock", self.name, crate::doors::process::id());
        let path = self.root.join(file);
        match private().create_new(true).open(&path) {
            Ok(_) => {
                let _ = fs::remove_file(&path);
                true
            }
            Err(error) => error.kind() == ErrorKind::AlreadyExists,
        }
    }

    fn lock_error(&self, error: &std::io::Error) -> ProtocolError {
        ProtocolError::root(&self.lock_path(), error)
    }

    /// The transport's settings for one session, explicit in full: its default would read a file from the working folder.
    pub(crate) fn transport_config(&self, session: u64) -> Config {
        let mut config = Config::default();
        let prefix = format!("{:08x}_", session as u32);
        let separator = std::path::MAIN_SEPARATOR;
        let folder = format!("{}{separator}{}{separator}", shared_memory(), self.stem);
        // lengths: on Linux 28 + 9 bytes here, on macOS 36 + 9; at most 45 more for a socket; 107 and 103 are allowed
        config.global.prefix =
            FileName::new(prefix.as_bytes()).expect("digits, letters and an underscore");
        config
            .global
            .set_root_path(&IoxPath::new(folder.as_bytes()).expect("letters, digits and slashes"));
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        config
    }
}

/// Names of the daemons that run under `root`, sorted.
///
/// # Errors
/// [`ProtocolError::Root`].
pub fn running(root: Option<&Path>) -> Result<Vec<String>, ProtocolError> {
    let mut names = names_with_lock(root)?;
    names.retain(|paths| !paths.is_group() && matches!(paths.presence(), Ok(Presence::Running(_))));
    Ok(names.into_iter().map(|paths| paths.name).collect())
}

/// The name of a daemon, and the number of its group where that has one.
fn parts(name: &str) -> (&str, Option<usize>) {
    let group = name.rsplit_once('.').and_then(|(daemon, number)| {
        let group: usize = number.parse().ok()?;
        // one way to write each number
        (group.to_string() == number).then_some((daemon, Some(group)))
    });
    group.unwrap_or((name, None))
}

pub(crate) fn names_with_lock(root: Option<&Path>) -> Result<Vec<DaemonPaths>, ProtocolError> {
    let root = private_folder(&root.map_or_else(default_root, Path::to_owned))?;
    let entries = match fs::read_dir(&root) {
        Ok(entries) => entries,
        // the last daemon took the folder with it
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(ProtocolError::root(&root, &error)),
    };
    let mut places: Vec<DaemonPaths> = entries
        .flatten()
        .filter_map(|entry| {
            DaemonPaths::new(
                Some(&root),
                entry.file_name().to_str()?.strip_suffix(".lock")?,
            )
            .ok()
        })
        .collect();
    places.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(places)
}

/// The line of a daemon that starts; then comes its [`Beacon`].
pub(crate) const STARTING: &str = "tightloop starting\n";

/// What the holder of the lock says. A file that cannot be read says nothing about it.
fn read_beacon(file: &File) -> std::io::Result<Presence> {
    let mut bytes = [0; 128];
    let read = files::read_at(file, &mut bytes, 0)?;
    Ok(presence_of(&bytes[..read]))
}

/// What the bytes of a lock file say of its holder.
pub(crate) fn presence_of(bytes: &[u8]) -> Presence {
    match str::from_utf8(bytes).ok() {
        Some(STARTING) => Presence::Starting,
        text => text
            .and_then(parse_beacon)
            .map_or(Presence::Silent, Presence::Running),
    }
}

fn parse_beacon(text: &str) -> Option<Beacon> {
    let mut words = text.strip_suffix('\n')?.split(' ');
    let ("tightloop", protocol, pid, session) =
        (words.next()?, words.next()?, words.next()?, words.next()?)
    else {
        return None;
    };
    let groups = words.next().map_or(Some(1), |word| word.parse().ok())?;
    (1..=GROUPS_MAX).contains(&groups).then_some(Beacon {
        protocol: protocol.parse().ok()?,
        pid: pid.parse().ok()?,
        session: u64::from_str_radix(session, 16).ok()?,
        groups,
    })
}

/// Makes a folder that only we may use, and returns it absolute.
pub(crate) fn private_folder(path: &Path) -> Result<PathBuf, ProtocolError> {
    let error = |problem: String| ProtocolError::Root {
        path: path.to_owned(),
        problem,
    };
    let mut tries = 0;
    let (metadata, absolute) = loop {
        match made_folder(path) {
            Ok(made) => break made,
            // the last daemon there takes the folder with it, maybe right now: it was there, and is no folder any more
            Err(cause) if files::is_passing(&cause) && tries < TRIES => tries += 1,
            Err(cause) => return Err(ProtocolError::root(path, &cause)),
        }
    };
    if metadata.is_symlink() {
        return Err(error("it is a link; remove it".to_owned()));
    }
    match exposed(&metadata) {
        Some(problem) => Err(error(problem)),
        None => Ok(absolute),
    }
}

fn made_folder(path: &Path) -> std::io::Result<(Metadata, PathBuf)> {
    make_private_folder(path)?;
    // everybody may make links in shared memory, at names that can be guessed
    let metadata = match path.starts_with(shared_memory()) {
        true => fs::symlink_metadata(path)?,
        false => fs::metadata(path)?,
    };
    Ok((metadata, files::absolute(path)?))
}

#[cfg(all(test, not(simulated)))]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_no_groups_or_of_more_than_anybody_serves_is_no_daemon() {
        let presence = |groups: &str| {
            let line = format!("tightloop 5 7 00000000deadbeef{groups}\n");
            presence_of(line.as_bytes())
        };
        assert!(matches!(presence(""), Presence::Running(beacon) if beacon.groups == 1));
        assert!(matches!(presence(" 64"), Presence::Running(beacon) if beacon.groups == 64));
        for groups in [
            " 0",
            " 1025",
            " 18446744073709551615",
            " 99999999999999999999",
        ] {
            assert_eq!(presence(groups), Presence::Silent, "{groups}");
        }
    }

    #[test]
    fn names_with_slashes_dots_or_nothing_are_refused() {
        let names = ["", "a/b", "..", "a.lock", "ä", &"x".repeat(65)];
        for name in [&names[..], &[".0", "a.", "a.-1", "a.01", "a.0.0", "a/b.0"]].concat() {
            assert!(
                matches!(
                    DaemonPaths::new(None, name),
                    Err(ProtocolError::BadName { .. })
                ),
                "{name:?}"
            );
        }
    }

    #[cfg(unix)] // Windows lets few users make links
    #[test]
    fn a_link_in_shared_memory_is_not_followed() {
        let name = format!("tightloop-link-{}", std::process::id());
        let (target, link) = (
            std::env::temp_dir().join(&name),
            Path::new(shared_memory()).join(format!("{name}-link")),
        );
        fs::create_dir(&target).unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        let refused = DaemonPaths::new(Some(&link), "name");
        fs::remove_file(&link).unwrap();
        fs::remove_dir(&target).unwrap();
        assert!(
            matches!(&refused, Err(ProtocolError::Root { problem, .. }) if problem.contains("link")),
            "{refused:?}"
        );
    }

    #[cfg(unix)] // on Windows the folder stays, since the lock file in it is open
    #[test]
    fn a_folder_that_others_remove_meanwhile_is_made_again() {
        use std::sync::atomic::{AtomicBool, Ordering};

        let path = std::env::temp_dir().join(format!("tightloop-races-{}", std::process::id()));
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) {
                    let _ = fs::remove_dir(&path);
                }
            });
            let made: Vec<_> = (0..2000)
                .map(|_| (private_folder(&path), names_with_lock(Some(&path))))
                .collect();
            stop.store(true, Ordering::Relaxed);
            for (folder, names) in made {
                assert_eq!(folder.unwrap(), path);
                assert!(names.unwrap().is_empty());
            }
        });
        let _ = fs::remove_dir(&path);
    }
}
