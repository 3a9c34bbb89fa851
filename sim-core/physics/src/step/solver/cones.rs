//! Laws of friction cones: force, stiffness and cost of a contact (Todorov 2014; MuJoCo documentation, "Friction cones";
//! `mj_constraintUpdate`).
//!
//! ```text
//! elliptic, with t = |jar of the tangents|:
//!     jar₀ ≥ μ t                 nothing                                                  separated
//!     μ jar₀ + impratio t ≤ 0    s = ½ D (jar₀² + impratio t²)                            sticks
//!     between                    s = ½ D / (1 + μ²/impratio) (jar₀ - μ t)²                slides
//! pyramidal, over the edges jar₀ ± μ jar₁, jar₀ ± μ jar₂:    s = Σ ½ D min(edge, 0)²
//! ```

use crate::constants::contact::Cone;
use crate::lane::{Num, Real};

/// The law of a contact at a residual `jar` = J a - aref.
pub(super) struct ConeLaw<F> {
    /// -s' along normal and tangents.
    pub force: [F; 3],
    /// s'': 00, 01, 02, 11, 12, 22.
    pub stiffness: [F; 6],
    /// Which piece of s it is on: 0 where it has no force. See [`is_curved`].
    pub state: F,
    /// s.
    pub cost: F,
}

/// 1 where s is not quadratic on its piece, else 0: where a contact of an elliptic cone slides.
#[inline(always)]
pub(super) fn is_curved<F: Num>(cone: Cone, state: F) -> F {
    match cone {
        Cone::Elliptic => F::select(F::c(1.5).lt(state), F::c(1.0), F::c(0.0)),
        Cone::Pyramidal => F::c(0.0),
    }
}

/// The law of an elliptic cone. Where it `holds`, a contact that slides has the sticking piece.
#[inline(always)]
pub(super) fn elliptic<F: Num>(
    impratio: F::Real,
    jar: [F; 3],
    [stiff, soft, mu]: [F; 3],
    holds: Option<F::Mask>,
) -> ConeLaw<F> {
    let (zero, one, half) = (F::c(0.0), F::c(1.0), F::c(0.5));
    let ratio = impratio.to_f64();
    // slip t = |jar of the tangents|, and its direction d = (x, y)
    let square = jar[1].fma(jar[1], jar[2] * jar[2]);
    let slip = square.sqrt();
    // slip > 0 where a contact slides; elsewhere the quotient is not used
    let inverse = one.div(F::select(zero.lt(slip), slip, one));
    let (x, y) = (jar[1] * inverse, jar[2] * inverse);
    // jar₀ - μ t ≥ 0: separated; μ jar₀ + impratio t ≤ 0: sticks, as does a contact that is held
    let excess = mu.fnma(slip, jar[0]);
    let leaves = !excess.lt(zero);
    let mut sticks = !zero.lt(mu.fma(jar[0], slip * F::c(ratio)));
    if let Some(holds) = holds {
        sticks = sticks | holds;
    }
    // masks that exclude each other; a contact of stiffness 0, past its margin, is on no piece
    let acts = !leaves & zero.lt(stiff);
    let sticks = acts & sticks;
    let slides = acts & !sticks;
    // impratio D along the tangents; normal force of the sliding piece, -D / (1 + μ²/impratio) (jar₀ - μ t)
    let across = stiff * F::c(ratio);
    let push = -(soft * excess);
    // sliding: soft (1, -μ d)(1, -μ d)ᵀ, and the rotation of the friction force with the slip direction d
    let rub = soft * mu;
    let turn = (push * mu) * inverse;
    let along = rub * mu - turn;
    // the friction of a contact that slides: μ times its normal force, against d
    let pull = -(push * mu);
    ConeLaw {
        force: [
            by_piece::<F>(sticks, slides, -(stiff * jar[0]), push),
            by_piece::<F>(sticks, slides, -(across * jar[1]), pull * x),
            by_piece::<F>(sticks, slides, -(across * jar[2]), pull * y),
        ],
        stiffness: [
            by_piece::<F>(sticks, slides, stiff, soft),
            by_piece::<F>(sticks, slides, zero, -(rub * x)),
            by_piece::<F>(sticks, slides, zero, -(rub * y)),
            by_piece::<F>(sticks, slides, across, (along * x).fma(x, turn)),
            by_piece::<F>(sticks, slides, zero, along * x * y),
            by_piece::<F>(sticks, slides, across, (along * y).fma(y, turn)),
        ],
        state: by_piece::<F>(sticks, slides, one, F::c(2.0)),
        cost: half
            * by_piece::<F>(
                sticks,
                slides,
                (stiff * jar[0]).fma(jar[0], across * square),
                -(push * excess),
            ),
    }
}

/// The law of a contact along a line jar + α jv.
pub(super) struct LineLaw<F> {
    /// Force times the line's change of jar.
    pub power: F,
    /// Stiffness times the square of that change.
    pub bend: F,
    /// Which piece of s it is on.
    pub state: F,
}

/// [`elliptic`] at jar + α jv, from the normal parts and, along the tangents, jar · jar, jar · jv and jv · jv.
#[inline(always)]
pub(super) fn elliptic_along<F: Num>(
    impratio: F::Real,
    [normal, change]: [F; 2],
    [start, mixed, end]: [F; 3],
    alpha: F,
    [stiff, soft, mu]: [F; 3],
) -> LineLaw<F> {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let ratio = impratio.to_f64();
    // jar₀ at α
    let normal = alpha.fma(change, normal);
    // half the rate of the squared slip
    let turn = alpha.fma(end, mixed);
    // t² = jar · jar + 2 α jar · jv + α² jv · jv over the tangents; rounding may leave it below 0
    let square = alpha.fma(mixed + turn, start).max(zero);
    let slip = square.sqrt();
    let inverse = one.div(F::select(zero.lt(slip), slip, one));
    // the pieces of `elliptic`
    let excess = mu.fnma(slip, normal);
    let leaves = !excess.lt(zero);
    let sticks = !zero.lt(mu.fma(normal, slip * F::c(ratio)));
    let acts = !leaves & zero.lt(stiff);
    let sticks = acts & sticks;
    let slides = acts & !sticks;
    let across = stiff * F::c(ratio);
    let push = -(soft * excess);
    // sliding: rates of the slip and of the excess, and the growth of the slip's rate
    let rate = turn * inverse;
    let speed = mu.fnma(rate, change);
    let growth = rate.fnma(rate, end).max(zero) * inverse;
    // sticking: s' = D jar₀ jv₀ + impratio D t t'
    let pulled = (stiff * normal).fma(change, across * turn);
    // p' = -power; sliding: s'' = soft (e'² + e e'') with e = jar₀ - μ t, e'' = -μ t''
    LineLaw {
        power: by_piece::<F>(sticks, slides, -pulled, push * speed),
        bend: by_piece::<F>(
            sticks,
            slides,
            (stiff * change).fma(change, across * end),
            (soft * speed).fma(speed, push * mu * growth),
        ),
        state: by_piece::<F>(sticks, slides, one, F::c(2.0)),
    }
}

/// A value where the contact sticks, another where it slides, 0 where it is separated.
#[inline(always)]
fn by_piece<F: Num>(sticks: F::Mask, slides: F::Mask, stick: F, slide: F) -> F {
    F::select(sticks, stick, F::select(slides, slide, F::c(0.0)))
}

/// The law of a pyramidal cone: four edges, each active where its force pushes. Its piece is the set of active edges.
#[inline(always)]
pub(super) fn pyramidal<F: Num>(jar: [F; 3], stiff: F, mu: F) -> ConeLaw<F> {
    let (zero, half) = (F::c(0.0), F::c(0.5));
    let (a, b) = (mu * jar[1], mu * jar[2]);
    let mut push = [zero; 4];
    let mut active = [zero; 4];
    let (mut state, mut cost) = (zero, zero);
    // edges jar₀ ± μ jar₁, jar₀ ± μ jar₂: s = ½ D edge² = -½ force · edge where it pushes; bit i is set then
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
    // edges have J = (1, ± μ): opposite ones add up along the normal, and their difference acts along the tangent
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

/// Curvature of s along jv: jvᵀ W jv.
#[inline(always)]
pub(super) fn bend_along<F: Num>(law: &ConeLaw<F>, jv: [F; 3]) -> F {
    let [nn, nx, ny, xx, xy, yy] = law.stiffness;
    let n = nn.fma(jv[0], nx.fma(jv[1], ny * jv[2]));
    let x = nx.fma(jv[0], xx.fma(jv[1], xy * jv[2]));
    let y = ny.fma(jv[0], xy.fma(jv[1], yy * jv[2]));
    power(&[n, x, y], jv)
}

/// Power of a force along jv: f · jv.
#[inline(always)]
pub(super) fn power<F: Num>(force: &[F; 3], jv: [F; 3]) -> F {
    force[0].fma(jv[0], force[1].fma(jv[1], force[2] * jv[2]))
}
