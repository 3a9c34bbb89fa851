//! Spatial vectors and inertias about a fixed reference point, in world axes (Featherstone 2008, chapter 2).

use super::vec3::{
    Mat3, Vec3, add, constant, cross, cross_add, dot, scale, scale_add, transform, transform_add,
};
use crate::lane::Num;

/// A motion or force: linear part, then angular part.
pub type Spatial<F> = [Vec3<F>; 2];
/// Index of the linear part.
pub const LINEAR: usize = 0;
/// Index of the angular part.
pub const ANGULAR: usize = 1;

/// Inertia about the reference point: mass, first moment m c, then xx yy zz xy xz yz of the second moment.
pub type Inertia<F> = [F; 10];

/// a + b
#[inline(always)]
pub fn sum<F: Num>(a: Spatial<F>, b: Spatial<F>) -> Spatial<F> {
    [add(a[0], b[0]), add(a[1], b[1])]
}

/// a s + b
#[inline(always)]
pub fn scale_sum<F: Num>(a: Spatial<F>, s: F, b: Spatial<F>) -> Spatial<F> {
    [scale_add(a[0], s, b[0]), scale_add(a[1], s, b[1])]
}

/// Power of a force on a motion.
#[inline(always)]
pub fn power<F: Num>(motion: &Spatial<F>, force: &Spatial<F>) -> F {
    dot(motion[LINEAR], force[LINEAR]) + dot(motion[ANGULAR], force[ANGULAR])
}

/// Rate of change of a motion vector that is carried along with velocity `v`: v × m.
#[inline(always)]
pub fn cross_motion<F: Num>(v: &Spatial<F>, m: &Spatial<F>) -> Spatial<F> {
    [
        cross_add(v[ANGULAR], m[LINEAR], cross(v[LINEAR], m[ANGULAR])),
        cross(v[ANGULAR], m[ANGULAR]),
    ]
}

/// v ×* f + g, the rate of change of a force vector that is carried along, added to another.
#[inline(always)]
pub fn cross_force_add<F: Num>(v: &Spatial<F>, f: &Spatial<F>, g: Spatial<F>) -> Spatial<F> {
    [
        cross_add(v[ANGULAR], f[LINEAR], g[LINEAR]),
        cross_add(
            v[ANGULAR],
            f[ANGULAR],
            cross_add(v[LINEAR], f[LINEAR], g[ANGULAR]),
        ),
    ]
}

/// Momentum of an inertia that moves with velocity `v`.
#[inline(always)]
pub fn momentum<F: Num>(i: &Inertia<F>, v: &Spatial<F>) -> Spatial<F> {
    let h = [i[1], i[2], i[3]];
    let w = v[ANGULAR];
    let second = [
        i[4].fma(w[0], i[7].fma(w[1], i[8] * w[2])),
        i[7].fma(w[0], i[5].fma(w[1], i[9] * w[2])),
        i[8].fma(w[0], i[9].fma(w[1], i[6] * w[2])),
    ];
    [
        cross_add(w, h, scale(v[LINEAR], i[0])),
        cross_add(h, v[LINEAR], second),
    ]
}

/// A symmetric constant, xx yy zz xy xz yz, times a vector.
#[inline(always)]
pub fn symmetric<F: Num>(i: [F::Real; 6], a: Vec3<F>) -> Vec3<F> {
    let [xx, yy, zz, xy, xz, yz] = i;
    let columns = [
        constant([xx, xy, xz]),
        constant([xy, yy, yz]),
        constant([xz, yz, zz]),
    ];
    transform(&columns, a)
}

/// Inertia about the reference point of a body whose frame has this rotation and origin.
///
/// `inertia` is xx yy zz xy xz yz about the centre of mass, in the body's axes [kg·m²];
/// `center` the centre of mass in the body's frame [m].
#[inline(always)]
pub fn place<F: Num>(
    mass: F::Real,
    center: Vec3<F::Real>,
    inertia: [F::Real; 6],
    rotation: &Mat3<F>,
    origin: Vec3<F>,
) -> Inertia<F> {
    let m = F::k(mass);
    let c = transform_add(rotation, constant(center), origin);
    let h = scale(c, m);
    let [xx, yy, zz, xy, xz, yz] = inertia;
    // columns of R I
    let turned = [
        transform(rotation, constant([xx, xy, xz])),
        transform(rotation, constant([xy, yy, yz])),
        transform(rotation, constant([xz, yz, zz])),
    ];
    let (hc, zero) = (dot(h, c), F::c(0.0));
    [
        m,
        h[0],
        h[1],
        h[2],
        second_moment(&turned, rotation, h, c, 0, 0, hc),
        second_moment(&turned, rotation, h, c, 1, 1, hc),
        second_moment(&turned, rotation, h, c, 2, 2, hc),
        second_moment(&turned, rotation, h, c, 0, 1, zero),
        second_moment(&turned, rotation, h, c, 0, 2, zero),
        second_moment(&turned, rotation, h, c, 1, 2, zero),
    ]
}

/// `(R I Rᵀ + m (c·c 1 - c cᵀ))(a, b)` from the columns of R I; `start` is m c·c on the diagonal, else 0.
// a function, not a closure: closures do not inherit the target features of the lane
#[inline(always)]
fn second_moment<F: Num>(
    turned: &Mat3<F>,
    rotation: &Mat3<F>,
    h: Vec3<F>,
    c: Vec3<F>,
    a: usize,
    b: usize,
    start: F,
) -> F {
    let moved = h[a].fnma(c[b], start);
    turned[0][a].fma(
        rotation[0][b],
        turned[1][a].fma(rotation[1][b], turned[2][a].fma(rotation[2][b], moved)),
    )
}
