//! The system of an iteration where several lanes share a world: its columns are spread over the lanes.
//!
//! Lane l of n keeps the columns l, l + n, l + 2 n, … of the full symmetric matrix, a *group* of columns at a time: element (i, g) of
//! a lane is entry (i, g n + l). Contacts add to all columns at once, so no sum runs over lanes. The factor eliminates from the last
//! dof to the first, as [`crate::math::factor`] does: each lane gets the eliminated column from its owner, and updates its own.

use super::contacts::{ContactsOf, law_held};
use super::hold::Hold;
use crate::constants::Constants;
use crate::constants::contact::row;
use crate::each;
use crate::lane::{Cx, Num};
use crate::math::factor::inverse;
use crate::step::constraints::contact_rows::class_list;

/// Most entries of a system that one lane keeps, in registers: 48 dofs with 8 lanes, 96 with 32.
const ENTRIES_MAX: usize = 288;

/// Whether so many lanes share the columns of a system of so many dofs.
pub fn is_spread(lanes: usize, dofs: usize) -> bool {
    lanes > 1 && dofs * dofs.div_ceil(lanes) <= ENTRIES_MAX
}

/// Of an assembly: J's weight (6) and the force (3) of a contact. Their places are used by searches and by what follows them.
const WEIGHT: usize = row::AHEAD;
const PULL: usize = row::POWER;

/// The mass matrix, spread over the lanes of a world.
pub(super) struct Spread<F> {
    lanes: usize,
    size: usize,
    /// Columns of a lane.
    groups: usize,
    mass: Vec<F>,
    /// Its diagonal: an entry per column.
    diagonal: Vec<F>,
}

/// Values of dofs, another in each lane: an entry per column.
fn group_values<C: Cx>(cx: &mut C, lanes: usize, group: usize, values: &[C::F]) -> C::F {
    let first = group * lanes;
    cx.own(&values[first..values.len().min(first + lanes)])
}

impl<F: Num> Spread<F> {
    /// Spreads the mass matrix; none where a world has one lane, or the system is too large.
    pub fn new<C: Cx<F = F>>(cx: &mut C, m: &Constants<F::Real>, mass: &[F]) -> Option<Spread<F>> {
        let (lanes, size) = (cx.lanes(), m.dofs.len());
        if !is_spread(lanes, size) {
            return None;
        }
        let groups = size.div_ceil(lanes);
        // M(i, j), 0 where the pattern has no such entry
        let entry = |i: usize, j: usize| m.pattern.find(i, j).map_or(F::c(0.0), |at| mass[at]);
        let mut spread = Spread {
            lanes,
            size,
            groups,
            mass: Vec::new(),
            diagonal: Vec::new(),
        };
        // row i, a group at a time: lane l gets M(i, g n + l)
        for i in 0..size {
            let row: Vec<F> = (0..size).map(|j| entry(i, j)).collect();
            for group in 0..groups {
                spread.mass.push(group_values(cx, lanes, group, &row));
            }
        }
        // M(j, j) of each lane's columns: what `stiffening` divides by
        let diagonal: Vec<F> = (0..size).map(|i| entry(i, i)).collect();
        for group in 0..groups {
            spread
                .diagonal
                .push(group_values(cx, lanes, group, &diagonal));
        }
        Some(spread)
    }

    /// The value of a dof, of its owner.
    fn of_owner<C: Cx<F = F>>(&self, cx: &mut C, x: &[F], dof: usize) -> F {
        cx.of_lane(x[dof / self.lanes], dof % self.lanes)
    }

    /// y = M x, the same in all lanes.
    pub fn multiply<C: Cx<F = F>>(&self, cx: &mut C, x: &[F], y: &mut [F]) {
        // M is symmetric: a lane's column times x is the entry of M x for its dof
        let mut products = vec![F::c(0.0); self.groups];
        for (row, x) in self.mass.chunks_exact(self.groups).zip(x) {
            for (product, entry) in products.iter_mut().zip(row) {
                *product = entry.fma(*x, *product);
            }
        }
        // all lanes get the entry of each dof from its owner
        for (dof, y) in y.iter_mut().enumerate() {
            *y = self.of_owner(cx, &products, dof);
        }
    }

    /// Solves (M + `joints` + Jᵀ W J) x = `vector` + Jᵀ f, with sums over contacts, held as `hold` says. Leaves the right-hand side in
    /// `pull`, the solution in `vector`. Without `pull` there is no Jᵀ f. Returns the largest ratio of diagonal entries of the matrix and M.
    ///
    /// `joints` is packed as the mass matrix.
    pub fn solve<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        m: &Constants<F::Real>,
        joints: &[F],
        vector: &mut [F],
        pull: Option<&mut [C::V]>,
        hold: Option<Hold<C>>,
    ) -> F {
        let (size, groups, lanes) = (self.size, self.groups, self.lanes);
        // entry (i, j) of Jᵀ W J of joint rows and ties, 0 outside of the pattern
        let entry = |i: usize, j: usize| m.pattern.find(i, j).map_or(F::c(0.0), |at| joints[at]);
        // M and the joint rows: a cell for each entry, since the loops over contacts add to cells
        let mut cells: Vec<C::V> = Vec::with_capacity(size * groups);
        for i in 0..size {
            let row: Vec<F> = (0..size).map(|j| entry(i, j)).collect();
            for group in 0..groups {
                let more = group_values(cx, lanes, group, &row);
                cells.push(cx.var(self.mass[i * groups + group] + more));
            }
        }
        // the right-hand side: each lane has the entries of its own columns
        let mut sides: Vec<C::V> = Vec::with_capacity(groups);
        for group in 0..groups {
            let side = group_values(cx, lanes, group, vector);
            sides.push(cx.var(side));
        }
        // Jᵀ W J and Jᵀ f of contacts are added to both
        for class in 0..m.contacts.classes.len() {
            let sides = pull.is_some().then_some(&mut sides[..]);
            self.add_class(cx, &m.contacts, class, &mut cells, sides, hold);
        }
        let mut matrix: Vec<F> = cells.iter().map(|cell| cx.get(cell)).collect();
        let mut side: Vec<F> = sides.iter().map(|cell| cx.get(cell)).collect();
        // the right-hand side, the same in all lanes, before it is eliminated
        for (dof, pull) in pull.into_iter().flatten().enumerate() {
            let x = self.of_owner(cx, &side, dof);
            cx.put(pull, x);
        }
        let ratio = self.stiffening(cx, &matrix);
        self.eliminate(cx, &mut matrix, &mut side, vector);
        ratio
    }

    /// Adds the contacts of a class, and writes the pieces that they are on.
    fn add_class<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        t: &ContactsOf<C>,
        k: usize,
        cells: &mut [C::V],
        mut sides: Option<&mut [C::V]>,
        hold: Option<Hold<C>>,
    ) {
        let (class, rows) = (&t.classes[k], t.memory.rows);
        let list = class_list(cx, t, k);
        // W, f and the piece of each contact, into its row: each lane reads them for its columns
        each!(cx, r in list, {
            let jar = cx.load3(rows, r, row::JAR);
            let holds = hold.map(|hold| hold.of_contact(cx, t, r));
            let law = law_held(cx, t, r, jar, holds);
            cx.fill(rows, r, row::STATE, law.state);
            cx.fill_all(rows, r, WEIGHT, law.stiffness);
            cx.fill_all(rows, r, PULL, law.force);
        });
        // of each group, three times the column of a lane's dof, and 1 where it has one
        let mut columns: Vec<Option<(F, F)>> = Vec::new();
        for group in 0..self.groups {
            let (mut places, mut has) = (Vec::new(), Vec::new());
            for lane in 0..self.lanes {
                let dof = group * self.lanes + lane;
                let place = class.columns.iter().position(|column| column.dof == dof);
                places.push(F::c(3.0 * place.unwrap_or(0) as f64));
                has.push(F::c(if place.is_some() { 1.0 } else { 0.0 }));
            }
            let dofs = group * self.lanes..(group + 1) * self.lanes;
            let is_used = class
                .columns
                .iter()
                .any(|column| dofs.contains(&column.dof));
            columns.push(is_used.then(|| (cx.own(&places), cx.own(&has))));
        }
        // the same contacts again, now by the columns of each lane
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let [nn, nx, ny] = cx.load3(rows, r, WEIGHT);
            let [xx, xy, yy] = cx.load3(rows, r, WEIGHT + 3);
            let weight = [[nn, nx, ny], [nx, xx, xy], [ny, xy, yy]];
            let force = cx.load3(rows, r, PULL);
            // per group: J(c) of the lane's dof, W J(c), and J(c) · f on the right-hand side
            let mut stiff = vec![None; self.groups];
            for (group, column) in columns.iter().enumerate() {
                let Some((place, has)) = *column else { continue };
                let mut jacobian = [F::c(0.0); 3];
                for (i, x) in jacobian.iter_mut().enumerate() {
                    *x = cx.load_at(rows, r, row::JACOBIAN + i, place) * has;
                }
                let mut product = jacobian;
                for i in 0..3 {
                    let along = weight[i][1].fma(jacobian[1], weight[i][2] * jacobian[2]);
                    product[i] = weight[i][0].fma(jacobian[0], along);
                }
                stiff[group] = Some(product);
                let Some(sides) = &mut sides else { continue };
                let mut sum = cx.get(&sides[group]);
                for (x, f) in jacobian.into_iter().zip(force) {
                    sum = x.fma(f, sum);
                }
                cx.put(&mut sides[group], sum);
            }
            // entry (dof of c, lane's dof) += J(c) · W J of the lane's column
            for (c, column) in class.columns.iter().enumerate() {
                let jacobian = cx.load3(rows, r, row::JACOBIAN + 3 * c);
                for (group, stiff) in stiff.iter().enumerate() {
                    let Some(stiff) = stiff else { continue };
                    let cell = &mut cells[column.dof * self.groups + group];
                    let mut sum = cx.get(cell);
                    for (x, y) in jacobian.into_iter().zip(*stiff) {
                        sum = x.fma(y, sum);
                    }
                    cx.put(cell, sum);
                }
            }
        });
    }

    /// The largest ratio of diagonal entries of a matrix and M.
    fn stiffening<C: Cx<F = F>>(&self, cx: &mut C, matrix: &[F]) -> F {
        let mut largest = F::c(1.0);
        // of a group, lane l has its diagonal entry in row g n + l
        for group in 0..self.groups {
            let mut entries = Vec::new();
            let mut masses = Vec::new();
            for dof in (group * self.lanes..self.size).take(self.lanes) {
                entries.push(matrix[dof * self.groups + group]);
                masses.push(F::c(0.0));
            }
            masses.resize(self.lanes, F::c(1.0));
            // lanes without a dof divide 0 by 1
            let (entry, missing) = (cx.own(&entries), cx.own(&masses));
            largest = entry.div(self.diagonal[group] + missing).max(largest);
        }
        cx.max_lanes(largest)
    }

    /// Solves the system: `side` is spread, the solution `x` is the same in all lanes.
    fn eliminate<C: Cx<F = F>>(&self, cx: &mut C, matrix: &mut [F], side: &mut [F], x: &mut [F]) {
        let (size, groups, lanes) = (self.size, self.groups, self.lanes);
        let mut inverses = vec![F::c(0.0); size];
        // H = Lᵀ D L from the last dof to the first: all lanes get the pivot and the side of k from its owner
        for k in (0..size).rev() {
            let (group_of_k, lane_of_k) = (k / lanes, k % lanes);
            let pivot = cx.of_lane(matrix[k * groups + group_of_k], lane_of_k);
            inverses[k] = inverse(pivot);
            x[k] = cx.of_lane(side[group_of_k], lane_of_k);
            // L(k, j) of the columns before k, 0 of the others
            let before = k.div_ceil(lanes);
            let mut lower = Vec::new();
            for group in 0..before {
                let columns = k.min((group + 1) * lanes) - group * lanes;
                let mut scales = vec![inverses[k]; columns];
                scales.resize(lanes, F::c(0.0));
                let scale = cx.own(&scales);
                let entry = matrix[k * groups + group] * scale;
                side[group] = entry.fnma(x[k], side[group]);
                lower.push(entry);
            }
            // A(i, j) -= A(k, i) L(k, j)
            for i in 0..k {
                // (k, i) instead of (i, k), which waits for the column before
                let entry = self.of_owner(cx, &matrix[k * groups..], i);
                for (group, lower) in lower.iter().enumerate() {
                    let at = i * groups + group;
                    matrix[at] = entry.fnma(*lower, matrix[at]);
                }
            }
        }
        // x(k) = (side(k) - Σ A(k, j) x(j) over j < k) / D(k); each lane keeps the sums of its own dofs
        let mut sums = vec![F::c(0.0); groups];
        for k in 0..size {
            let known = cx.of_lane(sums[k / lanes], k % lanes);
            x[k] = (x[k] - known) * inverses[k];
            for group in (k + 1) / lanes..groups {
                sums[group] = matrix[k * groups + group].fma(x[k], sums[group]);
            }
        }
    }
}
