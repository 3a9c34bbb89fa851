//! Parameters that differ from world to world: what each does, that worlds keep to themselves, and what is refused.

mod common;

use common::{Demo, Run, START, command, lesson_with_table};
use sim_engine::backend::{BackendError, Values, cpu};
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_model::{Body, Collision, Description, Model, Pose, Shape, TargetMode};
use sim_physics::arrays::Field;
use sim_physics::constants::params::{NO_LIMIT, Param};
use std::sync::Arc;

const FIELDS: [Field; 5] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQdd,
    Field::MassMatrix,
    Field::ContactForce,
];

/// The arm over a table with a cube on it, whose parameters vary.
fn arm(params: impl IntoIterator<Item = Param>) -> Description {
    let mut scene = lesson_with_table(Demo::Target, true);
    scene.params.extend(params);
    scene
}

fn options(worlds: usize, precision: Precision, lanes: Lanes, threads: usize) -> Options {
    common::options(&FIELDS, worlds, precision, lanes, threads)
}

/// Bits of all fields of a world.
fn bits(run: &Run, world: usize) -> Vec<u64> {
    let fields = FIELDS.iter().flat_map(|&field| run.get(field, world));
    fields.map(f64::to_bits).collect()
}

/// Some frames of the demo, the same in every world.
fn play(run: &mut Run, frames: std::ops::Range<usize>) {
    for frame in frames {
        let (field, row) = command(Demo::Target, frame);
        let mut all = row.to_vec();
        all.resize(run.sim.model().dofs(), 0.0);
        run.command(field, &all);
        run.step();
    }
}

/// The same row of a parameter in every world.
fn set(run: &mut Run, param: Param, row: &[f64]) {
    let all: Vec<f64> = (0..run.sim.worlds()).flat_map(|_| row.to_vec()).collect();
    let columns = 0..row.len();
    run.sim
        .write_param(param, columns, Values::F64(&all), None)
        .unwrap();
}

fn starts(model: &Model, param: Param) -> Vec<f64> {
    let range = model.constants().varying.range(param).unwrap();
    let all = model.constants().varying.starts();
    all[range].iter().map(|&(_, x)| x).collect()
}

/// A scene with numbers that no joint or shape has by itself, in the parameters that nothing else derives from.
fn changed(scene: &mut Description) {
    scene.gravity = [0.3, -0.2, -8.0];
    for joint in &mut scene.robots[0].joints {
        for dof in joint.dofs.iter_mut().filter(|dof| dof.target_ke > 0.0) {
            dof.damping = 0.4;
            (dof.target_ke, dof.target_kd) = (0.8 * dof.target_ke, 1.3 * dof.target_kd);
            dof.effort_limit = Some(40.0);
        }
    }
    for shape in &mut scene.shapes {
        shape.surface.mu = 0.35;
    }
    for link in scene.robots.iter_mut().flat_map(|robot| &mut robot.links) {
        for collision in &mut link.collisions {
            collision.surface.mu = 0.25;
        }
    }
}

#[test]
fn written_parameters_equal_constants_bit_for_bit() {
    let params = [
        Param::Gravity,
        Param::JointDamping,
        Param::JointTargetKe,
        Param::JointTargetKd,
        Param::JointEffortLimit,
        Param::ShapeMu,
    ];
    let mut constant = arm([]);
    changed(&mut constant);
    let constant = constant.compile().unwrap();
    // what they are to become, from a model of those numbers
    let mut source = arm(params);
    changed(&mut source);
    let source = source.compile().unwrap();
    let model = arm(params).compile().unwrap();
    for precision in [Precision::F64, Precision::F32] {
        let mut fixed = Run::new(&constant, options(1, precision, Lanes::Scalar, 1));
        let mut run = Run::new(&model, options(1, precision, Lanes::Scalar, 1));
        for param in params {
            set(&mut run, param, &starts(&source, param));
        }
        play(&mut fixed, 0..40);
        play(&mut run, 0..40);
        assert_eq!(bits(&fixed, 0), bits(&run, 0), "{precision:?}");
    }
}

#[test]
fn parameters_at_their_start_change_nothing() {
    let constant = arm([]).compile().unwrap();
    let all = Param::ALL.into_iter();
    // of a body of several links, masses that vary are added up in another order, and so are inverse weights of two bodies;
    // friction that may be is a row to solve
    let others = [
        Param::BodyMassScale,
        Param::BodyMass,
        Param::BodyInertia,
        Param::BodyCom,
        Param::BodyInvweight0,
        Param::JointFriction,
        // computed in the precision of the run
        Param::ShapeSolref,
        Param::ShapeSolimp,
    ];
    let exact: Vec<Param> = all.filter(|p| !others.contains(p)).collect();
    let model = arm(exact).compile().unwrap();
    assert_ne!(constant.hash(), model.hash(), "what varies is part of it");
    for precision in [Precision::F64, Precision::F32] {
        let runs = [&constant, &model].map(|model| {
            let mut run = Run::new(model, options(1, precision, Lanes::Scalar, 1));
            play(&mut run, 0..40);
            bits(&run, 0)
        });
        assert_eq!(runs[0], runs[1], "{precision:?}");
    }
    let near = arm(others).compile().unwrap();
    let [fixed, run] = [&constant, &near].map(|model| {
        let mut run = Run::reference(model, &FIELDS);
        play(&mut run, 0..40);
        run
    });
    for field in FIELDS {
        let off = common::distance(&fixed.get(field, 0), &run.get(field, 0));
        assert!(off < 1e-9, "{field:?} {off}");
    }
}

#[test]
fn masses_and_armatures_act_as_those_of_a_scene() {
    // without limits, friction and contacts nothing derives from masses
    let scene = |scale: f64, armature: f64| {
        let mut scene = common::lesson(Demo::Torque);
        for joint in &mut scene.robots[0].joints {
            (joint.range, joint.mimic) = (None, None);
            for dof in &mut joint.dofs {
                (dof.friction, dof.armature) = (0.0, dof.armature + armature);
            }
        }
        for (k, link) in scene.robots[0].links.iter_mut().enumerate() {
            if let Some(inertial) = &mut link.inertial {
                let scale = 1.0 + scale * (k % 3) as f64;
                inertial.mass *= scale;
                inertial.inertia = inertial.inertia.map(|row| row.map(|x| x * scale));
            }
        }
        scene
    };
    let heavy = scene(0.2, 0.05).compile().unwrap();
    let mut varying = scene(0.0, 0.0);
    varying
        .params
        .extend([Param::BodyMassScale, Param::JointArmature]);
    let model = varying.compile().unwrap();
    let mut fixed = Run::reference(&heavy, &FIELDS);
    let mut run = Run::reference(&model, &FIELDS);
    let order = varying.robots[0].link_order();
    let scales: Vec<f64> = order.iter().map(|k| 1.0 + 0.2 * (k % 3) as f64).collect();
    set(&mut run, Param::BodyMassScale, &scales);
    let armatures: Vec<f64> = starts(&model, Param::JointArmature)
        .iter()
        .map(|x| x + 0.05)
        .collect();
    set(&mut run, Param::JointArmature, &armatures);
    for run in [&mut fixed, &mut run] {
        run.write(Field::JointQ, &START);
        for frame in 0..30 {
            let (field, row) = command(Demo::Torque, frame);
            run.command(field, &row);
            run.step();
        }
    }
    for field in [
        Field::JointQ,
        Field::JointQd,
        Field::JointQdd,
        Field::MassMatrix,
    ] {
        let (a, b) = (fixed.get(field, 0), run.get(field, 0));
        let size = a.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
        let off = common::distance(&a, &b) / size;
        assert!(off < 1e-10, "{field:?} {off}");
    }
}

/// Numbers of each world for every parameter: near what they start from, another in every world.
fn numbers_near_starts(model: &Model, param: Param, seeds: &[usize]) -> Vec<f64> {
    let starts = starts(model, param);
    let mut numbers = Vec::new();
    for &seed in seeds {
        for (k, start) in starts.iter().enumerate() {
            let share = ((seed * 31 + k * 7 + param as usize * 5) % 37) as f64 / 37.0;
            numbers.push(match param {
                Param::BodyF => 4.0 * (share - 0.5),
                Param::CommandDelay => (30.0 * share).floor(),
                Param::JointFriction => share,
                Param::JointFNoise | Param::JointTargetQNoise | Param::JointTargetQdNoise => 0.0,
                Param::JointEffortLimit if *start == NO_LIMIT => 60.0 + 20.0 * share,
                Param::JointRef => 0.1 * share,
                // in its bounds
                Param::ShapeSolimp => start * (0.9 + 0.1 * share),
                _ => start * (0.8 + 0.5 * share),
            });
        }
    }
    numbers
}

/// Bits of every world after some frames, each with the parameters of its seed from frame 5 on.
fn run_own(
    model: &Arc<Model>,
    seeds: &[usize],
    precision: Precision,
    lanes: Lanes,
    threads: usize,
) -> Vec<Vec<u64>> {
    let mut run = Run::new(model, options(seeds.len(), precision, lanes, threads));
    play(&mut run, 0..5);
    for param in Param::ALL {
        let columns = 0..param.columns(&model.sizes());
        let numbers = numbers_near_starts(model, param, seeds);
        run.sim
            .write_param(param, columns, Values::F64(&numbers), None)
            .unwrap();
    }
    play(&mut run, 5..25);
    (0..seeds.len()).map(|world| bits(&run, world)).collect()
}

#[test]
fn worlds_with_independent_parameters_equal_runs_of_one_world() {
    let model = arm(Param::ALL).compile().unwrap();
    let seeds: Vec<usize> = (0..35).collect();
    for precision in [Precision::F32, Precision::F64] {
        let together = run_own(&model, &seeds, precision, Lanes::Auto, 1);
        for (lanes, threads) in [(Lanes::Eight, 2), (Lanes::Scalar, 1), (Lanes::Sixteen, 2)] {
            if cpu::available(lanes) {
                assert_eq!(
                    together,
                    run_own(&model, &seeds, precision, lanes, threads),
                    "{precision:?} {lanes:?}"
                );
            }
        }
        for seed in [0, 17, 34] {
            let alone = run_own(&model, &[seed], precision, Lanes::Auto, 1);
            assert_eq!(together[seed], alone[0], "{precision:?} world {seed}");
        }
        assert!(together.iter().skip(1).all(|world| *world != together[0]));
    }
}

#[test]
fn a_masked_write_leaves_the_other_worlds_as_they_were() {
    let model = arm(Param::ALL).compile().unwrap();
    let options = options(20, Precision::F32, Lanes::Auto, 1);
    let (mut untouched, mut run) = (Run::new(&model, options.clone()), Run::new(&model, options));
    let mask: Vec<bool> = (0..20).map(|world| world % 3 == 1).collect();
    play(&mut untouched, 0..6);
    play(&mut run, 0..3);
    for param in Param::ALL {
        let columns = param.columns(&model.sizes());
        if columns == 0 {
            continue;
        }
        let mut numbers = numbers_near_starts(&model, param, &(0..20).collect::<Vec<_>>());
        // rows outside the mask are ignored
        for world in (0..20).filter(|&world| !mask[world]) {
            numbers[world * columns] = f64::NAN;
        }
        let before = run.sim.param(param).unwrap();
        run.sim
            .write_param(param, 0..columns, Values::F64(&numbers), Some(&mask))
            .unwrap();
        let after = run.sim.param(param).unwrap();
        for (world, &is_asked) in mask.iter().enumerate() {
            let row = world * columns..(world + 1) * columns;
            let expected = if is_asked { &numbers } else { &before };
            let expected = expected[row.clone()].iter().map(|&x| f64::from(x as f32));
            assert!(after[row].iter().copied().eq(expected), "{param:?}");
        }
    }
    play(&mut run, 3..6);
    for (world, is_asked) in mask.into_iter().enumerate() {
        assert_eq!(bits(&run, world) == bits(&untouched, world), !is_asked);
    }
}

#[test]
fn a_reset_keeps_parameters_and_takes_loads_away() {
    let model = arm(Param::ALL).compile().unwrap();
    let mut run = Run::new(&model, options(3, Precision::F64, Lanes::Auto, 1));
    for param in Param::ALL {
        let columns = 0..param.columns(&model.sizes());
        let numbers = numbers_near_starts(&model, param, &[4, 5, 6]);
        run.sim
            .write_param(param, columns, Values::F64(&numbers), None)
            .unwrap();
    }
    let mask = [true, false, true];
    run.sim.reset(Some(&mask), None).unwrap();
    for param in Param::ALL {
        let columns = param.columns(&model.sizes());
        let mut expected = numbers_near_starts(&model, param, &[4, 5, 6]);
        if param.is_load() {
            expected[..columns].fill(0.0);
            expected[2 * columns..].fill(0.0);
        }
        assert_eq!(run.sim.param(param).unwrap(), expected, "{param:?}");
    }
}

#[test]
fn a_force_on_a_link_is_that_of_its_jacobian() {
    let mut scene = arm([Param::BodyF]);
    scene.shapes.clear();
    let model = scene.compile().unwrap();
    let fields = [Field::SmoothForce, Field::BodyJacobian, Field::JointQdd];
    let mut run = Run::reference(&model, &fields);
    run.forward();
    let before = run.get(Field::SmoothForce, 0);
    let (links, dofs) = (model.bodies(), model.dofs());
    let wrenches: Vec<f64> = (0..6 * links)
        .map(|k| ((k * 7) % 11) as f64 - 5.0)
        .collect();
    set(&mut run, Param::BodyF, &wrenches);
    run.forward();
    let jacobian = run.get(Field::BodyJacobian, 0);
    let after = run.get(Field::SmoothForce, 0);
    for dof in 0..dofs {
        let expected: f64 = (0..6 * links)
            .map(|k| wrenches[k] * jacobian[k * dofs + dof])
            .sum();
        let got = after[dof] - before[dof];
        assert!((got - expected).abs() < 1e-10, "{dof}: {got} {expected}");
    }
}

#[test]
fn a_push_on_a_free_body_is_newtons_law() {
    let mut scene = Description::new(1e-3, 1);
    scene.gravity = [0.0; 3];
    let half_extents = [0.1, 0.2, 0.3];
    let shape = Collision::new(None, Shape::Box { half_extents }, Pose::identity());
    let mut body = Body::new("box", Pose::identity());
    body.shapes.push((shape, 500.0));
    scene.add_body(body).unwrap();
    scene.params.extend([Param::BodyF, Param::BodyMassScale]);
    let model = scene.compile().unwrap();
    let mut run = Run::reference(&model, &[Field::JointQdd]);
    set(&mut run, Param::BodyMassScale, &[2.0]);
    set(&mut run, Param::BodyF, &[3.0, -6.0, 9.0, 1.0, 2.0, -3.0]);
    run.forward();
    let mass = 2.0 * 500.0 * 8.0 * 0.1 * 0.2 * 0.3;
    let moment = |a: f64, b: f64| mass / 3.0 * (a * a + b * b);
    let expected = [
        3.0 / mass,
        -6.0 / mass,
        9.0 / mass,
        1.0 / moment(0.2, 0.3),
        2.0 / moment(0.1, 0.3),
        -3.0 / moment(0.1, 0.2),
    ];
    let off = common::distance(&run.get(Field::JointQdd, 0), &expected);
    assert!(off < 1e-12, "{off}");
}

#[test]
fn wrong_parameters_are_refused_by_name_and_change_nothing() {
    let model = arm([Param::JointTargetKe, Param::BodyMassScale])
        .compile()
        .unwrap();
    let mut run = Run::new(&model, options(2, Precision::F32, Lanes::Auto, 1));
    let dofs = model.dofs();
    let mut write = |param, columns: std::ops::Range<usize>, values: &[f64]| {
        run.sim
            .write_param(param, columns, Values::F64(values), None)
    };
    let error = write(Param::JointArmature, 0..dofs, &vec![1.0; 2 * dofs]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "`joint_armature` is the same constant in all worlds of this run; to write it, name it at launch: \
         params=(\"joint_armature\",) (of this run vary: body_mass_scale, joint_target_ke)"
    );
    let mut gains = vec![1.0; 2 * dofs];
    gains[dofs + 2] = -1.0;
    let error = write(Param::JointTargetKe, 0..dofs, &gains).unwrap_err();
    assert!(
        matches!(error, BackendError::BelowLeast { world: 1, .. }),
        "{error}"
    );
    gains[dofs + 2] = f64::INFINITY;
    let error = write(Param::JointTargetKe, 0..dofs, &gains).unwrap_err();
    assert!(
        matches!(error, BackendError::NotFinite { world: 1, .. }),
        "{error}"
    );
    let error = write(Param::JointTargetKe, 0..dofs + 1, &gains).unwrap_err();
    assert!(matches!(error, BackendError::Columns { .. }), "{error}");
    let error = write(Param::JointTargetKe, 0..dofs, &gains[1..]).unwrap_err();
    assert!(matches!(error, BackendError::Length { .. }), "{error}");
    let links = model.bodies();
    for mass in [0.0, -1.0] {
        let error = write(Param::BodyMassScale, 0..links, &vec![mass; 2 * links]).unwrap_err();
        assert!(
            matches!(error, BackendError::BelowLeast { world: 0, .. }),
            "{error}"
        );
    }
    let kept = [
        starts(&model, Param::JointTargetKe),
        starts(&model, Param::JointTargetKe),
    ]
    .concat();
    let kept: Vec<f64> = kept.iter().map(|&x| f64::from(x as f32)).collect();
    assert_eq!(run.sim.param(Param::JointTargetKe).unwrap(), kept);
}

#[test]
fn gains_do_not_reach_what_has_no_drive() {
    let gains = [
        Param::JointTargetKe,
        Param::JointTargetKd,
        Param::JointEffortLimit,
    ];
    let model = arm(gains).compile().unwrap();
    let free = model.dofs() - 6..model.dofs();
    let [plain, driven] = [0.0, 700.0].map(|number| {
        let mut run = Run::reference(&model, &[Field::JointQ]);
        for param in gains {
            let mut row = starts(&model, param);
            row[free.clone()].fill(number);
            set(&mut run, param, &row);
        }
        let mut start = model.start().joint_q.clone();
        start[11] += 2.0;
        run.write(Field::JointQ, &start);
        play(&mut run, 0..20);
        run.get(Field::JointQ, 0)
    });
    assert_eq!(plain, driven);
    // it falls, and meets nothing
    assert!((plain[11] - 2.125 + 0.5 * 9.81 / 9.0).abs() < 0.01);
}

#[test]
fn a_drive_that_follows_velocities_has_no_position_gain() {
    let mut scene = arm([Param::JointTargetKe]);
    for joint in &mut scene.robots[0].joints {
        for dof in &mut joint.dofs {
            dof.target_mode = TargetMode::Velocity;
        }
    }
    let model = scene.compile().unwrap();
    let mut run = Run::new(&model, options(1, Precision::F32, Lanes::Auto, 1));
    let gains = vec![5.0; model.dofs()];
    let error = run
        .sim
        .write_param(
            Param::JointTargetKe,
            0..gains.len(),
            Values::F64(&gains),
            None,
        )
        .unwrap_err();
    assert!(
        matches!(error, BackendError::VelocityMode { .. }),
        "{error}"
    );
}
