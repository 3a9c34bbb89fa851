//! The way of a tendon around the outside of a circle: two tangents, and the arc between them (MuJoCo: `wrap_circle`).
//!
//! With d⊥ across the point d, the tangents from d touch the circle of radius r at
//!
//! ```text
//! c = (r² d ± r √(d² - r²) d⊥) / d²
//! ```
//!
//! There are two ways around. The one that is nearer to a side site counts, else the shorter one.

use super::flat::{Arc, Flat, TINY, angle, cross, dot, scale, scale_add, select, sub, unit};
use crate::lane::{Num, Real};
use std::f64::consts::PI;

/// What a way whose tangents cross is worth, less than any other [–].
const CROSSED: f64 = -1e4;

/// One of the two ways.
struct Way<F: Num> {
    meets: Flat<F>,
    leaves: Flat<F>,
    /// What speaks for it.
    worth: F,
    /// Where its tangents cross.
    crosses: F::Mask,
    /// Of its arc [m].
    length: F,
}

/// Where a tendon between two points touches; it passes on the side of the point `side`, if there is one.
#[inline(always)]
pub(super) fn outer<F: Num>(
    [first, last]: [Flat<F>; 2],
    side: Option<Flat<F>>,
    radius: F,
) -> Arc<F> {
    let one = F::c(1.0);
    let side = side.map(|side| scale(unit(side), radius));
    let square = radius * radius;
    let (from, to) = (dot(first, first), dot(last, last));
    // it has no way around where an end is inside, or both are one point
    let along = sub(last, first);
    let long = dot(along, along);
    let is_point = long.lt(F::c(TINY));
    let free = !(from.lt(square) | to.lt(square) | is_point);
    // and needs none where the straight line passes, on the side of the site
    let part = (-dot(along, first)).div(F::select(is_point, one, long));
    let part = part.max(F::c(0.0)).min(one);
    let nearest = scale_add(along, part, first);
    let misses = square.lt(dot(nearest, nearest));
    let mut passes = misses;
    if let Some(side) = side {
        passes = passes & !dot(side, nearest).lt(F::c(0.0));
    }
    // one way turns with the clock, the other against it
    let squares = [from, to];
    let with_clock = way([first, last], squares, side, radius, one, misses);
    let against = way([first, last], squares, side, radius, -one, misses);
    let is_with = against.worth.lt(with_clock.worth);
    let crosses = (is_with & with_clock.crosses) | (!is_with & against.crosses);
    Arc {
        touches: free & !passes & !crosses,
        length: F::select(is_with, with_clock.length, against.length),
        meets: select(is_with, with_clock.meets, against.meets),
        leaves: select(is_with, with_clock.leaves, against.leaves),
    }
}

/// A way around, `turn` = 1 with the clock, -1 against it. Its tangents can cross where the straight line misses the circle.
#[inline(always)]
fn way<F: Num>(
    [first, last]: [Flat<F>; 2],
    [from, to]: [F; 2],
    side: Option<Flat<F>>,
    radius: F,
    turn: F,
    misses: F::Mask,
) -> Way<F> {
    let meets = tangent(first, from, radius, turn);
    let leaves = tangent(last, to, radius, -turn);
    let worth = match side {
        Some(side) => dot(unit(scale_add(meets, F::c(1.0), leaves)), side),
        None => {
            let chord = sub(meets, leaves);
            -dot(chord, chord)
        }
    };
    // elsewhere they only seem to, by a rounding
    let crosses = misses & cross_each_other([first, meets], [last, leaves]);
    // past half a turn where the arc turns the other way, but for a rounding of no arc at all
    let (begin, end) = (unit(meets), unit(leaves));
    let sine = cross(begin, end);
    let angle = angle(sine.abs(), dot(begin, end));
    let rounding = match F::Real::DOUBLE {
        true => 0.0,
        false => 8.0 * f64::from(f32::EPSILON),
    };
    let is_long = F::c(rounding).lt(turn * sine);
    Way {
        meets,
        leaves,
        worth: F::select(crosses, F::c(CROSSED), worth),
        crosses,
        length: radius * F::select(is_long, F::c(2.0 * PI) - angle, angle),
    }
}

/// Where a tangent from a point touches the circle.
#[inline(always)]
fn tangent<F: Num>(point: Flat<F>, square: F, radius: F, turn: F) -> Flat<F> {
    let one = F::c(1.0);
    // selects: points inside have no tangent, and the centre divides by 1
    let is_center = square.lt(F::c(TINY * TINY));
    let inverse = one.div(F::select(is_center, one, square));
    let beyond = radius.fnma(radius, square).max(F::c(0.0)).sqrt();
    let across = scale([point[1], -point[0]], turn * radius * beyond);
    scale(scale_add(point, radius * radius, across), inverse)
}

/// Do two pieces of lines cross?
#[inline(always)]
fn cross_each_other<F: Num>([a, b]: [Flat<F>; 2], [c, d]: [Flat<F>; 2]) -> F::Mask {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let (first, second, apart) = (sub(b, a), sub(d, c), sub(a, c));
    let det = cross(first, second);
    let is_parallel = det.abs().lt(F::c(TINY));
    let inverse = one.div(F::select(is_parallel, one, det));
    // how far along each of them they meet
    let on_first = cross(second, apart) * inverse;
    let on_second = cross(first, apart) * inverse;
    let is_off = on_first.lt(zero) | one.lt(on_first) | on_second.lt(zero) | one.lt(on_second);
    !(is_parallel | is_off)
}
