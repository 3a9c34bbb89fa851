//! What worlds start from where the scene has distributions.

mod common;

use common::drawn::{self, launched, model, scene};
use sim_engine::simulation::Precision;
use sim_model::{Distribution, JointKind, Pose};
use sim_physics::arrays::Field;
use sim_physics::constants::Motion;

#[test]
fn a_start_in_f32_is_the_rounded_one_in_f64() {
    let model = model();
    let single = launched(&model, 40, Precision::F32);
    let double = launched(&model, 40, Precision::F64);
    for world in 0..40 {
        for field in [Field::JointQ, Field::JointQd] {
            let rounded = double.get(field, world);
            let rounded: Vec<f64> = rounded.iter().map(|&x| f64::from(x as f32)).collect();
            assert_eq!(
                single.get(field, world),
                rounded,
                "{field:?} of world {world}"
            );
        }
    }
}

#[test]
fn positions_are_clamped_to_limits_and_followers_follow() {
    let model = scene(20.0).compile().unwrap();
    let run = launched(&model, 500, Precision::F64);
    let (start, m) = (model.start(), model.constants());
    for limit in &m.limits {
        let coord = m.dofs[limit.dof].coord;
        let leader = m.equalities.iter().find(|e| e.follower == limit.dof);
        let all: Vec<f64> = (0..500)
            .map(|world| run.get(Field::JointQ, world)[coord])
            .collect();
        let Some(mimic) = leader else {
            let (low, high) = (limit.lower, limit.upper);
            assert!(all.iter().all(|q| (low..=high).contains(q)));
            for end in [low, high] {
                let count = all.iter().filter(|q| q.to_bits() == end.to_bits()).count();
                assert!(count > 50, "{count} of 500 at {end}");
            }
            continue;
        };
        let leader = m.dofs[mimic.leader].coord;
        for (world, q) in all.iter().enumerate() {
            let moved = run.get(Field::JointQ, world)[leader] - start.joint_q[leader];
            let expected = start.joint_q[coord] + mimic.multiplier * moved;
            assert_eq!(q.to_bits(), expected.to_bits(), "world {world}");
            let qd = run.get(Field::JointQd, world);
            let expected = mimic.multiplier * qd[mimic.leader];
            assert_eq!(qd[mimic.follower].to_bits(), expected.to_bits());
        }
    }
}

#[test]
fn quaternions_are_unit_and_turn_as_documented() {
    let mut scene = scene(1.0);
    let fixed = |value| {
        let (low, high) = (value, value);
        Some(Distribution::Uniform { low, high })
    };
    for robot in &mut scene.robots {
        for joint in &mut robot.joints {
            for (dof, value) in joint.dofs.iter_mut().zip([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]) {
                match joint.kind {
                    JointKind::Ball | JointKind::Free => dof.offset_q = fixed(value),
                    _ => dof.offset_q = None,
                }
            }
        }
    }
    let model = scene.compile().unwrap();
    let run = launched(&model, 3, Precision::F64);
    let q = run.get(Field::JointQ, 2);
    let start = &model.start().joint_q;
    let about = |axis: usize, angle: f64| {
        let mut unit = [0.0; 3];
        unit[axis] = 1.0;
        Pose::about(unit, angle)
    };
    let rotation = |from: &[f64]| Pose {
        pos: [0.0; 3],
        quat: [from[0], from[1], from[2], from[3]],
    };
    let close = |actual: &[f64], expected: [f64; 4]| {
        let off = |(a, b): (&f64, f64)| (a - b).abs();
        let off = actual.iter().zip(expected).map(off).fold(0.0, f64::max);
        // some ten operations on numbers up to 1
        assert!(off < 16.0 * f64::EPSILON, "{actual:?} is not {expected:?}");
    };
    let m = model.constants();
    let mut seen = 0;
    for body in &m.bodies {
        let at = body.coord;
        match body.motion {
            Motion::Free => {
                // roll, pitch, yaw about the world's axes, in that order
                let turns = about(2, 0.6).mul(&about(1, 0.5)).mul(&about(0, 0.4));
                let expected = turns.mul(&rotation(&start[at + 3..]));
                close(&q[at + 3..at + 7], expected.quat);
                for k in 0..3 {
                    let expected = start[at + k] + 0.1 * (k + 1) as f64;
                    assert!((q[at + k] - expected).abs() < 4.0 * f64::EPSILON * expected.abs());
                }
                seen += 1;
            }
            Motion::Ball => {
                let angle = f64::sqrt(0.01 + 0.04 + 0.09);
                let axis = [0.1 / angle, 0.2 / angle, 0.3 / angle];
                let expected = rotation(&start[at..]).mul(&Pose::about(axis, angle));
                close(&q[at..at + 4], expected.quat);
                seen += 1;
            }
            Motion::Revolute | Motion::Prismatic => {
                assert_eq!(q[at].to_bits(), start[at].to_bits());
            }
            Motion::Mocap => panic!("the scene has no mocap body"),
        }
    }
    assert_eq!(seen, 3);
    let drawn = launched(&drawn::model(), 50, Precision::F32);
    for world in 0..50 {
        let q = drawn.get(Field::JointQ, world);
        for first in m.quaternions() {
            let length: f64 = q[first..first + 4].iter().map(|x| x * x).sum();
            assert!((length - 1.0).abs() < 4.0 * f64::from(f32::EPSILON));
        }
    }
}

#[test]
fn drawn_joints_have_the_scenes_mean_and_spread() {
    let model = model();
    let worlds = 4096;
    let run = launched(&model, worlds, Precision::F64);
    let all: Vec<Vec<f64>> = (0..worlds).map(|w| run.get(Field::JointQd, w)).collect();
    let followers: Vec<usize> = model
        .constants()
        .equalities
        .iter()
        .map(|e| e.follower)
        .collect();
    let dofs: Vec<usize> = (0..model.dofs())
        .filter(|d| !followers.contains(d))
        .collect();
    let root = (worlds as f64).sqrt();
    // velocities are normal with mean 0.01 and deviation 0.1; one of 100 000 samples is 4.5 standard errors off
    let z = |w: usize, dof: usize| (all[w][dof] - 0.01) / 0.1;
    for &dof in &dofs {
        let mean = (0..worlds).map(|w| z(w, dof)).sum::<f64>() / worlds as f64;
        assert!(mean.abs() * root < 4.5, "dof {dof}: mean {mean}");
        let square = (0..worlds).map(|w| z(w, dof).powi(2)).sum::<f64>() / worlds as f64;
        assert!(
            (square - 1.0).abs() * root / 2f64.sqrt() < 4.5,
            "dof {dof}: {square}"
        );
    }
    for (i, &a) in dofs.iter().enumerate() {
        for &b in &dofs[..i] {
            let both = (0..worlds).map(|w| z(w, a) * z(w, b)).sum::<f64>() / worlds as f64;
            assert!(
                both.abs() * root < 4.5,
                "dofs {a} and {b}: correlation {both}"
            );
        }
    }
}

#[test]
fn a_scene_without_distributions_starts_as_it_is_written() {
    let mut plain = scene(1.0);
    for dof in plain
        .robots
        .iter_mut()
        .flat_map(|robot| &mut robot.joints)
        .flat_map(|joint| &mut joint.dofs)
    {
        (dof.offset_q, dof.offset_qd) = (None, None);
    }
    let model = plain.compile().unwrap();
    assert_ne!(model.hash(), drawn::model().hash());
    let mut run = launched(&model, 5, Precision::F64);
    run.sim.reset(None, Some(&[5])).unwrap();
    run.forward();
    for world in 0..5 {
        assert_eq!(run.get(Field::JointQ, world), model.start().joint_q);
        assert!(
            run.get(Field::JointQd, world)
                .iter()
                .all(|x| x.to_bits() == 0)
        );
    }
}

#[test]
fn offsets_that_make_no_sense_are_refused_by_name() {
    let uniform = |low, high| Distribution::Uniform { low, high };
    let normal = |mean, std| Distribution::Normal { mean, std };
    for (offset, words) in [
        (uniform(1.0, 0.5), "low is 1 and high is 0.5"),
        (uniform(f64::NAN, 0.5), "low is NaN; give a finite number"),
        (uniform(0.0, f64::INFINITY), "high is inf"),
        (normal(0.0, -1.0), "std is -1; it must not be negative"),
        (normal(1e7, 1.0), "mean is 1e7; give at most 1e6"),
        (normal(0.0, 1e7), "std is 1e7"),
    ] {
        let mut scene = scene(1.0);
        let joints = &mut scene.robots[0].joints;
        let lift = joints
            .iter_mut()
            .find(|joint| joint.name == "lift")
            .unwrap();
        lift.dofs[0].offset_q = Some(offset);
        let error = scene.compile().unwrap_err().to_string();
        let culprit = "robot `r`: joint `lift`: offset of joint_q";
        assert!(error.contains(words) && error.contains(culprit), "{error}");
    }
    let mut scene = scene(1.0);
    let joints = &mut scene.robots[0].joints;
    let follower = joints
        .iter_mut()
        .find(|joint| joint.mimic.is_some())
        .unwrap();
    follower.dofs[0].offset_qd = Some(normal(0.0, 1.0));
    let error = scene.compile().unwrap_err().to_string();
    assert!(error.contains("joint `oppose` mimics `grip`"), "{error}");
}
