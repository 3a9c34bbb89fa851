//! Where each field lies in the arena of a frame.

use super::fields::{Dtype, FieldDtype, Group};
use super::table::Field;
use crate::constants::Sizes;

/// Alignment of every array in an arena [bytes]: what NumPy, torch and JAX take without a copy.
pub const ALIGNMENT: usize = 64;

/// One array of an arena: contiguous, world-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The field.
    pub field: Field,
    /// Element type.
    pub dtype: Dtype,
    /// Shape, worlds first.
    pub shape: Vec<usize>,
    /// From the start of the arena [bytes].
    pub offset: usize,
    /// Size [bytes].
    pub bytes: usize,
}

/// The arrays of an arena.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// In order of their offsets.
    pub slots: Vec<Slot>,
    /// Size of the arena [bytes], a multiple of [`ALIGNMENT`].
    pub bytes: usize,
}

impl Layout {
    /// Arrays of the given fields, each once, then of all counters.
    pub fn new(sizes: &Sizes, worlds: usize, real: Dtype, fields: &[Field]) -> Layout {
        let counters = Field::ALL
            .iter()
            .filter(|field| field.row().group == Group::Counter);
        let mut layout = Layout {
            slots: Vec::new(),
            bytes: 0,
        };
        for &field in fields.iter().chain(counters) {
            if layout.slots.iter().any(|slot| slot.field == field) {
                continue;
            }
            let dtype = match field.row().dtype {
                FieldDtype::Real => real,
                FieldDtype::Fixed(dtype) => dtype,
            };
            let mut shape = vec![worlds];
            shape.extend(field.row().shape.iter().map(|axis| axis.len(sizes)));
            let bytes = shape.iter().product::<usize>() * dtype.bytes();
            layout.slots.push(Slot {
                field,
                dtype,
                shape,
                offset: layout.bytes,
                bytes,
            });
            layout.bytes += bytes.next_multiple_of(ALIGNMENT);
        }
        layout
    }
}
