//! The field table of a sample: laid out by the sender, checked by the receiver before anything is read through it.

use crate::{ALIGNMENT, Dtype, Row};

/// Rows that a table may have.
pub const ROWS_MAX: usize = 128;

/// A checked field table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    rows: Vec<Row>,
    words: Vec<u64>,
    total: usize,
}

impl Table {
    /// Lays out arrays one after the other behind the table.
    ///
    /// # Panics
    /// When there are more than [`ROWS_MAX`] arrays: our own tables never have.
    pub fn lay_out(arrays: impl IntoIterator<Item = (String, Dtype, Vec<usize>, usize)>) -> Table {
        let arrays: Vec<_> = arrays.into_iter().collect();
        assert!(
            arrays.len() <= ROWS_MAX,
            "{} arrays in one sample",
            arrays.len()
        );
        let mut offset = Table::head_bytes(arrays.len());
        let mut rows = Vec::with_capacity(arrays.len());
        for (name, dtype, shape, start) in arrays {
            let bytes = shape.iter().product::<usize>() * dtype.size();
            rows.push(Row {
                name,
                dtype,
                shape,
                start,
                offset,
                bytes,
            });
            offset = (offset + bytes).next_multiple_of(ALIGNMENT);
        }
        Table::from_rows(rows, offset)
    }

    /// A table over arrays that lie where the caller has put them.
    pub(crate) fn from_rows(rows: Vec<Row>, total: usize) -> Table {
        let mut words = vec![0; rows.len() * Row::WORDS];
        for (row, words) in rows.iter().zip(words.as_chunks_mut().0) {
            row.encode(words);
        }
        Table { rows, words, total }
    }

    /// A table whose arrays lie in one arena, at offsets that count from its start.
    ///
    /// The arena begins at [`Table::head_bytes`].
    pub fn over_arena(
        slots: impl IntoIterator<Item = (String, Dtype, Vec<usize>, usize)>,
        arena_bytes: usize,
    ) -> Table {
        let slots: Vec<_> = slots.into_iter().collect();
        let head = Table::head_bytes(slots.len());
        let rows = slots
            .into_iter()
            .map(|(name, dtype, shape, offset)| {
                let bytes = shape.iter().product::<usize>() * dtype.size();
                Row {
                    name,
                    dtype,
                    shape,
                    start: 0,
                    offset: head + offset,
                    bytes,
                }
            })
            .collect();
        Table::from_rows(rows, head + arena_bytes.next_multiple_of(ALIGNMENT))
    }

    /// Reads and checks the table of a sample of `payload`.
    ///
    /// After this, every row lies inside the sample, behind the table, aligned, and overlaps no other row.
    ///
    /// # Errors
    /// One sentence about the first thing that is wrong.
    pub fn parse(payload: &[u64], rows: u32) -> Result<Table, String> {
        let count = rows as usize;
        let total = size_of_val(payload);
        if count > ROWS_MAX {
            return Err(format!(
                "{count} rows in the field table, at most {ROWS_MAX} are allowed"
            ));
        }
        let Some(words) = payload.get(..count * Row::WORDS) else {
            return Err(format!(
                "field table of {count} rows in a sample of {total} bytes"
            ));
        };
        let mut rows: Vec<Row> = Vec::with_capacity(count);
        let mut free = Table::head_bytes(count);
        for words in words.as_chunks().0 {
            let row = Row::decode(words)?;
            let end = row.offset.checked_add(row.bytes);
            if row.offset % ALIGNMENT != 0 || row.offset < free || end.is_none_or(|end| end > total)
            {
                return Err(format!(
                    "{}: bytes {}..+{} do not lie, aligned and apart, in a sample of {total} bytes",
                    row.name, row.offset, row.bytes
                ));
            }
            // arrays without columns, of robots that stand still, begin where their neighbours do
            let twin = |other: &Row| other.name == row.name && other.start == row.start;
            if row.bytes > 0 && rows.iter().any(|other| other.bytes > 0 && twin(other)) {
                return Err(format!("{} comes twice", row.name));
            }
            free = row.offset + row.bytes;
            rows.push(row);
        }
        Ok(Table {
            rows,
            words: words.to_vec(),
            total,
        })
    }

    /// Bytes before the first array: the rows, rounded up to [`ALIGNMENT`].
    pub const fn head_bytes(rows: usize) -> usize {
        (rows * Row::WORDS * 8).next_multiple_of(ALIGNMENT)
    }

    /// The rows in order.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The row named so.
    pub fn row(&self, name: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.name == name)
    }

    /// The table as the protocol has it.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Size of the sample in bytes.
    pub fn total_bytes(&self) -> usize {
        self.total
    }

    /// Whether `payload` begins with exactly this table and is long enough for it: then it needs no second check.
    pub fn describes(&self, payload: &[u64], rows: u32) -> bool {
        rows as usize == self.rows.len()
            && size_of_val(payload) >= self.total
            && payload.starts_with(&self.words)
    }
}

#[cfg(all(test, not(simulated)))]
mod tests {
    use super::*;

    fn sample() -> (Table, Vec<u64>) {
        let table = Table::lay_out([
            ("joint_q".to_owned(), Dtype::F32, vec![3, 9], 0),
            ("time".to_owned(), Dtype::F64, vec![3], 0),
        ]);
        let mut payload = vec![0; table.total_bytes() / 8];
        payload[..table.words().len()].copy_from_slice(table.words());
        (table, payload)
    }

    #[test]
    fn a_table_reads_as_it_was_written() {
        let (table, payload) = sample();
        assert_eq!(Table::parse(&payload, 2).unwrap(), table);
        assert!(table.describes(&payload, 2));
    }

    #[test]
    fn a_truncated_table_is_refused() {
        let (_, payload) = sample();
        for words in 0..2 * Row::WORDS {
            assert!(
                Table::parse(&payload[..words], 2).is_err(),
                "{words} words were accepted"
            );
        }
        let error = Table::parse(&payload[..payload.len() - 8], 2).unwrap_err();
        assert!(error.starts_with("time"), "{error}");
    }

    #[test]
    fn every_hostile_word_of_a_table_is_refused_or_harmless() {
        let (_, payload) = sample();
        let total = payload.len() * 8;
        for word in 0..2 * Row::WORDS {
            for value in [
                0,
                1,
                7,
                63,
                u64::MAX,
                u64::MAX - 63,
                1 << 32,
                total as u64,
                payload[word] ^ 1,
            ] {
                let mut hostile = payload.clone();
                hostile[word] = value;
                if let Ok(table) = Table::parse(&hostile, 2) {
                    for row in table.rows() {
                        assert!(
                            row.offset >= Table::head_bytes(2) && row.offset + row.bytes <= total,
                            "{row:?}"
                        );
                        assert_eq!(
                            row.shape.iter().product::<usize>() * row.dtype.size(),
                            row.bytes
                        );
                    }
                }
            }
        }
        assert!(Table::parse(&payload, u32::MAX).is_err());
    }

    #[test]
    fn an_array_comes_once_and_one_without_columns_beside_it() {
        let read = |columns: [usize; 2]| {
            let array = |columns| ("joint_f".to_owned(), Dtype::F32, vec![3, columns], 0);
            let table = Table::lay_out(columns.map(array));
            let mut payload = vec![0; table.total_bytes() / 8];
            payload[..table.words().len()].copy_from_slice(table.words());
            Table::parse(&payload, 2)
        };
        assert!(read([0, 9]).is_ok() && read([9, 0]).is_ok() && read([0, 0]).is_ok());
        assert_eq!(read([9, 9]).unwrap_err(), "joint_f comes twice");
    }

    #[test]
    fn arrays_that_overlap_are_refused() {
        let (_, mut payload) = sample();
        payload[Row::WORDS + 10] = payload[10]; // `time` begins where `joint_q` does
        assert!(Table::parse(&payload, 2).is_err());
    }
}
