//! Calls of XLA's foreign functions as Rust sees them: arrays as slices, results as errors.
//!
//! The structs are those of `xla/ffi/api/c_api.h`, versions 0.1 to 0.3 (jaxlib 0.4.35 to 0.10), which
//! `jax.ffi.include_dir()` has. They differ only behind the members that are read here. A newer minor version adds members
//! at the end of structs, so a handler of 0.3 fits as long as XLA accepts that version.

use std::ffi::{CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;
use std::sync::atomic::{AtomicI32, Ordering};

use sim_protocol::Dtype;

/// The only major version of the interface.
pub(super) const MAJOR: i32 = 0;
/// The newest minor version whose structs these are.
const MINOR: i32 = 3;
/// `XLA_FFI_Extension_Metadata`.
const METADATA: c_int = 1;
/// `XLA_FFI_ExecutionStage_EXECUTE`.
const EXECUTE: c_int = 3;
/// `XLA_FFI_ArgType_BUFFER` and `XLA_FFI_RetType_BUFFER`.
const BUFFER: c_int = 1;
/// `XLA_FFI_AttrType_STRING`.
const STRING: c_int = 4;

/// Minor version of the XLA of this process; it asks each handler for the version that it was made for.
static VERSION: AtomicI32 = AtomicI32::new(MINOR);

/// Answers XLA with the version of its own header, as far as it is known here.
pub(super) fn set_version(minor: i32) {
    VERSION.store(minor.min(MINOR), Ordering::Relaxed);
}

/// Why a call failed: XLA's code, the name of an exception of `tightloop.errors`, and a sentence.
pub(super) struct Failure {
    pub(super) code: Code,
    pub(super) class: String,
    pub(super) message: String,
}

/// XLA's codes of errors, those of Abseil.
#[derive(Clone, Copy)]
#[repr(i32)]
pub(super) enum Code {
    InvalidArgument = 3,
    ResourceExhausted = 8,
    FailedPrecondition = 9,
    Internal = 13,
    Unavailable = 14,
}

/// Type of a buffer's entries.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Kind {
    Bool,
    Number(Dtype),
    /// By XLA's number.
    Other(i32),
}

impl Kind {
    fn new(number: c_int) -> Kind {
        match number {
            1 => Kind::Bool,
            4 => Kind::Number(Dtype::I32),
            6 => Kind::Number(Dtype::U8),
            8 => Kind::Number(Dtype::U32),
            9 => Kind::Number(Dtype::U64),
            11 => Kind::Number(Dtype::F32),
            12 => Kind::Number(Dtype::F64),
            other => Kind::Other(other),
        }
    }

    /// Bytes of an entry, where it is known.
    fn size(self) -> Option<usize> {
        match self {
            Kind::Bool => Some(1),
            Kind::Number(dtype) => Some(dtype.size()),
            Kind::Other(_) => None,
        }
    }
}

/// An array of the program, row-major.
pub(super) struct Operand<'a> {
    pub(super) kind: Kind,
    pub(super) shape: Vec<usize>,
    /// Aligned for its entries.
    pub(super) bytes: &'a [u8],
}

/// An array that the call fills.
pub(super) struct Output<'a> {
    pub(super) kind: Kind,
    pub(super) shape: Vec<usize>,
    /// Aligned for its entries.
    pub(super) bytes: &'a mut [u8],
}

/// One call of a program.
pub(super) struct Call<'a> {
    /// What is called: `step`, `reset`, `write` or `forward`.
    pub(super) name: &'a str,
    /// Names of the operands behind the token and the mask.
    pub(super) inputs: &'a str,
    /// Names of the outputs behind the token.
    pub(super) fields: &'a str,
    pub(super) operands: Vec<Operand<'a>>,
    pub(super) outputs: Vec<Output<'a>>,
}

/// A mistake of ours.
pub(super) fn internal(message: String) -> Failure {
    Failure {
        code: Code::Internal,
        class: "TightloopError".into(),
        message,
    }
}

/// The address of the handler.
pub(super) fn address() -> usize {
    handler as *const () as usize
}

/// The address of the handler of other devices, which refuses.
pub(super) fn address_elsewhere() -> usize {
    handler_elsewhere as *const () as usize
}

/// Answers a call of XLA on a device whose memory the daemon does not see.
///
/// # Safety
/// As [`handler`].
unsafe extern "C" fn handler_elsewhere(frame: *mut CallFrame) -> *mut c_void {
    // SAFETY: the caller's promise.
    unsafe {
        answer(frame, |_| {
            Err(Failure {
                code: Code::FailedPrecondition,
                class: "GpuMemoryError".into(),
                message: "the program runs on a GPU, and tightloop.adapters.jax steps on the CPU alone: set JAX_PLATFORMS=cpu, \
                          or jit the program under jax.default_device(jax.devices(\"cpu\")[0])"
                    .into(),
            })
        })
    }
}

/// Answers a call of XLA; a null pointer is success.
///
/// # Safety
/// `frame` is what XLA gives a handler.
unsafe extern "C" fn handler(frame: *mut CallFrame) -> *mut c_void {
    // SAFETY: the caller's promise; in the stage of execution the buffers have values.
    unsafe { answer(frame, |frame| super::run(read(frame)?)) }
}

/// Answers a call of XLA by `body`, if it is one to execute.
///
/// # Safety
/// As [`handler`].
unsafe fn answer(
    frame: *mut CallFrame,
    body: impl FnOnce(&CallFrame) -> Result<(), Failure>,
) -> *mut c_void {
    // SAFETY: the caller's promise; XLA keeps the frame until the handler returns.
    let frame = unsafe { &*frame };
    // SAFETY: as above.
    if unsafe { tell_version(frame.extensions) } || frame.stage != EXECUTE {
        return ptr::null_mut();
    }
    let failure = match catch_unwind(AssertUnwindSafe(|| body(frame))) {
        Ok(Ok(())) => return ptr::null_mut(),
        Ok(Err(failure)) => failure,
        Err(_) => internal("a panic in tightloop, which is a bug; its message is on stderr".into()),
    };
    // SAFETY: as above.
    unsafe { error(frame, failure) }
}

/// Whether XLA only asks for the version of the handler, which is then answered.
///
/// # Safety
/// The list of extensions is XLA's.
unsafe fn tell_version(mut extension: *mut Extension) -> bool {
    while !extension.is_null() {
        // SAFETY: each begins with the members of `Extension`.
        let base = unsafe { &*extension };
        if base.kind == METADATA {
            // SAFETY: that is its type; XLA gives it to be written.
            let metadata = unsafe { &mut *(*extension.cast::<MetadataExtension>()).metadata };
            metadata.version = Version {
                struct_size: size_of::<Version>(),
                extensions: ptr::null_mut(),
                major: MAJOR,
                minor: VERSION.load(Ordering::Relaxed),
            };
            metadata.traits = 0;
            return true;
        }
        extension = base.next;
    }
    false
}

/// Arrays and attributes of a call.
///
/// # Safety
/// As [`handler`], in the stage of execution.
unsafe fn read<'a>(frame: &'a CallFrame) -> Result<Call<'a>, Failure> {
    // SAFETY: XLA's arrays have as many entries as it says.
    let (operands, outputs) = unsafe { (frame.operands.buffers()?, frame.outputs.buffers()?) };
    let operands = operands.into_iter().map(|buffer| {
        let (kind, shape, bytes) = buffer.extent()?;
        // SAFETY: the buffer has these bytes until the handler returns, and an operand is not written.
        let bytes = unsafe { std::slice::from_raw_parts(buffer.start(bytes), bytes) };
        Ok(Operand { kind, shape, bytes })
    });
    let outputs = outputs.into_iter().map(|buffer| {
        let (kind, shape, bytes) = buffer.extent()?;
        // SAFETY: as above; an output is the handler's alone, since no output was declared the alias of an operand. XLA
        // allocates without clearing; bytes of any value are valid.
        let bytes = unsafe { std::slice::from_raw_parts_mut(buffer.start(bytes), bytes) };
        Ok(Output { kind, shape, bytes })
    });
    // SAFETY: as of the buffers.
    let texts = unsafe { frame.attributes.texts() };
    let text = |name: &str| {
        let named = texts.iter().find(|(known, _)| *known == name);
        let text = named.map(|(_, text)| *text);
        text.ok_or_else(|| internal(format!("the call has no attribute `{name}`")))
    };
    Ok(Call {
        name: text("call")?,
        inputs: text("inputs")?,
        fields: text("fields")?,
        operands: operands.collect::<Result<_, Failure>>()?,
        outputs: outputs.collect::<Result<_, Failure>>()?,
    })
}

/// An error as XLA owns it.
///
/// # Safety
/// As [`handler`].
unsafe fn error(frame: &CallFrame, failure: Failure) -> *mut c_void {
    let message = format!("{}: {}", failure.class, failure.message);
    let message = CString::new(message.replace('\0', "\\0")).unwrap_or_default();
    let mut given = ErrorCreate {
        struct_size: size_of::<ErrorCreate>(),
        extensions: ptr::null_mut(),
        message: message.as_ptr(),
        code: failure.code as c_int,
    };
    // SAFETY: the table of functions is XLA's, and the function copies the message.
    unsafe { ((*frame.api).error_create)(&raw mut given) }
}

#[repr(C)]
struct Extension {
    struct_size: usize,
    kind: c_int,
    next: *mut Extension,
}

#[repr(C)]
struct Version {
    struct_size: usize,
    extensions: *mut Extension,
    major: c_int,
    minor: c_int,
}

/// The members that every version has.
#[repr(C)]
struct Metadata {
    struct_size: usize,
    version: Version,
    traits: u32,
}

#[repr(C)]
struct MetadataExtension {
    base: Extension,
    metadata: *mut Metadata,
}

/// The first functions of the table.
#[repr(C)]
struct Api {
    struct_size: usize,
    extensions: *mut Extension,
    version: Version,
    internal: *const c_void,
    error_create: unsafe extern "C" fn(*mut ErrorCreate) -> *mut c_void,
}

#[repr(C)]
struct ErrorCreate {
    struct_size: usize,
    extensions: *mut Extension,
    message: *const c_char,
    code: c_int,
}

#[repr(C)]
struct Buffer {
    struct_size: usize,
    extensions: *mut Extension,
    dtype: c_int,
    data: *mut c_void,
    rank: i64,
    dims: *const i64,
}

/// `XLA_FFI_Args` and `XLA_FFI_Rets`.
#[repr(C)]
struct Buffers {
    struct_size: usize,
    extensions: *mut Extension,
    size: i64,
    types: *const c_int,
    entries: *const *const Buffer,
}

#[repr(C)]
struct Span {
    start: *const u8,
    size: usize,
}

#[repr(C)]
struct Attributes {
    struct_size: usize,
    extensions: *mut Extension,
    size: i64,
    types: *const c_int,
    names: *const *const Span,
    values: *const *const c_void,
}

/// `XLA_FFI_CallFrame`, up to the members that are read.
#[repr(C)]
struct CallFrame {
    struct_size: usize,
    extensions: *mut Extension,
    api: *const Api,
    context: *mut c_void,
    stage: c_int,
    operands: Buffers,
    outputs: Buffers,
    attributes: Attributes,
}

impl Buffers {
    /// # Safety
    /// The arrays have `size` entries each.
    unsafe fn buffers(&self) -> Result<Vec<&Buffer>, Failure> {
        // SAFETY: the caller's promise.
        let (types, entries) =
            unsafe { (many(self.types, self.size), many(self.entries, self.size)) };
        if types.iter().any(|&kind| kind != BUFFER) {
            return Err(internal("the call has an argument that is no array".into()));
        }
        // SAFETY: the types were checked.
        Ok(entries.iter().map(|&entry| unsafe { &*entry }).collect())
    }
}

impl Buffer {
    /// Type, shape and bytes.
    fn extent(&self) -> Result<(Kind, Vec<usize>, usize), Failure> {
        let kind = Kind::new(self.dtype);
        // SAFETY: XLA gives as many dimensions as its rank.
        let dims = unsafe { many(self.dims, self.rank) };
        let shape: Vec<usize> = dims.iter().map(|&size| size as usize).collect();
        let size = kind
            .size()
            .ok_or_else(|| internal(format!("the call has an array of {kind:?}")))?;
        let bytes = shape.iter().product::<usize>() * size;
        if !(self.data as usize).is_multiple_of(size) {
            return Err(internal("the call has an array that is not aligned".into()));
        }
        Ok((kind, shape, bytes))
    }

    /// The first entry; somewhere aligned if there is none.
    fn start(&self, bytes: usize) -> *mut u8 {
        match bytes {
            0 => ptr::NonNull::<u64>::dangling().as_ptr().cast(),
            _ => self.data.cast(),
        }
    }
}

impl Attributes {
    /// Names and values of those that are texts.
    ///
    /// # Safety
    /// As of [`Buffers::buffers`].
    unsafe fn texts<'a>(&self) -> Vec<(&'a str, &'a str)> {
        // SAFETY: the caller's promise.
        let (types, names, values) = unsafe {
            (
                many(self.types, self.size),
                many(self.names, self.size),
                many(self.values, self.size),
            )
        };
        let all = types.iter().zip(names).zip(values);
        let texts = all.filter(|((kind, _), _)| **kind == STRING);
        texts
            .filter_map(|((_, &name), &value)| {
                // SAFETY: the type says that the value is a span, as names are.
                let (name, value) = unsafe { (&*name, &*value.cast::<Span>()) };
                // SAFETY: a span has as many bytes as it says.
                unsafe { Some((name.text()?, value.text()?)) }
            })
            .collect()
    }
}

impl Span {
    /// # Safety
    /// It has `size` bytes for as long as the result is used.
    unsafe fn text<'a>(&self) -> Option<&'a str> {
        // SAFETY: the caller's promise.
        std::str::from_utf8(unsafe { many(self.start, self.size as i64) }).ok()
    }
}

/// # Safety
/// There are `size` entries from `start` on, for as long as the result is used.
unsafe fn many<'a, T>(start: *const T, size: i64) -> &'a [T] {
    match size {
        ..=0 => &[],
        // SAFETY: the caller's promise.
        _ => unsafe { std::slice::from_raw_parts(start, size as usize) },
    }
}
