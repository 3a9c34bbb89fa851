//! A command at the daemon: copied once, then checked; nothing is read from shared memory twice.

use crate::command::{FROM_WORLD, MASK, PATH, command_bytes};
use crate::{CommandHeader, Description, Dtype, Op, Row, Table};

/// The last command received.
#[derive(Debug)]
pub struct Inbox {
    pub(super) header: CommandHeader,
    pub(super) op: Op,
    pub(super) table: Table,
    words: Vec<u64>,
    used: usize,
}

/// The numbers of an array in a command.
#[derive(Debug, Clone, Copy)]
pub enum Numbers<'a> {
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
    /// Whole numbers.
    U64(&'a [u64]),
}

impl Inbox {
    /// Room for the commands of a daemon.
    pub fn for_commands_of(description: &Description) -> Inbox {
        Inbox::new(command_bytes(description))
    }

    fn new(capacity_bytes: usize) -> Inbox {
        Inbox {
            header: CommandHeader::default(),
            op: Op::Forward,
            table: Table::lay_out([]),
            words: vec![0; capacity_bytes.div_ceil(8)],
            used: 0,
        }
    }

    /// Copies a payload and checks its table, unless the table is the one that was checked last.
    ///
    /// # Errors
    /// One sentence about the first thing that is wrong.
    pub fn take(&mut self, header: CommandHeader, payload: &[u64]) -> Result<(), String> {
        self.header = header;
        self.used = 0;
        self.op =
            Op::from_code(header.op).ok_or_else(|| format!("unknown operation {}", header.op))?;
        let Some(words) = self.words.get_mut(..payload.len()) else {
            return Err(format!(
                "a command of {} bytes, at most {} fit",
                payload.len() * 8,
                self.words.len() * 8
            ));
        };
        words.copy_from_slice(payload);
        if !self.table.describes(words, header.rows) {
            self.table = Table::parse(words, header.rows)?;
        }
        for (name, dtype) in [
            (MASK, Dtype::U8),
            (PATH, Dtype::U8),
            (FROM_WORLD, Dtype::U64),
        ] {
            let row = self.table.row(name);
            if let Some(row) = row.filter(|row| row.dtype != dtype || row.shape.len() != 1) {
                let (got, axes, expected) =
                    (row.dtype.numpy_name(), row.shape.len(), dtype.numpy_name());
                return Err(format!(
                    "{name}: {got} of {axes} axes; {expected} of one is needed"
                ));
            }
        }
        self.used = payload.len();
        Ok(())
    }

    /// The command as it came: field table and arrays.
    pub(super) fn payload(&self) -> &[u64] {
        &self.words[..self.used]
    }

    /// What is asked for.
    pub fn op(&self) -> Op {
        self.op
    }

    /// Lease and number of the command.
    pub fn header(&self) -> &CommandHeader {
        &self.header
    }

    /// The arrays, without the mask.
    pub fn arrays(&self) -> impl Iterator<Item = &Row> {
        self.table.rows().iter().filter(|row| row.name != MASK)
    }

    /// The numbers of an array; `None` when it is not of one of those types.
    pub fn numbers(&self, row: &Row) -> Option<Numbers<'_>> {
        let bytes = self.bytes(row);
        match row.dtype {
            Dtype::F32 => Some(Numbers::F32(bytemuck::cast_slice(bytes))),
            Dtype::F64 => Some(Numbers::F64(bytemuck::cast_slice(bytes))),
            Dtype::U64 => Some(Numbers::U64(bytemuck::cast_slice(bytes))),
            _ => None,
        }
    }

    /// The mask, one byte a world, if there is one. Its length is not checked.
    pub fn mask(&self) -> Option<&[u8]> {
        Some(self.bytes(self.table.row(MASK)?))
    }

    /// The path of a snapshot, if there is one, as it came: it may not be UTF-8.
    pub fn path(&self) -> Option<&[u8]> {
        Some(self.bytes(self.table.row(PATH)?))
    }

    /// The world of a snapshot that goes into all, if there is one: its entries, of which there should be one.
    pub fn from_world(&self) -> Option<&[u64]> {
        Some(bytemuck::cast_slice(
            self.bytes(self.table.row(FROM_WORLD)?),
        ))
    }

    /// Bytes of an array of this command's table; the table was checked against the payload.
    fn bytes(&self, row: &Row) -> &[u8] {
        let bytes: &[u8] = bytemuck::cast_slice(&self.words[..self.used]);
        &bytes[row.offset..row.offset + row.bytes]
    }
}
