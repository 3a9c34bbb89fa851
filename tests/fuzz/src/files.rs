//! Files for readers that take a path: a folder of this thread, in memory where the system has such a place.

use std::path::{Path, PathBuf};

/// A folder that is removed with its files.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

thread_local! {
    static FOLDER: Folder = made();
}

fn made() -> Folder {
    let shared = Path::new("/dev/shm");
    let parent = match shared.is_dir() {
        true => shared.to_owned(),
        false => std::env::temp_dir(),
    };
    let thread = format!("{:?}", std::thread::current().id());
    let digits: String = thread.chars().filter(char::is_ascii_digit).collect();
    let folder = parent.join(format!("tightloop-fuzz-{}-{digits}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("the folder can be made");
    Folder(folder)
}

/// Writes a file of this name, and returns its path. The next one of the name replaces it.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    FOLDER.with(|folder| {
        let path = folder.0.join(name);
        std::fs::write(&path, bytes).expect("the file can be written");
        path
    })
}
