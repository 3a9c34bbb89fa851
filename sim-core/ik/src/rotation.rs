//! The rotation between two frames, as a rotation vector.
//!
//! ```text
//! E = R Tᵀ     2 n sin θ = Σ tₖ × rₖ     2 cos θ = tr E - 1     e = θ n
//! ```
//!
//! Near θ = π the sine has no direction: there n nᵀ (1 - cos θ) = (E + Eᵀ)/2 - cos θ.

use sim_physics::lane::{Lane, Num};
use sim_physics::math::vec3::{Mat3, Vec3};
use std::f64::consts::PI;

/// Below this sine, of an angle past π/2, the axis is that of the symmetric part.
const SINE_MIN: f64 = 0.05;

/// The rotation vector, at most π long, that turns `from` into `to`; world axes [rad].
#[inline(always)]
pub fn between<F: Lane>(to: &Mat3<F>, from: &Mat3<F>) -> Vec3<F> {
    let (zero, half, one) = (F::c(0.0), F::c(0.5), F::c(1.0));
    let mut double = from[0].cross(to[0]);
    double = from[1].cross_add(to[1], double);
    double = from[2].cross_add(to[2], double);
    let trace = from[0].dot(to[0]) + from[1].dot(to[1]) + from[2].dot(to[2]);
    let sine = double * half;
    let cosine = (trace - one) * half;
    let size = sine.dot(sine).sqrt();
    let acute = size.atan2_positive(cosine.abs());
    let is_obtuse = cosine.lt(zero);
    let angle = F::select(is_obtuse, F::c(PI) - acute, acute);
    let is_small = size.lt(F::c(1e-15));
    let ratio = angle.div(F::select(is_small, one, size));
    let mut turn = sine * F::select(is_small, one, ratio);
    let is_half_turn = is_obtuse & size.lt(F::c(SINE_MIN));
    // rare: where no lane has one, the result is the same without it
    if F::any(is_half_turn) {
        let axis = axis_of_half_turn(to, from, cosine, sine);
        for i in 0..3 {
            turn[i] = F::select(is_half_turn, axis[i] * angle, turn[i]);
        }
    }
    turn
}

/// The axis of a turn by nearly π, from the largest column of the symmetric part, along the sine.
#[inline(always)]
fn axis_of_half_turn<F: Num>(to: &Mat3<F>, from: &Mat3<F>, cosine: F, sine: Vec3<F>) -> Vec3<F> {
    let half = F::c(0.5);
    let entry = |i: usize, j: usize| {
        to[0][i].fma(from[0][j], to[1][i].fma(from[1][j], to[2][i] * from[2][j]))
    };
    let (xx, yy, zz) = (
        entry(0, 0) - cosine,
        entry(1, 1) - cosine,
        entry(2, 2) - cosine,
    );
    let xy = (entry(0, 1) + entry(1, 0)) * half;
    let xz = (entry(0, 2) + entry(2, 0)) * half;
    let yz = (entry(1, 2) + entry(2, 1)) * half;
    let columns = [Vec3([xx, xy, xz]), Vec3([xy, yy, yz]), Vec3([xz, yz, zz])];
    let (mut axis, mut largest) = (columns[0], xx);
    for (column, diagonal) in [(columns[1], yy), (columns[2], zz)] {
        let is_larger = largest.lt(diagonal);
        for i in 0..3 {
            axis[i] = F::select(is_larger, column[i], axis[i]);
        }
        largest = F::select(is_larger, diagonal, largest);
    }
    let inverse = F::c(1.0).div(axis.dot(axis).sqrt());
    let sign = F::select(axis.dot(sine).lt(F::c(0.0)), -inverse, inverse);
    axis * sign
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim_physics::math::quat;

    #[test]
    fn turns_of_all_sizes_are_found() {
        let axes = [[0.6, -0.64, 0.48], [1.0, 0.0, 0.0], [0.0, -0.8, 0.6]];
        let from = quat::matrix(quat::exp(Vec3([0.3, -1.2, 0.7])));
        for axis in axes {
            for angle in [
                0.0,
                1e-12,
                1e-4,
                0.3,
                1.5,
                1.6,
                3.0,
                3.1,
                PI - 1e-3,
                PI - 1e-9,
            ] {
                let turn = Vec3(axis) * angle;
                let by = quat::matrix(quat::exp(turn));
                let to = Mat3([by * from[0], by * from[1], by * from[2]]);
                let vector = between(&to, &from);
                let error = vector - turn;
                // quat::matrix and three products: a few roundings of 1, times π at most
                assert!(
                    error.dot(error).sqrt() < 1e-14 * (1.0 + PI),
                    "{axis:?} {angle}: {vector:?}"
                );
            }
        }
    }

    #[test]
    fn a_half_turn_has_an_axis() {
        let from = quat::matrix([0.0, 0.0, 0.0, 1.0]);
        for axis in 0..3 {
            let mut q = [0.0f32; 4];
            q[axis] = 1.0;
            let from: Mat3<f32> = Mat3(from.0.map(|column| Vec3(column.0.map(|x| x as f32))));
            let vector = between(&quat::matrix(q), &from);
            for i in 0..3 {
                let expected = if i == axis { std::f32::consts::PI } else { 0.0 };
                assert!((vector[i].abs() - expected).abs() < 1e-6, "{vector:?}");
            }
        }
    }
}
