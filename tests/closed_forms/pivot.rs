//! A body on a ball joint: the spherical pendulum and the gyroscope.

use crate::{
    GRAVITY, Quat, SUBSTEPS, Top, Vec3, after, assert_first_order, dot, motion, one_body, quat,
    rounding, turned, vec3,
};
use sim_engine::simulation::Precision;
use sim_model::JointKind;
use std::f64::consts::TAU;

/// A bob on a rod of 0.4 m below the joint.
const PENDULUM: Top = Top {
    mass: 1.5,
    center: [0.0, 0.0, -0.4],
    moments: [0.002, 0.002, 0.002],
};
/// A disc on a stem of 0.1 m above the joint.
const GYROSCOPE: Top = Top {
    mass: 0.5,
    center: [0.0, 0.0, 0.1],
    moments: [1e-3, 1e-3, 2e-3],
};

impl Top {
    /// Moments about the joint, which lies on the third axis [kg·m²].
    fn about_joint(&self) -> Vec3 {
        let [first, second, third] = self.moments;
        let far = self.mass * self.center[2].powi(2);
        [first + far, second + far, third]
    }
}

/// A turn about x.
fn tilted(angle: f64) -> Quat {
    [(0.5 * angle).sin(), 0.0, 0.0, (0.5 * angle).cos()]
}

/// Azimuth and tilt of the third axis [rad].
fn direction(turn: Quat) -> (f64, f64) {
    let [x, y, z] = turned(turn, [0.0, 0.0, 1.0]);
    (y.atan2(x), x.hypot(y).atan2(z))
}

/// How far an azimuth is from an expected one [rad].
fn ahead(azimuth: f64, expected: f64) -> f64 {
    (azimuth - expected + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU
}

/// Energy [J] and vertical angular momentum [kg·m²/s] of a top.
fn conserved(top: &Top, turn: Quat, spin: Vec3) -> [f64; 2] {
    let moments = top.about_joint();
    let momentum: Vec3 = std::array::from_fn(|i| moments[i] * spin[i]);
    let height = turned(turn, top.center)[2];
    [
        0.5 * dot(spin, momentum) + top.mass * GRAVITY * height,
        turned(turn, momentum)[2],
    ]
}

/// How much energy and vertical angular momentum of a swinging pendulum drift in 3 s, relative to their size.
fn drifts(dt: f64, precision: Precision) -> [f64; 2] {
    let scene = one_body(dt, JointKind::Ball, PENDULUM);
    let (turn, spin) = (tilted(0.8), [1.0, 2.0, -0.5]);
    let start = conserved(&PENDULUM, turn, spin);
    let (q, qd, _) = after(&scene, precision, &turn, &spin, 3.0);
    let end = conserved(&PENDULUM, quat(&q), vec3(&qd));
    let hanging = -PENDULUM.mass * GRAVITY * 0.4;
    let sizes = [start[0] - hanging, start[1]];
    std::array::from_fn(|i| (end[i] - start[i]) / sizes[i])
}

#[test]
fn spherical_pendulum_keeps_energy_and_vertical_angular_momentum_to_first_order() {
    let (coarse, fine) = (drifts(2e-4, Precision::F64), drifts(1e-4, Precision::F64));
    for (what, (coarse, fine)) in ["energy", "vertical angular momentum"]
        .iter()
        .zip(coarse.into_iter().zip(fine))
    {
        assert!(fine.abs() < 2e-3, "{what} drifts by {fine:e}");
        assert_first_order(what, coarse, fine);
    }
    for (single, double) in drifts(2e-4, Precision::F32).into_iter().zip(coarse) {
        assert!(
            (single - double).abs() < rounding(1.5e4, 1.0),
            "{single:e}, {double:e}"
        );
    }
}

#[test]
fn conical_pendulum_turns_steadily_with_its_period_to_rounding_in_both_precisions() {
    let (tilt, turns) = (0.7_f64, 2.0);
    // the axis points up, away from the bob; what the bob's own inertia adds to both sides cancels
    let period = TAU * (0.4 * tilt.cos() / GRAVITY).sqrt();
    let rate = TAU / period;
    let scene = one_body(period / 5000.0, JointKind::Ball, PENDULUM);
    let (turn, spin) = (tilted(tilt), [0.0, rate * tilt.sin(), rate * tilt.cos()]);
    for precision in [Precision::F64, Precision::F32] {
        let (q, _, n) = after(&scene, precision, &turn, &spin, turns * period);
        let (azimuth, now) = direction(quat(&q));
        let (start, _) = direction(turn);
        // the body turns about the vertical as a whole, so that its velocity stands still in its own axes: such a
        // motion the method keeps exactly
        let tolerance = match precision {
            Precision::F64 => 1e-16 * n,
            Precision::F32 => rounding(n, 1.0),
        };
        let off = [ahead(azimuth, start), now - tilt];
        assert!(
            off.iter().all(|x| x.abs() < tolerance),
            "{precision:?}: {off:?} rad off"
        );
    }
}

/// How far a gyroscope in steady precession is off at most during half a turn of it: azimuth and tilt [rad].
fn gyroscope_errors(dt: f64, precision: Precision) -> [f64; 2] {
    let (tilt, along) = (0.6_f64, 150.0);
    let [first, _, third] = GYROSCOPE.about_joint();
    let (weight, inertia) = (GYROSCOPE.mass * GRAVITY * 0.1, first * tilt.cos());
    // I1 cos θ Ω² - I3 ω3 Ω + m g l = 0, the slow root
    let momentum = third * along;
    let root = (momentum * momentum - 4.0 * inertia * weight).sqrt();
    let rate = 2.0 * weight / (momentum + root);
    let scene = one_body(dt, JointKind::Ball, GYROSCOPE);
    let turn = tilted(tilt);
    let spin = [0.0, rate * tilt.sin(), along];
    let (start, _) = direction(turn);
    let mut worst = [0.0_f64; 2];
    let states = motion(&scene, precision, &turn, &spin, 0.5 * TAU / rate);
    for (frame, (q, _)) in (1..).zip(states) {
        let seconds = f64::from(frame) * SUBSTEPS as f64 * dt;
        let (azimuth, now) = direction(quat(&q));
        let off = [ahead(azimuth, start + rate * seconds), now - tilt];
        worst = std::array::from_fn(|i| worst[i].max(off[i].abs()));
    }
    worst
}

#[test]
fn gyroscope_precesses_at_the_rate_of_the_exact_quadratic_to_first_order() {
    // the explicit gyroscopic force makes it nod by an angle of the order of the step
    let (coarse, fine) = (
        gyroscope_errors(2e-5, Precision::F64),
        gyroscope_errors(1e-5, Precision::F64),
    );
    for (what, (coarse, fine)) in ["azimuth", "tilt"].iter().zip(coarse.into_iter().zip(fine)) {
        assert!(fine < 3e-3, "{what} is off by {fine:e} rad");
        assert_first_order(what, coarse, fine);
    }
    let single = gyroscope_errors(2e-4, Precision::F32);
    for (single, double) in single
        .into_iter()
        .zip(gyroscope_errors(2e-4, Precision::F64))
    {
        assert!(
            (single - double).abs() < rounding(1e4, 1.0),
            "{single:e}, {double:e}"
        );
    }
}
