//! Unit quaternions (x, y, z, w).

use super::vec3::Vec3;
use crate::lane::Num;

/// x, y, z, w
pub type Quat<F> = [F; 4];

/// A constant quaternion.
#[inline(always)]
pub fn constant<F: Num>(a: Quat<F::Real>) -> Quat<F> {
    [F::k(a[0]), F::k(a[1]), F::k(a[2]), F::k(a[3])]
}

/// Hamilton's product: first `b`, then `a`.
#[inline(always)]
pub fn mul<F: Num>(a: Quat<F>, b: Quat<F>) -> Quat<F> {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw.fma(bx, ax.fma(bw, ay.fma(bz, -(az * by)))),
        aw.fma(by, ay.fma(bw, az.fma(bx, -(ax * bz)))),
        aw.fma(bz, az.fma(bw, ax.fma(by, -(ay * bx)))),
        aw.fma(bw, -ax.fma(bx, ay.fma(by, az * bz))),
    ]
}

/// `a` after a turn about its own z by an angle whose half has this sine and cosine.
#[inline(always)]
pub fn turn_z<F: Num>(a: Quat<F>, sin_half: F, cos_half: F) -> Quat<F> {
    let [x, y, z, w] = a;
    [
        x.fma(cos_half, y * sin_half),
        y.fma(cos_half, -(x * sin_half)),
        z.fma(cos_half, w * sin_half),
        w.fma(cos_half, -(z * sin_half)),
    ]
}

/// The rotated vector: v + 2 u × (u × v + w v), u the imaginary part.
#[inline(always)]
pub fn rotate<F: Num>(q: Quat<F>, v: Vec3<F>) -> Vec3<F> {
    use super::vec3::{cross, cross_add, scale, scale_add};
    let u = [q[0], q[1], q[2]];
    let t = cross_add(u, v, scale(v, q[3]));
    scale_add(cross(u, t), F::c(2.0), v)
}
