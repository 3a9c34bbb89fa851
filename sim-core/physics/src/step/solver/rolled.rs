//! The system of an iteration where a model has many dofs: loops over a matrix in scratch memory.
//!
//! ```text
//! for k falling:   L(k, i) = A(k, i) / D(k)     A(i, j) -= L(k, i) A(k, j)     y(i) -= L(k, i) y(k)     of all j <= i < k
//! for k rising:    x(i) -= L(i, k) x(k)                                                                 of all i > k
//! ```
//!
//! That is A = Lᵀ D L as in [`crate::math::factor`], and x begins as y / D. A tree makes no fill, and rows whose entry is 0 are skipped.
//! Every number has the operations of the unrolled code in its order, so bits are the same where one thread has a world, but for the signs
//! of zeros. Each loop over dofs writes rows of its own, so the lanes of a world share it. Rows are of the part of the system that k is
//! of. A row is updated a few columns at a time, and those right of the diagonal are skipped.

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
    /// Whether it is asked how stiff contacts make the matrix.
    pub asks_for_stiffness: bool,
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
        // M and the rows of joints, then contacts, class after class: first those whose entries lie in M's pattern
        self.begin(cx, vector);
        for couples in [false, true] {
            let classes = self.contacts.classes.iter().enumerate();
            for (class, _) in classes.filter(|(_, class)| class.couples == couples) {
                self.add_class::<TURNS>(cx, class, pull.is_some(), hold);
            }
        }
        // how stiff the matrix is, while its diagonal is there
        let ratio = self.stiffening(cx);
        // the right-hand side, before it is eliminated
        for (dof, pull) in pull.into_iter().flatten().enumerate() {
            let row = cx.at(dof);
            let x = cx.load(self.tables.sides, row, side::SIDE);
            cx.put(pull, x);
        }
        // A = Lᵀ D L and y, then x
        self.eliminate(cx);
        self.substitute(cx);
        // every thread of the world gets all of it, zeros with a sign of their own
        for (dof, x) in vector.iter_mut().enumerate() {
            let row = cx.at(dof);
            *x = cx.load(self.tables.sides, row, side::SOLUTION) + C::F::c(0.0);
        }
        ratio
    }

    /// The first dof, and what follows the last.
    fn bounds(&self, cx: &C) -> [C::I; 2] {
        [cx.at(0), cx.at(self.tables.matrix.rows)]
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
                for column in &class.columns {
                    let x = cx.load(matrix, i, column.dof);
                    sums.push(cx.var(x));
                }
                let x = cx.load(sides, i, side::SIDE);
                let mut push = cx.var(x);
                each!(cx, r in list, {
                    // a contact of other bodies does not have the dof: its J(c) is 0
                    let here = self.column_at::<TURNS>(cx, class, r, at);
                    let mut size = C::F::c(0.0);
                    for x in here {
                        size = size + x.abs();
                    }
                    when!(cx, C::F::c(0.0).lt(size), {
                        let (stiff, force) = self.pushed::<TURNS>(cx, class, r, here, hold);
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
                        let mut x = cx.get(&push);
                        for (a, f) in here.into_iter().zip(force) {
                            x = a.fma(f, x);
                        }
                        cx.put(&mut push, x);
                    });
                });
                // each lane writes the rows of its dofs; what lies right of the diagonal is not used
                for (column, sum) in class.columns.iter().zip(&sums) {
                    let x = cx.get(sum);
                    cx.fill(matrix, i, column.dof, x);
                }
                if pulls {
                    let x = cx.get(&push);
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

    /// W J(c) of a contact with this column, and f.
    fn pushed<const TURNS: bool>(
        &self,
        cx: &mut C,
        class: &ClassOf<C>,
        r: C::I,
        column: [C::F; 6],
        hold: Option<Hold<C>>,
    ) -> ([C::F; 6], [C::F; 6]) {
        let (t, zero) = (self.contacts, C::F::c(0.0));
        // held contacts stick in the model, wherever they are
        let holds = hold.map(|hold| hold.of_contact(cx, t, r));
        // W and f of all six rows
        if let Some(block) = block_of::<_, TURNS>(class) {
            let jar = turning::six(cx, t, r, row::JAR, block + more::JAR);
            let law = turning::law_at(cx, t, r, block, jar, holds);
            return (law.times(column), law.force);
        }
        // W and f of normal and tangents
        let jar = cx.load3(t.memory.rows, r, row::JAR);
        let law = law_held(cx, t, r, jar, holds);
        let [nn, nx, ny, xx, xy, yy] = law.stiffness;
        let weight = [[nn, nx, ny], [nx, xx, xy], [ny, xy, yy]];
        let (mut stiff, mut force) = ([zero; 6], [zero; 6]);
        // W J(c), summed as `assembly` does
        for i in 0..3 {
            let along = weight[i][1].fma(column[1], weight[i][2] * column[2]);
            stiff[i] = weight[i][0].fma(column[0], along);
            force[i] = law.force[i];
        }
        (stiff, force)
    }

    /// The largest ratio of diagonal entries of the matrix and M; 1 where that is of no use.
    fn stiffening(&self, cx: &mut C) -> C::F {
        let mut largest = C::F::c(1.0);
        if !self.asks_for_stiffness {
            return largest;
        }
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
        let RolledSystem {
            matrix,
            sides,
            of_dofs,
            ..
        } = self.tables;
        let [begin, stop] = self.bounds(cx);
        span!(cx, before in begin, stop, {
            let k = cx.index(of_dofs, before, of_dof::BACKWARDS, matrix.rows);
            let first = cx.index(of_dofs, k, of_dof::FIRST, matrix.rows);
            let dof = cx.number(k);
            // 1 / D(k), and y(k)
            let pivot = inverse(cx.load_at(matrix, k, 0, dof));
            let known = cx.load(sides, k, side::SIDE);
            // the rows before k, in columns up to their own; all of them read row k
            span!(cx, i in first, k, {
                let number = cx.number(i);
                let entry = cx.load_at(matrix, k, 0, number);
                // other branches of a tree have 0 there
                when!(cx, C::F::c(0.0).lt(entry.abs()), {
                    let share = entry * pivot;
                    let y = cx.load(sides, i, side::SIDE);
                    cx.fill(sides, i, side::SIDE, known.fnma(share, y));
                    // columns up to i lie in some of the groups
                    for from in (0..matrix.rows).step_by(TOGETHER) {
                        let to = matrix.rows.min(from + TOGETHER);
                        when!(cx, C::F::c(from as f64 - 0.5).lt(number), {
                            // columns of other parts have 0 in row k, and stay; all are read first, as vectors
                            let mut entries = Vec::new();
                            for j in from..to {
                                let other = cx.load(matrix, k, j);
                                let x = cx.load(matrix, i, j);
                                entries.push(share.fnma(other, x));
                            }
                            for (x, j) in entries.into_iter().zip(from..to) {
                                cx.fill(matrix, i, j, x);
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
        // y / D, and 1 / D, which each row needs again
        span!(cx, i in begin, stop, {
            let number = cx.number(i);
            let pivot = inverse(cx.load_at(matrix, i, 0, number));
            let x = cx.load(sides, i, side::SIDE) * pivot;
            cx.fill(sides, i, side::SOLUTION, x);
            cx.fill(sides, i, side::PIVOT, pivot);
        });
        span!(cx, k in begin, stop, {
            // x(k) is known; what it adds to the rows behind it
            let x = cx.load(sides, k, side::SOLUTION);
            let dof = cx.number(k);
            let next = cx.index(of_dofs, k, of_dof::NEXT, matrix.rows + 1);
            let end = cx.index(of_dofs, k, of_dof::END, matrix.rows + 1);
            span!(cx, i in next, end, {
                let share = cx.load_at(matrix, i, 0, dof) * cx.load(sides, i, side::PIVOT);
                let other = cx.load(sides, i, side::SOLUTION);
                cx.fill(sides, i, side::SOLUTION, share.fnma(x, other));
            });
        });
    }
}
