//! A free body: free fall, Euler's equations, and the precession of a body of revolution.

use crate::{
    GRAVITY, Quat, Top, Vec3, after, assert_first_order, conjugate, cross, distance, dot, one_body,
    quat, rounding, turned, vec3,
};
use sim_engine::simulation::Precision;
use sim_model::JointKind;

/// A body without symmetry that spins near its middle axis, where a rotation is unstable.
const BRICK: Top = Top {
    mass: 2.0,
    center: [0.1, -0.2, 0.05],
    moments: [0.2, 0.5, 0.6],
};
const TURN: Quat = [0.1, -0.5, 0.5, 0.7];
const SPIN: Vec3 = [0.3, 2.0, 0.1];

/// A state of a free body: the frame at the origin.
fn state(turn: Quat, velocity: Vec3, spin: Vec3) -> (Vec<f64>, Vec<f64>) {
    (
        [[0.0; 3].as_slice(), &turn].concat(),
        [velocity, turned(turn, spin)].concat(),
    )
}

#[test]
fn free_fall_is_the_parabola_of_the_method_to_rounding_in_both_precisions() {
    let (dt, seconds, velocity) = (1e-3, 0.4, [0.3, -1.0, 2.0]);
    for precision in [Precision::F64, Precision::F32] {
        // spun about its origin, or carried without spin: then the frame moves as the centre of mass does
        for (center, spin) in [([0.0; 3], SPIN), (BRICK.center, [0.0; 3])] {
            let scene = one_body(dt, JointKind::Free, Top { center, ..BRICK });
            let (q, qd) = state(TURN, velocity, spin);
            let (q, qd, n) = after(&scene, precision, &q, &qd, seconds);
            let (fallen, speed) = (GRAVITY * dt * dt * n * (n + 1.0) / 2.0, GRAVITY * dt * n);
            let expected = velocity.map(|v| v * dt * n);
            let expected = [expected[0], expected[1], expected[2] - fallen];
            let tolerance = match precision {
                Precision::F64 => 1e-15 * n,
                Precision::F32 => rounding(n, speed),
            };
            let error = distance(vec3(&q[..3]), expected);
            assert!(error < tolerance, "{precision:?}: {error:e} m");
            let expected = [velocity[0], velocity[1], velocity[2] - speed];
            let error = distance(vec3(&qd[..3]), expected);
            assert!(error < tolerance, "{precision:?}: {error:e} m/s");
        }
    }
}

/// Angular momentum in world axes and rotational energy of a body without gravity.
fn conserved(turn: Quat, spin: Vec3) -> (Vec3, f64) {
    let momentum: Vec3 = std::array::from_fn(|i| BRICK.moments[i] * spin[i]);
    (turned(turn, momentum), 0.5 * dot(spin, momentum))
}

/// Angular velocity in the body's axes after some seconds, by Runge-Kutta of fourth order in Euler's equations.
fn euler(mut spin: Vec3, seconds: f64) -> Vec3 {
    let rate = |w: Vec3| {
        let momentum: Vec3 = std::array::from_fn(|i| BRICK.moments[i] * w[i]);
        let torque = cross(momentum, w);
        std::array::from_fn::<f64, 3, _>(|i| torque[i] / BRICK.moments[i])
    };
    let ahead = |w: Vec3, r: Vec3, h: f64| std::array::from_fn::<f64, 3, _>(|i| w[i] + h * r[i]);
    let steps = 20_000;
    let h = seconds / f64::from(steps);
    for _ in 0..steps {
        let a = rate(spin);
        let b = rate(ahead(spin, a, 0.5 * h));
        let c = rate(ahead(spin, b, 0.5 * h));
        let d = rate(ahead(spin, c, h));
        spin = std::array::from_fn(|i| spin[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
    }
    spin
}

/// How far spin, angular momentum and energy are off after 2 s, relative to their size.
fn spin_errors(dt: f64, precision: Precision) -> [f64; 3] {
    let mut scene = one_body(dt, JointKind::Free, BRICK);
    scene.gravity = [0.0; 3];
    let (turn, norm) = (TURN, TURN.iter().map(|x| x * x).sum::<f64>().sqrt());
    let turn = turn.map(|x| x / norm);
    let (q, qd) = state(turn, [0.0; 3], SPIN);
    let (q, qd, n) = after(&scene, precision, &q, &qd, 2.0);
    let turn_after = quat(&q[3..]);
    let spin = turned(conjugate(turn_after), vec3(&qd[3..]));
    let ((momentum, energy), (first_momentum, first_energy)) =
        (conserved(turn_after, spin), conserved(turn, SPIN));
    // no force: the centre of mass stays where it was
    let center = turned(turn_after, BRICK.center);
    let start = turned(turn, BRICK.center);
    let moved = distance(std::array::from_fn(|i| q[i] + center[i]), start);
    // the frame is stepped by the velocity of its origin, whose circle has the error of the method
    assert!(moved < 0.25 * 4.0 * dt * n * dt, "{moved} m");
    let size = dot(first_momentum, first_momentum).sqrt();
    [
        distance(spin, euler(SPIN, 2.0)) / 2.0,
        distance(momentum, first_momentum) / size,
        (energy / first_energy - 1.0).abs(),
    ]
}

#[test]
fn spin_of_a_brick_follows_eulers_equations_and_keeps_momentum_and_energy_to_first_order() {
    let (coarse, fine) = (
        spin_errors(2e-4, Precision::F64),
        spin_errors(1e-4, Precision::F64),
    );
    for (what, (coarse, fine)) in ["spin", "angular momentum", "energy"]
        .iter()
        .zip(coarse.into_iter().zip(fine))
    {
        assert!(fine < 1e-3, "{what} is off by {fine:e}");
        assert_first_order(what, coarse, fine);
    }
    for (single, double) in spin_errors(2e-4, Precision::F32).into_iter().zip(coarse) {
        assert!(
            (single - double).abs() < rounding(1e4, 1.0),
            "{single:e}, {double:e}"
        );
    }
}

#[test]
fn spin_of_a_body_of_revolution_precesses_in_it_at_the_analytic_rate() {
    // (I3/I1 - 1) ω3 = 2.4 rad/s
    let (first, third, along, across) = (0.1, 0.16, 4.0, 1.0);
    let rate = (third / first - 1.0) * along;
    let disc = Top {
        mass: 1.0,
        center: [0.0; 3],
        moments: [first, first, third],
    };
    let (dt, seconds) = (1e-3, 5.0);
    let mut scene = one_body(dt, JointKind::Free, disc);
    scene.gravity = [0.0; 3];
    for precision in [Precision::F64, Precision::F32] {
        let (q, qd) = state([0.0, 0.0, 0.0, 1.0], [0.0; 3], [across, 0.0, along]);
        let (q, qd, n) = after(&scene, precision, &q, &qd, seconds);
        let spin = turned(conjugate(quat(&q[3..])), vec3(&qd[3..]));
        let tolerance = match precision {
            Precision::F64 => 1e-14 * n,
            Precision::F32 => rounding(n, along),
        };
        assert!(
            (spin[2] - along).abs() < tolerance,
            "{precision:?}: {spin:?}"
        );
        // Euler's implicit step turns by atan(Ω h), which is Ω h to third order, and shrinks by its hypotenuse
        let angle = rate * seconds;
        let lag = (rate * dt).powi(2) / 3.0 * angle;
        let phase = spin[1].atan2(spin[0]);
        let behind = (angle - phase + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
            - std::f64::consts::PI;
        assert!(
            (behind - lag).abs() < 1e-3 * lag + tolerance,
            "{precision:?}: {behind:e} rad behind, expected {lag:e}"
        );
        let length = across * (1.0 + (rate * dt).powi(2)).powf(-0.5 * n);
        assert!(
            (spin[0].hypot(spin[1]) - length).abs() < 2.0 * tolerance,
            "{precision:?}: {spin:?}"
        );
    }
}
