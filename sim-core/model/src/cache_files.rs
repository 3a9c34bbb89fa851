//! Files of a cache: whole or not there, checked against damage, and bounded together.
//!
//! A file is the BLAKE3 digest of its body, then the body. It is written under another name and renamed, so that processes may
//! share a folder. Whatever is wrong, the answer is that there is no such file: a cache only saves time.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::SystemTime;

use crate::files;

/// Bytes of a digest.
pub(crate) const DIGEST: usize = 32;

/// What tells bytes from all others, by accident or by intent.
pub(crate) fn digest(bytes: &[u8]) -> [u8; DIGEST] {
    *blake3::hash(bytes).as_bytes()
}

/// The body of a file that is there and not damaged; it then counts as used now.
pub(crate) fn load(path: &Path, most: u64) -> Option<Vec<u8>> {
    let mut bytes = files::read(path, most).ok()?;
    let (told, body) = bytes.split_first_chunk::<DIGEST>()?;
    if digest(body) != *told {
        return None;
    }
    // marking needs the right to write on some systems
    if let Ok(file) = fs::File::options().append(true).open(path) {
        let _ = file.set_modified(SystemTime::now());
    }
    Some(bytes.split_off(DIGEST))
}

/// Writes a file, then removes others of its folder as [`keep_within`] does.
pub(crate) fn store(path: &Path, body: &[u8], most: u64) {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    let Some(folder) = path.parent() else { return };
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let draft = path.with_extension(format!("{}-{number}", std::process::id()));
    let written = fs::create_dir_all(folder)
        .and_then(|()| fs::File::create(&draft))
        .and_then(|mut file| {
            file.write_all(&digest(body))?;
            file.write_all(body)
        })
        .and_then(|()| fs::rename(&draft, path));
    if written.is_err() {
        let _ = fs::remove_file(&draft);
    }
    keep_within(folder, most);
}

/// Removes files of a folder, those first that were used longest ago, until they have at most this many bytes together.
///
/// A file counts as used when it was last written or marked as modified. Files of killed writers go like all others.
fn keep_within(folder: &Path, most: u64) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    let mut kept: Vec<(SystemTime, u64, PathBuf)> = entries
        .filter_map(|entry| {
            let entry = entry.ok()?;
            let told = entry.metadata().ok().filter(|told| told.is_file())?;
            Some((told.modified().ok()?, told.len(), entry.path()))
        })
        .collect();
    kept.sort();
    let mut bytes: u64 = kept.iter().map(|(_, length, _)| length).sum();
    for (_, length, path) in kept {
        if bytes <= most {
            return;
        }
        // another process may have removed it already
        let _ = fs::remove_file(path);
        bytes -= length;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    struct Folder(PathBuf);

    impl Folder {
        fn new(test: &str) -> Folder {
            let name = format!("tightloop-cache-{}-{test}", std::process::id());
            Folder(std::env::temp_dir().join(name))
        }

        fn names(&self) -> Vec<String> {
            let mut names: Vec<String> = fs::read_dir(&self.0)
                .unwrap()
                .map(|entry| entry.unwrap().file_name().into_string().unwrap())
                .collect();
            names.sort();
            names
        }

        /// Makes a file seem to have been used so long ago.
        fn age(&self, name: &str, seconds: u64) {
            let then = SystemTime::now() - Duration::from_secs(seconds);
            let file = fs::File::options().write(true).open(self.0.join(name));
            file.unwrap().set_modified(then).unwrap();
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn damage_of_any_byte_is_no_file() {
        let folder = Folder::new("damage");
        let path = folder.0.join("a");
        assert_eq!(load(&path, 1000), None);
        store(&path, b"body", 1000);
        assert_eq!(load(&path, 1000).as_deref(), Some(&b"body"[..]));
        assert_eq!(folder.names(), ["a"]);
        let whole = fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 1;
            fs::write(&path, damaged).unwrap();
            assert_eq!(load(&path, 1000), None, "byte {at}");
        }
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            assert_eq!(load(&path, 1000), None, "{length} bytes");
        }
        store(&path, b"other", 1000);
        assert_eq!(load(&path, 1000).as_deref(), Some(&b"other"[..]));
    }

    #[test]
    fn what_was_used_longest_ago_goes_first() {
        let folder = Folder::new("bound");
        let [a, b, c, d] = ["a", "b", "c", "d"].map(|name| folder.0.join(name));
        // each has 132 bytes
        let body = [7; 100];
        for (path, age) in [(&a, 30), (&b, 20), (&c, 10)] {
            store(path, &body, 1000);
            folder.age(path.file_name().unwrap().to_str().unwrap(), age);
        }
        assert!(load(&a, 1000).is_some());
        store(&d, &body, 3 * 132);
        assert_eq!(folder.names(), ["a", "c", "d"]);
        store(&d, &body, 2 * 132 - 1);
        assert_eq!(folder.names(), ["d"]);
        store(&a, &[7; 1000], 500);
        assert!(folder.names().is_empty());
    }

    #[test]
    fn processes_that_write_and_remove_at_once_find_whole_files_or_none() {
        let folder = Folder::new("shared");
        let bodies: Vec<Vec<u8>> = (0..4).map(|k| vec![k; 5000]).collect();
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let (folder, bodies) = (&folder, &bodies);
                scope.spawn(move || {
                    for round in 0..100 {
                        let k = (thread + round) % 4;
                        let path = folder.0.join(k.to_string());
                        if let Some(bytes) = load(&path, 1 << 20) {
                            assert_eq!(bytes, bodies[k]);
                        }
                        store(&path, &bodies[k], 3 * 5032);
                    }
                });
            }
        });
        assert!(folder.names().len() <= 3, "{:?}", folder.names());
    }
}
