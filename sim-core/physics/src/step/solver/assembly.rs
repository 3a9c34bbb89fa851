//! Jᵀ W J of contacts, in the packed triangle of the system.

use super::contacts::{ClassOf, ContactsOf, add_turning, block_of, law_held, only};
use super::hold::Hold;
use super::turning;
use crate::constants::contact::{Run, row, turning as more};
use crate::each;
use crate::lane::{Cx, MaskOf, Num};
use crate::step::constraints::contact_rows::class_list;

/// Adds Jᵀ W J of a class to `hessian`, and Jᵀ f to `rhs` if `pulls`. Writes the pieces that its contacts are on in the model.
#[inline(always)]
pub(super) fn assemble<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    k: usize,
    hessian: &mut [C::V],
    rhs: &mut [C::V],
    pulls: bool,
    hold: Option<Hold<C>>,
) {
    let class: &ClassOf<C> = &t.classes[k];
    let list = class_list(cx, t, k);
    // a class with torsional friction has six rows per contact
    if let Some(block) = block_of::<_, TURNS>(class) {
        each!(cx, r in list, {
            let holds = hold.map(|hold| hold.of_contact(cx, t, r));
            assemble_turning(cx, t, (class, block), r, (hessian, rhs), pulls, holds);
        });
        return;
    }
    each!(cx, r in list, {
        // W and f at a, on the sticking piece where the contact is held; the line search reads the piece
        let jar = cx.load3(t.memory.rows, r, row::JAR);
        let holds = hold.map(|hold| hold.of_contact(cx, t, r));
        let law = law_held(cx, t, r, jar, holds);
        cx.fill(t.memory.rows, r, row::STATE, law.state);
        // in worlds without this contact, J too is -0: W J is 0 there
        let mut stiffness = law.stiffness;
        for x in &mut stiffness {
            *x = cx.or_nothing(*x);
        }
        let [nn, nx, ny, xx, xy, yy] = stiffness;
        let rows = [[nn, nx, ny], [nx, xx, xy], [ny, xy, yy]];
        // worlds without this contact add 0
        let mut pull = law.force;
        for x in &mut pull {
            *x = cx.only(*x);
        }
        // Jᵀ f
        if pulls {
            for run in &class.runs {
                let first = row::JACOBIAN + 3 * run.column;
                cx.add_triples(t.memory.rows, r, first, pull, &mut rhs[run.places()]);
            }
        }
        // W J(c) of three columns at a time, then its products with the columns up to c
        let mut c = 0;
        while let Some([a, b, d]) = class.entries[c..].first_chunk() {
            let stiff = [
                stiff_column(cx, t, r, &rows, c),
                stiff_column(cx, t, r, &rows, c + 1),
                stiff_column(cx, t, r, &rows, c + 2),
            ];
            add_three_columns(cx, t, r, stiff, [a, b, d], hessian);
            c += 3;
        }
        // one or two columns that are left
        for (c, entries) in class.entries.iter().enumerate().skip(c) {
            let stiff = stiff_column(cx, t, r, &rows, c);
            add_column(cx, t, r, stiff, entries, hessian);
        }
    });
}

/// W J(c) of a contact; 0 in worlds without it, where J is -0 and W is -0.
#[inline(always)]
fn stiff_column<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    r: C::I,
    rows: &[[C::F; 3]; 3],
    c: usize,
) -> [C::F; 3] {
    let column = cx.load3(t.memory.rows, r, row::JACOBIAN + 3 * c);
    let mut stiff = [C::F::c(0.0); 3];
    for i in 0..3 {
        let along = rows[i][1].fma(column[1], rows[i][2] * column[2]);
        stiff[i] = rows[i][0].fma(column[0], along);
    }
    stiff
}

/// Adds the products of a column with those of its entries.
#[inline(always)]
fn add_column<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    r: C::I,
    stiff: [C::F; 3],
    entries: &[Run],
    hessian: &mut [C::V],
) {
    for run in entries {
        let first = row::JACOBIAN + 3 * run.column;
        cx.add_triples(t.memory.rows, r, first, stiff, &mut hessian[run.places()]);
    }
}

/// [`add_column`] of three columns that follow each other, at once where they are three rows of a packed triangle.
#[inline(always)]
fn add_three_columns<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    r: C::I,
    stiff: [[C::F; 3]; 3],
    entries: [&[Run]; 3],
    hessian: &mut [C::V],
) {
    // each column has one run, as long as the one before and one entry more: J is read once for three rows
    if let [[a], [b], [c]] = entries
        && a.place + a.len <= b.place
        && b.place + b.len <= c.place
        && (a.column, a.len + 1) == (b.column, b.len)
        && (a.column, a.len + 2) == (c.column, c.len)
    {
        let first = row::JACOBIAN + 3 * a.column;
        let places = [a.place, b.place, c.place];
        cx.add_triples_of_three(t.memory.rows, r, first, stiff, hessian, places, a.len);
        return;
    }
    for (stiff, entries) in stiff.into_iter().zip(entries) {
        add_column(cx, t, r, stiff, entries, hessian);
    }
}

/// [`assemble`] of one contact with torsional friction.
#[inline(always)]
fn assemble_turning<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    (class, block): (&ClassOf<C>, usize),
    r: C::I,
    (hessian, rhs): (&mut [C::V], &mut [C::V]),
    pulls: bool,
    holds: Option<MaskOf<C>>,
) {
    let rows = t.memory.rows;
    // W and f of the six rows, and Jᵀ f
    let jar = turning::six(cx, t, r, row::JAR, block + more::JAR);
    let law = turning::law_at(cx, t, r, block, jar, holds);
    cx.fill(rows, r, row::STATE, law.state);
    if pulls {
        add_turning(cx, t, class, block, r, law.force, rhs);
    }
    // W J(c), 0 in worlds without this contact, and its products with the columns up to c
    for (c, entries) in class.entries.iter().enumerate() {
        let (first, other) = (row::JACOBIAN + 3 * c, block + more::JACOBIAN + 3 * c);
        let column = turning::six(cx, t, r, first, other);
        let [a, b, d, e, f, g] = only(cx, law.times(column));
        for run in entries {
            let cells = &mut hessian[run.places()];
            let (first, other) = (
                row::JACOBIAN + 3 * run.column,
                more::JACOBIAN + 3 * run.column,
            );
            cx.add_triples(rows, r, first, [a, b, d], cells);
            cx.add_triples(rows, r, block + other, [e, f, g], cells);
        }
    }
}
