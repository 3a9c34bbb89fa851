//! A folder of compiled programs: SPIR-V by source, and the driver's pipeline cache by driver version.
//!
//! A file is `MAGIC`, the FNV-1a hash of the rest, then the rest. It is written under another name first and then renamed. Files that
//! are damaged or of another version are ignored, and so are failures to write: the cache only saves time.

use crate::module::{Binding, Module};
use crate::source::Source;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Head of every file. Increase the number when the file layout or the translation changes.
const MAGIC: &[u8; 8] = b"tldev 04";

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
        let body = load(&self.file(&key))?;
        let module = parse(&body, &key)?;
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
        body
    }

    /// Stores the driver's pipeline cache, if it changed.
    pub fn keep_pipelines(&self, body: &[u8]) {
        if self.kept.swap(fnv(body), Ordering::Relaxed) != fnv(body) {
            store(&self.driver, body);
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

/// FNV-1a, 64 bits: detects damage and names files. It does not resist attackers.
fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    })
}
