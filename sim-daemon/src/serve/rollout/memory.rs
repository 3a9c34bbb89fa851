//! What a policy keeps from frame to frame, per world: whether it has begun, its last action, phases and histories.

use super::question::{Source, Term};

/// Places in a world's memory, and the memory of all worlds.
pub(super) struct Memory {
    /// `(worlds, width)`
    values: Vec<f64>,
    width: usize,
    actions: usize,
    /// First value of each term.
    firsts: Vec<usize>,
}

/// One world's.
pub(super) struct Kept<'a> {
    values: &'a mut [f64],
    actions: usize,
    firsts: &'a [usize],
}

impl Memory {
    /// Memory of worlds, as it was left or, if there is none, before the first frame.
    ///
    /// # Errors
    /// One sentence about memory of another policy.
    pub(super) fn new(
        terms: &[Term],
        sizes: &[usize],
        actions: usize,
        worlds: usize,
        left: Vec<f64>,
    ) -> Result<Memory, String> {
        let mut width = 1 + actions;
        let mut firsts = Vec::with_capacity(terms.len());
        for (term, size) in terms.iter().zip(sizes) {
            firsts.push(width);
            width += usize::from(matches!(term.source, Source::Clock { .. }));
            width += (term.history - 1) * size;
        }
        let values = match left.len() {
            0 => vec![0.0; worlds * width],
            length if length == worlds * width => left,
            length => {
                return Err(format!(
                    "memory has {length} values, and this policy {worlds} × {width}; give that of its own last rollout"
                ));
            }
        };
        Ok(Memory {
            values,
            width,
            actions,
            firsts,
        })
    }

    /// All of it, `(worlds, width)`.
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// That of a world.
    pub(super) fn world(&mut self, world: usize) -> Kept<'_> {
        Kept {
            values: &mut self.values[world * self.width..][..self.width],
            actions: self.actions,
            firsts: &self.firsts,
        }
    }
}

impl Kept<'_> {
    /// Begins anew, as before the first frame.
    pub(super) fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Whether there was a frame.
    pub(super) fn has_begun(&self) -> bool {
        self.values[0] != 0.0
    }

    pub(super) fn begin(&mut self) {
        self.values[0] = 1.0;
    }

    pub(super) fn last_action(&mut self) -> &mut [f64] {
        &mut self.values[1..1 + self.actions]
    }

    /// The phase of a clock.
    pub(super) fn phase(&mut self, term: usize) -> &mut f64 {
        &mut self.values[self.firsts[term]]
    }

    /// Values of a term in the frames before, the oldest first; a clock has its phase before them.
    pub(super) fn history(&mut self, term: usize, clocks: usize, values: usize) -> &mut [f64] {
        &mut self.values[self.firsts[term] + clocks..][..values]
    }
}
