//! Where recorded programs keep the system of a model with many dofs, which loops solve: see [`crate::step::solver`].
//!
//! Code that is unrolled over the entries of a factor grows with the cube of the dofs, and no driver compiles that of a hundred. Code of
//! loops over a matrix in scratch memory grows with the dofs.

use super::Constants;
use super::recast::{Recast, same};
use crate::lane::{Fixed, Real, Table};

/// Tables of a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RolledSystem {
    /// The matrix: a row per dof. Entry j of row i is used for j <= i in the same part alone.
    pub matrix: Table,
    /// Scalars of each dof; see [`side`].
    pub sides: Table,
    /// Indices of each dof; see [`of_dof`].
    pub of_dofs: Fixed,
    /// Of each class of contacts a row per dof, classes one after another: where the Jacobian of its contacts has the dof; see
    /// [`place`].
    pub places: Fixed,
}

/// Columns of [`RolledSystem::sides`].
pub mod side {
    /// The right-hand side.
    pub const SIDE: usize = 0;
    /// The solution.
    pub const SOLUTION: usize = 1;
    /// The inverse of its pivot.
    pub const PIVOT: usize = 2;
    /// Columns: a vector, since lanes write rows of their own.
    pub const COLUMNS: usize = 4;
}

/// Columns of [`RolledSystem::of_dofs`].
pub mod of_dof {
    /// In row k, the dof that lies k before the last one.
    pub const BACKWARDS: usize = 0;
    /// First dof of the part of the system that the dof is of: nothing couples it to other parts.
    pub const FIRST: usize = 1;
    /// What follows the last one.
    pub const END: usize = 2;
    /// In row k, the dof behind k.
    pub const NEXT: usize = 3;
    /// Columns.
    pub const COLUMNS: usize = 4;
}

/// Columns of [`RolledSystem::places`].
pub mod place {
    /// 3 c for column c of the class, 0 for a dof that the class does not have.
    pub const FIRST: usize = 0;
    /// 1 for a dof that the class has, else 0.
    pub const HAS: usize = 1;
    /// Columns.
    pub const COLUMNS: usize = 2;
}

impl RolledSystem {
    /// Gives a model such tables, behind those of its contacts.
    pub fn add_to<R: Real>(m: &mut Constants<R>) {
        let (t, dofs) = (&mut m.contacts, m.dofs.len());
        let mut table = |columns: usize| {
            let table = Table {
                base: t.memory.len,
                // rows begin at vectors of four
                stride: columns.next_multiple_of(4),
                rows: dofs,
            };
            t.memory.len += table.stride * table.rows;
            table
        };
        let (matrix, sides) = (table(dofs), table(side::COLUMNS));
        let of_dofs = Fixed {
            base: t.tables.indices.len(),
            stride: of_dof::COLUMNS,
            rows: dofs,
        };
        let pattern = match t.couples() {
            true => &m.coupled.pattern,
            false => &m.pattern,
        };
        for part in pattern.parts() {
            for dof in part.clone() {
                let row = [dofs - 1 - dof, part.start, part.end, dof + 1];
                t.tables.indices.extend(row.map(|index| index as u32));
            }
        }
        let places = Fixed {
            base: t.tables.numbers.len(),
            stride: place::COLUMNS,
            rows: dofs * t.classes.len(),
        };
        for class in &t.classes {
            for dof in 0..dofs {
                let column = class.columns.iter().position(|column| column.dof == dof);
                let row = column.map_or([0.0; 2], |c| [3.0 * c as f64, 1.0]);
                t.tables.numbers.extend(row.map(R::from_f64));
            }
        }
        t.rolled = Some(RolledSystem {
            matrix,
            sides,
            of_dofs,
            places,
        });
    }

    /// The places of a class.
    pub fn places_of(&self, class: usize) -> Fixed {
        let rows = self.matrix.rows;
        Fixed {
            base: self.places.base + class * rows * self.places.stride,
            rows,
            ..self.places
        }
    }
}

same! { RolledSystem }
