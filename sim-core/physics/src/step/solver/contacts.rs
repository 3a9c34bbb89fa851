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

use crate::constants::contact::Cone;
use crate::constants::contact::{Class, Contacts, row};
use crate::each;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::step::contact_rows::class_list;

/// What a contact does at `jar`.
pub(super) struct ConeLaw<F> {
    /// -s' along normal and tangents.
    pub force: [F; 3],
    /// s'': 00, 01, 02, 11, 12, 22.
    pub stiffness: [F; 6],
    /// Which piece of s it is on; see [`curved`].
    pub state: F,
    /// s.
    pub cost: F,
}

/// 1 where s is no quadratic on a piece, else 0: where a contact of an elliptic cone slides.
#[inline(always)]
fn curved<F: Num>(cone: Cone, state: F) -> F {
    match cone {
        Cone::Elliptic => F::select(F::c(1.5).lt(state), F::c(1.0), F::c(0.0)),
        Cone::Pyramidal => F::c(0.0),
    }
}

#[inline(always)]
fn elliptic<F: Num>(impratio: F::Real, jar: [F; 3], stiff: F, soft: F, mu: F) -> ConeLaw<F> {
    let (zero, one, half) = (F::c(0.0), F::c(1.0), F::c(0.5));
    let ratio = impratio.to_f64();
    let square = jar[1].fma(jar[1], jar[2] * jar[2]);
    let slip = square.sqrt();
    // of contacts that slide `slip` is above 0; elsewhere what comes of the division is not used
    let inverse = one.div(F::select(zero.lt(slip), slip, one));
    let (x, y) = (jar[1] * inverse, jar[2] * inverse);
    let excess = mu.fnma(slip, jar[0]);
    let leaves = !excess.lt(zero);
    let sticks = !zero.lt(mu.fma(jar[0], slip * F::c(ratio)));
    let acts = !leaves & zero.lt(stiff);
    let sticks = acts & sticks;
    let slides = acts & !sticks;
    let across = stiff * F::c(ratio);
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
        cost: half
            * of_piece::<F>(
                sticks,
                slides,
                (stiff * jar[0]).fma(jar[0], across * square),
                -(push * excess),
            ),
    }
}

/// What a contact of an elliptic cone does along a line.
struct Along<F> {
    /// Force times the line's change of jar.
    power: F,
    /// Stiffness times the square of that change.
    bend: F,
    state: F,
}

/// [`elliptic`] at jar + α jv, of which it needs the normal parts and, along the tangents, jar · jar, jar · jv and jv · jv.
#[inline(always)]
fn along_line<F: Num>(
    impratio: F::Real,
    [normal, change]: [F; 2],
    [start, mixed, end]: [F; 3],
    alpha: F,
    [stiff, soft, mu]: [F; 3],
) -> Along<F> {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let ratio = impratio.to_f64();
    let normal = alpha.fma(change, normal);
    // half the rate of the square
    let turn = alpha.fma(end, mixed);
    let square = alpha.fma(mixed + turn, start).max(zero);
    let slip = square.sqrt();
    let inverse = one.div(F::select(zero.lt(slip), slip, one));
    let excess = mu.fnma(slip, normal);
    let leaves = !excess.lt(zero);
    let sticks = !zero.lt(mu.fma(normal, slip * F::c(ratio)));
    let acts = !leaves & zero.lt(stiff);
    let sticks = acts & sticks;
    let slides = acts & !sticks;
    let across = stiff * F::c(ratio);
    let push = -(soft * excess);
    // of a sliding contact: rates of the slip and of the excess, and how fast the slip's rate grows
    let rate = turn * inverse;
    let speed = mu.fnma(rate, change);
    let growth = rate.fnma(rate, end).max(zero) * inverse;
    let pulled = (stiff * normal).fma(change, across * turn);
    Along {
        power: of_piece::<F>(sticks, slides, -pulled, push * speed),
        bend: of_piece::<F>(
            sticks,
            slides,
            (stiff * change).fma(change, across * end),
            (soft * speed).fma(speed, push * mu * growth),
        ),
        state: of_piece::<F>(sticks, slides, one, F::c(2.0)),
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
        cost,
    }
}

type ContactsOf<C> = Contacts<<<C as Cx>::F as Num>::Real>;
type ClassOf<C> = Class<<<C as Cx>::F as Num>::Real>;

/// The law of a contact at a `jar` of its row.
#[inline(always)]
fn law_at<C: Cx>(cx: &mut C, t: &ContactsOf<C>, r: C::I, jar: [C::F; 3]) -> ConeLaw<C::F> {
    let stiff = cx.load(t.memory.rows, r, row::STIFFNESS);
    let mu = cx.load(t.memory.rows, r, row::MU);
    match t.cone {
        Cone::Elliptic => {
            let soft = cx.load(t.memory.rows, r, row::SOFT);
            elliptic(t.impratio, jar, stiff, soft, mu)
        }
        Cone::Pyramidal => pyramidal(jar, stiff, mu),
    }
}

/// The law of a contact at α of the line search.
#[inline(always)]
fn law_along<C: Cx>(cx: &mut C, t: &ContactsOf<C>, r: C::I, alpha: C::F) -> Along<C::F> {
    let rows = t.memory.rows;
    if t.cone == Cone::Elliptic {
        let normal = [cx.load(rows, r, row::JAR), cx.load(rows, r, row::AHEAD)];
        let squares = cx.load3(rows, r, row::SQUARES);
        let numbers = [
            cx.load(rows, r, row::STIFFNESS),
            cx.load(rows, r, row::SOFT),
            cx.load(rows, r, row::MU),
        ];
        return along_line(t.impratio, normal, squares, alpha, numbers);
    }
    let (jar, jv) = (cx.load3(rows, r, row::JAR), cx.load3(rows, r, row::AHEAD));
    let mut there = jar;
    for i in 0..3 {
        there[i] = alpha.fma(jv[i], jar[i]);
    }
    let law = law_at(cx, t, r, there);
    Along {
        power: power(&law.force, jv),
        bend: bent(&law, jv),
        state: law.state,
    }
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

/// The worlds that have contacts now; none if no world has.
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
            let [x, y, z] = cx.load3(t.memory.rows, r, row::AREF);
            let mut jar = [-x, -y, -z];
            for run in &class.runs {
                let first = row::JACOBIAN + 3 * run.column;
                jar = cx.sum_triples(t.memory.rows, r, first, &a[run.places()], jar);
            }
            cx.fill_all(t.memory.rows, r, place, jar);
        });
    }
}

/// Adds Jᵀ W J of a class to the matrix that it is for, and Jᵀ f to the right-hand side if `pulls`; keeps the pieces that
/// its contacts are on.
#[inline(always)]
pub(super) fn assemble<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    k: usize,
    hessian: &mut [C::V],
    rhs: &mut [C::V],
    pulls: bool,
) {
    let class: &ClassOf<C> = &t.classes[k];
    let list = class_list(cx, t, k);
    each!(cx, r in list, {
        let jar = cx.load3(t.memory.rows, r, row::JAR);
        let law = law_at(cx, t, r, jar);
        cx.fill(t.memory.rows, r, row::STATE, law.state);
        let [nn, nx, ny, xx, xy, yy] = law.stiffness;
        let rows = [[nn, nx, ny], [nx, xx, xy], [ny, xy, yy]];
        let mut pull = law.force;
        for x in &mut pull {
            *x = cx.only(*x);
        }
        if pulls {
            for run in &class.runs {
                let first = row::JACOBIAN + 3 * run.column;
                cx.add_triples(t.memory.rows, r, first, pull, &mut rhs[run.places()]);
            }
        }
        for (c, entries) in class.entries.iter().enumerate() {
            let mut own = cx.load3(t.memory.rows, r, row::JACOBIAN + 3 * c);
            for x in &mut own {
                *x = cx.only(*x);
            }
            let mut stiff = [C::F::c(0.0); 3];
            for i in 0..3 {
                let along = rows[i][1].fma(own[1], rows[i][2] * own[2]);
                stiff[i] = cx.only(rows[i][0].fma(own[0], along));
            }
            for run in entries {
                let (first, places) = (row::JACOBIAN + 3 * run.column, run.places());
                cx.add_triples(t.memory.rows, r, first, stiff, &mut hessian[places]);
            }
        }
    });
}

/// Adds to `sum` where a contact is on another piece of its cost at `AHEAD` than it was at `JAR`, or on a curved one there; to
/// `curved` where it is on a curved one at either.
#[inline(always)]
pub(super) fn changes<C: Cx>(cx: &mut C, t: &ContactsOf<C>, sum: &mut C::V, curved: &mut C::V) {
    for k in 0..t.classes.len() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let before = cx.load(t.memory.rows, r, row::STATE);
            let ahead = cx.load3(t.memory.rows, r, row::AHEAD);
            let after = law_at(cx, t, r, ahead).state;
            let slides = self::curved(t.cone, after);
            let moved = (before - after).abs() + slides;
            let more = cx.get(sum) + cx.only(moved);
            cx.put(sum, more);
            let more = cx.get(curved) + cx.only(self::curved(t.cone, before) + slides);
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
            let jar = cx.load3(t.memory.rows, r, row::JAR);
            let law = law_at(cx, t, r, jar);
            let mut force = law.force;
            for x in &mut force {
                *x = cx.only(*x);
            }
            cx.fill_all(t.memory.rows, r, row::FORCE, force);
            for run in &class.runs {
                let first = row::JACOBIAN + 3 * run.column;
                cx.add_triples(t.memory.rows, r, first, force, &mut joint[run.places()]);
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
            let jar = cx.load3(t.memory.rows, r, place);
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
            let (jar, ahead) = (cx.load3(t.memory.rows, r, row::JAR), cx.load3(t.memory.rows, r, row::AHEAD));
            let law = law_at(cx, t, r, jar);
            let mut jv = [C::F::c(0.0); 3];
            for i in 0..3 {
                jv[i] = cx.only(ahead[i] - jar[i]);
            }
            cx.fill_all(t.memory.rows, r, row::AHEAD, jv);
            let bend = bent(&law, jv);
            let more = cx.get(descent) + cx.only(bend);
            cx.put(descent, more);
            cx.fill_all(t.memory.rows, r, row::POWER, [power(&law.force, jv), bend]);
            if t.cone == Cone::Elliptic {
                let [[_, x, y], [_, u, v]] = [jar, jv];
                let squares = [x.fma(x, y * y), x.fma(u, y * v), u.fma(u, v * v)];
                cx.fill_all(t.memory.rows, r, row::SQUARES, squares);
            }
            let aref = cx.load3(t.memory.rows, r, row::AREF);
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
            let here = law_along(cx, t, r, alpha);
            let [state, power, bend] = cx.load3(t.memory.rows, r, row::STATE);
            let model = power - alpha * bend;
            let moved = (here.state - state).abs() + curved(t.cone, here.state);
            // exactly nothing where the piece is the same quadratic, whatever rounding says
            let differs = C::F::c(0.5).lt(moved);
            let zero = C::F::c(0.0);
            let more = C::F::select(differs, model - here.power, zero);
            let more = cx.only(more);
            let sum = cx.get(slope) + more;
            cx.put(slope, sum);
            let sum = cx.get(size) + more.abs();
            cx.put(size, sum);
            let bend = C::F::select(differs, here.bend - bend, zero);
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
