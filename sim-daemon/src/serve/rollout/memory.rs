//! What a policy keeps from frame to frame, per world: whether it has begun, its last action, phases and histories.
//!
//! The first value is 0 before the first frame, 1 after it, and 2 where the world is frozen by a fault.

use super::question::{Source, Term};

/// First value of a world whose policy has seen a frame.
const BEGUN: f64 = 1.0;
/// Of one that a fault has frozen since.
const FROZEN: f64 = 2.0;

/// Places in a world's memory.
pub(super) struct Places {
    width: usize,
    actions: usize,
    /// First value of each term.
    firsts: Vec<usize>,
}

/// The memory of all worlds.
pub(super) struct Memory {
    /// `(worlds, width)`
    values: Vec<f64>,
    places: Places,
}

/// One world's.
pub(super) struct Kept<'a> {
    values: &'a mut [f64],
    actions: usize,
    firsts: &'a [usize],
}

impl Places {
    /// Lays out the memory of a world.
    ///
    /// # Errors
    /// One sentence about more values than an array has.
    pub(super) fn lay_out(
        terms: &[Term],
        sizes: &[usize],
        actions: usize,
        worlds: usize,
    ) -> Result<Places, String> {
        let mut width = Some(1 + actions);
        let mut firsts = Vec::with_capacity(terms.len());
        for (term, &size) in terms.iter().zip(sizes) {
            firsts.push(width.unwrap_or_default());
            let clocks = usize::from(matches!(term.source, Source::Clock { .. }));
            let past = term.history.saturating_sub(1).checked_mul(size);
            width = past
                .and_then(|past| past.checked_add(clocks))
                .and_then(|more| width?.checked_add(more));
        }
        let fits = |&width: &usize| {
            let values = worlds.checked_mul(width);
            values
                .and_then(|values| values.checked_mul(size_of::<f64>()))
                .is_some()
        };
        let width = width
            .filter(fits)
            .ok_or("the history of a term is too long; give a shorter one")?;
        Ok(Places {
            width,
            actions,
            firsts,
        })
    }

    /// Bytes of all worlds.
    pub(super) fn bytes(&self, worlds: usize) -> u64 {
        (worlds * self.width * size_of::<f64>()) as u64
    }
}

impl Memory {
    /// Memory of worlds, as it was left or, if there is none, before the first frame.
    ///
    /// # Errors
    /// One sentence about memory of another policy.
    pub(super) fn new(places: Places, worlds: usize, left: Vec<f64>) -> Result<Memory, String> {
        let width = places.width;
        let values = match left.len() {
            0 => vec![0.0; worlds * width],
            length if length == worlds * width => left,
            length => {
                return Err(format!(
                    "memory has {length} values, and this policy {worlds} × {width}; give that of its own last rollout"
                ));
            }
        };
        Ok(Memory { values, places })
    }

    /// All of it, `(worlds, width)`.
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// That of a world.
    pub(super) fn world(&mut self, world: usize) -> Kept<'_> {
        Kept {
            values: &mut self.values[world * self.places.width..][..self.places.width],
            actions: self.places.actions,
            firsts: &self.places.firsts,
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
        self.values[0] = BEGUN;
    }

    /// Whether the world was frozen after the last frame.
    pub(super) fn is_frozen(&self) -> bool {
        self.values[0] == FROZEN
    }

    /// Keeps whether the world is frozen now.
    pub(super) fn set_frozen(&mut self, is_frozen: bool) {
        if self.has_begun() {
            self.values[0] = if is_frozen { FROZEN } else { BEGUN };
        }
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
