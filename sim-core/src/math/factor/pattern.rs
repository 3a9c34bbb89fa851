//! Which entries of a symmetric matrix may differ from zero.

use super::{dense, tri};
use std::collections::BTreeSet;

/// Entries that may differ from zero, fill included, and where they are kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pattern {
    blocks: Vec<Block>,
    /// Block of each row.
    block_of: Vec<usize>,
    /// Runs of row k, columns counted from the block's first: `runs[starts[k]..starts[k + 1]]`.
    starts: Vec<usize>,
    runs: Vec<Run>,
}

/// A part of the matrix that nothing couples to the rest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Block {
    /// Its first row.
    pub first: usize,
    /// Its number of rows.
    pub size: usize,
    /// Where its triangle begins.
    pub offset: usize,
    /// No zeros, and small enough to be unrolled.
    pub dense: bool,
}

/// Columns `start..end` of a row: the path from a dof to the root of its tree makes few of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub start: usize,
    pub end: usize,
}

impl Pattern {
    /// The pattern of a matrix with these off-diagonal entries (either triangle), with its fill.
    pub fn new(size: usize, entries: impl IntoIterator<Item = (usize, usize)>) -> Pattern {
        let mut rows = vec![BTreeSet::new(); size];
        for (a, b) in entries {
            assert!(
                a < size && b < size,
                "entry ({a}, {b}) of a pattern of {size}"
            );
            if a != b {
                rows[a.max(b)].insert(a.min(b));
            }
        }
        for k in (0..size).rev() {
            let row: Vec<usize> = rows[k].iter().copied().collect();
            for (n, &i) in row.iter().enumerate() {
                rows[i].extend(&row[..n]);
            }
        }
        let mut pattern = Pattern {
            starts: vec![0],
            ..Pattern::default()
        };
        pattern.add_blocks(&rows);
        for (k, row) in rows.iter().enumerate() {
            let block = &pattern.blocks[pattern.block_of[k]];
            let first = pattern.runs.len();
            for column in row.iter().map(|column| column - block.first) {
                match pattern.runs[first..].last_mut() {
                    Some(run) if run.end == column => run.end += 1,
                    _ => pattern.runs.push(Run {
                        start: column,
                        end: column + 1,
                    }),
                }
            }
            pattern.starts.push(pattern.runs.len());
        }
        pattern
    }

    /// A block ends where no later row reaches back across.
    fn add_blocks(&mut self, rows: &[BTreeSet<usize>]) {
        let mut reach: Vec<usize> = rows
            .iter()
            .enumerate()
            .map(|(k, row)| *row.first().unwrap_or(&k))
            .collect();
        for k in (1..rows.len()).rev() {
            reach[k - 1] = reach[k - 1].min(if reach[k] < k { reach[k] } else { k - 1 });
        }
        let (mut first, mut offset) = (0, 0);
        while first < rows.len() {
            let next = |k: &usize| reach[*k] == *k;
            let end = (first + 1..rows.len()).find(next).unwrap_or(rows.len());
            let size = end - first;
            let full = (first..end).all(|k| rows[k].len() == k - first);
            let dense = full && size <= dense::LARGEST;
            self.block_of
                .extend(std::iter::repeat_n(self.blocks.len(), size));
            self.blocks.push(Block {
                first,
                size,
                offset,
                dense,
            });
            offset += tri(size, 0);
            first = end;
        }
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.block_of.len()
    }

    /// Numbers that a matrix of this pattern takes.
    pub fn len(&self) -> usize {
        self.blocks
            .last()
            .map_or(0, |block| block.offset + tri(block.size, 0))
    }

    /// No rows?
    pub fn is_empty(&self) -> bool {
        self.block_of.is_empty()
    }

    /// Where entry (row, column) is kept; column ≤ row, both in one block.
    #[inline(always)]
    pub fn at(&self, row: usize, column: usize) -> usize {
        let block = &self.blocks[self.block_of[row]];
        block.offset + tri(row - block.first, column - block.first)
    }

    /// Where entry (row, column) of either triangle is kept, if it is.
    pub fn find(&self, row: usize, column: usize) -> Option<usize> {
        let (row, column) = (row.max(column), row.min(column));
        (self.block_of[row] == self.block_of[column]).then(|| self.at(row, column))
    }

    #[inline(always)]
    pub(super) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Runs of a row of a block, both counted from the block's first.
    #[inline(always)]
    pub(super) fn runs(&self, block: &Block, row: usize) -> &[Run] {
        let k = block.first + row;
        &self.runs[self.starts[k]..self.starts[k + 1]]
    }
}
