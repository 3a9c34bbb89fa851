//! What a program left behind, world by world.

use super::program::Played;
use sim_engine::backend::COUNTERS;
use sim_engine::simulation::Precision;
use sim_physics::arrays::{Field, FieldDtype, Group, status};

impl Played {
    /// The state shown is finite; a frozen world stands where it was, and one that is not has made its step.
    pub fn check_frozen(&self, before: &[u64], is_set: &[bool]) -> Result<(), String> {
        let frame = &self.run.arena;
        for (world, is_set) in is_set.iter().enumerate() {
            let states = self
                .fields(frame, world)
                .into_iter()
                .zip(self.fields(before, world));
            let states = states.filter(|((field, _), _)| field.row().group == Group::State);
            let is_frozen =
                |frame| self.counter(frame, world, Field::Status) as u32 & status::FROZEN != 0;
            let [last, step] = [before, frame].map(|frame| self.counter(frame, world, Field::Step));
            // by itself, after a frame with a fault
            let was_reset = is_frozen(before) && step < 2;
            if !is_set && !was_reset {
                if is_frozen(before) && !is_frozen(frame) {
                    return Err(format!(
                        "world {world} is no longer frozen, though nobody reset it"
                    ));
                }
                if step != last + u64::from(!is_frozen(frame)) {
                    return Err(format!("world {world}: step {step} after {last}"));
                }
            }
            for ((field, now), (_, then)) in states {
                if !self.numbers(now).iter().all(|x| x.is_finite()) {
                    return Err(format!("world {world}: {field:?} is not finite"));
                }
                if is_frozen(frame) && !is_set && !was_reset && now != then {
                    return Err(format!("world {world}: {field:?} moves while frozen"));
                }
            }
        }
        Ok(())
    }

    /// A counter of a world in a frame.
    pub fn counter(&self, frame: &[u64], world: usize, counter: Field) -> u64 {
        let fields = self.fields(frame, world);
        let (_, bytes) = fields
            .iter()
            .find(|(field, _)| *field == counter)
            .expect("every frame has it");
        let digits = bytes.iter().rev();
        digits.fold(0, |number, &byte| number << 8 | u64::from(byte))
    }

    /// A field's bytes as numbers of the run's precision.
    pub fn numbers(&self, bytes: &[u8]) -> Vec<f64> {
        match self.run.sim.precision() {
            Precision::F32 => {
                let words = bytes.as_chunks().0.iter();
                words.map(|&x| f64::from(f32::from_le_bytes(x))).collect()
            }
            Precision::F64 => bytes
                .as_chunks()
                .0
                .iter()
                .map(|&x| f64::from_le_bytes(x))
                .collect(),
        }
    }

    /// Bytes of each field of a world in a frame.
    pub fn fields<'a>(&self, frame: &'a [u64], world: usize) -> Vec<(Field, &'a [u8])> {
        let bytes: &[u8] = bytemuck::cast_slice(frame);
        let slots = self.run.sim.layout().slots.iter();
        slots
            .map(|slot| {
                let size = slot.bytes / slot.shape[0];
                (slot.field, &bytes[slot.offset + world * size..][..size])
            })
            .collect()
    }

    /// Bytes of a world in a snapshot: its counters, then its numbers.
    fn record<'a>(&self, snapshot: &'a [u8], world: usize) -> (&'a [u8], &'a [u8]) {
        const HEAD: usize = 40;
        let size = (snapshot.len() - HEAD) / self.run.sim.worlds();
        snapshot[HEAD + world * size..][..size].split_at(COUNTERS)
    }

    /// Bits are the same; of numbers that are none, it does not matter which.
    fn alike(&self, field: Field, first: &[u8], second: &[u8]) -> bool {
        let is_real = field.row().dtype == FieldDtype::Real;
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
        first == second
            || is_real
                && self
                    .numbers(first)
                    .iter()
                    .zip(&self.numbers(second))
                    .all(same)
    }

    /// What of a world differs from a world of another run, in the frames of both and at the end.
    pub fn differs(&self, world: usize, other: &Played, other_world: usize) -> Result<(), String> {
        if self.frames.len() != other.frames.len() {
            return Err(format!(
                "{} and {} frames",
                self.frames.len(),
                other.frames.len()
            ));
        }
        for (k, (first, second)) in self.frames.iter().zip(&other.frames).enumerate() {
            let (fields, others) = (
                self.fields(&first.1, world),
                other.fields(&second.1, other_world),
            );
            for (field, bytes) in &fields {
                let Some((_, other_bytes)) = others.iter().find(|(of, _)| of == field) else {
                    continue;
                };
                if !self.alike(*field, bytes, other_bytes) {
                    let at = bytes.iter().zip(*other_bytes).position(|(a, b)| a != b);
                    return Err(format!(
                        "world {world}, frame {k}: {field:?} differs from byte {} on: {:?} and {:?}",
                        at.unwrap_or(0),
                        self.numbers(bytes),
                        self.numbers(other_bytes),
                    ));
                }
            }
        }
        let ((counters, numbers), (others, other_numbers)) = (
            self.record(&self.end, world),
            other.record(&other.end, other_world),
        );
        if counters != others {
            return Err(format!(
                "world {world} at the end: counters {counters:?} and {others:?}"
            ));
        }
        if numbers != other_numbers {
            let (a, b) = (self.numbers(numbers), self.numbers(other_numbers));
            return Err(format!("world {world} at the end: numbers {a:?} and {b:?}"));
        }
        Ok(())
    }
}
