//! Headers of the two kinds of samples, and the row that describes one array in them.
//!
//! A sample is lines of eight words, 64-byte aligned: first the field table ([`Row::WORDS`] words per row), then, from the next
//! 64-byte boundary, the arrays. Numbers are little endian, as everything that shares memory with us is.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

/// Version of everything in this crate that the other side must agree on.
pub const PROTOCOL_VERSION: u32 = 5;

/// Alignment of a sample and of every array in it [bytes].
pub const ALIGNMENT: usize = 64;

/// What samples are made of: 64 bytes, 64-byte aligned.
///
/// Words with an alignment set on the service would do as well, but the transport then takes 64 bytes for each of them.
#[derive(
    Debug, Default, Clone, Copy, PartialEq, Eq, ZeroCopySend, bytemuck::Pod, bytemuck::Zeroable,
)]
#[repr(C)]
#[repr(align(64))]
#[type_name("tightloop.Line.v1")]
pub struct Line(pub [u64; Line::WORDS]);
const _: () = assert!(size_of::<Line>() == ALIGNMENT && align_of::<Line>() == ALIGNMENT);

impl Line {
    /// Words in a line.
    pub const WORDS: usize = ALIGNMENT / 8;
}

/// Head of a sample from the daemon.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("tightloop.FrameHeader.v3")]
pub struct FrameHeader {
    /// Run of the daemon.
    pub session: u64,
    /// Lease that this answers; 0 on the observers' service.
    pub epoch: u64,
    /// Sequence number of the command that this answers; 0 on the observers' service.
    pub ack_seq: u64,
    /// Frames evaluated since the daemon started; observers compare it to tell newer from older.
    pub frame: u64,
    /// [`crate::Description::schema_hash`] of the daemon.
    pub schema: u64,
    /// Time the daemon spent on the command [ns].
    pub busy_ns: u64,
    /// 0: done, the sample is a frame. Else a [`RefusalKind`], and the sample is one array of text.
    pub outcome: u32,
    /// Rows in the field table.
    pub rows: u32,
    /// Core that the daemon runs on.
    pub core: u64,
    /// 1 more than the slot of device memory that has the same frame; 0 if none has.
    pub slot: u64,
    /// Value of the timeline of frames when that slot is written.
    pub done: u64,
    /// When the next frame is due on the monotonic clock [ns]; 0 where frames keep no pace.
    pub due_next: u64,
}
const _: () = assert!(size_of::<FrameHeader>() == 88 && align_of::<FrameHeader>() == 8);

/// Head of a sample to the daemon.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("tightloop.CommandHeader.v1")]
pub struct CommandHeader {
    /// Run of the daemon that the client attached to.
    pub session: u64,
    /// The client's lease.
    pub epoch: u64,
    /// 1, 2, 3 … within a lease.
    pub seq: u64,
    /// An [`Op`].
    pub op: u32,
    /// Rows in the field table.
    pub rows: u32,
    /// Core that the client runs on.
    pub core: u64,
}
const _: () = assert!(size_of::<CommandHeader>() == 40 && align_of::<CommandHeader>() == 8);

/// What a command asks for. Every one is answered by a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Op {
    /// Set the given inputs, advance every world by one control frame.
    Step = 1,
    /// Put the worlds under the mask back to the start, of their next episode or, with a `seed`, of that seed's first.
    Reset = 2,
    /// Set the state of the worlds under the mask, evaluate the fields there.
    Write = 3,
    /// Evaluate the fields without stepping.
    Forward = 4,
    /// Write all worlds into a file, evaluate the fields.
    Snapshot = 5,
    /// Set the worlds under the mask to those of such a file, or to one of them; evaluate the fields there.
    Restore = 6,
    /// Solve the inverse kinematics that a file asks for, write the answer into it, evaluate the fields.
    Ik = 7,
    /// Advance every world by several control frames with the policy that a file asks for, write what was collected into it,
    /// show the last one.
    Rollout = 8,
}

impl Op {
    /// All, in the order of their numbers, which begin with 1.
    pub const ALL: [Op; 8] = [
        Op::Step,
        Op::Reset,
        Op::Write,
        Op::Forward,
        Op::Snapshot,
        Op::Restore,
        Op::Ik,
        Op::Rollout,
    ];

    /// The inverse of `op as u32`.
    pub fn from_code(op: u32) -> Option<Op> {
        Op::ALL.into_iter().find(|&known| known as u32 == op)
    }
}

/// Why the daemon did not accept a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum RefusalKind {
    /// An entry is NaN or infinite.
    NotFinite = 1,
    /// An array has the wrong shape or type.
    Shape = 2,
    /// The field is unknown or cannot be set.
    Field = 3,
    /// The sample makes no sense.
    Malformed = 4,
    /// The command is of another session, lease, or older than one already carried out.
    Stale = 5,
    /// The simulation refused.
    Backend = 6,
    /// A snapshot cannot be written, read or restored.
    Snapshot = 7,
}

impl RefusalKind {
    /// The inverse of `kind as u32`; what a newer daemon may add reads as [`RefusalKind::Backend`].
    pub fn from_code(kind: u32) -> RefusalKind {
        use RefusalKind::*;
        [NotFinite, Shape, Field, Malformed, Stale, Snapshot]
            .into_iter()
            .find(|&known| known as u32 == kind)
            .unwrap_or(Backend)
    }
}

/// Type of the entries of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum Dtype {
    /// 32-bit float.
    F32 = 1,
    /// 64-bit float.
    F64 = 2,
    /// 32-bit signed integer.
    I32 = 3,
    /// 32-bit unsigned integer.
    U32 = 4,
    /// 64-bit unsigned integer.
    U64 = 5,
    /// Byte; masks are 0 or 1.
    U8 = 6,
}

impl Dtype {
    /// Bytes of an entry.
    pub fn size(self) -> usize {
        match self {
            Dtype::U8 => 1,
            Dtype::F32 | Dtype::I32 | Dtype::U32 => 4,
            Dtype::F64 | Dtype::U64 => 8,
        }
    }

    /// Name as in NumPy: `float32`, `uint64` …
    pub fn numpy_name(self) -> &'static str {
        match self {
            Dtype::F32 => "float32",
            Dtype::F64 => "float64",
            Dtype::I32 => "int32",
            Dtype::U32 => "uint32",
            Dtype::U64 => "uint64",
            Dtype::U8 => "uint8",
        }
    }

    fn from_code(dtype: u64) -> Option<Dtype> {
        use Dtype::*;
        [F32, F64, I32, U32, U64, U8]
            .into_iter()
            .find(|&known| known as u64 == dtype)
    }
}

/// One array of a sample: a row of its field table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// Name; at most [`Row::NAME`] bytes.
    pub name: String,
    /// Type of the entries.
    pub dtype: Dtype,
    /// Shape, worlds first; one to four axes.
    pub shape: Vec<usize>,
    /// First column of the input that the array sets (0 in frames).
    pub start: usize,
    /// First byte, counted from the start of the sample; a multiple of [`ALIGNMENT`].
    pub offset: usize,
    /// Number of bytes.
    pub bytes: usize,
}

impl Row {
    /// Words that a row takes.
    pub const WORDS: usize = 12;
    /// Bytes that a name may have.
    pub const NAME: usize = 32;
    /// Axes that an array may have.
    pub const AXES: usize = 4;

    /// Writes the row as the protocol has it.
    pub(crate) fn encode(&self, words: &mut [u64; Row::WORDS]) {
        encode_row(
            words,
            &self.name,
            self.dtype,
            &self.shape,
            self.start,
            self.offset,
        );
    }

    /// Reads a row and checks it by itself; its place in the sample is checked by [`crate::Table::parse`].
    pub(crate) fn decode(words: &[u64; Row::WORDS]) -> Result<Row, String> {
        let mut name = [0; Row::NAME];
        for (bytes, word) in name.chunks_exact_mut(8).zip(words) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        let length = name.iter().position(|&byte| byte == 0).unwrap_or(Row::NAME);
        let name = std::str::from_utf8(&name[..length])
            .map_err(|_| "a name is not UTF-8".to_owned())?
            .to_owned();
        if name.is_empty() {
            return Err("a name is empty".to_owned());
        }
        let dtype = Dtype::from_code(words[4] & 0xffff_ffff)
            .ok_or_else(|| format!("{name}: unknown dtype {}", words[4] & 0xffff_ffff))?;
        let axes = (words[4] >> 32) as usize;
        if !(1..=Row::AXES).contains(&axes) {
            return Err(format!("{name}: {axes} axes"));
        }
        let number = |word: u64| {
            usize::try_from(word).map_err(|_| format!("{name}: number {word} too large"))
        };
        let shape = words[5..5 + axes]
            .iter()
            .map(|&n| number(n))
            .collect::<Result<Vec<_>, _>>()?;
        let (start, offset, bytes) = (number(words[9])?, number(words[10])?, number(words[11])?);
        let needed = shape
            .iter()
            .try_fold(dtype.size(), |product, &n| product.checked_mul(n));
        if needed != Some(bytes) {
            return Err(format!(
                "{name}: shape {shape:?} of {} does not make {bytes} bytes",
                dtype.numpy_name()
            ));
        }
        Ok(Row {
            name,
            dtype,
            shape,
            start,
            offset,
            bytes,
        })
    }
}

/// Writes a row as the protocol has it; a client does this for every command without allocating.
///
/// # Panics
/// When the name is longer than [`Row::NAME`] or the shape has more than [`Row::AXES`] axes: our own tables never do.
pub(crate) fn encode_row(
    words: &mut [u64; Row::WORDS],
    name: &str,
    dtype: Dtype,
    shape: &[usize],
    start: usize,
    offset: usize,
) {
    assert!(
        name.len() <= Row::NAME && shape.len() <= Row::AXES,
        "row {name:?} does not fit"
    );
    let mut bytes = [0; Row::NAME];
    bytes[..name.len()].copy_from_slice(name.as_bytes());
    for (word, bytes) in words.iter_mut().zip(bytes.as_chunks().0) {
        *word = u64::from_le_bytes(*bytes);
    }
    words[4] = dtype as u64 | (shape.len() as u64) << 32;
    for axis in 0..Row::AXES {
        words[5 + axis] = shape.get(axis).map_or(0, |&n| n as u64);
    }
    words[9] = start as u64;
    words[10] = offset as u64;
    words[11] = (shape.iter().product::<usize>() * dtype.size()) as u64;
}
