//! What a command carries, and how it lies in a sample.

use std::ops::Range;

use crate::wire::header::encode_row;
use crate::{ALIGNMENT, Description, Dtype, InputInfo, Op, ProtocolError, ROWS_MAX, Table};

/// Name of the mask in a command: a byte per world.
pub(crate) const MASK: &str = "mask";
/// Name of a snapshot's path in a command: bytes of UTF-8.
pub(crate) const PATH: &str = "path";
/// Name of the world of a snapshot that goes into all, in a command: one `u64`.
pub(crate) const FROM_WORLD: &str = "from_world";
/// Name of what a step takes from device memory: the value of the timeline of commands, then a bit per command.
pub(crate) const ON_DEVICE: &str = "on_device";
/// Longest path [bytes], as Linux has it.
pub(crate) const PATH_MAX: usize = 4096;
/// Name of the seeds in a reset.
const SEED: &str = "seed";

/// Numbers for an input, row-major `(worlds, columns)`. The daemon gets them in the precision of its run.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
}

impl Values<'_> {
    /// Number of entries.
    pub fn len(&self) -> usize {
        match self {
            Values::F32(values) => values.len(),
            Values::F64(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// One array that a step or a write sets.
#[derive(Debug, Clone)]
pub struct Command<'a> {
    /// Its name: one of [`Description::commands`] for a step, of [`Description::writes`] for a write.
    pub field: &'a str,
    /// Columns of the input that the array covers, such as dofs.
    pub columns: Range<usize>,
    /// The numbers, `(worlds, columns)`.
    pub values: Values<'a>,
}

/// Commands of a step that the client leaves in device memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OnDevice {
    /// Value that the timeline of commands has when the client is done with all frames that it dropped, and with these commands.
    pub ready: u64,
    /// A bit per command, in the order of [`crate::DeviceMemory::commands`].
    pub commands: u64,
}

/// One call of a client, as it came.
pub(crate) struct Call<'a> {
    pub(crate) op: Op,
    pub(crate) arrays: &'a [Command<'a>],
    pub(crate) mask: Option<&'a [bool]>,
    pub(crate) path: Option<&'a str>,
    pub(crate) from_world: Option<u64>,
    /// One for all worlds, or one per world.
    pub(crate) seed: Option<&'a [u64]>,
    pub(crate) on_device: Option<OnDevice>,
}

impl<'a> Call<'a> {
    /// A call of arrays and a mask alone.
    pub(crate) fn new(op: Op, arrays: &'a [Command<'a>], mask: Option<&'a [bool]>) -> Call<'a> {
        Call {
            op,
            arrays,
            mask,
            path: None,
            from_world: None,
            seed: None,
            on_device: None,
        }
    }

    /// Finds what the daemon would refuse anyway, with the names at hand.
    pub(crate) fn check(&self, description: &Description) -> Result<(), ProtocolError> {
        let (worlds, arrays) = (description.worlds, self.arrays);
        let (inputs, verb): (&[InputInfo], _) = match self.op {
            Op::Write | Op::Reset => (&description.writes, "written"),
            _ => (&description.commands, "commanded"),
        };
        if arrays.len() >= ROWS_MAX {
            let (expected, got) = (
                format!("at most {} arrays", ROWS_MAX - 1),
                arrays.len().to_string(),
            );
            return Err(ProtocolError::Shape {
                field: "command".to_owned(),
                expected,
                got,
            });
        }
        for (index, array) in arrays.iter().enumerate() {
            let Some(input) = inputs.iter().find(|input| input.name == array.field) else {
                let known = inputs
                    .iter()
                    .map(|input| input.name.as_str())
                    .collect::<Vec<_>>()
                    .join(", ");
                return Err(ProtocolError::NotAnInput {
                    field: array.field.to_owned(),
                    verb,
                    known,
                });
            };
            let shape = |expected, got| ProtocolError::Shape {
                field: array.field.to_owned(),
                expected,
                got,
            };
            let columns = &array.columns;
            if columns.start > columns.end || columns.end > input.columns {
                return Err(shape(
                    format!("columns within 0..{}", input.columns),
                    format!("{columns:?}"),
                ));
            }
            if array.values.len() != worlds * columns.len() {
                let expected = format!(
                    "{worlds} worlds x {} columns = {}",
                    columns.len(),
                    worlds * columns.len()
                );
                return Err(shape(
                    format!("{expected} entries"),
                    format!("{}", array.values.len()),
                ));
            }
            let overlaps = |other: &&Command<'_>| {
                other.field == array.field
                    && other.columns.start < columns.end
                    && columns.start < other.columns.end
            };
            if arrays[..index].iter().find(overlaps).is_some() {
                return Err(shape(
                    "each column at most once".to_owned(),
                    format!("{columns:?} twice"),
                ));
            }
        }
        if let Some(seed) = self.seed
            && seed.len() != 1
            && seed.len() != worlds
        {
            return Err(ProtocolError::Shape {
                field: SEED.to_owned(),
                expected: format!("(1,) or ({worlds},)"),
                got: format!("({},)", seed.len()),
            });
        }
        if let Some(mask) = self.mask
            && mask.len() != worlds
        {
            return Err(ProtocolError::Shape {
                field: MASK.to_owned(),
                expected: format!("({worlds},)"),
                got: format!("({},)", mask.len()),
            });
        }
        match self.path {
            Some(path) if path.len() > PATH_MAX => Err(ProtocolError::Shape {
                field: PATH.to_owned(),
                expected: format!("at most {PATH_MAX} bytes"),
                got: path.len().to_string(),
            }),
            _ => Ok(()),
        }
    }

    /// Rows of the field table.
    pub(crate) fn rows(&self) -> usize {
        let others = [
            self.seed.is_some(),
            self.mask.is_some(),
            self.path.is_some(),
            self.from_world.is_some(),
            self.on_device.is_some(),
        ];
        self.arrays.len() + others.into_iter().filter(|&is_there| is_there).count()
    }

    /// Size of the sample.
    pub(crate) fn bytes(&self, description: &Description) -> usize {
        let arrays = self
            .arrays
            .iter()
            .map(|array| padded(array, description.real()));
        let seed = self.seed.map_or(0, seed_bytes);
        let mask = self.mask.map_or(0, |_| mask_bytes(description.worlds));
        let path = self
            .path
            .map_or(0, |path| path.len().next_multiple_of(ALIGNMENT));
        let from_world = self.from_world.map_or(0, |_| ALIGNMENT);
        let on_device = self.on_device.map_or(0, |_| ALIGNMENT);
        let rest = seed + mask + path + from_world + on_device;
        Table::head_bytes(self.rows()) + arrays.sum::<usize>() + rest
    }

    /// Writes field table and arrays; of `words`, every word that means something.
    pub(crate) fn write(&self, description: &Description, words: &mut [u64]) {
        let (worlds, real) = (description.worlds, description.real());
        let head = Table::head_bytes(self.rows());
        let (table, data) = words.split_at_mut(head / 8);
        let (table, _) = table.as_chunks_mut();
        let mut offset = 0;
        for (row, array) in table.iter_mut().zip(self.arrays) {
            let (columns, bytes) = (&array.columns, padded(array, real));
            encode_row(
                row,
                array.field,
                real,
                &[worlds, columns.len()],
                columns.start,
                head + offset,
            );
            copy_values(
                array.values,
                real,
                &mut data[offset / 8..(offset + bytes) / 8],
            );
            offset += bytes;
        }
        let mut rows = table[self.arrays.len()..].iter_mut();
        let mut bytes_of = |name, dtype: Dtype, entries: usize| {
            let row = rows.next().expect("a row for all that is sent");
            encode_row(row, name, dtype, &[entries], 0, head + offset);
            let (first, bytes) = (offset / 8, (entries * dtype.size()).next_multiple_of(8));
            offset += bytes.next_multiple_of(ALIGNMENT);
            first..first + bytes / 8
        };
        if let Some(seed) = self.seed {
            data[bytes_of(SEED, Dtype::U64, seed.len())].copy_from_slice(seed);
        }
        if let Some(mask) = self.mask {
            let words = &mut data[bytes_of(MASK, Dtype::U8, worlds)];
            let bytes: &mut [u8] = bytemuck::cast_slice_mut(words);
            bytes
                .iter_mut()
                .zip(mask)
                .for_each(|(byte, &set)| *byte = u8::from(set));
        }
        if let Some(path) = self.path {
            let words = &mut data[bytes_of(PATH, Dtype::U8, path.len())];
            bytemuck::cast_slice_mut(words)[..path.len()].copy_from_slice(path.as_bytes());
        }
        if let Some(world) = self.from_world {
            data[bytes_of(FROM_WORLD, Dtype::U64, 1)][0] = world;
        }
        if let Some(OnDevice { ready, commands }) = self.on_device {
            data[bytes_of(ON_DEVICE, Dtype::U64, 2)].copy_from_slice(&[ready, commands]);
        }
    }
}

/// Bytes of an array in a sample.
fn padded(array: &Command<'_>, real: Dtype) -> usize {
    (array.values.len() * real.size()).next_multiple_of(ALIGNMENT)
}

/// Bytes that the largest command of a run takes: every input of a step or of a write, or seeds, a mask, and what else a
/// restore has.
pub(crate) fn command_bytes(description: &Description) -> usize {
    let columns = |inputs: &[InputInfo]| inputs.iter().map(|input| input.columns).sum::<usize>();
    let columns = columns(&description.commands).max(columns(&description.writes));
    let entries = description.worlds * (columns * description.real().size()).max(size_of::<u64>());
    // an input may come in several pieces, each rounded up
    let head = Table::head_bytes(ROWS_MAX) + ROWS_MAX * ALIGNMENT;
    let restore = PATH_MAX + 2 * ALIGNMENT;
    head + entries.next_multiple_of(ALIGNMENT) + mask_bytes(description.worlds) + restore
}

fn seed_bytes(seed: &[u64]) -> usize {
    size_of_val(seed).next_multiple_of(ALIGNMENT)
}

fn mask_bytes(worlds: usize) -> usize {
    worlds.next_multiple_of(ALIGNMENT)
}

/// Copies numbers into words, converting them to `real`.
fn copy_values(values: Values<'_>, real: Dtype, words: &mut [u64]) {
    fn into<A: Copy, B: bytemuck::Pod>(values: &[A], words: &mut [u64], convert: impl Fn(A) -> B) {
        let entries: &mut [B] = bytemuck::cast_slice_mut(words);
        entries
            .iter_mut()
            .zip(values)
            .for_each(|(entry, &value)| *entry = convert(value));
    }
    match (values, real) {
        (Values::F32(values), Dtype::F64) => into(values, words, f64::from),
        (Values::F32(values), _) => into(values, words, |value| value),
        (Values::F64(values), Dtype::F64) => into(values, words, |value| value),
        (Values::F64(values), _) => into(values, words, |value| value as f32),
    }
}
