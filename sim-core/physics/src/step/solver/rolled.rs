//! The system of an iteration where a model has many dofs: loops over a matrix in scratch memory.
//!
//! ```text
//! for k rising:    A(i, j) -= A(i, k) A(j, k) / D(k)     y(i) -= A(i, k) y(k) / D(k)      of all k < j <= i
//! for k falling:   x(k) = y(k) / D(k)                    y(i) -= A(k, i) x(k)             of all i < k
//! ```
//!
//! That is A = L D Lᵀ with L D below the diagonal. Each loop over dofs writes rows of its own, so the lanes of a world share it. Column k
//! is copied before the rows behind it change: all of them read it. Rows are of the part of the system that k is of. A row is updated a
//! few columns at a time, and those that are done or right of the diagonal are skipped.

use super::contacts::{ClassOf, ContactsOf, block_of, law_held};
use super::hold::Hold;
use super::turning;
use crate::constants::contact::{row, turning as more};
use crate::constants::rolled::{RolledSystem, of_dof, place, side};
use crate::lane::{Cx, Num};
use crate::math::factor::{Pattern, inverse};
use crate::step::constraints::contact_rows::class_list;
use crate::{each, span, when};

/// Columns of a row that are updated, or skipped, together: two vectors of a matrix row, so that a test costs little beside them.
const TOGETHER: usize = 8;

/// A system, and where it is solved.
pub(super) struct Rolled<'a, C: Cx> {
    pub tables: RolledSystem,
    pub contacts: &'a ContactsOf<C>,
    /// The pattern of M.
    pub pattern: &'a Pattern,
    /// M, packed.
    pub mass: &'a [C::F],
    /// M and Jᵀ W J of the rows of joints, packed as M.
    pub with_joints: &'a [C::F],
}

impl<C: Cx> Rolled<'_, C> {
    /// Solves (`with_joints` + Jᵀ W J) x = `vector` + Jᵀ f, with sums over contacts, held as `hold` says. Leaves the right-hand side in
    /// `pull`, the solution in `vector`. Without `pull` there is no Jᵀ f. Returns the largest ratio of diagonal entries of the matrix
    /// and M.
    #[inline(always)]
    pub fn solve<const TURNS: bool>(
        &self,
        cx: &mut C,
        vector: &mut [C::F],
        pull: Option<&mut [C::V]>,
        hold: Option<Hold<C>>,
    ) -> C::F {
        // M and the rows of joints, then contacts, class after class
        self.begin(cx, vector);
        for class in 0..self.contacts.classes.len() {
            self.add_class::<TURNS>(cx, class, pull.is_some(), hold);
        }
        // how stiff the matrix is, while its diagonal is there
        let ratio = self.stiffening(cx);
        // the right-hand side, before it is eliminated
        for (dof, pull) in pull.into_iter().flatten().enumerate() {
            let row = cx.at(dof);
            let x = cx.load(self.tables.sides, row, side::SIDE);
            cx.put(pull, x);
        }
        // A = L D Lᵀ and y, then x
        self.eliminate(cx);
        self.substitute(cx);
        // every thread of the world gets all of it
        for (dof, x) in vector.iter_mut().enumerate() {
            let row = cx.at(dof);
            *x = cx.load(self.tables.sides, row, side::SOLUTION);
        }
        ratio
    }

    /// The first dof, and what follows the last.
    fn bounds(&self, cx: &C) -> [C::I; 2] {
        [cx.at(0), cx.at(self.tables.matrix.rows)]
    }

    /// The first dof of the part that a dof is of, and what follows the last.
    fn part(&self, cx: &mut C, dof: C::I) -> [C::I; 2] {
        let (of_dofs, size) = (self.tables.of_dofs, self.tables.matrix.rows);
        let first = cx.index(of_dofs, dof, of_dof::FIRST, size);
        let end = cx.index(of_dofs, dof, of_dof::END, size + 1);
        [first, end]
    }

    /// Writes the matrix and the right-hand side without contacts.
    fn begin(&self, cx: &mut C, vector: &[C::F]) {
        let RolledSystem { matrix, sides, .. } = self.tables;
        // 0 everywhere, in rows that lanes share
        let [first, end] = self.bounds(cx);
        span!(cx, i in first, end, {
            for column in 0..matrix.stride {
                cx.fill(matrix, i, column, C::F::c(0.0));
            }
        });
        // entries of M's pattern up to the diagonal; those of couplings stay 0
        for (i, x) in vector.iter().enumerate() {
            let row = cx.at(i);
            for j in 0..i + 1 {
                if let Some(at) = self.pattern.find(i, j) {
                    cx.fill(matrix, row, j, self.with_joints[at]);
                }
            }
            // the right-hand side beside them
            cx.fill(sides, row, side::SIDE, *x);
        }
    }

    /// Adds the contacts of a class, and writes the pieces that they are on.
    fn add_class<const TURNS: bool>(
        &self,
        cx: &mut C,
        number: usize,
        pulls: bool,
        hold: Option<Hold<C>>,
    ) {
        let (t, RolledSystem { matrix, sides, .. }) = (self.contacts, self.tables);
        let class = &t.classes[number];
        let list = class_list(cx, t, number);
        let places = self.tables.places_of(number);
        let [first, end] = self.bounds(cx);
        // each dof of the class: its entries with all others, summed over the contacts
        span!(cx, i in first, end, {
            // dofs of other classes are passed over
            let has = C::F::c(0.5).lt(cx.constant(places, i, place::HAS));
            when!(cx, has, {
                // where its column begins; a sum for each column of the class, and one for the right-hand side
                let at = cx.constant(places, i, place::FIRST);
                let mut sums: Vec<C::V> = Vec::new();
                for _ in &class.columns {
                    sums.push(cx.var(C::F::c(0.0)));
                }
                let mut push = cx.var(C::F::c(0.0));
                each!(cx, r in list, {
                    // a contact of other bodies does not have the dof: its J(c) is 0
                    let here = self.column_at::<TURNS>(cx, class, r, at);
                    let mut size = C::F::c(0.0);
                    for x in here {
                        size = size + x.abs();
                    }
                    when!(cx, C::F::c(0.0).lt(size), {
                        let (stiff, along) = self.pushed::<TURNS>(cx, class, r, here, hold);
                        // J(c)ᵀ W J of this dof, for all columns c
                        for (c, sum) in sums.iter_mut().enumerate() {
                            let column = self.column::<TURNS>(cx, class, r, c);
                            let mut x = cx.get(sum);
                            for (a, b) in column.into_iter().zip(stiff) {
                                x = a.fma(b, x);
                            }
                            cx.put(sum, x);
                        }
                        // Jᵀ f of this dof
                        let x = cx.get(&push) + along;
                        cx.put(&mut push, x);
                    });
                });
                // each lane writes the rows of its dofs; what lies right of the diagonal is not used
                for (column, sum) in class.columns.iter().zip(&sums) {
                    let x = cx.load(matrix, i, column.dof) + cx.get(sum);
                    cx.fill(matrix, i, column.dof, x);
                }
                if pulls {
                    let x = cx.load(sides, i, side::SIDE) + cx.get(&push);
                    cx.fill(sides, i, side::SIDE, x);
                }
            });
        });
        // the line search reads the piece; whether a contact is held depends on the one before
        each!(cx, r in list, {
            let holds = hold.map(|hold| hold.of_contact(cx, t, r));
            let state = match block_of::<_, TURNS>(class) {
                None => {
                    let jar = cx.load3(t.memory.rows, r, row::JAR);
                    law_held(cx, t, r, jar, holds).state
                }
                Some(block) => {
                    let jar = turning::six(cx, t, r, row::JAR, block + more::JAR);
                    turning::law_at(cx, t, r, block, jar, holds).state
                }
            };
            cx.fill(t.memory.rows, r, row::STATE, state);
        });
    }

    /// J(c) of a contact: three numbers, or six where its class has torsional friction.
    fn column<const TURNS: bool>(
        &self,
        cx: &mut C,
        class: &ClassOf<C>,
        r: C::I,
        c: usize,
    ) -> [C::F; 6] {
        let (t, zero) = (self.contacts, C::F::c(0.0));
        let first = row::JACOBIAN + 3 * c;
        match block_of::<_, TURNS>(class) {
            None => {
                let [a, b, d] = cx.load3(t.memory.rows, r, first);
                [a, b, d, zero, zero, zero]
            }
            Some(block) => turning::six(cx, t, r, first, block + more::JACOBIAN + 3 * c),
        }
    }

    /// [`Rolled::column`] where it begins at `place` of the Jacobian.
    fn column_at<const TURNS: bool>(
        &self,
        cx: &mut C,
        class: &ClassOf<C>,
        r: C::I,
        place: C::F,
    ) -> [C::F; 6] {
        let rows = self.contacts.memory.rows;
        // normal and tangents
        let mut column = [C::F::c(0.0); 6];
        for (i, x) in column.iter_mut().take(3).enumerate() {
            *x = cx.load_at(rows, r, row::JACOBIAN + i, place);
        }
        // rotations about them
        if let Some(block) = block_of::<_, TURNS>(class) {
            for (i, x) in column.iter_mut().skip(3).enumerate() {
                *x = cx.load_at(rows, r, block + more::JACOBIAN + i, place);
            }
        }
        column
    }

    /// W J(c) and J(c) · f of a contact with this column.
    fn pushed<const TURNS: bool>(
        &self,
        cx: &mut C,
        class: &ClassOf<C>,
        r: C::I,
        column: [C::F; 6],
        hold: Option<Hold<C>>,
    ) -> ([C::F; 6], C::F) {
        let (t, zero) = (self.contacts, C::F::c(0.0));
        // held contacts stick in the model, wherever they are
        let holds = hold.map(|hold| hold.of_contact(cx, t, r));
        // W and f of all six rows
        if let Some(block) = block_of::<_, TURNS>(class) {
            let jar = turning::six(cx, t, r, row::JAR, block + more::JAR);
            let law = turning::law_at(cx, t, r, block, jar, holds);
            return (law.times(column), turning::dot(column, law.force));
        }
        // W and f of normal and tangents
        let jar = cx.load3(t.memory.rows, r, row::JAR);
        let law = law_held(cx, t, r, jar, holds);
        let [nn, nx, ny, xx, xy, yy] = law.stiffness;
        let weight = [[nn, nx, ny], [nx, xx, xy], [ny, xy, yy]];
        let (mut stiff, mut along) = ([zero; 6], zero);
        // W J(c), and J(c) · f
        for i in 0..3 {
            for j in 0..3 {
                stiff[i] = weight[i][j].fma(column[j], stiff[i]);
            }
            along = column[i].fma(law.force[i], along);
        }
        (stiff, along)
    }

    /// The largest ratio of diagonal entries of the matrix and M.
    fn stiffening(&self, cx: &mut C) -> C::F {
        let mut largest = C::F::c(1.0);
        // as `linear::stiffening_of`: it scales the rounding of the step
        for dof in 0..self.tables.matrix.rows {
            let row = cx.at(dof);
            let entry = cx.load(self.tables.matrix, row, dof);
            let mass = self.mass[self.pattern.at(dof, dof)];
            largest = entry.div(mass).max(largest);
        }
        largest
    }

    /// Leaves L D below the diagonal, D on it, and y.
    fn eliminate(&self, cx: &mut C) {
        let RolledSystem { matrix, sides, .. } = self.tables;
        let zero = C::F::c(0.0);
        let [begin, stop] = self.bounds(cx);
        span!(cx, k in begin, stop, {
            let [first, end] = self.part(cx, k);
            let dof = cx.number(k);
            // 1 / D(k), and y(k) / D(k)
            let pivot = inverse(cx.load_at(matrix, k, 0, dof));
            let known = cx.load(sides, k, side::SIDE) * pivot;
            // column k for all lanes, 0 up to k; then what y(k) takes from the rows behind it
            span!(cx, i in first, end, {
                let below = dof.lt(cx.number(i));
                let entry = cx.load_at(matrix, i, 0, dof);
                cx.fill(sides, i, side::COLUMN, C::F::select(below, entry, zero));
                when!(cx, below, {
                    let y = cx.load(sides, i, side::SIDE);
                    cx.fill(sides, i, side::SIDE, entry.fnma(known, y));
                });
            });
            // the rows behind k, in columns that some row still needs
            span!(cx, i in first, end, {
                let number = cx.number(i);
                when!(cx, dof.lt(number), {
                    let scale = cx.load(sides, i, side::COLUMN) * pivot;
                    // columns from k + 1 to i lie in some of the groups
                    for from in (0..matrix.rows).step_by(TOGETHER) {
                        let to = matrix.rows.min(from + TOGETHER);
                        let behind = dof.lt(C::F::c((to - 1) as f64));
                        let below = C::F::c(from as f64 - 0.5).lt(number);
                        when!(cx, behind & below, {
                            // columns of the part up to k have 0 here, and stay; nothing reads those of other parts
                            for j in from..to {
                                let of_column = cx.at(j);
                                let entry = cx.load(sides, of_column, side::COLUMN);
                                let x = cx.load(matrix, i, j);
                                cx.fill(matrix, i, j, scale.fnma(entry, x));
                            }
                        });
                    }
                });
            });
        });
    }

    /// Finds x from y.
    fn substitute(&self, cx: &mut C) {
        let RolledSystem {
            matrix,
            sides,
            of_dofs,
            ..
        } = self.tables;
        let [begin, stop] = self.bounds(cx);
        span!(cx, before in begin, stop, {
            let k = cx.index(of_dofs, before, of_dof::BACKWARDS, matrix.rows);
            let [first, end] = self.part(cx, k);
            let dof = cx.number(k);
            // all that is known of x(k) has left y(k)
            let pivot = inverse(cx.load_at(matrix, k, 0, dof));
            let x = cx.load(sides, k, side::SIDE) * pivot;
            cx.fill(sides, k, side::SOLUTION, x);
            // what it adds to the rows before it
            span!(cx, i in first, end, {
                let number = cx.number(i);
                when!(cx, number.lt(dof), {
                    let entry = cx.load_at(matrix, k, 0, number);
                    let y = cx.load(sides, i, side::SIDE);
                    cx.fill(sides, i, side::SIDE, entry.fnma(x, y));
                });
            });
        });
    }
}
