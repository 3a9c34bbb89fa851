//! Motions in one plane: pendulums, and a mass on a rail.

use crate::GRAVITY;
use crate::common::Run;
use sim_model::{Description, Inertial, Joint, JointKind, Link, Pose, Robot};
use sim_physics::arrays::Field;

/// A link with its mass `m` [kg] at distance `l` [m] below the joint, and a small inertia about it.
fn bob(name: &str, m: f64, l: f64) -> Link {
    let i = 1e-3 * m * l * l;
    Link {
        name: name.into(),
        inertial: Some(Inertial {
            mass: m,
            pos: [0.0, 0.0, -l],
            inertia: [[i, 0.0, 0.0], [0.0, i, 0.0], [0.0, 0.0, i]],
        }),
        collisions: Vec::new(),
    }
}

/// `count` pendulums, each hanging from the end of the one before, turning about y.
fn pendulum(dt: f64, count: usize, l: f64) -> Description {
    let mut scene = Description::new(dt, 10);
    scene.gravity = [0.0, 0.0, -GRAVITY];
    let mut links = vec![Link {
        name: "base".into(),
        inertial: None,
        collisions: Vec::new(),
    }];
    let mut joints = Vec::new();
    for k in 0..count {
        links.push(bob(&format!("bob{k}"), 1.0 / (k + 1) as f64, l));
        let at = if k == 0 { [0.0; 3] } else { [0.0, 0.0, -l] };
        joints.push(Joint {
            axis: [0.0, 1.0, 0.0],
            origin: Pose::at(at),
            ..Joint::new(JointKind::Revolute, &format!("joint{k}"), Some(k), k + 1)
        });
    }
    scene.robots.push(Robot {
        name: "pendulum".into(),
        pose: Pose::identity(),
        floating: false,
        self_collisions: false,
        links,
        joints,
        notes: Vec::new(),
        warnings: Vec::new(),
        urdf: None,
        precompiled: None,
    });
    scene
}

/// Arithmetic-geometric mean: the period of a pendulum is 2π √(I/mgl) / agm(1, cos(θ/2)).
fn agm(mut a: f64, mut b: f64) -> f64 {
    for _ in 0..40 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    a
}

#[test]
fn pendulum_period_equals_the_elliptic_integral_within_1e_5() {
    let (dt, l, amplitude) = (1e-4, 0.5, 1.2_f64);
    let model = pendulum(dt, 1, l).compile().unwrap();
    let mut run = Run::reference(&model, &[Field::JointQ, Field::JointQd]);
    run.write(Field::JointQ, &[amplitude]);
    let inertia = 1.001 * l * l;
    let expected = std::f64::consts::TAU * (inertia / (GRAVITY * l)).sqrt()
        / agm(1.0, (0.5 * amplitude).cos());
    // the angle first crosses zero after a quarter period; from there count whole ones
    let mut crossings = Vec::new();
    let (mut before, mut time) = (amplitude, 0.0);
    while crossings.len() < 5 {
        run.step();
        time += 10.0 * dt;
        let q = run.get(Field::JointQ, 0)[0];
        if before > 0.0 && q <= 0.0 {
            crossings.push(time - 10.0 * dt * q / (q - before));
        }
        before = q;
    }
    let period = (crossings[4] - crossings[0]) / 4.0;
    // the method is of first order but symplectic: its period is right to order dt²
    assert!(
        (period / expected - 1.0).abs() < 1e-5,
        "{period} s, expected {expected} s"
    );
}

/// Largest energy error of a free double pendulum over 10 s, as a share of its swing.
fn energy_error(dt: f64) -> f64 {
    let l = 0.5;
    let model = pendulum(dt, 2, l).compile().unwrap();
    let fields = [Field::JointQ, Field::JointQd, Field::MassMatrix];
    let mut run = Run::reference(&model, &fields);
    run.write(Field::JointQ, &[1.0, 0.7]);
    run.forward();
    let energy = |run: &Run| {
        let (q, v) = (run.get(Field::JointQ, 0), run.get(Field::JointQd, 0));
        let m = run.get(Field::MassMatrix, 0);
        let kinetic =
            0.5 * (v[0] * (m[0] * v[0] + m[1] * v[1]) + v[1] * (m[2] * v[0] + m[3] * v[1]));
        let (first, second) = (-l * q[0].cos(), -l * (q[0] + q[1]).cos());
        kinetic + GRAVITY * (first + 0.5 * (first + second))
    };
    let start = energy(&run);
    let hanging = GRAVITY * (-l - 0.5 * 2.0 * l);
    let mut worst = 0.0_f64;
    for _ in 0..(1.0 / dt) as usize {
        run.step();
        worst = worst.max(((energy(&run) - start) / (start - hanging)).abs());
    }
    worst
}

#[test]
fn energy_of_a_free_double_pendulum_drifts_less_than_2e_3_in_10_s_and_half_that_at_half_the_step() {
    // semi-implicit Euler is of first order, and not symplectic where M depends on q
    let (coarse, fine) = (energy_error(1e-4), energy_error(5e-5));
    assert!(coarse < 2e-3, "{coarse:e}");
    assert!(
        (fine / coarse - 0.5).abs() < 0.05,
        "{coarse:e}, at half the step {fine:e}"
    );
}

#[test]
fn mass_slides_down_a_rail_with_half_g_t_squared() {
    let (dt, m) = (1e-3, 2.0);
    let mut scene = pendulum(dt, 1, 0.3);
    let joint = &mut scene.robots[0].joints[0];
    *joint = Joint {
        axis: [0.0, 0.0, -1.0],
        ..Joint::new(JointKind::Prismatic, "rail", Some(0), 1)
    };
    let model = scene.compile().unwrap();
    let mut run = Run::reference(&model, &[Field::JointQ, Field::JointQdd, Field::BodyQ]);
    for _ in 0..100 {
        run.step();
    }
    // semi-implicit Euler falls by g dt² n (n + 1) / 2
    let n = 1000.0;
    let expected = GRAVITY * dt * dt * n * (n + 1.0) / 2.0;
    let q = run.get(Field::JointQ, 0)[0];
    assert!(
        (q - expected).abs() < 1e-12 * n,
        "{q} m, expected {expected} m"
    );
    assert!((run.get(Field::JointQdd, 0)[0] - GRAVITY).abs() < 1e-12 * m * GRAVITY);
    assert!((run.get(Field::BodyQ, 0)[7 + 2] + expected).abs() < 1e-12 * n);
}
