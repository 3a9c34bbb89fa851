//! Laws of contacts, and sums over them (Todorov 2014; MuJoCo documentation, "Friction cones").
//!
//! ```text
//! elliptic, with t = |jar of the tangents|:
//!     jar₀ ≥ μ t                 nothing
//!     μ jar₀ + impratio t ≤ 0    s = ½ D (jar₀² + impratio t²)
//!     between                    s = ½ D / (1 + μ²/impratio) (jar₀ - μ t)²
//! pyramidal, over the edges jar₀ ± μ jar₁, jar₀ ± μ jar₂:    s = Σ ½ D min(edge, 0)²
//! ```
//!
//! Classes are looped over natively, the contacts of a class by the machine. What is added up over contacts goes through
//! cells: with zeros of worlds that have no such contact.

use crate::each;
use crate::lane::{Cx, Num, Real};
use crate::model::Cone;
use crate::model::contact::{Class, Contacts, row};
use crate::step::contact_rows::class_list;

/// What a contact does at `jar`.
pub(super) struct ConeLaw<F> {
    /// -s' along normal and tangents.
    pub force: [F; 3],
    /// s'': 00, 01, 02, 11, 12, 22.
    pub stiffness: [F; 6],
    /// Which piece of s it is on.
    pub state: F,
    /// 1 where s is no quadratic there, else 0.
    pub curved: F,
    /// s.
    pub cost: F,
}

#[inline(always)]
fn law<F: Num>(cone: Cone, impratio: F::Real, jar: [F; 3], stiff: F, mu: F) -> ConeLaw<F> {
    match cone {
        Cone::Elliptic => elliptic(impratio, jar, stiff, mu),
        Cone::Pyramidal => pyramidal(jar, stiff, mu),
    }
}

#[inline(always)]
fn elliptic<F: Num>(impratio: F::Real, jar: [F; 3], stiff: F, mu: F) -> ConeLaw<F> {
    let (zero, one, half) = (F::c(0.0), F::c(1.0), F::c(0.5));
    let ratio = impratio.to_f64();
    let square = jar[1].fma(jar[1], jar[2] * jar[2]);
    let slip = square.sqrt();
    // of contacts that slide `slip` is above 0; elsewhere what comes of the division is not used
    let inverse = one.div(F::select(zero.lt(slip), slip, one));
    let (x, y) = (jar[1] * inverse, jar[2] * inverse);
    let excess = mu.fnma(slip, jar[0]);
    let leaves = F::not(excess.lt(zero));
    let sticks = F::not(zero.lt(mu.fma(jar[0], slip * F::c(ratio))));
    let acts = F::and(F::not(leaves), zero.lt(stiff));
    let sticks = F::and(acts, sticks);
    let slides = F::and(acts, F::not(sticks));
    let across = stiff * F::c(ratio);
    let soft = stiff.div((mu * mu).fma(F::c(1.0 / ratio), one));
    let push = -(soft * excess);
    // of a sliding contact: soft (1, -μ d)(1, -μ d)ᵀ, and the turning of the friction force
    let rub = soft * mu;
    let turn = (push * mu) * inverse;
    let along = rub * mu - turn;
    let pull = -(push * mu);
    ConeLaw {
        force: [
            of_piece::<F>(sticks, slides, -(stiff * jar[0]), push),
            of_piece::<F>(sticks, slides, -(across * jar[1]), pull * x),
            of_piece::<F>(sticks, slides, -(across * jar[2]), pull * y),
        ],
        stiffness: [
            of_piece::<F>(sticks, slides, stiff, soft),
            of_piece::<F>(sticks, slides, zero, -(rub * x)),
            of_piece::<F>(sticks, slides, zero, -(rub * y)),
            of_piece::<F>(sticks, slides, across, (along * x).fma(x, turn)),
            of_piece::<F>(sticks, slides, zero, along * x * y),
            of_piece::<F>(sticks, slides, across, (along * y).fma(y, turn)),
        ],
        state: of_piece::<F>(sticks, slides, one, F::c(2.0)),
        curved: F::select(slides, one, zero),
        cost: half
            * of_piece::<F>(
                sticks,
                slides,
                (stiff * jar[0]).fma(jar[0], across * square),
                -(push * excess),
            ),
    }
}

/// What holds while the contact sticks or slides; 0 where it does neither.
#[inline(always)]
fn of_piece<F: Num>(sticks: F::Mask, slides: F::Mask, stick: F, slide: F) -> F {
    F::select(sticks, stick, F::select(slides, slide, F::c(0.0)))
}

#[inline(always)]
fn pyramidal<F: Num>(jar: [F; 3], stiff: F, mu: F) -> ConeLaw<F> {
    let (zero, half) = (F::c(0.0), F::c(0.5));
    let (a, b) = (mu * jar[1], mu * jar[2]);
    let mut push = [zero; 4];
    let mut active = [zero; 4];
    let (mut state, mut cost) = (zero, zero);
    for (i, edge) in [jar[0] + a, jar[0] - a, jar[0] + b, jar[0] - b]
        .into_iter()
        .enumerate()
    {
        let force = -(stiff * edge);
        let on = zero.lt(force);
        push[i] = F::select(on, force, zero);
        active[i] = F::select(on, stiff, zero);
        state = state + F::select(on, F::c(f64::from(1 << i)), zero);
        cost = cost - half * push[i] * edge;
    }
    let square = mu * mu;
    ConeLaw {
        force: [
            (push[0] + push[1]) + (push[2] + push[3]),
            mu * (push[0] - push[1]),
            mu * (push[2] - push[3]),
        ],
        stiffness: [
            (active[0] + active[1]) + (active[2] + active[3]),
            mu * (active[0] - active[1]),
            mu * (active[2] - active[3]),
            square * (active[0] + active[1]),
            zero,
            square * (active[2] + active[3]),
        ],
        state,
        curved: zero,
        cost,
    }
}

type ContactsOf<C> = Contacts<<<C as Cx>::F as Num>::Real>;
type ClassOf<C> = Class<<<C as Cx>::F as Num>::Real>;

/// Three neighbouring numbers of a contact.
#[inline(always)]
fn three<C: Cx>(cx: &mut C, t: &ContactsOf<C>, r: C::I, k: usize) -> [C::F; 3] {
    [
        cx.load(t.memory.rows, r, k),
        cx.load(t.memory.rows, r, k + 1),
        cx.load(t.memory.rows, r, k + 2),
    ]
}

/// The law of a contact at a `jar` of its row.
#[inline(always)]
fn law_at<C: Cx>(cx: &mut C, t: &ContactsOf<C>, r: C::I, jar: [C::F; 3]) -> ConeLaw<C::F> {
    let stiff = cx.load(t.memory.rows, r, row::STIFFNESS);
    let mu = cx.load(t.memory.rows, r, row::MU);
    law(t.cone, t.impratio, jar, stiff, mu)
}

/// The contacts that the worlds have now.
#[inline(always)]
pub(super) fn count<C: Cx>(cx: &mut C, t: &ContactsOf<C>) -> C::F {
    let mut sum = C::F::c(0.0);
    for class in 0..t.classes.len() {
        let at = cx.at(class);
        sum = sum + cx.load(t.memory.counts, at, 0);
    }
    sum
}

/// The contacts that couple what the mass matrix does not.
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

/// jar = J a - aref, to `place` of every contact.
#[inline(always)]
pub(super) fn residual<C: Cx>(cx: &mut C, t: &ContactsOf<C>, a: &[C::F], place: usize) {
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            for i in 0..3 {
                let mut jar = -cx.load(t.memory.rows, r, row::AREF + i);
                for (c, column) in class.columns.iter().enumerate() {
                    let j = cx.load(t.memory.rows, r, row::JACOBIAN + 3 * c + i);
                    jar = j.fma(a[column.dof], jar);
                }
                cx.fill(t.memory.rows, r, place + i, jar);
            }
        });
    }
}

/// Adds Jᵀ W J of a class to a Hessian of this pattern, and Jᵀ f to the right-hand side if `pulls`.
#[inline(always)]
pub(super) fn assemble<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    k: usize,
    pattern: &crate::math::factor::Pattern,
    hessian: &mut [C::V],
    rhs: &mut [C::V],
    pulls: bool,
) {
    let class: &ClassOf<C> = &t.classes[k];
    let list = class_list(cx, t, k);
    each!(cx, r in list, {
        let jar = three(cx, t, r, row::JAR);
        let law = law_at(cx, t, r, jar);
        let [nn, nx, ny, xx, xy, yy] = law.stiffness;
        let rows = [[nn, nx, ny], [nx, xx, xy], [ny, xy, yy]];
        let mut pull = law.force;
        for x in &mut pull {
            *x = cx.only(*x);
        }
        for (c, column) in class.columns.iter().enumerate() {
            let mut own = three(cx, t, r, row::JACOBIAN + 3 * c);
            for x in &mut own {
                *x = cx.only(*x);
            }
            if pulls {
                let mut moved = cx.get(&rhs[column.dof]);
                for i in 0..3 {
                    moved = own[i].fma(pull[i], moved);
                }
                cx.put(&mut rhs[column.dof], moved);
            }
            let mut stiff = [C::F::c(0.0); 3];
            for i in 0..3 {
                let along = rows[i][1].fma(own[1], rows[i][2] * own[2]);
                stiff[i] = cx.only(rows[i][0].fma(own[0], along));
            }
            for &(_, other) in class.entries.iter().filter(|entry| entry.0 == c) {
                let at = pattern.at(column.dof, class.columns[other].dof);
                let mut entry = cx.get(&hessian[at]);
                for i in 0..3 {
                    let j = cx.load(t.memory.rows, r, row::JACOBIAN + 3 * other + i);
                    let j = cx.only(j);
                    entry = j.fma(stiff[i], entry);
                }
                cx.put(&mut hessian[at], entry);
            }
        }
    });
}

/// Adds to `sum` where a contact is on another piece of its cost at `AHEAD` than at `JAR`, or on a curved one there; to
/// `curved` where it is on a curved one at either.
#[inline(always)]
pub(super) fn changes<C: Cx>(cx: &mut C, t: &ContactsOf<C>, sum: &mut C::V, curved: &mut C::V) {
    for k in 0..t.classes.len() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let (here, ahead) = (three(cx, t, r, row::JAR), three(cx, t, r, row::AHEAD));
            let before = law_at(cx, t, r, here);
            let after = law_at(cx, t, r, ahead);
            let moved = (before.state - after.state).abs() + after.curved;
            let more = cx.get(sum) + cx.only(moved);
            cx.put(sum, more);
            let more = cx.get(curved) + cx.only(before.curved + after.curved);
            cx.put(curved, more);
        });
    }
}

/// Forces of all contacts, and adds their sum in joint space.
#[inline(always)]
pub(super) fn forces<C: Cx>(cx: &mut C, t: &ContactsOf<C>, joint: &mut [C::V]) {
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let jar = three(cx, t, r, row::JAR);
            let law = law_at(cx, t, r, jar);
            let mut force = law.force;
            for (i, x) in force.iter_mut().enumerate() {
                *x = cx.only(*x);
                cx.fill(t.memory.rows, r, row::FORCE + i, *x);
            }
            for (c, column) in class.columns.iter().enumerate() {
                let mut sum = cx.get(&joint[column.dof]);
                for (i, x) in force.iter().enumerate() {
                    let j = cx.load(t.memory.rows, r, row::JACOBIAN + 3 * c + i);
                    sum = cx.only(j).fma(*x, sum);
                }
                cx.put(&mut joint[column.dof], sum);
            }
        });
    }
}

/// Adds Σ s(jar) at `place` to `sum`.
#[inline(always)]
pub(super) fn cost<C: Cx>(cx: &mut C, t: &ContactsOf<C>, place: usize, sum: &mut C::V) {
    for k in 0..t.classes.len() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let jar = three(cx, t, r, place);
            let law = law_at(cx, t, r, jar);
            let more = cx.get(sum) + cx.only(law.cost);
            cx.put(sum, more);
        });
    }
}

/// Turns `AHEAD` from the end of a step into its change; adds to `descent` Σ W jv², to `terms` Σ W (|J a| + |aref|)²: a
/// force is stiffness times a small difference of J a and aref, and rounded as they are.
#[inline(always)]
pub(super) fn begin_line<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    descent: &mut C::V,
    terms: &mut C::V,
) {
    for k in 0..t.classes.len() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let (jar, ahead) = (three(cx, t, r, row::JAR), three(cx, t, r, row::AHEAD));
            let law = law_at(cx, t, r, jar);
            let mut jv = [C::F::c(0.0); 3];
            for i in 0..3 {
                jv[i] = cx.only(ahead[i] - jar[i]);
                cx.fill(t.memory.rows, r, row::AHEAD + i, jv[i]);
            }
            let more = cx.get(descent) + cx.only(bent(&law, jv));
            cx.put(descent, more);
            let aref = three(cx, t, r, row::AREF);
            let [nn, _, _, xx, _, yy] = law.stiffness;
            let mut sum = C::F::c(0.0);
            for (i, stiff) in [nn, xx, yy].into_iter().enumerate() {
                let rounded = (jar[i] + aref[i]).abs() + aref[i].abs();
                sum = (stiff * rounded).fma(rounded, sum);
            }
            let more = cx.get(terms) + cx.only(sum);
            cx.put(terms, more);
        });
    }
}

/// Slope, curvature and size of terms that contacts add to those of a line at `alpha`, beyond its quadratic model.
#[inline(always)]
pub(super) fn derivative<C: Cx>(
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
            let (jar, jv) = (three(cx, t, r, row::JAR), three(cx, t, r, row::AHEAD));
            let mut there = jar;
            for i in 0..3 {
                there[i] = alpha.fma(jv[i], jar[i]);
            }
            let start = law_at(cx, t, r, jar);
            let here = law_at(cx, t, r, there);
            let bend = bent(&start, jv);
            let model = power(&start.force, jv) - alpha * bend;
            let moved = (here.state - start.state).abs() + here.curved;
            // exactly nothing where the piece is the same quadratic, whatever rounding says
            let differs = C::F::c(0.5).lt(moved);
            let zero = C::F::c(0.0);
            let more = C::F::select(differs, model - power(&here.force, jv), zero);
            let more = cx.only(more);
            let sum = cx.get(slope) + more;
            cx.put(slope, sum);
            let sum = cx.get(size) + more.abs();
            cx.put(size, sum);
            let bend = C::F::select(differs, bent(&here, jv) - bend, zero);
            let sum = cx.get(curvature) + cx.only(bend);
            cx.put(curvature, sum);
        });
    }
}

/// jvᵀ W jv
#[inline(always)]
fn bent<F: Num>(law: &ConeLaw<F>, jv: [F; 3]) -> F {
    let [nn, nx, ny, xx, xy, yy] = law.stiffness;
    let n = nn.fma(jv[0], nx.fma(jv[1], ny * jv[2]));
    let x = nx.fma(jv[0], xx.fma(jv[1], xy * jv[2]));
    let y = ny.fma(jv[0], xy.fma(jv[1], yy * jv[2]));
    power(&[n, x, y], jv)
}

/// f · jv
#[inline(always)]
fn power<F: Num>(force: &[F; 3], jv: [F; 3]) -> F {
    force[0].fma(jv[0], force[1].fma(jv[1], force[2] * jv[2]))
}
