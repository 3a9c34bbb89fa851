//! Surfaces of shapes where they differ from world to world: friction, inverse weights, and softness of contacts.
//!
//! Each shape has a row in a table of every world, and each contact pair that a model names one with its friction. Scalars of
//! a contact follow from the rows of its two shapes by MuJoCo's rules (`mj_contactParam`).

use super::axes_of;
use crate::constants::contact::{
    Contacts, MU_MIN, Solid, WEIGHT_MIN, mixing, pair, rule, soft, surface, surface_velocity,
};
use crate::constants::params::Param;
use crate::constants::{IMPEDANCE_BOUNDS, SOLREF_DEFAULT, WIDTH_MIN};
use crate::lane::{Cx, MaskOf, Num, map};
use crate::math::vec3::{Vec3, load_vec3};
use crate::step::ConstantsOf;
use crate::step::params::param;
use surface::{SOLIMP, SOLREF};

/// Writes what differs per world of a shape's surface and body.
#[inline(always)]
pub(super) fn place_surface<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    params: &[C::F],
    solid: &Solid<<C::F as Num>::Real>,
    row: C::I,
) {
    let (table, varying) = (m.contacts.memory.mu, m.contacts.varying);
    let columns = [
        (varying.mu, Param::ShapeMu, surface::MU),
        (varying.turning, Param::ShapeMuTorsional, surface::TORSION),
        (varying.turning, Param::ShapeMuRolling, surface::ROLLING),
    ];
    for (_, which, column) in columns.into_iter().filter(|(varies, ..)| *varies) {
        let mu = param(m, params, which, solid.shape, solid.friction[column]);
        cx.fill(table, row, column, mu);
    }
    if let (true, Some(first)) = (varying.weight, m.varying.first(Param::BodyInvweight0)) {
        // what stands still has no inverse weight
        let weight = solid.link.map_or(C::F::c(0.0), |link| params[first + link]);
        cx.fill(table, row, surface::WEIGHT, weight);
    }
    if varying.softness {
        let fixed = &solid.softness;
        for (k, &fixed) in fixed.iter().enumerate() {
            let (which, place) = match k.checked_sub(SOLREF) {
                None => (Param::ShapeSolref, SOLREF * solid.shape + k),
                Some(k) => (Param::ShapeSolimp, SOLIMP * solid.shape + k),
            };
            let x = param(m, params, which, place, fixed);
            cx.fill(table, row, surface::SOFTNESS + k, x);
        }
    }
}

/// Writes the friction of the contact pairs that models name, after the rows of shapes.
#[inline(always)]
pub(super) fn place_pairs<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, params: &[C::F]) {
    let (t, table) = (&m.contacts, m.contacts.memory.mu);
    let Some(first) = m.varying.first(Param::PairFriction) else {
        return;
    };
    for k in 0..table.rows - t.solids.len() {
        let row = cx.at(t.solids.len() + k);
        for column in 0..t.varying.frictions() {
            cx.fill(table, row, column, params[first + 3 * k + column]);
        }
    }
}

/// A column of the surfaces of a pair's two shapes.
#[inline(always)]
fn surfaces<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    column: usize,
) -> (C::F, C::F) {
    let (indices, table) = (t.handles.pair_indices, t.memory.mu);
    let a = cx.index(indices, p, pair::SOLID_A, table.rows);
    let b = cx.index(indices, p, pair::SOLID_B, table.rows);
    (cx.load(table, a, column), cx.load(table, b, column))
}

/// Coefficient of friction of a pair where those of shapes vary: of sliding, torsion or rolling, by its column.
#[inline(always)]
pub(super) fn friction<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    column: usize,
) -> C::F {
    let (a, b) = surfaces(cx, t, p, column);
    let mut mu = t.combine.coefficient(a, b);
    // some pairs have the larger coefficient, however the others combine theirs, or that of one shape, or their own
    if t.keeps_max.rows > 0 {
        let rule = cx.constant(t.keeps_max, p, 0);
        // rules are whole: a half keeps the comparison clear of rounding
        let is_at_least = |least: f64| C::F::c(least - 0.5).lt(rule);
        mu = C::F::select(is_at_least(rule::LARGER), a.max(b), mu);
        if t.has_rules {
            mu = C::F::select(is_at_least(rule::FIRST), a, mu);
            mu = C::F::select(is_at_least(rule::SECOND), b, mu);
            let of_pair = friction_of_pair(cx, t, p, column);
            mu = C::F::select(is_at_least(rule::OWN), of_pair, mu);
            // beside pairs whose own friction varies, others have that of their model
            // (without such pairs, `of_pair` has it already)
            if t.varying.pairs {
                let fixed = fixed_friction(cx, t, p, column);
                mu = C::F::select(is_at_least(rule::FIXED), fixed, mu);
            }
        }
    }
    mu.max(C::F::c(MU_MIN))
}

/// Coefficient of friction of a contact pair that a model names.
#[inline(always)]
fn friction_of_pair<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    column: usize,
) -> C::F {
    if t.varying.pairs {
        let row = cx.index(t.named_pairs, p, 0, t.memory.mu.rows);
        return cx.load(t.memory.mu, row, column);
    }
    fixed_friction(cx, t, p, column)
}

/// Coefficient of friction of a pair that is the same in all worlds.
#[inline(always)]
fn fixed_friction<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    column: usize,
) -> C::F {
    let mu = cx.constant(t.handles.pair_numbers, p, pair::MU);
    match column != surface::MU && t.turning.rows > 0 {
        true => mu * cx.constant(t.turning, p, column - surface::TORSION),
        false => mu,
    }
}

/// Torsional and rolling friction over that of sliding, and the inverse weight of both bodies, where one of them varies.
#[inline(always)]
pub(super) fn varying<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    mu: Option<C::F>,
) -> Option<[C::F; 3]> {
    if !t.varying.turning && !t.varying.weight {
        return None;
    }
    let mut scalars = [C::F::c(0.0); 3];
    if t.varying.turning {
        let mu = mu.unwrap_or(cx.constant(t.handles.pair_numbers, p, pair::MU));
        scalars[0] = friction(cx, t, p, surface::TORSION).div(mu);
        scalars[1] = friction(cx, t, p, surface::ROLLING).div(mu);
    }
    if t.varying.weight {
        let (a, b) = surfaces(cx, t, p, surface::WEIGHT);
        scalars[2] = (a + b).max(C::F::c(WEIGHT_MIN));
    }
    Some(scalars)
}

/// Softness of a pair's contacts where that of shapes varies, by [`soft`] (MuJoCo: `mj_contactParam`, `getsolparam`).
#[inline(always)]
pub(super) fn softness<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
) -> Option<[C::F; soft::COLUMNS]> {
    if !t.varying.softness {
        return None;
    }
    let rule = cx.constant(t.mixing, p, mixing::RULE);
    let follows = |least: f64| C::F::c(least - 0.5).lt(rule);
    let mixed = mixed(cx, t, p, [follows(rule::FIRST), follows(rule::SECOND)]);
    let [first, second, d_min, d_max, width, midpoint, _] = mixed;
    let least_time = cx.constant(t.mixing, p, mixing::LEAST_TIME);
    let [d_min, d_max, midpoint] = map([d_min, d_max, midpoint], bounded);
    let [stiffness, damping] = reference([first, second], d_max, least_time);
    // friction of shapes from URDF keeps its own damping
    let keeps = C::F::c(0.5).lt(cx.constant(t.mixing, p, mixing::KEEPS_SLIDING));
    let fixed_sliding = cx.constant(t.handles.pair_numbers, p, pair::SLIDING);
    let sliding = C::F::select(keeps, fixed_sliding, damping);
    // without a width the impedance is the mean of both ends
    let (one, mean) = (C::F::c(1.0), (d_min + d_max) * C::F::c(0.5));
    let has_width = C::F::c(WIDTH_MIN).lt(width);
    let varied = [
        stiffness,
        damping,
        sliding,
        C::F::select(has_width, d_min, mean),
        C::F::select(has_width, d_max, mean),
        C::F::select(has_width, one.div(width), one),
        midpoint,
    ];
    // a pair that a model names has its own
    let mut softness = varied;
    for (k, x) in softness.iter_mut().enumerate() {
        let fixed = match k {
            0..=2 => cx.constant(t.handles.pair_numbers, p, pair::STIFFNESS + k),
            _ => cx.constant(t.mixing, p, mixing::IMPEDANCE + k - soft::IMPEDANCE),
        };
        *x = C::F::select(follows(rule::OWN), fixed, varied[k]);
    }
    Some(softness)
}

/// `solref` and `solimp` of two shapes: a mixture, or those of the first or the second shape alone.
#[inline(always)]
fn mixed<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    [is_first, is_second]: [MaskOf<C>; 2],
) -> [C::F; SOLREF + SOLIMP] {
    let zero = C::F::c(0.0);
    let share = cx.constant(t.mixing, p, mixing::SHARE);
    let rest = C::F::c(1.0) - share;
    // direct references are not mixed: the smaller values count
    let (a, b) = surfaces(cx, t, p, surface::SOFTNESS);
    let are_times = zero.lt(a) & zero.lt(b);
    let mut mixed = [zero; SOLREF + SOLIMP];
    for (k, x) in mixed.iter_mut().enumerate() {
        let (a, b) = surfaces(cx, t, p, surface::SOFTNESS + k);
        let mut both = share.fma(a, rest * b);
        if k < SOLREF {
            both = C::F::select(are_times, both, a.min(b));
        }
        *x = C::F::select(is_second, b, C::F::select(is_first, a, both));
    }
    mixed
}

/// Reference stiffness [1/s²] and damping [1/s] of a `solref`.
#[inline(always)]
fn reference<F: Num>([first, second]: [F; 2], d_max: F, least_time: F) -> [F; 2] {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    // one positive value alone has no meaning: the default counts
    let (is_time, is_ratio) = (zero.lt(first), zero.lt(second));
    let is_sound = (is_time & is_ratio) | (!is_time & !is_ratio);
    let first = F::select(is_sound, first, F::c(SOLREF_DEFAULT[0]));
    let second = F::select(is_sound, second, F::c(SOLREF_DEFAULT[1]));
    // 1 / (d T ζ)² and 2 / (d T)
    let time = first.max(least_time);
    let natural = time * second * d_max;
    let stiffness = one.div((natural * natural).max(F::c(WIDTH_MIN)));
    let damping = F::c(2.0).div(d_max * time);
    // both negative or 0: -first / d² and -second / d
    let is_time = zero.lt(first);
    [
        F::select(is_time, stiffness, (zero - first).div(d_max * d_max)),
        F::select(is_time, damping, (zero - second).div(d_max)),
    ]
}

/// An impedance in MuJoCo's bounds.
#[inline(always)]
fn bounded<F: Num>(d: F) -> F {
    d.max(F::c(IMPEDANCE_BOUNDS[0]))
        .min(F::c(IMPEDANCE_BOUNDS[1]))
}

/// How the surface of a pair's second shape moves relative to that of the first, beside the shapes: velocity at the point that
/// rows count from [m/s], and angular velocity [rad/s]. None where no surface moves.
///
/// The velocity of a surface at p is R v + (R ω) × (p - c), for a shape with axes R and centre c.
#[inline(always)]
pub(super) fn surface_motion<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
) -> Option<[Vec3<C::F>; 2]> {
    if t.surface_velocities.rows == 0 {
        return None;
    }
    let (indices, poses, origins) = (t.handles.pair_indices, t.memory.poses, t.memory.origins);
    // the point that rows of the class count from
    let start = cx.index(indices, p, pair::ORIGIN, origins.rows);
    let start = load_vec3(cx, origins, start, 0);
    let sides = [
        (pair::SOLID_A, pair::ORIGIN_A),
        (pair::SOLID_B, pair::ORIGIN_B),
    ];
    let mut motions = [[Vec3::zero(); 2]; 2];
    for (side, (solid, origin)) in sides.into_iter().enumerate() {
        // the shape and the reference point of its tree
        let row = cx.index(indices, p, solid, poses.rows);
        let origin = cx.index(indices, p, origin, origins.rows);
        let origin = load_vec3(cx, origins, origin, 0);
        // its centre from the point that rows count from
        let center = load_vec3(cx, poses, row, 9) + (origin - start);
        let axes = axes_of(cx, poses, row);
        // v and ω in the axes of the shape
        let mut local = [C::F::c(0.0); surface_velocity::OF_SHAPE];
        for (k, x) in local.iter_mut().enumerate() {
            let column = side * surface_velocity::OF_SHAPE + k;
            *x = cx.constant(t.surface_velocities, p, column);
        }
        // at that point: R v + c × (R ω)
        let [x, y, z, u, v, w] = local;
        let spin = axes.mul_add(Vec3([u, v, w]), Vec3::zero());
        let linear = axes.mul_add(Vec3([x, y, z]), center.cross(spin));
        motions[side] = [linear, spin];
    }
    // of the second side of rows relative to the first
    let flip = cx.constant(t.handles.pair_numbers, p, pair::FLIP);
    let [first, second] = motions;
    Some([(second[0] - first[0]) * flip, (second[1] - first[1]) * flip])
}
