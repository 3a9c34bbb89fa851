//! Files that somebody names: opened only where they are files, and read up to a limit.
//!
//! A pipe may be waited for without end, and a device may have no end.

use std::fs::{File, OpenOptions};
use std::io::Read as _;
use std::path::Path;

use crate::error::ModelError;

/// Why a file is not read.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// What the operating system said.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// A folder, a pipe, a socket or a device.
    #[error("it is not a file")]
    NotAFile,
    /// More bytes than anybody needs.
    #[error("it is larger than the limit of {} MiB", limit >> 20)]
    TooLarge {
        /// Most bytes that are read.
        limit: u64,
    },
}

impl FileError {
    /// What is wrong, for a message that says itself that the file cannot be read.
    pub fn reason(&self) -> String {
        match self {
            FileError::Read(problem) => problem.to_string(),
            other => other.to_string(),
        }
    }

    /// As the error of a robot's or a model's file.
    pub(crate) fn at_path(&self, path: &Path) -> ModelError {
        ModelError::File {
            path: path.to_owned(),
            reason: self.reason(),
        }
    }
}

/// Opens a file to read; waits for nobody.
///
/// # Errors
/// What the system says; [`FileError::NotAFile`].
pub fn open(path: &Path) -> Result<File, FileError> {
    let file = to_read()
        .open(path)
        .map_err(|problem| match is_of_a_device(&problem) {
            true => FileError::NotAFile,
            false => FileError::Read(problem),
        })?;
    match file.metadata()?.is_file() && !is_of_processes(&file) {
        true => Ok(file),
        false => Err(FileError::NotAFile),
    }
}

/// Whether it is a socket, or a device without a driver.
#[cfg(unix)]
fn is_of_a_device(problem: &std::io::Error) -> bool {
    use rustix::io::Errno;

    [Errno::NXIO, Errno::NODEV]
        .map(|errno| Some(errno.raw_os_error()))
        .contains(&problem.raw_os_error())
}

#[cfg(not(unix))]
fn is_of_a_device(_: &std::io::Error) -> bool {
    false
}

/// Whether it lies in `/proc`: those say that they are files of no bytes, and reading some waits or takes what others read.
#[cfg(target_os = "linux")]
fn is_of_processes(file: &File) -> bool {
    rustix::fs::fstatfs(file).is_ok_and(|system| system.f_type == rustix::fs::PROC_SUPER_MAGIC)
}

#[cfg(not(target_os = "linux"))]
fn is_of_processes(_: &File) -> bool {
    false
}

/// A pipe without a writer would be waited for, and a terminal would become that of this process.
#[cfg(unix)]
fn to_read() -> OpenOptions {
    use rustix::fs::OFlags;
    use std::os::unix::fs::OpenOptionsExt as _;

    let flags = OFlags::NONBLOCK | OFlags::NOCTTY;
    let mut options = OpenOptions::new();
    options.read(true).custom_flags(flags.bits() as i32);
    options
}

/// No pipe or terminal has the name of a file.
#[cfg(not(unix))]
fn to_read() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true);
    options
}

/// The bytes of a file of at most `limit` of them.
///
/// # Errors
/// As [`open`], and [`FileError::TooLarge`].
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>, FileError> {
    let file = open(path)?;
    let length = file.metadata()?.len();
    // a file that is too large is not read to find out
    if length > limit {
        return Err(FileError::TooLarge { limit });
    }
    let mut bytes = Vec::with_capacity(length as usize);
    // it may grow meanwhile
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(FileError::TooLarge { limit });
    }
    Ok(bytes)
}

/// A path with `%20` and its like written out; `None` where that is no text.
pub(crate) fn percent_decoded(text: &str) -> Option<String> {
    let mut parts = text.split('%');
    let mut bytes = parts.next()?.as_bytes().to_vec();
    for part in parts {
        let code = part
            .get(..2)
            .filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()))
            .and_then(|digits| u8::from_str_radix(digits, 16).ok());
        match code {
            Some(byte) => {
                bytes.push(byte);
                bytes.extend(&part.as_bytes()[2..]);
            }
            None => {
                bytes.push(b'%');
                bytes.extend(part.as_bytes());
            }
        }
    }
    let text = String::from_utf8(bytes).ok()?;
    (!text.contains('\0')).then_some(text)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn only_files_up_to_a_limit_are_read_and_nobody_is_waited_for() {
        let folder = std::env::temp_dir().join(format!("tightloop-files-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (pipe, file) = (folder.join("pipe"), folder.join("file"));
        rustix::fs::mknodat(
            rustix::fs::CWD,
            &pipe,
            rustix::fs::FileType::Fifo,
            rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR,
            0,
        )
        .unwrap();
        std::fs::write(&file, [7; 100]).unwrap();
        let socket = folder.join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        for path in [
            &pipe,
            &folder,
            &socket,
            Path::new("/dev/zero"),
            Path::new("/dev/null"),
            Path::new("/proc/self/maps"),
        ] {
            let read = read(path, 1 << 20);
            assert!(
                matches!(read, Err(FileError::NotAFile)),
                "{path:?}: {read:?}"
            );
        }
        assert_eq!(read(&file, 100).unwrap(), [7; 100]);
        let read_less = read(&file, 99);
        assert!(matches!(read_less, Err(FileError::TooLarge { limit: 99 })));
        let missing = read(&folder.join("nothing"), 1).unwrap_err();
        assert!(missing.to_string().contains("No such file"), "{missing}");
        std::fs::remove_dir_all(folder).unwrap();
    }
}
