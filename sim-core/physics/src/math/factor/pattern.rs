//! Which entries of a symmetric matrix may differ from zero, and where they are kept.

use super::{dense, general, tree, tri};
use std::collections::BTreeSet;

/// Entries that may differ from zero, fill included, and where they are kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pattern {
    blocks: Vec<Block>,
    /// Where each row begins.
    starts: Vec<usize>,
    /// Place of each column in the rows that have it.
    places: Vec<usize>,
    /// Scalars of a matrix.
    len: usize,
    /// Block of each row.
    block_of: Vec<usize>,
    /// Part of `runs` that is a row's; columns counted from the block's first.
    run_starts: Vec<usize>,
    runs: Vec<Run>,
    /// Part of `path_rows` and `path_starts` that is a row's.
    path_bounds: Vec<usize>,
    /// Rows on the path to the root, root first, counted from the block's first.
    path_rows: Vec<usize>,
    /// Where they begin, counted from the block's first scalar.
    path_starts: Vec<usize>,
    /// Segments of the trees.
    segments: Vec<Segment>,
    /// Tiles of the general blocks, and the columns of each above it, counted from the block's first.
    tiles: Vec<Tile>,
    tile_runs: Vec<Run>,
}

/// A part of the matrix that nothing couples to the rest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Block {
    /// Its first row.
    pub first: usize,
    /// Its number of rows.
    pub size: usize,
    /// Where its scalars begin.
    pub offset: usize,
    /// How many scalars it has.
    pub len: usize,
    /// Its structure.
    pub kind: Kind,
    /// Its part of the segments, if it is no general one.
    segments: (usize, usize),
    /// Its part of the tiles, if it is a general one.
    tiles: (usize, usize),
}

/// Structure of a block, which decides how it is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// No zeros, and small: a packed triangle.
    Dense,
    /// Each row couples to the rows on its path to the root: paths one after another.
    Tree,
    /// Anything else: a packed triangle, with zeros.
    General,
}

/// Columns `start..end` of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub start: usize,
    pub end: usize,
}

/// Rows of a tree that follow each other on a path, kept one after another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Segment {
    /// Its first row, counted from the block's first.
    pub first: usize,
    /// Its number of rows.
    pub size: usize,
    /// Where its scalars begin, counted from the block's first.
    pub start: usize,
    /// Where they end.
    end: usize,
}

impl Segment {
    /// Its rows, counted from the block's first.
    #[inline(always)]
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.size
    }
    /// Its scalars, counted from the block's first.
    #[inline(always)]
    pub fn range(&self) -> std::ops::Range<usize> {
        self.start..self.end
    }
    /// Does it begin at the root? It is a full triangle then.
    #[inline(always)]
    pub fn is_root(&self) -> bool {
        self.start == 0
    }
}

/// Rows of a general block that follow each other and are eliminated together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    /// Its first row, counted from the block's first.
    pub first: usize,
    /// Its number of rows.
    pub size: usize,
    /// Its part of the runs of tiles.
    runs: (usize, usize),
}

/// A row of a tree.
pub(super) struct Path<'a> {
    /// Rows on the path to the root, root first, counted from the block's first.
    pub rows: &'a [usize],
    /// Where they begin.
    pub starts: &'a [usize],
}

impl Pattern {
    /// Its layout in the text that a model's hash is of: names, keys and order are those of recordings, whatever they are here.
    pub fn layout_text(&self) -> String {
        let Pattern {
            blocks,
            starts,
            places,
            len,
            block_of,
            run_starts,
            runs,
            path_bounds,
            path_rows,
            path_starts,
            segments,
            // follow from the rows
            tiles: _,
            tile_runs: _,
        } = self;
        let blocks = blocks.iter().map(|block| {
            let Block {
                first,
                size,
                offset,
                len,
                kind,
                segments,
                tiles: _,
            } = block;
            let kind = match kind {
                Kind::Dense => "Dense",
                Kind::Tree => "Tree",
                Kind::General => "General",
            };
            format!(
                "Block {{ first: {first}, size: {size}, offset: {offset}, len: {len}, kind: {kind}, segments: {segments:?} }}"
            )
        });
        let runs =
            (runs.iter()).map(|Run { start, end }| format!("Run {{ start: {start}, end: {end} }}"));
        let segments = segments.iter().map(|segment| {
            let Segment {
                first,
                size,
                start,
                end,
            } = segment;
            format!("Segment {{ first: {first}, size: {size}, start: {start}, end: {end} }}")
        });
        let [blocks, runs, segments] = [
            blocks.collect::<Vec<_>>(),
            runs.collect(),
            segments.collect(),
        ]
        .map(|parts| parts.join(", "));
        format!(
            "Pattern {{ blocks: [{blocks}], starts: {starts:?}, places: {places:?}, len: {len}, block_of: {block_of:?}, \
             run_starts: {run_starts:?}, runs: [{runs}], path_bounds: {path_bounds:?}, path_rows: {path_rows:?}, \
             path_starts: {path_starts:?}, segments: [{segments}] }}"
        )
    }

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
            // fill: eliminating a row couples its last column to all others
            let mut row = rows[k].clone();
            if let Some(last) = row.pop_last() {
                rows[last].append(&mut row);
            }
        }
        let mut pattern = Pattern {
            run_starts: vec![0],
            path_bounds: vec![0],
            ..Pattern::default()
        };
        let mut first = 0;
        while first < size {
            let end = block_end(&rows, first);
            pattern.add_block(&rows[first..end], first);
            first = end;
        }
        pattern
    }

    fn add_block(&mut self, rows: &[BTreeSet<usize>], first: usize) {
        let (size, offset) = (rows.len(), self.len);
        let full = (0..size).all(|k| rows[k].len() == k);
        // the path of a row is that of the last row on it, and that row
        let is_path = |row: &BTreeSet<usize>| match row.last() {
            None => true,
            Some(&last) => {
                let above = &rows[last - first];
                row.len() == above.len() + 1 && above.is_subset(row)
            }
        };
        let kind = match (full && size <= dense::LARGEST, rows.iter().all(is_path)) {
            (true, _) => Kind::Dense,
            (false, true) => Kind::Tree,
            (false, false) => Kind::General,
        };
        for (k, row) in rows.iter().enumerate() {
            let (start, place) = match kind {
                Kind::Tree => (self.len, row.len()),
                Kind::Dense | Kind::General => (offset + tri(k, 0), k),
            };
            self.starts.push(start);
            self.places.push(place);
            self.len = start + place + 1;
            self.block_of.push(self.blocks.len());
            self.add_runs(row, first);
            for &column in row {
                self.path_rows.push(column - first);
                self.path_starts.push(self.starts[column] - offset);
            }
            self.path_bounds.push(self.path_rows.len());
        }
        let (segments, tiles) = (self.segments.len(), self.tiles.len());
        match kind {
            Kind::Dense | Kind::Tree => self.add_segments(rows, first, offset),
            Kind::General => self.add_tiles(rows, first),
        }
        self.blocks.push(Block {
            first,
            size,
            offset,
            len: self.len - offset,
            kind,
            segments: (segments, self.segments.len()),
            tiles: (tiles, self.tiles.len()),
        });
    }

    /// Takes the rows of a general block [`general::TILE`] at a time, from the last on.
    fn add_tiles(&mut self, rows: &[BTreeSet<usize>], first: usize) {
        let mut end = rows.len();
        while end > 0 {
            let begin = end.saturating_sub(general::TILE);
            // columns of any of them
            let columns: BTreeSet<usize> = rows[begin..end].iter().flatten().copied().collect();
            let above = columns.iter().map(|column| column - first);
            let runs = self.tile_runs.len();
            add_to_runs(&mut self.tile_runs, runs, above.filter(|&k| k < begin));
            self.tiles.push(Tile {
                first: begin,
                size: end - begin,
                runs: (runs, self.tile_runs.len()),
            });
            end = begin;
        }
    }

    /// Cuts a tree where it branches, and its branches into even parts of at most [`tree::SEGMENT`] rows.
    fn add_segments(&mut self, rows: &[BTreeSet<usize>], first: usize, offset: usize) {
        let parent = |k: usize| rows[k].last().map(|&row| row - first);
        let children = |k: usize| (0..rows.len()).filter(|&i| parent(i) == Some(k)).count();
        let mut begin = 0;
        while begin < rows.len() {
            let mut end = begin + 1;
            while end < rows.len() && parent(end) == Some(end - 1) && children(end - 1) == 1 {
                end += 1;
            }
            while begin < end {
                let left = end - begin;
                let size = match begin {
                    0 => left.min(dense::LARGEST),
                    _ => left.div_ceil(left.div_ceil(tree::SEGMENT)),
                };
                let last =
                    self.starts[first + begin + size - 1] + self.places[first + begin + size - 1];
                self.segments.push(Segment {
                    first: begin,
                    size,
                    start: self.starts[first + begin] - offset,
                    end: last + 1 - offset,
                });
                begin += size;
            }
        }
    }

    fn add_runs(&mut self, row: &BTreeSet<usize>, first: usize) {
        let begin = self.runs.len();
        add_to_runs(
            &mut self.runs,
            begin,
            row.iter().map(|column| column - first),
        );
        self.run_starts.push(self.runs.len());
    }

    /// Scalars of a matrix with this pattern.
    pub fn len(&self) -> usize {
        self.len
    }

    /// No rows?
    pub fn is_empty(&self) -> bool {
        self.block_of.is_empty()
    }

    /// Where entry (row, column) is kept; column ≤ row, and the pattern has it.
    #[inline(always)]
    pub fn at(&self, row: usize, column: usize) -> usize {
        self.starts[row] + self.places[column]
    }

    /// Where entry (row, column) of either triangle is kept, if it is. A general block keeps its zeros, too.
    pub fn find(&self, row: usize, column: usize) -> Option<usize> {
        let (row, column) = (row.max(column), row.min(column));
        let block = &self.blocks[self.block_of[row]];
        let kept = match block.kind {
            Kind::Dense | Kind::General => column >= block.first,
            Kind::Tree => self.has(row, column),
        };
        kept.then(|| self.at(row, column))
    }

    /// May entry (row, column) of either triangle differ from zero? A factorisation visits no other.
    pub fn has(&self, row: usize, column: usize) -> bool {
        let (row, column) = (row.max(column), row.min(column));
        let block = &self.blocks[self.block_of[row]];
        let path = &self.path_rows[self.path_bounds[row]..self.path_bounds[row + 1]];
        column == row || (column >= block.first && path.contains(&(column - block.first)))
    }

    /// Columns before the diagonal of a row that it has.
    pub(super) fn columns(&self, row: usize) -> impl Iterator<Item = usize> + '_ {
        let first = self.blocks[self.block_of[row]].first;
        let columns = &self.path_rows[self.path_bounds[row]..self.path_bounds[row + 1]];
        columns.iter().map(move |column| first + column)
    }

    /// Where a row begins, and the place of its column in rows that have it: [`Pattern::at`] is their sum.
    pub(super) fn start_and_place(&self, row: usize) -> (usize, usize) {
        (self.starts[row], self.places[row])
    }

    #[inline(always)]
    pub(super) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Rows of each part of the matrix that nothing couples to the rest.
    #[inline(always)]
    pub fn parts(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        let rows = |block: &Block| block.first..block.first + block.size;
        self.blocks.iter().map(rows)
    }

    /// The part that a row is of.
    pub fn part_of(&self, row: usize) -> usize {
        let part = self.parts().position(|rows| rows.contains(&row));
        part.expect("every row is of a part")
    }

    /// Runs of a row of a block, both counted from the block's first.
    #[inline(always)]
    pub(super) fn runs(&self, block: &Block, row: usize) -> &[Run] {
        let k = block.first + row;
        &self.runs[self.run_starts[k]..self.run_starts[k + 1]]
    }

    /// Tiles of a general block, the last rows first.
    #[inline(always)]
    pub(super) fn tiles(&self, block: &Block) -> &[Tile] {
        &self.tiles[block.tiles.0..block.tiles.1]
    }

    /// Columns above a tile that any of its rows has.
    #[inline(always)]
    pub(super) fn columns_above(&self, tile: &Tile) -> &[Run] {
        &self.tile_runs[tile.runs.0..tile.runs.1]
    }

    /// Scalars of a row of a block, both counted from the block's first; the diagonal is the last.
    #[inline(always)]
    pub(super) fn row(&self, block: &Block, row: usize) -> std::ops::Range<usize> {
        let k = block.first + row;
        let start = self.starts[k] - block.offset;
        start..start + self.places[k] + 1
    }

    /// Segments of a tree, in the order of their rows.
    #[inline(always)]
    pub(super) fn segments(&self, block: &Block) -> &[Segment] {
        &self.segments[block.segments.0..block.segments.1]
    }

    /// Path of a row of a tree, counted from the block's first.
    #[inline(always)]
    pub(super) fn path(&self, block: &Block, row: usize) -> Path<'_> {
        let k = block.first + row;
        let bounds = self.path_bounds[k]..self.path_bounds[k + 1];
        Path {
            rows: &self.path_rows[bounds.clone()],
            starts: &self.path_starts[bounds],
        }
    }
}

/// Appends rising columns as runs; those before `begin` are complete.
fn add_to_runs(runs: &mut Vec<Run>, begin: usize, columns: impl Iterator<Item = usize>) {
    for column in columns {
        match runs[begin..].last_mut() {
            Some(run) if run.end == column => run.end += 1,
            _ => runs.push(Run {
                start: column,
                end: column + 1,
            }),
        }
    }
}

/// A block ends where no later row reaches back across.
fn block_end(rows: &[BTreeSet<usize>], first: usize) -> usize {
    let mut end = first + 1;
    for k in first + 1..rows.len() {
        if rows[k].first().is_some_and(|&column| column < end) {
            end = k + 1;
        }
    }
    end
}
