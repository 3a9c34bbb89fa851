//! Rows of a factor that rank-one updates reach.

use super::pattern::Pattern;
use std::ops::Range;

/// Rows that an update of a factor changes, the last one first: those in which the vector may differ from 0, and all that
/// they couple to.
///
/// A row of the path is known by its place on it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UpdatePath {
    /// Of each row, its place among those that the path is of.
    sources: Vec<Option<usize>>,
    /// Entry (k, i) of the matrix is at `starts[k] + places[i]`.
    starts: Vec<usize>,
    places: Vec<usize>,
    /// Of each row i, the rows before it on the path that have an entry (k, i).
    before: Vec<Vec<Range<usize>>>,
}

impl UpdatePath {
    /// The path of vectors that are 0 but for some rows: `of`.
    pub fn new(pattern: &Pattern, of: &[usize]) -> UpdatePath {
        // rows to come, with the rows of the path so far that have an entry in their column
        let size = of.iter().max().map_or(0, |last| last + 1);
        let mut rows: Vec<Option<Vec<Range<usize>>>> = vec![None; size];
        for &row in of {
            rows[row] = Some(Vec::new());
        }
        let mut path = UpdatePath::default();
        for row in (0..size).rev() {
            let Some(before) = rows[row].take() else {
                continue;
            };
            let k = path.starts.len();
            for column in pattern.columns(row) {
                let before = rows[column].get_or_insert_default();
                match before.last_mut() {
                    Some(range) if range.end == k => range.end += 1,
                    _ => before.push(k..k + 1),
                }
            }
            let (start, place) = pattern.start_and_place(row);
            path.sources.push(of.iter().position(|other| *other == row));
            path.starts.push(start);
            path.places.push(place);
            path.before.push(before);
        }
        path
    }

    /// Of each row, the last one first, its place among those that the path is of.
    #[inline(always)]
    pub fn sources(&self) -> &[Option<usize>] {
        &self.sources
    }

    /// The rows before row i that have an entry in its column.
    #[inline(always)]
    pub fn before(&self, i: usize) -> &[Range<usize>] {
        &self.before[i]
    }

    /// Where entry (k, i) is kept; k is not after i, and the pattern has it.
    #[inline(always)]
    pub fn at(&self, k: usize, i: usize) -> usize {
        self.starts[k] + self.places[i]
    }
}
