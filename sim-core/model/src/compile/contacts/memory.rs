//! Room for contacts: how many there may be, and where their tables and rows lie.

use super::pairs::{ContactBuilder, rows_of};
use super::pieces::Piece;
use sim_physics::constants::clip::Cut;
use sim_physics::constants::contact::{
    COUNTS, Contacts, Handles, Kind, Memory, pair, row, turning,
};
use sim_physics::constants::height_field::FIELD_CANDIDATES;
use sim_physics::lane::{Fixed, Table};

/// Contacts that there is room for by default, where more could be found: a hundred shapes in a heap.
const DEFAULT_CONTACTS_MAX: usize = 512;

impl ContactBuilder<'_> {
    pub(super) fn capacities(&self, contacts: &mut Contacts<f64>, bounds: &[usize]) {
        let most: usize = bounds.iter().sum();
        let geoms = self.shapes.iter().filter_map(|shape| shape.geom);
        let condim = geoms.map(|geom| geom.condim).fold(3, usize::max);
        let of_a_contact = rows_of(self.scene.solver.cone, condim);
        contacts.contacts_max = self
            .scene
            .contacts_max
            .unwrap_or(most.min(DEFAULT_CONTACTS_MAX));
        let enough = contacts.contacts_max * of_a_contact;
        contacts.rows_max = self.scene.rows_max.unwrap_or(enough);
        contacts.may_overflow =
            contacts.contacts_max < most || contacts.rows_max < most * of_a_contact;
    }

    pub(super) fn lay_out(
        &self,
        contacts: &mut Contacts<f64>,
        numbers: Vec<f64>,
        indices: Vec<u32>,
        stride: usize,
        widest: usize,
        rows: usize,
    ) {
        let is_wide = contacts.classes.iter().any(|class| class.turns.is_some());
        let row_len = match is_wide {
            true => row::JACOBIAN + turning::JACOBIAN + 6 * widest,
            false => row::JACOBIAN + 3 * widest,
        };
        let pairs = contacts.pairs.len();
        let tables = &mut contacts.tables;
        let fixed = |base, stride, rows| Fixed { base, stride, rows };
        let pair_numbers = fixed(tables.numbers.len(), stride, pairs);
        tables.numbers.extend(numbers);
        let pair_indices = fixed(tables.indices.len(), pair::INDICES, pairs);
        tables.indices.extend(indices);
        let class_rows = fixed(tables.indices.len(), 2, contacts.classes.len());
        for class in &contacts.classes {
            let index = |x: usize| u32::try_from(x).expect("capacities are small");
            tables
                .indices
                .extend([index(class.first), index(class.capacity)]);
        }
        contacts.handles = Handles {
            pair_numbers,
            pair_indices,
            class_rows,
            pair_blocks: Fixed::default(),
        };
        // whose features are clipped by scratch tables, besides hulls
        let is_clipped = |piece: &&Piece| matches!(piece.solid.kind, Kind::Cylinder | Kind::Field);
        let clipped = self.pieces.iter().filter(is_clipped).count();
        let mut kinds = self.pieces.iter().map(|piece| piece.solid.kind);
        let has_fields = kinds.any(|kind| kind == Kind::Field);
        let named_pairs = match contacts.varying.pairs {
            true => self.rules.pairs().count(),
            false => 0,
        };
        let mut len = 0;
        // bases and strides of four: a GPU then reads and writes four numbers at a time
        let mut table = |stride: usize, rows: usize| {
            let stride = if stride == 1 {
                1
            } else {
                stride.next_multiple_of(4)
            };
            let base = len;
            len += (stride * rows).next_multiple_of(4);
            Table { base, stride, rows }
        };
        contacts.memory = Memory {
            poses: table(12, self.pieces.len()),
            origins: table(3, self.constants.trees.len() + 1),
            counts: table(1, contacts.classes.len() + COUNTS),
            rows: table(row_len, rows),
            mu: match contacts.varying.any() {
                true => table(contacts.varying.columns(), self.pieces.len() + named_pairs),
                false => contacts.memory.mu,
            },
            cut: match contacts.hulls.spans.rows + clipped {
                0 => contacts.memory.cut,
                _ => Cut {
                    corners: table(Cut::CORNERS[1], Cut::CORNERS[0]),
                    candidates: table(Cut::CANDIDATES[1], Cut::CANDIDATES[0]),
                    edges: table(Cut::EDGES[1], Cut::EDGES[0]),
                },
            },
            field_candidates: match has_fields {
                true => table(row::PAIR + 2, FIELD_CANDIDATES),
                false => contacts.memory.field_candidates,
            },
            // `add_fields` sets its rows
            field_cells: contacts.memory.field_cells,
            field_prisms: match has_fields {
                true => table(1, FIELD_CANDIDATES),
                false => contacts.memory.field_prisms,
            },
            len: 0,
        };
        contacts.memory.len = len;
    }
}
