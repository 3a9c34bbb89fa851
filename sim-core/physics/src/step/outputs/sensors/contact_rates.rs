//! How fast the second shape of a contact moves from the first (MuJoCo: `linvel`, `angvel`).
//!
//! ```text
//! v = Σ ±(v(b) + ω(b) × (p - r))        ω = Σ ±ω(b)        + for the second shape, - for the first
//! ```
//!
//! Both are along the normal and the tangents that MuJoCo shows, which have the signs of a force.

use super::contacts::{Contact, seen};
use crate::constants::contact::row;
use crate::constants::sensors::ContactRates;
use crate::lane::{Cx, Num, map};
use crate::math::spatial::Spatial;
use crate::math::vec3::{Vec3, load_vec3};
use crate::step::{BlockOf, ConstantsOf};

/// Linear and angular velocity of the second shape of contact `r` of a class, from the first one,
/// as a sensor shows them.
#[inline(always)]
pub(super) fn moving<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    (class, r): (usize, C::I),
    rates: &ContactRates,
    contact: &Contact<C::F>,
) -> [Vec3<C::F>; 2] {
    let (zero, one, half) = (C::F::c(0.0), C::F::c(1.0), C::F::c(0.5));
    let rows = m.contacts.memory.rows;
    // the moving bodies of both shapes, counted from 1
    let pair = cx.load(rows, r, row::PAIR);
    let sides = [
        cx.pick(m.sensors.pairs, pair, rates.column),
        cx.pick(m.sensors.pairs, pair, rates.column + 1),
    ];
    // rows have points from the reference point of the second tree
    let point = load_vec3(cx, rows, r, row::POINT);
    let tree = m.contacts.classes[class].trees.1;
    let (mut linear, mut angular) = (Vec3::zero(), Vec3::zero());
    for &body in &rates.bodies {
        // +1 on the second side, -1 on the first, 0 on neither: each world has another pair
        let number = C::F::c((body + 1) as f64);
        let [first, second] = map(sides, |side| {
            C::F::select((side - number).abs().lt(half), one, zero)
        });
        let sign = second - first;
        let of_body = m.bodies[body].tree;
        let mut arm = point;
        if of_body != tree {
            arm = arm + (b.work.reference[tree] - b.work.reference[of_body]);
        }
        // v + ω × p with its sign
        let Spatial([v, omega]) = b.work.velocity[body];
        linear = linear + omega.cross_add(arm, v) * sign;
        angular = angular + omega * sign;
    }
    // the normal of the contact points from the first shape to the second, as its force does
    [
        seen(contact, contact.frame.transpose_mul(linear)),
        seen(contact, contact.frame.transpose_mul(angular)),
    ]
}
