//! Contacts with torsional and rolling friction (MuJoCo: `condim` 4 and 6; `mj_constraintUpdate`).
//!
//! A contact has six rows: along the normal and two tangents, then rotation about the normal and about the tangents. The rows
//! of rotations are scaled by μᵢ / μ, so that all directions of friction have the stiffness and the cone of the tangents:
//!
//! ```text
//! jarᵢ' = μᵢ / μ jarᵢ        slip = |jar₁, jar₂, jar₃' … jar₅'|        see `cones`
//! ```
//!
//! The stiffness is W = (nn, cᵀ; c, diag + along d dᵀ), with the slip direction d.

use crate::constants::contact::{Cone, Contacts, row, turning};
use crate::lane::{Cx, MaskOf, Num, Real};

type ContactsOf<C> = Contacts<<<C as Cx>::F as Num>::Real>;

/// The law of a contact at a residual of its six rows.
pub(super) struct TurningLaw<F> {
    /// -s'.
    pub force: [F; 6],
    /// Which piece of s it is on, as in [`super::cones::ConeLaw`].
    pub state: F,
    /// s.
    pub cost: F,
    normal: F,
    cross: [F; 5],
    diagonal: [F; 5],
    along: F,
    direction: [F; 5],
}

impl<F: Num> TurningLaw<F> {
    /// W u.
    #[inline(always)]
    pub fn times(&self, u: [F; 6]) -> [F; 6] {
        // nn u₀ + c · u, and the part of u along d
        let mut first = self.normal * u[0];
        let mut aligned = F::c(0.0);
        for i in 0..5 {
            first = self.cross[i].fma(u[i + 1], first);
            aligned = self.direction[i].fma(u[i + 1], aligned);
        }
        // c u₀ + diag u + along d (d · u)
        let aligned = aligned * self.along;
        let mut product = [first; 6];
        for i in 0..5 {
            let tangential = self.diagonal[i].fma(u[i + 1], self.direction[i] * aligned);
            product[i + 1] = self.cross[i].fma(u[0], tangential);
        }
        product
    }

    /// The diagonal of W.
    #[inline(always)]
    pub fn diagonal(&self) -> [F; 6] {
        let mut all = [self.normal; 6];
        for i in 0..5 {
            let d = self.direction[i];
            all[i + 1] = (self.along * d).fma(d, self.diagonal[i]);
        }
        all
    }
}

/// The six scalars at `place` of a contact's row and `more` of its second block.
#[inline(always)]
pub(super) fn six<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    r: C::I,
    place: usize,
    more: usize,
) -> [C::F; 6] {
    let [a, b, c] = cx.load3(t.memory.rows, r, place);
    let [d, e, f] = cx.load3(t.memory.rows, r, more);
    [a, b, c, d, e, f]
}

/// The law at a residual; `block` is where the contact's second block begins. `holds` as in [`super::cones::elliptic`].
#[inline(always)]
pub(super) fn law_at<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    r: C::I,
    block: usize,
    jar: [C::F; 6],
    holds: Option<MaskOf<C>>,
) -> TurningLaw<C::F> {
    let stiff = cx.load(t.memory.rows, r, row::STIFFNESS);
    let mu = cx.load(t.memory.rows, r, row::MU);
    match t.cone {
        Cone::Elliptic => {
            let soft = cx.load(t.memory.rows, r, row::SOFT);
            elliptic(t.impratio, jar, [stiff, soft, mu], holds)
        }
        Cone::Pyramidal => {
            // which of the rotations have friction differs from contact to contact
            let exists = cx.load3(t.memory.rows, r, block + turning::EXISTS);
            pyramidal(jar, stiff, mu, exists)
        }
    }
}

/// Squares of the slip along a line: jar · jar, jar · jv, jv · jv over the directions of friction.
#[inline(always)]
pub(super) fn squares<F: Num>(jar: [F; 6], jv: [F; 6]) -> [F; 3] {
    let mut sums = [F::c(0.0); 3];
    for i in 1..6 {
        sums[0] = jar[i].fma(jar[i], sums[0]);
        sums[1] = jar[i].fma(jv[i], sums[1]);
        sums[2] = jv[i].fma(jv[i], sums[2]);
    }
    sums
}

/// u · v.
#[inline(always)]
pub(super) fn dot<F: Num>(u: [F; 6], v: [F; 6]) -> F {
    let mut sum = u[0] * v[0];
    for i in 1..6 {
        sum = u[i].fma(v[i], sum);
    }
    sum
}

#[inline(always)]
pub(super) fn elliptic<F: Num>(
    impratio: F::Real,
    jar: [F; 6],
    [stiff, soft, mu]: [F; 3],
    holds: Option<F::Mask>,
) -> TurningLaw<F> {
    let (zero, one, half) = (F::c(0.0), F::c(1.0), F::c(0.5));
    let ratio = impratio.to_f64();
    // slip as in `cones::elliptic`, over five directions
    let [square, ..] = squares(jar, jar);
    let slip = square.sqrt();
    // slip > 0 where a contact slides; elsewhere the quotient is not used
    let inverse = one.div(F::select(zero.lt(slip), slip, one));
    // separated, sticking or held, sliding: masks that exclude each other
    let excess = mu.fnma(slip, jar[0]);
    let leaves = !excess.lt(zero);
    let mut sticks = !zero.lt(mu.fma(jar[0], slip * F::c(ratio)));
    if let Some(holds) = holds {
        sticks = sticks | holds;
    }
    let acts = !leaves & zero.lt(stiff);
    let (sticks, slides) = (acts & sticks, acts & !sticks);
    let by_piece = |stick, slide| F::select(sticks, stick, F::select(slides, slide, zero));
    // impratio D of friction that sticks; a contact that slides pushes along the normal, and by μ push against d
    let across = stiff * F::c(ratio);
    let push = -(soft * excess);
    let rub = soft * mu;
    let turn = (push * mu) * inverse;
    let pull = -(push * mu);
    // W = diag(stiff, across …) where it sticks; where it slides, soft (1, -μ d)(1, -μ d)ᵀ + turn (1 - d dᵀ)
    let mut law = TurningLaw {
        force: [by_piece(-(stiff * jar[0]), push); 6],
        state: by_piece(one, F::c(2.0)),
        cost: half
            * by_piece(
                (stiff * jar[0]).fma(jar[0], across * square),
                -(push * excess),
            ),
        normal: by_piece(stiff, soft),
        cross: [zero; 5],
        diagonal: [by_piece(across, turn); 5],
        along: by_piece(zero, rub * mu - turn),
        direction: [zero; 5],
    };
    // c, d and the force along each direction of friction
    for i in 0..5 {
        let d = jar[i + 1] * inverse;
        law.direction[i] = d;
        law.cross[i] = by_piece(zero, -(rub * d));
        law.force[i + 1] = by_piece(-(across * jar[i + 1]), pull * d);
    }
    law
}

/// Two edges for each direction of friction that the contact has; `exists` is 1 for the rotations that it has, else 0.
#[inline(always)]
pub(super) fn pyramidal<F: Num>(jar: [F; 6], stiff: F, mu: F, exists: [F; 3]) -> TurningLaw<F> {
    let (zero, half) = (F::c(0.0), F::c(0.5));
    let square = mu * mu;
    let mut law = TurningLaw {
        force: [zero; 6],
        state: zero,
        cost: zero,
        normal: zero,
        cross: [zero; 5],
        diagonal: [zero; 5],
        along: zero,
        direction: [zero; 5],
    };
    for i in 0..5 {
        // the tangents always have edges; a rotation has them if the contact has its friction
        let edge_stiffness = match i {
            0 | 1 => stiff,
            _ => stiff * exists[i - 2],
        };
        // two edges jar₀ ± μ jarᵢ, each on where it pushes; then bit 2 i or 2 i + 1 is set
        let side = mu * jar[i + 1];
        let edges = [jar[0] + side, jar[0] - side];
        let (mut push, mut active) = ([zero; 2], [zero; 2]);
        for (e, edge) in edges.into_iter().enumerate() {
            let force = -(edge_stiffness * edge);
            let on = zero.lt(force);
            push[e] = F::select(on, force, zero);
            active[e] = F::select(on, edge_stiffness, zero);
            let bit = F::c(f64::from(1 << (2 * i + e)));
            law.state = law.state + F::select(on, bit, zero);
            law.cost = law.cost - half * push[e] * edge;
        }
        // edges have J = (1, ± μ): W and f sum over all of them
        law.force[0] = law.force[0] + (push[0] + push[1]);
        law.force[i + 1] = mu * (push[0] - push[1]);
        law.normal = law.normal + (active[0] + active[1]);
        law.cross[i] = mu * (active[0] - active[1]);
        law.diagonal[i] = square * (active[0] + active[1]);
    }
    law
}
