//! The transport's shared memory: files of a daemon's private folder.
//!
//! In place of iceoryx2's POSIX shared memory, which other users can open at times, whose pages are missing on a full file
//! system, and which waits without end for a file that somebody has cut. Here
//! - a file has mode 0600, takes all of its pages before it is mapped, and gets its name when it is complete;
//! - a file whose length is not the one that it was made with is an error at once;
//! - no descriptor stays open: a mapping needs none.

use std::cell::Cell;
use std::fmt::Debug;
use std::fs;
use std::io::{self, ErrorKind};
use std::marker::PhantomData;
use std::mem::{ManuallyDrop, MaybeUninit};
use std::path::{Path as FilePath, PathBuf};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use iceoryx2_bb_memory::bump_allocator::BumpAllocator;
use iceoryx2_bb_posix::access_mode::AccessMode;
use iceoryx2_cal::dynamic_storage::{
    DynamicStorage, DynamicStorageBuilder, DynamicStorageCreateError, DynamicStorageOpenError,
    DynamicStorageOpenOrCreateError, Initializer, file,
};
use iceoryx2_cal::named_concept::{
    FileName, NamedConcept, NamedConceptBuilder, NamedConceptConfiguration,
    NamedConceptDoesExistError, NamedConceptListError, NamedConceptMgmt,
    NamedConceptPathHintRemoveError, NamedConceptRemoveError, Path,
};
use sim_system::files::private;
use sim_system::storage::NewFile;

use crate::memory::mapping::{self, Mapping};
use crate::memory::problem::{Problem, failed, take_problem};
use crate::wire::hash::Fnv;

/// At both ends of a segment whose pages the reader takes, what the transport itself writes [bytes].
const MANAGEMENT: u64 = 1 << 20;

/// What sorts of things the storage can hold.
pub trait Content: Debug + Send + Sync + ZeroCopySend {}
impl<T: Debug + Send + Sync + ZeroCopySend> Content for T {}

thread_local! {
    static READER_RESERVES: Cell<bool> = const { Cell::new(false) };
}

/// Makes ports whose memory the reader takes, with [`crate::transport::budget::reserve`], before anything is sent.
pub(crate) fn reserved_by_reader<T>(make: impl FnOnce() -> T) -> T {
    /// Also when the transport panics.
    struct Reset;
    impl Drop for Reset {
        fn drop(&mut self) {
            READER_RESERVES.set(false);
        }
    }
    let _reset = Reset;
    READER_RESERVES.set(true);
    make()
}

/// What a file holds; the transport's own memory follows.
#[repr(C)]
struct Data<T> {
    /// Length of the file.
    bytes: u64,
    value: MaybeUninit<T>,
}

/// Shared memory that begins with a `T`.
#[derive(Debug)]
pub struct Storage<T: Content> {
    mapping: ManuallyDrop<Mapping>,
    config: file::Configuration<T>,
    name: FileName,
    is_owned: AtomicBool,
}

// SAFETY: the mapping is valid on every thread, and `T` is what its threads share.
unsafe impl<T: Content> Send for Storage<T> {}
// SAFETY: as above; a storage hands out shared references only.
unsafe impl<T: Content> Sync for Storage<T> {}

impl<T: Content> Storage<T> {
    fn data(&self) -> *mut Data<T> {
        self.mapping.start().as_ptr().cast()
    }
}

impl<T: Content> Drop for Storage<T> {
    fn drop(&mut self) {
        if self.has_ownership() {
            // SAFETY: the value was initialised before the file got its name, and its last owner drops it.
            unsafe { (*self.data()).value.assume_init_drop() };
        }
        // SAFETY: this is the only place that drops it. Windows removes no file that is mapped.
        unsafe { ManuallyDrop::drop(&mut self.mapping) };
        if self.has_ownership() {
            // somebody else may have removed it
            let _ = fs::remove_file(path(&self.config, &self.name));
        }
    }
}

impl<T: Content> Abandonable for Storage<T> {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller forgets the storage afterwards, so the mapping is dropped once.
        unsafe { ManuallyDrop::drop(&mut this.as_mut().mapping) };
    }
}

impl<T: Content> NamedConcept for Storage<T> {
    fn name(&self) -> &FileName {
        &self.name
    }
}

/// Names and folders are those of iceoryx2's own files.
impl<T: Content> NamedConceptMgmt for Storage<T> {
    type Configuration = file::Configuration<T>;

    fn does_exist_cfg(
        name: &FileName,
        config: &Self::Configuration,
    ) -> Result<bool, NamedConceptDoesExistError> {
        file::Storage::<T>::does_exist_cfg(name, config)
    }

    fn list_cfg(config: &Self::Configuration) -> Result<Vec<FileName>, NamedConceptListError> {
        file::Storage::<T>::list_cfg(config)
    }

    unsafe fn remove_cfg(
        name: &FileName,
        config: &Self::Configuration,
    ) -> Result<bool, NamedConceptRemoveError> {
        // SAFETY: as the caller proves.
        unsafe { file::Storage::<T>::remove_cfg(name, config) }
    }

    fn remove_path_hint(folder: &Path) -> Result<(), NamedConceptPathHintRemoveError> {
        file::Storage::<T>::remove_path_hint(folder)
    }
}

impl<T: Content> DynamicStorage<T> for Storage<T> {
    type Builder<'builder> = Builder<'builder, T>;

    fn does_support_persistency() -> bool {
        true
    }

    fn has_ownership(&self) -> bool {
        self.is_owned.load(Ordering::Relaxed)
    }

    fn release_ownership(&self) {
        self.is_owned.store(false, Ordering::Relaxed);
    }

    fn acquire_ownership(&self) {
        self.is_owned.store(true, Ordering::Relaxed);
    }

    fn get(&self) -> &T {
        // SAFETY: the value was initialised before the file got its name, and lies inside the mapping.
        unsafe { (*self.data()).value.assume_init_ref() }
    }

    unsafe fn __internal_set_type_name_in_config(config: &mut Self::Configuration, name: &str) {
        // SAFETY: as the caller proves.
        unsafe { file::Storage::<T>::__internal_set_type_name_in_config(config, name) };
    }
}

/// Makes and opens storages.
#[derive(Debug)]
pub struct Builder<'builder, T: Content> {
    name: FileName,
    config: file::Configuration<T>,
    supplementary: usize,
    has_ownership: bool,
    initializer: Initializer<'builder, T>,
    _content: PhantomData<T>,
}

impl<T: Content> NamedConceptBuilder<Storage<T>> for Builder<'_, T> {
    fn new(name: &FileName) -> Self {
        Builder {
            name: *name,
            config: file::Configuration::default(),
            supplementary: 0,
            has_ownership: true,
            initializer: Initializer::new(|_, _| false),
            _content: PhantomData,
        }
    }

    fn config(mut self, config: &file::Configuration<T>) -> Self {
        self.config = config.clone();
        self
    }
}

impl<'builder, T: Content> DynamicStorageBuilder<'builder, T, Storage<T>> for Builder<'builder, T> {
    fn has_ownership(mut self, value: bool) -> Self {
        self.has_ownership = value;
        self
    }

    /// Nothing here is for other users.
    fn enable_global_access(self, _: bool) -> Self {
        self
    }

    fn supplementary_size(mut self, value: usize) -> Self {
        self.supplementary = value;
        self
    }

    /// A file is complete or not there: nobody waits for one.
    fn timeout(self, _: Duration) -> Self {
        self
    }

    fn initializer<F: FnMut(&mut MaybeUninit<T>, &mut BumpAllocator) -> bool + 'builder>(
        mut self,
        value: F,
    ) -> Self {
        self.initializer = Initializer::new(value);
        self
    }

    fn create(mut self) -> Result<Storage<T>, DynamicStorageCreateError> {
        take_problem();
        self.make()
    }

    fn open(self, access: AccessMode) -> Result<Storage<T>, DynamicStorageOpenError> {
        take_problem();
        self.open_existing(access)
    }

    fn open_or_create(self) -> Result<Storage<T>, DynamicStorageOpenOrCreateError> {
        take_problem();
        match self.open_existing(AccessMode::ReadWrite) {
            Err(DynamicStorageOpenError::DoesNotExist) => {}
            opened => return Ok(opened?),
        }
        let (name, config) = (self.name, self.config.clone());
        match self.create() {
            // another process was faster
            Err(DynamicStorageCreateError::AlreadyExists) => {
                let other = Builder::new(&name).config(&config);
                Ok(other.open_existing(AccessMode::ReadWrite)?)
            }
            made => Ok(made?),
        }
    }
}

impl<T: Content> Builder<'_, T> {
    /// Makes a file without a name, fills it, and gives it its name.
    fn make(&mut self) -> Result<Storage<T>, DynamicStorageCreateError> {
        let bytes = size_of::<Data<T>>() + self.supplementary;
        let failed = |problem| {
            failed(problem);
            DynamicStorageCreateError::InternalError
        };
        let path = path(&self.config, &self.name);
        let system = |error| failed(Problem::of_file(&path, error));
        let folder = self.config.get_path_hint().to_string();
        let folder = FilePath::new(&folder);
        let file = new_file(folder, bytes as u64).map_err(|error| match error.kind() {
            ErrorKind::StorageFull => failed(Problem::full(folder, bytes as u64)),
            _ => system(error),
        })?;
        let ownership = (owner(&self.config), true);
        let mapping = Mapping::new(file.file(), bytes, true, ownership).map_err(system)?;
        let storage = Storage {
            mapping: ManuallyDrop::new(mapping),
            config: self.config.clone(),
            name: self.name,
            is_owned: AtomicBool::new(false),
        };
        let data = storage.data();
        // SAFETY: the mapping is at least as long as `Data`, and nobody else knows the file.
        let (value, rest) = unsafe {
            (*data).bytes = bytes as u64;
            (&mut (*data).value, NonNull::new_unchecked(data.add(1)))
        };
        let mut allocator = BumpAllocator::new(rest.cast(), self.supplementary);
        if !self.initializer.call(value, &mut allocator) {
            return Err(DynamicStorageCreateError::InitializationFailed);
        }
        match file.publish(&path) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                return Err(DynamicStorageCreateError::AlreadyExists);
            }
            Err(error) => return Err(system(error)),
        }
        if self.has_ownership {
            storage.acquire_ownership();
        }
        Ok(storage)
    }

    fn open_existing(&self, access: AccessMode) -> Result<Storage<T>, DynamicStorageOpenError> {
        let path = path(&self.config, &self.name);
        let may_write = matches!(access, AccessMode::ReadWrite);
        let system = |error: io::Error| {
            failed(Problem::of_file(&path, error));
            DynamicStorageOpenError::InternalError
        };
        let file = match private().write(may_write).open(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                return Err(DynamicStorageOpenError::DoesNotExist);
            }
            opened => opened.map_err(system)?,
        };
        let status = file.metadata().map_err(system)?;
        let bytes = status.len() as usize;
        let ownership = (owner(&self.config), false);
        let mapping = (status.is_file() && bytes >= size_of::<Data<T>>())
            .then(|| Mapping::new(&file, bytes, may_write, ownership).map_err(system))
            .transpose()?;
        // SAFETY: the mapping is long enough, and any bits are a number.
        let whole = |mapping: &Mapping| unsafe {
            mapping.start().cast::<u64>().read_volatile() == bytes as u64
        };
        let Some(mapping) = mapping.filter(whole) else {
            let path = path.to_string_lossy().into_owned();
            failed(Problem::Damaged { path });
            return Err(DynamicStorageOpenError::InternalError);
        };
        Ok(Storage {
            mapping: ManuallyDrop::new(mapping),
            config: self.config.clone(),
            name: self.name,
            is_owned: AtomicBool::new(false),
        })
    }
}

/// Whose files those of a configuration are: a number of the run of a daemon.
fn owner(config: &impl NamedConceptConfiguration) -> u64 {
    run(
        &config.get_path_hint().to_string(),
        &config.get_prefix().to_string(),
    )
}

fn run(folder: &str, prefix: &str) -> u64 {
    let mut hash = Fnv::new();
    hash.text(folder.trim_end_matches('/'));
    hash.text(prefix);
    hash.value()
}

/// Whether another program has cut a file of a run while it was mapped here.
pub(crate) fn is_damaged(config: &Config) -> bool {
    mapping::is_damaged(run_of(config))
}

/// The number of a run of a daemon.
pub(crate) fn run_of(config: &Config) -> u64 {
    let (folder, prefix) = (config.global.root_path(), config.global.prefix);
    run(&folder.to_string(), &prefix.to_string())
}

/// A new file with its pages, which has no name yet.
fn new_file(folder: &FilePath, bytes: u64) -> io::Result<NewFile> {
    let ends = (READER_RESERVES.get() && bytes > 2 * MANAGEMENT).then_some(MANAGEMENT);
    NewFile::create(folder, bytes, ends)
}

/// Where the file of a name is.
fn path<T: Content>(config: &file::Configuration<T>, name: &FileName) -> PathBuf {
    config.path_for(name).to_string().into()
}
