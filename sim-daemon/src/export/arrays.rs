//! A frame in memory of our own.

use sim_engine::simulation::Simulation;
use sim_protocol::{Dtype, Table};

use crate::export;
use crate::eyes::Images;

/// The arrays of a frame.
pub struct Arrays {
    table: Table,
    arena: Vec<u64>,
}

/// One of them.
#[derive(Clone, Copy, Debug)]
pub struct Array<'a> {
    /// Name of its field.
    pub name: &'a str,
    /// Type of an entry.
    pub dtype: Dtype,
    /// Its shape, worlds first.
    pub shape: &'a [usize],
    /// Its entries.
    pub bytes: &'a [u8],
}

impl Arrays {
    /// As frames of a simulation and of its cameras are laid out; all zero.
    pub(crate) fn new(simulation: &Simulation, images: &Images) -> Arrays {
        Arrays {
            table: export::frame_table(simulation.layout(), images),
            arena: vec![0; images.arena_bytes().div_ceil(8)],
        }
    }

    /// Where a simulation writes a frame.
    pub(crate) fn arena(&mut self) -> &mut [u64] {
        &mut self.arena
    }

    /// All of them, in the order of the frame.
    pub fn iter(&self) -> impl Iterator<Item = Array<'_>> {
        let bytes: &[u8] = bytemuck::cast_slice(&self.arena);
        let head = Table::head_bytes(self.table.rows().len());
        self.table.rows().iter().map(move |row| Array {
            name: &row.name,
            dtype: row.dtype,
            shape: &row.shape,
            bytes: &bytes[row.offset - head..][..row.bytes],
        })
    }
}
