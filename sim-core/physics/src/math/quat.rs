//! Unit quaternions (x, y, z, w).

use super::vec3::{Mat3, Vec3};
use crate::lane::Num;

/// x, y, z, w
pub type Quat<F> = [F; 4];

/// A constant quaternion.
#[inline(always)]
pub fn constant<F: Num>(a: Quat<F::Real>) -> Quat<F> {
    [F::k(a[0]), F::k(a[1]), F::k(a[2]), F::k(a[3])]
}

/// Hamilton's product: the rotation `b`, then `a`.
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

/// `a` after a rotation about its own z, given sine and cosine of half the angle.
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

/// The rotation matrix of a unit quaternion, by columns.
#[inline(always)]
pub fn matrix<F: Num>(q: Quat<F>) -> Mat3<F> {
    let [x, y, z, w] = q;
    let (one, two) = (F::c(1.0), F::c(2.0));
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, xz, yz) = (x * y, x * z, y * z);
    let (wx, wy, wz) = (w * x, w * y, w * z);
    Mat3([
        Vec3([two.fnma(yy + zz, one), two * (xy + wz), two * (xz - wy)]),
        Vec3([two * (xy - wz), two.fnma(xx + zz, one), two * (yz + wx)]),
        Vec3([two * (xz + wy), two * (yz - wx), two.fnma(xx + yy, one)]),
    ])
}

/// The quaternion after rotating with angular velocity `spin` (in its own axes) for a time, normalised.
#[inline(always)]
pub fn turned<F: Num>(q: Quat<F>, spin: Vec3<F>, time: F) -> Quat<F> {
    let r = mul(q, exp(spin * time));
    let norm = r[0].fma(r[0], r[1].fma(r[1], r[2].fma(r[2], r[3] * r[3])));
    let inverse = F::c(1.0).div(norm.sqrt());
    [
        r[0] * inverse,
        r[1] * inverse,
        r[2] * inverse,
        r[3] * inverse,
    ]
}

/// The inverse of a unit quaternion.
#[inline(always)]
pub fn conjugate<F: Num>(q: Quat<F>) -> Quat<F> {
    [-q[0], -q[1], -q[2], q[3]]
}

/// The rotation of a rotation vector [rad].
#[inline(always)]
pub fn exp<F: Num>(turn: Vec3<F>) -> Quat<F> {
    let half = F::c(0.5);
    let angle = turn.dot(turn).sqrt();
    let (sin, cos) = (angle * half).sincos();
    // sin(θ/2) / θ; where θ is too small for a quotient, its limit 1/2
    let small = angle.lt(F::c(1e-15));
    let ratio = F::select(small, half, sin.div(F::select(small, F::c(1.0), angle)));
    let Vec3([x, y, z]) = turn * ratio;
    [x, y, z, cos]
}

/// The rotation vector of a unit quaternion, at most π long [rad].
#[inline(always)]
pub fn log<F: Num>(q: Quat<F>) -> Vec3<F> {
    let (zero, two) = (F::c(0.0), F::c(2.0));
    // q and -q are the same rotation: take the short way
    let w = q[3];
    let sign = F::select(w.lt(zero), -two, two);
    let axis = Vec3([q[0], q[1], q[2]]);
    let sin = axis.dot(axis).sqrt();
    let small = sin.lt(F::c(1e-15));
    let angle = sin.atan2_positive(w.abs());
    let ratio = F::select(
        small,
        F::c(1.0),
        angle.div(F::select(small, F::c(1.0), sin)),
    );
    axis * (ratio * sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_libms_to_two_ulps_of_half_pi() {
        for k in 0..=10_000 {
            let angle = k as f64 / 10_000.0 * std::f64::consts::FRAC_PI_2;
            for length in [1e-3, 1.0, 40.0] {
                let (sin, cos) = (length * angle.sin(), length * angle.cos());
                assert!(
                    (sin.atan2_positive(cos) - sin.atan2(cos)).abs() < 4.5e-16,
                    "{angle}"
                );
                let (sin, cos) = (sin as f32, cos as f32);
                assert!(
                    (sin.atan2_positive(cos) - sin.atan2(cos)).abs() < 2.4e-7,
                    "{angle}"
                );
            }
        }
    }

    #[test]
    fn rotation_vector_of_a_turn_is_that_turn() {
        for angle in [0.0, 1e-16, 1e-9, 1e-3, 1.0, 2.0, 3.1] {
            let turn = Vec3([angle * 0.6, angle * -0.64, angle * 0.48]);
            let back = log(exp(turn));
            let error = (0..3)
                .map(|i| (back[i] - turn[i]).abs())
                .fold(0.0, f64::max);
            // near π the angle is that of a small cosine
            assert!(
                error <= 4.0 * f64::EPSILON * angle.max(1e-16),
                "{angle}: {back:?}"
            );
        }
    }

    #[test]
    fn turns_past_half_a_circle_are_taken_the_short_way() {
        let back = log(exp(Vec3([0.0, 0.0, 4.0])));
        assert!(
            (back[2] - (4.0 - std::f64::consts::TAU)).abs() < 1e-14,
            "{back:?}"
        );
    }
}
