//! Sites, delay and noise: the same in every width and number of threads, and names that are refused.

mod common;

use common::{Demo, Run, command, lesson_with_table, noise};
use sim_engine::backend::{Values, cpu};
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_model::{Body, ContactSensor, Description, Pose, Site};
use sim_physics::arrays::Field;
use sim_physics::constants::params::Param;

const FIELDS: [Field; 11] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQMeasured,
    Field::JointQdMeasured,
    Field::JointTorque,
    Field::SiteQ,
    Field::SiteQd,
    Field::Gyro,
    Field::Accelerometer,
    Field::SiteInverseJacobian,
    Field::ContactSensor,
];
/// Every parameter of delay and noise, and friction, which is a row of constraints.
const VARIED: [Param; 13] = [
    Param::CommandDelay,
    Param::JointFriction,
    Param::JointFNoise,
    Param::JointTargetQNoise,
    Param::JointTargetQdNoise,
    Param::JointQNoise,
    Param::JointQdNoise,
    Param::JointTorqueNoise,
    Param::SiteQNoise,
    Param::SiteQdNoise,
    Param::GyroNoise,
    Param::AccelerometerNoise,
    Param::ContactSensorNoise,
];
const WORLDS: usize = 21;
const FRAMES: usize = 12;

/// The arm over a table with a cube on it, sites on both, and every parameter of delay and noise.
fn scene() -> Description {
    let mut scene = lesson_with_table(Demo::Target, true);
    let robot = &scene.robots[0];
    let hand = format!("{}/{}", robot.name, robot.links.last().unwrap().name);
    for (name, body, relative_to) in [
        ("camera", None, None),
        ("tip", Some(hand.as_str()), None),
        ("on cube", Some("cube"), Some("tip")),
        ("seen", Some("cube"), Some("camera")),
    ] {
        scene.sites.push(Site {
            name: name.to_owned(),
            body: body.map(str::to_owned),
            pose: Pose::from_rpy([0.01, 0.02, 0.03], [0.3, -0.2, 0.1]),
            relative_to: relative_to.map(str::to_owned),
            damping: Site::DAMPING,
        });
    }
    scene.contact_sensors.push(ContactSensor {
        name: "load".to_owned(),
        of: "table".to_owned(),
        against: Some("cube".to_owned()),
    });
    scene.params.extend(VARIED);
    scene
}

/// Parameters of each world: a delay, and noise in two of three.
fn vary(run: &mut Run) {
    let model = run.sim.model().clone();
    for param in model.constants().varying.params() {
        let columns = param.columns(&model.sizes());
        let values: Vec<f64> = (0..run.sim.worlds() * columns)
            .map(|k| {
                let (world, column) = (k / columns, k % columns);
                let number = noise(world + 7, param as usize * 100 + column).abs();
                match param {
                    Param::CommandDelay => (30.0 * number).floor(),
                    Param::JointFriction => 0.5 * number,
                    _ if world % 3 == 0 => 0.0,
                    _ => 0.01 * number,
                }
            })
            .collect();
        run.sim
            .write_param(param, 0..columns, Values::F64(&values), None)
            .unwrap();
    }
}

/// Some frames of the demo, targets a little off in each world, and what they show.
fn play(run: &mut Run, frames: std::ops::Range<usize>) -> Vec<Vec<u64>> {
    let (worlds, dofs) = (run.sim.worlds(), run.sim.model().dofs());
    frames
        .map(|frame| {
            let (field, row) = command(Demo::Target, 20 * frame);
            let values: Vec<f64> = (0..worlds * dofs)
                .map(|k| {
                    row.get(k % dofs)
                        .map_or(0.0, |x| x + 0.1 * noise(k / dofs, k % dofs))
                })
                .collect();
            run.sim
                .command(field, 0..dofs, Values::F64(&values))
                .unwrap();
            run.step();
            shown(run)
        })
        .collect()
}

/// Bits of all fields of each world.
fn shown(run: &Run) -> Vec<u64> {
    let worlds = 0..run.sim.worlds();
    let numbers =
        worlds.flat_map(|world| FIELDS.iter().flat_map(move |&field| run.get(field, world)));
    numbers.map(f64::to_bits).collect()
}

fn options(precision: Precision, lanes: Lanes, threads: usize) -> Options {
    common::options(&FIELDS, WORLDS, precision, lanes, threads)
}

#[test]
fn delay_noise_and_sensors_have_the_same_bits_in_every_width_and_on_two_threads() {
    let model = scene().compile().unwrap();
    let mut first = None;
    for lanes in [Lanes::Scalar, Lanes::Eight, Lanes::Sixteen] {
        if !cpu::available(lanes) {
            continue;
        }
        for threads in [1, 2] {
            let mut run = Run::new(&model, options(Precision::F32, lanes, threads));
            vary(&mut run);
            let frames = play(&mut run, 0..FRAMES);
            let expected = first.get_or_insert_with(|| frames.clone());
            assert!(frames == *expected, "{lanes:?}, {threads} threads");
        }
    }
}

#[test]
fn what_is_on_its_way_goes_with_a_snapshot_into_any_width() {
    let model = scene().compile().unwrap();
    let mut run = Run::new(&model, options(Precision::F32, Lanes::Scalar, 1));
    vary(&mut run);
    play(&mut run, 0..FRAMES);
    let snapshot = run.sim.snapshot();
    let expected = play(&mut run, FRAMES..2 * FRAMES);
    for lanes in [Lanes::Eight, Lanes::Sixteen] {
        if cpu::available(lanes) {
            let mut other = Run::new(&model, options(Precision::F32, lanes, 2));
            other.sim.restore(&snapshot, None, None).unwrap();
            assert!(
                play(&mut other, FRAMES..2 * FRAMES) == expected,
                "{lanes:?}"
            );
        }
    }
}

#[test]
fn evaluating_shows_the_same_again_and_changes_nothing() {
    let model = scene().compile().unwrap();
    for precision in [Precision::F32, Precision::F64] {
        let mut run = Run::new(&model, options(precision, Lanes::Auto, 1));
        vary(&mut run);
        let frames = play(&mut run, 0..FRAMES);
        let snapshot = run.sim.snapshot();
        run.forward();
        assert!(shown(&run) == *frames.last().unwrap());
        assert!(run.sim.snapshot() == snapshot);
    }
}

#[test]
fn single_precision_shows_what_double_does_to_its_rounding() {
    let model = scene().compile().unwrap();
    let shown = [Precision::F64, Precision::F32].map(|precision| {
        let mut run = Run::new(&model, options(precision, Lanes::Auto, 1));
        vary(&mut run);
        run.forward();
        let fields = FIELDS
            .iter()
            .filter(|field| **field != Field::ContactSensor);
        fields
            .flat_map(|&field| run.get(field, 1))
            .collect::<Vec<f64>>()
    });
    for (double, single) in shown[0].iter().zip(&shown[1]) {
        assert!(
            (double - single).abs() < 1e-4 * double.abs().max(1.0),
            "{double} {single}"
        );
    }
}

#[test]
fn the_inverse_of_a_free_body_at_its_centre_is_diagonal() {
    // J = 1, so that J⁺ = 1 / (1 + λ²), turned into the axes of what a site is measured from
    let mut scene = Description::new(0.01, 1);
    for (name, is_measured_from) in [("cube", true), ("other", false)] {
        let mut body = Body::new(name, Pose::at([3.0, -1.0, 2.0]));
        body.mass = Some(2.0);
        scene.add_body(body).unwrap();
        scene.sites.push(Site {
            name: format!("of {name}"),
            body: Some(name.to_owned()),
            pose: Pose::identity(),
            relative_to: is_measured_from.then(|| "lamp".to_owned()),
            damping: 0.3,
        });
    }
    // at the same place, and turned
    scene.sites.push(Site {
        name: "lamp".to_owned(),
        body: None,
        pose: Pose::from_rpy([5.0, 5.0, 5.0], [0.0, 0.0, std::f64::consts::FRAC_PI_2]),
        relative_to: None,
        damping: 0.3,
    });
    let model = scene.compile().unwrap();
    let expected = 1.0 / (1.0 + 0.3 * 0.3);
    for (precision, roundings) in [
        (Precision::F64, 8.0 * f64::EPSILON),
        (Precision::F32, 8.0 * f64::from(f32::EPSILON)),
    ] {
        let mut run = Run::new(&model, options(precision, Lanes::Auto, 1));
        run.forward();
        let inverse = run.get(Field::SiteInverseJacobian, 20);
        assert_eq!(inverse.len(), 3 * 12 * 6);
        for (k, value) in inverse.iter().enumerate() {
            let (site, dof, column) = (k / 72, k / 6 % 12, k % 6);
            // in the axes of the lamp x of the world is -y, and y is x
            let entry = match (site, dof / 6) {
                (0, 0) => match (dof % 3, column % 3, dof % 6 / 3 == column / 3) {
                    (0, 1, true) => -expected,
                    (1, 0, true) | (2, 2, true) => expected,
                    _ => 0.0,
                },
                (1, 1) if dof % 6 == column => expected,
                _ => 0.0,
            };
            assert!(
                (value - entry).abs() <= roundings,
                "{site} {dof} {column}: {value}"
            );
        }
    }
    let hash = model.hash();
    scene.sites[1].damping = 0.4;
    assert_ne!(scene.compile().unwrap().hash(), hash, "damping is hashed");
}

#[test]
fn a_scene_in_which_nothing_moves_takes_delays_and_noise_too() {
    let mut scene = Description::new(0.01, 8);
    scene.add_ground("ground", 0.0);
    scene.params.extend(VARIED);
    scene.sites.push(Site {
        name: "camera".to_owned(),
        body: None,
        pose: Pose::at([1.0, 2.0, 3.0]),
        relative_to: None,
        damping: Site::DAMPING,
    });
    let model = scene.compile().unwrap();
    for precision in [Precision::F32, Precision::F64] {
        let mut run = Run::new(&model, options(precision, Lanes::Auto, 1));
        vary(&mut run);
        run.step();
        assert_eq!(
            run.get(Field::SiteQ, 0),
            [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]
        );
        assert_eq!(run.get(Field::Accelerometer, 0)[2].round(), 10.0);
    }
}

#[test]
fn names_that_nothing_has_are_refused() {
    let refusal = |change: fn(&mut Description)| {
        let mut scene = scene();
        change(&mut scene);
        scene.compile().unwrap_err().to_string()
    };
    for (message, parts) in [
        (
            refusal(|s| s.sites[0].body = Some("cup".to_owned())),
            ["site `camera`", "`cup`", "`arm/base`"],
        ),
        (
            refusal(|s| s.sites[1].relative_to = Some("cup".to_owned())),
            ["site `tip`", "`cup`", "`arm/base`"],
        ),
        (
            refusal(|s| s.sites[1].name = "camera".to_owned()),
            ["site", "`camera`", "two"],
        ),
        (
            refusal(|s| s.contact_sensors[0].of = "cup".to_owned()),
            ["contact sensor `load`", "`cup`", "`table`"],
        ),
        (
            refusal(|s| s.sites[0].pose.pos[1] = f64::NAN),
            ["site `camera`", "position", "NaN"],
        ),
        (
            refusal(|s| s.sites[1].damping = 0.0),
            ["site `tip`", "damping is 0", "between 1e-6 and 1e6"],
        ),
        (
            refusal(|s| s.sites[1].damping = -0.1),
            ["site `tip`", "damping is -0.1", "between 1e-6 and 1e6"],
        ),
        (
            refusal(|s| s.sites[1].damping = 2e6),
            ["site `tip`", "damping", "between 1e-6 and 1e6"],
        ),
        (
            refusal(|s| s.sites[1].damping = f64::INFINITY),
            ["site `tip`", "damping", "inf"],
        ),
        (
            refusal(|s| s.command_delay_max = Some(8001)),
            ["command_delay_max", "8001", "1000 control frames"],
        ),
    ] {
        for part in parts {
            assert!(message.contains(part), "{message}");
        }
    }
}
