//! Sums over contacts: residuals, Jᵀ W J, forces, costs and their derivatives along a line.
//!
//! Classes are a native loop, the contacts of a class a loop of the execution context. Sums go through cells: a world without
//! the contact adds 0.

use super::cones::{
    ConeLaw, LineLaw, bend_along, elliptic, elliptic_along, is_curved, power, pyramidal,
};
use super::turning;
use crate::constants::contact::Cone;
use crate::constants::contact::{Class, Contacts, row, turning as more};
use crate::each;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::step::constraints::contact_rows::class_list;

/// Values in the active worlds, 0 elsewhere.
#[inline(always)]
pub(super) fn only<C: Cx, const N: usize>(cx: &mut C, mut xs: [C::F; N]) -> [C::F; N] {
    for x in &mut xs {
        *x = cx.only(*x);
    }
    xs
}

pub(super) type ContactsOf<C> = Contacts<<<C as Cx>::F as Num>::Real>;
pub(super) type ClassOf<C> = Class<<<C as Cx>::F as Num>::Real>;

/// Where the second block of a contact's row begins. Where no class has one, it is compiled without.
#[inline(always)]
pub(super) fn block_of<R, const TURNS: bool>(class: &Class<R>) -> Option<usize> {
    if TURNS { class.turns } else { None }
}

/// The law of a contact at a residual `jar`.
#[inline(always)]
pub(super) fn law_at<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    r: C::I,
    jar: [C::F; 3],
) -> ConeLaw<C::F> {
    law_held(cx, t, r, jar, None)
}

/// The law of a contact in the model of an iteration: that of [`law_at`], or the sticking piece where it `holds` a contact that slides.
#[inline(always)]
pub(super) fn law_held<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    r: C::I,
    jar: [C::F; 3],
    holds: Option<MaskOf<C>>,
) -> ConeLaw<C::F> {
    let stiff = cx.load(t.memory.rows, r, row::STIFFNESS);
    let mu = cx.load(t.memory.rows, r, row::MU);
    match t.cone {
        Cone::Elliptic => {
            let soft = cx.load(t.memory.rows, r, row::SOFT);
            elliptic(t.impratio, jar, [stiff, soft, mu], holds)
        }
        Cone::Pyramidal => pyramidal(jar, stiff, mu),
    }
}

/// The law of a contact at `alpha` of the line search. An elliptic cone has it from three products, kept by [`begin_line`].
#[inline(always)]
fn law_along<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    class: &ClassOf<C>,
    r: C::I,
    alpha: C::F,
) -> LineLaw<C::F> {
    let rows = t.memory.rows;
    // the slip at any α needs only jar · jar, jar · jv and jv · jv of the tangents
    if t.cone == Cone::Elliptic {
        let normal = [cx.load(rows, r, row::JAR), cx.load(rows, r, row::AHEAD)];
        let squares = cx.load3(rows, r, row::SQUARES);
        let scalars = [
            cx.load(rows, r, row::STIFFNESS),
            cx.load(rows, r, row::SOFT),
            cx.load(rows, r, row::MU),
        ];
        return elliptic_along(t.impratio, normal, squares, alpha, scalars);
    }
    // a pyramid is evaluated at the point of the line
    if let Some(block) = block_of::<_, TURNS>(class) {
        let jar = turning::six(cx, t, r, row::JAR, block + more::JAR);
        let jv = turning::six(cx, t, r, row::AHEAD, block + more::AHEAD);
        let mut there = jar;
        for i in 0..6 {
            there[i] = alpha.fma(jv[i], jar[i]);
        }
        let law = turning::law_at(cx, t, r, block, there, None);
        return LineLaw {
            power: turning::dot(law.force, jv),
            bend: turning::dot(law.times(jv), jv),
            state: law.state,
        };
    }
    let (jar, jv) = (cx.load3(rows, r, row::JAR), cx.load3(rows, r, row::AHEAD));
    let mut there = jar;
    for i in 0..3 {
        there[i] = alpha.fma(jv[i], jar[i]);
    }
    let law = law_at(cx, t, r, there);
    LineLaw {
        power: power(&law.force, jv),
        bend: bend_along(&law, jv),
        state: law.state,
    }
}

/// Contacts of a class per world.
#[inline(always)]
pub(super) fn count_of_class<C: Cx>(cx: &mut C, t: &ContactsOf<C>, class: usize) -> C::F {
    let at = cx.at(class);
    cx.load(t.memory.counts, at, 0)
}

/// Contacts per world.
#[inline(always)]
pub(super) fn count<C: Cx>(cx: &mut C, t: &ContactsOf<C>) -> C::F {
    let mut sum = C::F::c(0.0);
    for class in 0..t.classes.len() {
        let at = cx.at(class);
        sum = sum + cx.load(t.memory.counts, at, 0);
    }
    sum
}

/// The worlds that have contacts; none if no world of the block has.
#[inline(always)]
pub(super) fn touching<C: Cx>(cx: &mut C, t: &ContactsOf<C>) -> Option<MaskOf<C>> {
    if t.classes.is_empty() {
        return None;
    }
    let touching = C::F::c(0.5).lt(count(cx, t));
    if cx.anywhere(touching) {
        Some(touching)
    } else {
        None
    }
}

/// Contacts per world that couple dofs which the mass matrix does not couple.
#[inline(always)]
pub(super) fn coupling<C: Cx>(cx: &mut C, t: &ContactsOf<C>) -> C::F {
    let mut sum = C::F::c(0.0);
    for (k, class) in t.classes.iter().enumerate() {
        if class.couples {
            let at = cx.at(k);
            sum = sum + cx.load(t.memory.counts, at, 0);
        }
    }
    sum
}

/// Writes jar = J a - aref of every contact, to `place` of its row.
#[inline(always)]
pub(super) fn residual<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    a: &[C::F],
    place: usize,
) {
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            // columns that follow each other, in dofs too, are one run
            let [x, y, z] = cx.load3(t.memory.rows, r, row::AREF);
            let mut jar = [-x, -y, -z];
            for run in &class.runs {
                let first = row::JACOBIAN + 3 * run.column;
                jar = cx.sum_triples(t.memory.rows, r, first, &a[run.places()], jar);
            }
            cx.fill_all(t.memory.rows, r, place, jar);
            // rotations about the normal and the tangents
            if let Some(block) = block_of::<_, TURNS>(class) {
                let [x, y, z] = cx.load3(t.memory.rows, r, block + more::AREF);
                let mut jar = [-x, -y, -z];
                for run in &class.runs {
                    let first = block + more::JACOBIAN + 3 * run.column;
                    jar = cx.sum_triples(t.memory.rows, r, first, &a[run.places()], jar);
                }
                cx.fill_all(t.memory.rows, r, block + second(place), jar);
            }
        });
    }
}

/// Sets the residuals of all contacts to those ahead, where the step was taken as a whole.
#[inline(always)]
pub(super) fn step_ahead<C: Cx, const TURNS: bool>(cx: &mut C, t: &ContactsOf<C>) {
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let jar = cx.load3(t.memory.rows, r, row::AHEAD);
            cx.fill_all(t.memory.rows, r, row::JAR, jar);
            if let Some(block) = block_of::<_, TURNS>(class) {
                let jar = cx.load3(t.memory.rows, r, block + more::AHEAD);
                cx.fill_all(t.memory.rows, r, block + more::JAR, jar);
            }
        });
    }
}

/// Place in the second block of what is at a place of the first.
fn second(place: usize) -> usize {
    match place {
        row::JAR => more::JAR,
        row::AHEAD => more::AHEAD,
        other => unreachable!("{other} has no place in the second block"),
    }
}

/// Adds Jᵀ f of a contact with torsional friction.
#[inline(always)]
pub(super) fn add_turning<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    class: &ClassOf<C>,
    block: usize,
    r: C::I,
    force: [C::F; 6],
    to: &mut [C::V],
) {
    let [a, b, c, d, e, f] = only(cx, force);
    for run in &class.runs {
        let (first, other) = (
            row::JACOBIAN + 3 * run.column,
            more::JACOBIAN + 3 * run.column,
        );
        let cells = &mut to[run.places()];
        cx.add_triples(t.memory.rows, r, first, [a, b, c], cells);
        cx.add_triples(t.memory.rows, r, block + other, [d, e, f], cells);
    }
}

/// Adds to `sum` where a contact is on another piece of its cost at `AHEAD` than at `JAR`, or on a curved one at `AHEAD`. Adds
/// to `curved` where it is on a curved piece at either.
#[inline(always)]
pub(super) fn changes<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    sum: &mut C::V,
    curved: &mut C::V,
) {
    for k in 0..t.classes.len() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            // the piece at `JAR` is that of the last assembly
            let before = cx.load(t.memory.rows, r, row::STATE);
            let after = match block_of::<_, TURNS>(&t.classes[k]) {
                None => {
                    let ahead = cx.load3(t.memory.rows, r, row::AHEAD);
                    law_at(cx, t, r, ahead).state
                }
                Some(block) => {
                    let ahead = turning::six(cx, t, r, row::AHEAD, block + more::AHEAD);
                    turning::law_at(cx, t, r, block, ahead, None).state
                }
            };
            // a step to a sliding piece is not exact, since s is not quadratic there
            let slides = is_curved(t.cone, after);
            let moved = (before - after).abs() + slides;
            let more = cx.get(sum) + cx.only(moved);
            cx.put(sum, more);
            let more = cx.get(curved) + cx.only(is_curved(t.cone, before) + slides);
            cx.put(curved, more);
        });
    }
}

/// Writes the forces of all contacts, and adds Jᵀ f to `joint`.
#[inline(always)]
pub(super) fn forces<C: Cx, const TURNS: bool>(cx: &mut C, t: &ContactsOf<C>, joint: &mut [C::V]) {
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            if let Some(block) = block_of::<_, TURNS>(class) {
                let jar = turning::six(cx, t, r, row::JAR, block + more::JAR);
                let law = turning::law_at(cx, t, r, block, jar, None);
                let force = only(cx, law.force);
                let [a, b, c, d, e, f] = force;
                cx.fill_all(t.memory.rows, r, row::FORCE, [a, b, c]);
                cx.fill_all(t.memory.rows, r, block + more::FORCE, [d, e, f]);
                add_turning(cx, t, class, block, r, force, joint);
            } else {
                // f = -s' at the accelerations found
                let jar = cx.load3(t.memory.rows, r, row::JAR);
                let law = law_at(cx, t, r, jar);
                let force = only(cx, law.force);
                cx.fill_all(t.memory.rows, r, row::FORCE, force);
                for run in &class.runs {
                    let first = row::JACOBIAN + 3 * run.column;
                    cx.add_triples(t.memory.rows, r, first, force, &mut joint[run.places()]);
                }
            }
        });
    }
}

/// Adds Σ s(jar) at `place` to `sum`.
#[inline(always)]
pub(super) fn cost<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    place: usize,
    sum: &mut C::V,
) {
    for k in 0..t.classes.len() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            // s at the residual of this place
            let cost = match block_of::<_, TURNS>(&t.classes[k]) {
                None => {
                    let jar = cx.load3(t.memory.rows, r, place);
                    law_at(cx, t, r, jar).cost
                }
                Some(block) => {
                    let jar = turning::six(cx, t, r, place, block + second(place));
                    turning::law_at(cx, t, r, block, jar, None).cost
                }
            };
            let more = cx.get(sum) + cx.only(cost);
            cx.put(sum, more);
        });
    }
}

/// What contacts add up to at the start of a line.
pub(super) struct LineStart<C: Cx> {
    /// Σ W jv².
    pub descent: C::V,
    /// Σ W (|J a| + |aref|)²: a force is stiffness times a small difference of J a and aref, so it has their rounding.
    pub terms: C::V,
    /// Σ (f of the model - f) jv: what the slope is more than the model's.
    pub more: C::V,
    /// Contacts that are held.
    pub held: C::V,
}

impl<C: Cx> LineStart<C> {
    /// Adds the law of a contact that may be held, by its power along the line, and its state.
    #[inline(always)]
    fn add_held(&mut self, cx: &mut C, model: [C::F; 2], here: [C::F; 2]) {
        // (f of the model - f) · jv: how much more the true p'(0) is than the model's
        let more = cx.get(&self.more) + cx.only(model[0] - here[0]);
        cx.put(&mut self.more, more);
        // the model and the true cost are on different pieces where the contact is held
        let held = cx.get(&self.held) + cx.only((model[1] - here[1]).abs());
        cx.put(&mut self.held, held);
    }
}

/// The worlds in which the model of this iteration has a contact on its sticking piece; none where no contact is held.
#[inline(always)]
fn sticking<C: Cx>(cx: &mut C, t: &ContactsOf<C>, r: C::I) -> Option<MaskOf<C>> {
    if <<C::F as Num>::Real as Real>::DOUBLE || t.cone != Cone::Elliptic {
        return None;
    }
    let off = (cx.load(t.memory.rows, r, row::STATE) - C::F::c(1.0)).abs();
    Some(off.lt(C::F::c(0.5)))
}

/// Replaces `AHEAD`, the residual at the end of a step, by its change jv, and adds up the contacts.
#[inline(always)]
pub(super) fn begin_line<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    start: &mut LineStart<C>,
) {
    for k in 0..t.classes.len() {
        let list = class_list(cx, t, k);
        if let Some(block) = block_of::<_, TURNS>(&t.classes[k]) {
            each!(cx, r in list, {
                begin_turning_line(cx, t, block, r, start);
            });
            continue;
        }
        each!(cx, r in list, {
            let (jar, ahead) = (cx.load3(t.memory.rows, r, row::JAR), cx.load3(t.memory.rows, r, row::AHEAD));
            // the law of the model at a
            let holds = sticking(cx, t, r);
            let law = law_held(cx, t, r, jar, holds);
            // jv = J s over the segment; 0 in worlds without this contact
            let mut jv = [C::F::c(0.0); 3];
            for i in 0..3 {
                jv[i] = cx.only(ahead[i] - jar[i]);
            }
            cx.fill_all(t.memory.rows, r, row::AHEAD, jv);
            // f · jv and jvᵀ W jv of the model
            let (power_here, bend) = (power(&law.force, jv), bend_along(&law, jv));
            let more = cx.get(&start.descent) + cx.only(bend);
            cx.put(&mut start.descent, more);
            cx.fill_all(t.memory.rows, r, row::POWER, [power_here, bend]);
            // a held contact: how its true force at a differs from the model's
            if holds.is_some() {
                let here = law_at(cx, t, r, jar);
                let power = power(&here.force, jv);
                start.add_held(cx, [power_here, law.state], [power, here.state]);
            }
            // the slip at any α is the root of a quadratic: keep its coefficients
            if t.cone == Cone::Elliptic {
                let [[_, x, y], [_, u, v]] = [jar, jv];
                let squares = [x.fma(x, y * y), x.fma(u, y * v), u.fma(u, v * v)];
                cx.fill_all(t.memory.rows, r, row::SQUARES, squares);
            }
            // rounding of the terms of J a - aref, by their stiffness
            let aref = cx.load3(t.memory.rows, r, row::AREF);
            let [nn, _, _, xx, _, yy] = law.stiffness;
            let mut sum = C::F::c(0.0);
            for (i, stiff) in [nn, xx, yy].into_iter().enumerate() {
                let rounded = (jar[i] + aref[i]).abs() + aref[i].abs();
                sum = (stiff * rounded).fma(rounded, sum);
            }
            let more = cx.get(&start.terms) + cx.only(sum);
            cx.put(&mut start.terms, more);
        });
    }
}

/// [`begin_line`] of one contact with torsional friction.
#[inline(always)]
fn begin_turning_line<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    block: usize,
    r: C::I,
    start: &mut LineStart<C>,
) {
    let rows = t.memory.rows;
    // as in `begin_line`, over six rows
    let jar = turning::six(cx, t, r, row::JAR, block + more::JAR);
    let ahead = turning::six(cx, t, r, row::AHEAD, block + more::AHEAD);
    let holds = sticking(cx, t, r);
    let law = turning::law_at(cx, t, r, block, jar, holds);
    let mut jv = ahead;
    for i in 0..6 {
        jv[i] = cx.only(ahead[i] - jar[i]);
    }
    let [a, b, c, d, e, f] = jv;
    cx.fill_all(rows, r, row::AHEAD, [a, b, c]);
    cx.fill_all(rows, r, block + more::AHEAD, [d, e, f]);
    // jvᵀ W jv and f · jv of the model
    let bend = turning::dot(law.times(jv), jv);
    let sum = cx.get(&start.descent) + cx.only(bend);
    cx.put(&mut start.descent, sum);
    let power = turning::dot(law.force, jv);
    cx.fill_all(rows, r, row::POWER, [power, bend]);
    // how the true force of a held contact differs
    if holds.is_some() {
        let here = turning::law_at(cx, t, r, block, jar, None);
        let there = turning::dot(here.force, jv);
        start.add_held(cx, [power, law.state], [there, here.state]);
    }
    // coefficients of the squared slip along the line
    if t.cone == Cone::Elliptic {
        cx.fill_all(rows, r, row::SQUARES, turning::squares(jar, jv));
    }
    // rounding of the terms of J a - aref, by the diagonal of W
    let aref = turning::six(cx, t, r, row::AREF, block + more::AREF);
    let mut all = C::F::c(0.0);
    for (i, stiff) in law.diagonal().into_iter().enumerate() {
        let rounded = (jar[i] + aref[i]).abs() + aref[i].abs();
        all = (stiff * rounded).fma(rounded, all);
    }
    let sum = cx.get(&start.terms) + cx.only(all);
    cx.put(&mut start.terms, sum);
}

/// Adds what contacts change in slope, curvature and size of terms of a line at `alpha`, against its quadratic model.
#[inline(always)]
pub(super) fn derivative<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    alpha: C::F,
    slope: &mut C::V,
    curvature: &mut C::V,
    size: &mut C::V,
) {
    for k in 0..t.classes.len() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            // the law at α, against the quadratic piece of the model
            let here = law_along::<_, TURNS>(cx, t, &t.classes[k], r, alpha);
            let [state, power, bend] = cx.load3(t.memory.rows, r, row::STATE);
            // -p' of the quadratic model, whose force is power at α = 0
            let model = power - alpha * bend;
            let moved = (here.state - state).abs() + is_curved(t.cone, here.state);
            // exactly 0 where the piece is the same quadratic, in spite of rounding
            let differs = C::F::c(0.5).lt(moved);
            let zero = C::F::c(0.0);
            // p' gains (f of the model - f) · jv
            let more = C::F::select(differs, model - here.power, zero);
            let more = cx.only(more);
            let sum = cx.get(slope) + more;
            cx.put(slope, sum);
            // the size of the terms, whose rounding p' has
            let sum = cx.get(size) + more.abs();
            cx.put(size, sum);
            // of the curvature likewise
            let bend = C::F::select(differs, here.bend - bend, zero);
            let sum = cx.get(curvature) + cx.only(bend);
            cx.put(curvature, sum);
        });
    }
}
