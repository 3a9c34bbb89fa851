//! A command at the daemon: copied once, then checked; nothing is read from shared memory twice.

use crate::wire::command::{
    Call, FROM_WORLD, MASK, ON_DEVICE, OnDevice, PATH, Values, command_bytes,
};
use crate::{Command, CommandHeader, Description, Dtype, Op, Row, Table};

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
            (ON_DEVICE, Dtype::U64),
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
        let left = self.table.row(ON_DEVICE);
        if let Some(row) = left.filter(|row| row.shape[..] != [2]) {
            let got = row.shape[0];
            return Err(format!("{ON_DEVICE}: {got} entries; 2 are needed"));
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

    /// The arrays, without the mask and what is in device memory.
    pub fn arrays(&self) -> impl Iterator<Item = &Row> {
        let rows = self.table.rows().iter();
        rows.filter(|row| row.name != MASK && row.name != ON_DEVICE)
    }

    /// What a step takes from device memory, if anything.
    pub fn on_device(&self) -> Option<OnDevice> {
        let row = self.table.row(ON_DEVICE)?;
        let &[ready, commands] = bytemuck::cast_slice::<_, u64>(self.bytes(row)) else {
            return None;
        };
        Some(OnDevice { ready, commands })
    }

    /// Makes one of a step of commands here and commands that were in device memory.
    ///
    /// # Errors
    /// One sentence, where commands here have other than single precision, or do not fit beside the others.
    pub fn bring_here(
        &mut self,
        description: &Description,
        brought: &[(String, Vec<f32>)],
    ) -> Result<(), String> {
        let here: Vec<(Row, Vec<f32>)> = self
            .arrays()
            .map(|row| match self.numbers(row) {
                Some(Numbers::F32(values)) => Ok((row.clone(), values.to_vec())),
                _ => Err(format!("`{}`: entries must be float32", row.name)),
            })
            .collect::<Result<_, _>>()?;
        let worlds = description.worlds.max(1);
        let there = brought.iter().map(|(name, values)| Command {
            field: name,
            columns: 0..values.len() / worlds,
            values: Values::F32(values),
        });
        let here = here.iter().map(|(row, values)| Command {
            field: &row.name,
            columns: row.start..row.start.saturating_add(values.len() / worlds),
            values: Values::F32(values),
        });
        let commands: Vec<Command<'_>> = here.chain(there).collect();
        self.put(description, self.header, self.op, &commands)
    }

    /// Takes a command that the daemon makes itself.
    ///
    /// # Errors
    /// As [`Inbox::take`], and what does not fit.
    pub fn put(
        &mut self,
        description: &Description,
        header: CommandHeader,
        op: Op,
        commands: &[Command<'_>],
    ) -> Result<(), String> {
        let call = Call::new(op, commands, None);
        call.check(description).map_err(|error| error.to_string())?;
        let mut words = vec![0; call.bytes(description) / 8];
        call.write(description, &mut words);
        let (op, rows) = (op as u32, call.rows() as u32);
        self.take(CommandHeader { op, rows, ..header }, &words)
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

    /// The mask, one byte per world, if there is one. Its length is not checked.
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
