//! Solutions on robots from files: beside the kinematics of a step, within limits, and the same bits however they are computed.

use sim_ik::{IkError, Options, Precision, Problems, Reach, Solution, Solver, Task, Width, frame};
use sim_model::{Description, Model, UrdfOptions};
use sim_physics::arrays::Block;
use sim_physics::constants::Motion;
use sim_physics::lane::memory::Cpu;
use sim_physics::math::quat;
use sim_physics::step::Stage;
use sim_physics::step::outputs::poses::Poses;
use sim_physics::step::tree::kinematics::Kinematics;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// 1 mm and 0.1°.
const TOLERANCE: [f64; 2] = [1e-3, 0.1 * std::f64::consts::PI / 180.0];

const OPTIONS: Options = Options {
    iterations: 50,
    restarts: 30,
    tolerance: TOLERANCE,
    seed: 0,
};

fn robot(path: &str, floating: bool) -> Arc<Model> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path);
    let options = UrdfOptions {
        name: Some("robot".to_owned()),
        floating,
        ..UrdfOptions::default()
    };
    let mut scene = Description::new(0.002, 1);
    scene.add_urdf(path, options).unwrap();
    scene.compile().unwrap()
}

fn fr3() -> Arc<Model> {
    robot("examples/assets/fr3/fr3_franka_hand.urdf", false)
}

fn every_joint() -> Arc<Model> {
    robot(
        "sim-core/stages/recorded/tests/record_stages/every_joint.urdf",
        true,
    )
}

fn task(model: &Model, frames: &[&str]) -> Task {
    let reaches = frames.iter().map(|name| Reach {
        name: (*name).to_owned(),
        frame: frame(model, name).unwrap(),
        relative_to: None,
        position_weight: [1.0; 3],
        orientation_weight: [1.0; 3],
    });
    Task {
        reaches: reaches.collect(),
        moves: vec![true; model.dofs()],
        limits: true,
        posture_weight: vec![0.0; model.dofs()],
    }
}

/// Uniform numbers in [0, 1), by a linear congruential generator (Knuth's MMIX).
fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A random state within limits; mimic joints follow.
fn state(model: &Model, unit: &mut impl FnMut() -> f64) -> Vec<f64> {
    let m = model.constants();
    let mut q: Vec<f64> = (0..model.coords()).map(|_| unit() * 2.0 - 1.0).collect();
    for limit in &m.limits {
        q[m.dofs[limit.dof].coord] = limit.lower + (limit.upper - limit.lower) * unit();
    }
    for c in m.quaternions() {
        let norm = q[c..c + 4].iter().map(|x| x * x).sum::<f64>().sqrt();
        q[c..c + 4].iter_mut().for_each(|x| *x /= norm);
    }
    for e in &m.equalities {
        let leader = q[m.dofs[e.leader].coord];
        q[m.dofs[e.follower].coord] = e.offset + e.multiplier * leader;
    }
    q
}

/// Link frames by the stages of a step.
fn poses(model: &Model, q: &[f64]) -> Vec<[f64; 7]> {
    let m = model.constants();
    let mut block = Block::new(m, 0.0);
    block.joint_q.copy_from_slice(q);
    let cx = &mut Cpu::new(&mut [], &m.contacts.tables);
    Kinematics::run(cx, m, &mut block);
    Poses::run(cx, m, &mut block);
    block.work.body_q
}

/// Reachable targets of some links: positions and quaternions of each, from random states.
fn targets(model: &Model, links: &[&str], count: usize) -> [Vec<Vec<f64>>; 2] {
    let mut unit = uniform(7);
    let mut targets = [vec![Vec::new(); links.len()], vec![Vec::new(); links.len()]];
    for _ in 0..count {
        let poses = poses(model, &state(model, &mut unit));
        for (k, link) in links.iter().enumerate() {
            let at = model.body_names().iter().position(|name| name == link);
            let pose = poses[at.unwrap()];
            targets[0][k].extend_from_slice(&pose[..3]);
            targets[1][k].extend_from_slice(&pose[3..]);
        }
    }
    targets
}

/// Distance and angle between a link and its target.
fn errors(pose: &[f64; 7], position: &[f64], orientation: &[f64]) -> [f64; 2] {
    let distance: f64 = (0..3).map(|i| (pose[i] - position[i]).powi(2)).sum();
    let quat_of = |x: &[f64]| [x[0], x[1], x[2], x[3]];
    let apart = quat::mul(quat::conjugate(quat_of(orientation)), quat_of(&pose[3..]));
    let turn = quat::log(apart);
    [distance.sqrt(), turn.dot(turn).sqrt()]
}

struct Solved {
    joint_q: Vec<f64>,
    solutions: Vec<Solution>,
    targets: [Vec<Vec<f64>>; 2],
}

fn solved(model: &Arc<Model>, links: &[&str], count: usize, precision: Precision) -> Solved {
    let targets = targets(model, links, count);
    let solver = Solver::new(Arc::clone(model), &task(model, links)).unwrap();
    let problems = Problems {
        count,
        starts: &model.start().joint_q,
        postures: &[],
        positions: targets[0].iter().map(Vec::as_slice).collect(),
        orientations: targets[1].iter().map(Vec::as_slice).collect(),
    };
    let (joint_q, solutions) = solver
        .solve(&problems, OPTIONS, precision, Width::Auto, 1)
        .unwrap();
    Solved {
        joint_q,
        solutions,
        targets,
    }
}

/// Checks every solution by the stages of a step; returns how many are solved.
fn check(model: &Model, links: &[&str], solved: &Solved) -> usize {
    let coords = model.coords();
    let mut count = 0;
    for (k, solution) in solved.solutions.iter().enumerate() {
        let q = &solved.joint_q[k * coords..(k + 1) * coords];
        let poses = poses(model, q);
        let mut worst = [0.0f64; 2];
        for (r, link) in links.iter().enumerate() {
            let at = model.body_names().iter().position(|name| name == link);
            let pose = &poses[at.unwrap()];
            let position = &solved.targets[0][r][3 * k..3 * k + 3];
            let orientation = &solved.targets[1][r][4 * k..4 * k + 4];
            let pose_errors = errors(pose, position, orientation);
            worst = [worst[0].max(pose_errors[0]), worst[1].max(pose_errors[1])];
        }
        // both are double precision; angles by quaternions and by matrices
        assert!((worst[0] - solution.position_error).abs() < 1e-12);
        assert!((worst[1] - solution.rotation_error).abs() < 1e-7);
        if solution.is_solved {
            assert!(worst[0] <= TOLERANCE[0] && worst[1] <= TOLERANCE[1] + 1e-7);
            count += 1;
        }
        for limit in &model.constants().limits {
            let q = q[model.constants().dofs[limit.dof].coord];
            // a follower's bound is that of its leader times a multiplier
            let rounding = 1e-15 * (1.0 + limit.lower.abs().max(limit.upper.abs()));
            assert!(
                limit.lower - rounding <= q && q <= limit.upper + rounding,
                "{q}: {limit:?}"
            );
        }
    }
    count
}

#[test]
fn ten_thousand_poses_of_the_fr3_are_reached() {
    let model = fr3();
    let link = ["robot/fr3_hand_tcp"];
    let solved = solved(&model, &link, 10_000, Precision::F32);
    assert!(check(&model, &link, &solved) >= 9_950);
}

#[test]
fn double_precision_reaches_them_too() {
    let model = fr3();
    let link = ["robot/fr3_hand_tcp"];
    let solved = solved(&model, &link, 500, Precision::F64);
    assert!(check(&model, &link, &solved) >= 498);
}

#[test]
fn every_kind_of_joint_is_moved() {
    let model = every_joint();
    let m = model.constants();
    for motion in [
        Motion::Revolute,
        Motion::Prismatic,
        Motion::Ball,
        Motion::Free,
    ] {
        assert!(m.bodies.iter().any(|body| body.motion == motion));
    }
    let links = ["robot/camera", "robot/finger", "robot/thumb"];
    for precision in [Precision::F32, Precision::F64] {
        let solved = solved(&model, &links, 300, precision);
        assert!(check(&model, &links, &solved) >= 297);
    }
}

#[test]
fn a_result_depends_on_no_width_thread_or_number() {
    let model = fr3();
    let link = ["robot/fr3_hand_tcp"];
    let count = 203;
    let [positions, orientations] = targets(&model, &link, count);
    let solver = Solver::new(Arc::clone(&model), &task(&model, &link)).unwrap();
    let run = |count: usize, width: Width, threads: usize| {
        let problems = Problems {
            count,
            starts: &model.start().joint_q,
            postures: &[],
            positions: vec![&positions[0][..3 * count]],
            orientations: vec![&orientations[0][..4 * count]],
        };
        let all = solver.solve(&problems, OPTIONS, Precision::F32, width, threads);
        all.unwrap()
    };
    let bits = |q: &[f64]| q.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
    let (all, solutions) = run(count, Width::Auto, 1);
    assert!(solutions.iter().any(|solution| solution.restarts > 0));
    for (few, width, threads) in [
        (1, Width::Auto, 1),
        (7, Width::Eight, 2),
        (40, Width::Scalar, 1),
        (count, Width::Eight, 3),
        (count, Width::Auto, 16),
    ] {
        let (some, other) = run(few, width, threads);
        assert_eq!(bits(&some), bits(&all[..few * model.coords()]));
        for (a, b) in other.iter().zip(&solutions) {
            assert_eq!((a.iterations, a.restarts), (b.iterations, b.restarts));
        }
    }
}

#[test]
fn more_work_than_a_problem_may_have_is_refused_with_the_bound() {
    let model = fr3();
    let solver = Solver::new(Arc::clone(&model), &task(&model, &["robot/fr3_hand_tcp"])).unwrap();
    let start = model.start().joint_q.clone();
    let (place, turn) = ([[9.0; 3].as_slice()], [[0.0, 0.0, 0.0, 1.0].as_slice()]);
    let problems = out_of_reach(&start, &place, &turn, 1);
    for (iterations, restarts) in [
        (50, 1_000_000),
        (usize::MAX, 0),
        (1, usize::MAX),
        (1001, 999),
    ] {
        let options = Options {
            iterations,
            restarts,
            ..OPTIONS
        };
        let error = solver.solve(&problems, options, Precision::F32, Width::Auto, 1);
        let error = error.unwrap_err().to_string();
        assert!(error.contains("`iterations` and `restarts`"), "{error}");
        assert!(error.contains("at most 1000000"), "{error}");
    }
}

#[test]
fn more_threads_than_a_system_gives_are_refused() {
    let model = fr3();
    let solver = Solver::new(Arc::clone(&model), &task(&model, &["robot/fr3_hand_tcp"])).unwrap();
    let start = model.start().joint_q.clone();
    let (place, turn) = ([[9.0; 3].as_slice()], [[0.0, 0.0, 0.0, 1.0].as_slice()]);
    let problems = out_of_reach(&start, &place, &turn, 100_000);
    let solved = solver.solve(&problems, OPTIONS, Precision::F32, Width::Auto, 100_000);
    let error = solved.unwrap_err().to_string();
    assert!(
        error.contains("100000 threads are asked for; give 1 to 1024"),
        "{error}"
    );
}

#[test]
fn work_that_is_stopped_ends_soon_in_every_thread_and_precision() {
    let model = fr3();
    let solver = Solver::new(Arc::clone(&model), &task(&model, &["robot/fr3_hand_tcp"])).unwrap();
    let start = model.start().joint_q.clone();
    let (place, turn) = ([[9.0; 3].as_slice()], [[0.0, 0.0, 0.0, 1.0].as_slice()]);
    // alone it would take minutes
    let problems = out_of_reach(&start, &place, &turn, 100_000);
    let options = Options {
        iterations: 1000,
        restarts: 900,
        ..OPTIONS
    };
    for (precision, threads) in [
        (Precision::F32, 1),
        (Precision::F64, 1),
        (Precision::F32, 3),
    ] {
        let began = Instant::now();
        let stop = || began.elapsed() > Duration::from_millis(100);
        let solved = solver.solve_until(&stop, &problems, options, precision, Width::Auto, threads);
        assert!(matches!(solved, Err(IkError::Stopped)));
        assert!(began.elapsed() < Duration::from_secs(5));
    }
}

/// The same target for all problems.
fn out_of_reach<'a>(
    start: &'a [f64],
    position: &[&'a [f64]],
    orientation: &[&'a [f64]],
    count: usize,
) -> Problems<'a> {
    Problems {
        count,
        starts: start,
        postures: &[],
        positions: position.to_vec(),
        orientations: orientation.to_vec(),
    }
}

#[test]
fn a_target_out_of_reach_leaves_joints_within_limits_and_reports_it() {
    let model = fr3();
    let link = ["robot/fr3_hand_tcp"];
    let solver = Solver::new(Arc::clone(&model), &task(&model, &link)).unwrap();
    let positions = [3.0, 0.0, 0.5];
    let orientations = [0.0, 1.0, 0.0, 0.0];
    let problems = Problems {
        count: 1,
        starts: &model.start().joint_q,
        postures: &[],
        positions: vec![&positions],
        orientations: vec![&orientations],
    };
    let all = solver.solve(&problems, OPTIONS, Precision::F32, Width::Auto, 1);
    let (q, solutions) = all.unwrap();
    assert!(!solutions[0].is_solved && solutions[0].position_error > 1.0);
    for limit in &model.constants().limits {
        let q = q[model.constants().dofs[limit.dof].coord];
        assert!(limit.lower <= q && q <= limit.upper, "{q}: {limit:?}");
    }
}
