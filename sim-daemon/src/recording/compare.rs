//! A frame beside the recorded one: the first world and field that differ.

use std::fmt;

use sim_protocol::{Dtype, Row, Table};

use super::records::RecordedCommand;

/// A frame that was made again.
pub(super) struct Seen<'a> {
    pub(super) table: &'a Table,
    pub(super) arena: &'a [u64],
    pub(super) digests: &'a [u32],
    /// Rows of the arrays that were recorded whole.
    pub(super) observed: &'a [Row],
}

/// Where a frame first differs from the recorded one.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Difference {
    world: usize,
    field: String,
    /// Worlds that differ in some field.
    worlds: usize,
    /// The entry of the field, what was recorded and what it is here, where the array was recorded whole.
    entry: Option<(usize, String, String)>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Difference { world, field, .. } = self;
        match &self.entry {
            None => write!(f, "world {world}: `{field}` differs")?,
            Some((entry, recorded, here)) => {
                write!(
                    f,
                    "world {world}: `{field}`[{entry}] is {here}, recorded is {recorded}"
                )?;
            }
        }
        match self.worlds {
            1 => Ok(()),
            worlds => write!(f, "; {worlds} worlds differ"),
        }
    }
}

/// The first world that differs, and its first field, if any does.
///
/// # Errors
/// The recorded frame is not as large as ours: one sentence.
pub(super) fn first_difference(
    seen: &Seen<'_>,
    recorded: &RecordedCommand<'_>,
) -> Result<Option<Difference>, String> {
    let padded: usize = seen.observed.iter().map(padded_words).sum();
    if recorded.digests.len() != seen.digests.len() || recorded.observed.len() != padded {
        return Err("the frame recorded has other arrays than the scene makes".to_owned());
    }
    if recorded.digests == seen.digests
        && seen.arrays(recorded).all(|(_, here, there)| here == there)
    {
        return Ok(None);
    }
    let worlds = seen.table.rows().first().map_or(0, |row| row.shape[0]);
    let mut differing = (0..worlds).filter_map(|world| {
        let row = seen.table.rows().iter().enumerate();
        let row = row.map(|(index, row)| (index * worlds + world, row));
        let mut rows = row.filter(|(digest, row)| {
            recorded.digests[*digest] != seen.digests[*digest]
                || seen.entry(recorded, row, world).is_some()
        });
        rows.next().map(|(_, row)| (world, row))
    });
    let (world, row) = differing.next().expect("a digest or an array differs");
    Ok(Some(Difference {
        world,
        field: row.name.clone(),
        entry: seen.entry(recorded, row, world),
        worlds: 1 + differing.count(),
    }))
}

impl<'a> Seen<'a> {
    /// Each array that was recorded whole: its row, here, and as recorded.
    fn arrays(
        &self,
        recorded: &RecordedCommand<'a>,
    ) -> impl Iterator<Item = (&'a Row, &'a [u8], &'a [u8])> + use<'a> {
        let arena: &'a [u8] = bytemuck::cast_slice(self.arena);
        let head = Table::head_bytes(self.table.rows().len());
        let mut rest = recorded.observed;
        self.observed.iter().map(move |row| {
            let (array, others) = rest.split_at(padded_words(row));
            rest = others;
            let there = &bytemuck::cast_slice(array)[..row.bytes];
            (row, &arena[row.offset - head..][..row.bytes], there)
        })
    }

    /// The first entry of a world's part of a field that differs, as recorded and here.
    fn entry(
        &self,
        recorded: &RecordedCommand<'a>,
        row: &Row,
        world: usize,
    ) -> Option<(usize, String, String)> {
        let (_, here, there) = self
            .arrays(recorded)
            .find(|(other, ..)| other.name == row.name)?;
        let part = row.bytes / row.shape[0];
        let of_world =
            |array: &'a [u8]| array[world * part..][..part].chunks_exact(row.dtype.size());
        let mut pairs = of_world(here).zip(of_world(there)).enumerate();
        let (entry, (here, there)) = pairs.find(|(_, (here, there))| here != there)?;
        Some((entry, number(there, row.dtype), number(here, row.dtype)))
    }
}

fn padded_words(row: &Row) -> usize {
    row.bytes.next_multiple_of(sim_protocol::ALIGNMENT) / 8
}

/// A number of an array, in as many digits as tell it from its neighbours.
fn number(bytes: &[u8], dtype: Dtype) -> String {
    match dtype {
        Dtype::F32 => format!("{:?}", bytemuck::pod_read_unaligned::<f32>(bytes)),
        Dtype::F64 => format!("{:?}", bytemuck::pod_read_unaligned::<f64>(bytes)),
        Dtype::I32 => bytemuck::pod_read_unaligned::<i32>(bytes).to_string(),
        Dtype::U32 => bytemuck::pod_read_unaligned::<u32>(bytes).to_string(),
        Dtype::U64 => bytemuck::pod_read_unaligned::<u64>(bytes).to_string(),
        Dtype::U8 => bytes[0].to_string(),
    }
}
