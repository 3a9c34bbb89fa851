//! A folder of compiled programs: SPIR-V by source, and the driver's pipeline cache by driver version.
//!
//! A file is `MAGIC`, the FNV-1a hash of the rest, then the rest. It is written under another name first and then renamed. Files that
//! are damaged or of another version are ignored, and so are failures to write: the cache only saves time. Of more bytes than
//! [`BYTES_MAX`], the files used longest ago go first.

use crate::shader::module::{Binding, Module};
use crate::shader::source::Source;
use std::fs::{DirEntry, Metadata, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::SystemTime;

/// Head of every file. Increase the number when the file layout or the translation changes.
const MAGIC: &[u8; 8] = b"tldev 05";

/// Most bytes of programs, and of drivers: a hundred large models have less.
pub(crate) const BYTES_MAX: u64 = 256 << 20;

/// Translator of WGSL to SPIR-V; another version may give other SPIR-V.
const WRITER: &str = "naga 30.0.1";

/// A folder of compiled programs.
pub(crate) struct Cache {
    folder: PathBuf,
    /// File of the driver's pipeline cache.
    driver: PathBuf,
    /// Programs whose SPIR-V was found.
    pub hits: AtomicUsize,
    /// Hash of the pipeline cache in the file.
    kept: AtomicU64,
}

impl Cache {
    /// `driver` names device and driver version, in characters that a file name may have.
    pub fn new(folder: &Path, driver: &str) -> Cache {
        let _ = std::fs::create_dir_all(folder);
        Cache {
            folder: folder.to_owned(),
            driver: folder.join(format!("driver-{driver}")),
            hits: AtomicUsize::new(0),
            kept: AtomicU64::new(0),
        }
    }

    /// The program, if its SPIR-V is stored.
    pub fn module(&self, source: &Source) -> Option<Module> {
        let key = key(source);
        let path = self.file(&key);
        let body = load(&path)?;
        let module = parse(&body, &key)?;
        mark_as_used(&path);
        self.hits.fetch_add(1, Ordering::Relaxed);
        Some(module)
    }

    /// Whether the SPIR-V of a program is stored.
    pub fn knows(&self, source: &Source) -> bool {
        self.file(&key(source)).exists()
    }

    /// Stores a program.
    pub fn keep_module(&self, source: &Source, module: &Module) {
        let key = key(source);
        store(&self.file(&key), &print(module, &key));
    }

    /// The driver's pipeline cache of an earlier run; empty if there is none.
    pub fn pipelines(&self) -> Vec<u8> {
        let body = load(&self.driver).unwrap_or_default();
        self.kept.store(fnv(&body), Ordering::Relaxed);
        mark_as_used(&self.driver);
        body
    }

    /// Stores the driver's pipeline cache, if it changed.
    pub fn keep_pipelines(&self, body: &[u8]) {
        if self.kept.swap(fnv(body), Ordering::Relaxed) != fnv(body) {
            store(&self.driver, body);
        }
    }

    /// Removes the files used longest ago, where there are too many: once for all programs of a model.
    pub fn keep_within_bounds(&self) {
        for prefix in ["program-", "driver-"] {
            bound(&self.folder, prefix, BYTES_MAX);
        }
    }

    fn file(&self, key: &[u8]) -> PathBuf {
        self.folder.join(format!("program-{:016x}", fnv(key)))
    }
}

/// Everything that the SPIR-V depends on. The file holds it too, so that a hash collision does no harm.
fn key(source: &Source) -> Vec<u8> {
    let mut key = Vec::new();
    let mut put = |bytes: &[u8]| {
        key.extend((bytes.len() as u64).to_le_bytes());
        key.extend(bytes);
    };
    put(WRITER.as_bytes());
    put(env!("CARGO_PKG_VERSION").as_bytes());
    put(source.entry.as_bytes());
    put(source.wgsl.as_bytes());
    for (name, value) in &source.constants {
        put(name.as_bytes());
        put(&value.to_bits().to_le_bytes());
    }
    key
}

fn print(module: &Module, key: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    let mut put = |word: u32| body.extend(word.to_le_bytes());
    put(module.workgroup);
    put(module.bindings.len() as u32);
    for binding in &module.bindings {
        put(binding.number);
        put(u32::from(binding.read_only));
    }
    put(module.spirv.len() as u32);
    module.spirv.iter().copied().for_each(&mut put);
    body.extend(key);
    body
}

fn parse(body: &[u8], key: &[u8]) -> Option<Module> {
    let mut rest = body;
    let mut word = || {
        let (first, others) = rest.split_first_chunk::<4>()?;
        rest = others;
        Some(u32::from_le_bytes(*first))
    };
    let workgroup = word()?;
    let mut bindings = Vec::new();
    for _ in 0..word()? {
        bindings.push(Binding {
            number: word()?,
            read_only: word()? == 1,
        });
    }
    let mut spirv = Vec::new();
    for _ in 0..word()? {
        spirv.push(word()?);
    }
    (rest == key).then_some(Module {
        bindings,
        workgroup,
        spirv,
    })
}

fn load(path: &Path) -> Option<Vec<u8>> {
    let bytes = std::fs::read(path).ok()?;
    let (magic, rest) = bytes.split_first_chunk::<8>()?;
    let (hash, body) = rest.split_first_chunk::<8>()?;
    (magic == MAGIC && u64::from_le_bytes(*hash) == fnv(body)).then(|| body.to_vec())
}

/// Writes a whole file or nothing: several processes may share the folder.
fn store(path: &Path, body: &[u8]) {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let draft = path.with_extension(format!("{}-{number}", std::process::id()));
    let bytes = [&MAGIC[..], &fnv(body).to_le_bytes(), body].concat();
    if std::fs::write(&draft, bytes).is_err() || std::fs::rename(&draft, path).is_err() {
        let _ = std::fs::remove_file(&draft);
    }
}

/// Makes a file the one used last; one that is gone stays so.
fn mark_as_used(path: &Path) {
    if let Ok(file) = OpenOptions::new().append(true).open(path) {
        let _ = file.set_modified(SystemTime::now());
    }
}

/// Removes the files of a folder that begin with `prefix`, those used longest ago first, while they have more bytes than
/// `limit`. The newest one stays. Drafts of killed processes are among them.
///
/// Several processes may do so at once: what another one removed is not missed, and who has a file open reads on.
pub fn bound(folder: &Path, prefix: &str, limit: u64) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    let has_prefix = |entry: &DirEntry| entry.file_name().to_string_lossy().starts_with(prefix);
    let files = entries.flatten().filter(has_prefix).filter_map(|entry| {
        let status = entry.metadata().ok().filter(Metadata::is_file)?;
        Some((status.modified().ok()?, status.len(), entry.path()))
    });
    let mut files: Vec<_> = files.collect();
    let mut bytes: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
    if bytes <= limit {
        return;
    }
    files.sort();
    files.pop();
    for (_, length, path) in files {
        // not every new file is to remove another one
        if bytes <= limit / 8 * 7 {
            return;
        }
        let _ = std::fs::remove_file(path);
        bytes -= length;
    }
}

/// FNV-1a, 64 bits: detects damage and names files. It does not resist attackers.
fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn files_used_longest_ago_go_first_and_the_newest_stays() {
        let folder = std::env::temp_dir().join(format!("tightloop-cache-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let write = |name: &str, bytes: usize, age: u64| {
            std::fs::write(folder.join(name), vec![0; bytes]).unwrap();
            let file = OpenOptions::new().append(true).open(folder.join(name));
            let then = SystemTime::now() - Duration::from_secs(age);
            file.unwrap().set_modified(then).unwrap();
        };
        let names = || {
            let entries = std::fs::read_dir(&folder).unwrap().flatten();
            let names = entries.map(|entry| entry.file_name().into_string().unwrap());
            let mut names: Vec<_> = names.collect();
            names.sort();
            names
        };
        for k in 0..10 {
            write(&format!("program-{k}"), 100, 10 - k);
        }
        write("driver-a", 5000, 100);
        bound(&folder, "program-", 1000);
        assert_eq!(names().len(), 11, "they are at the limit, and not beyond");
        mark_as_used(&folder.join("program-0"));
        write("program-new", 100, 0);
        bound(&folder, "program-", 1000);
        let left = names();
        for gone in ["program-1", "program-2", "program-3"] {
            assert!(!left.contains(&gone.to_owned()), "{left:?}");
        }
        for stays in ["driver-a", "program-0", "program-9", "program-new"] {
            assert!(left.contains(&stays.to_owned()), "{left:?}");
        }
        assert_eq!(left.len(), 9);
        // one that is larger alone is there for who wrote it
        write("program-huge", 5000, 0);
        bound(&folder, "program-", 1000);
        assert_eq!(names(), ["driver-a", "program-huge"]);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
