//! Runs of the lesson beside those that were recorded of MuJoCo C (tests/data/README.md).

use super::{Demo, FRAMES, Run, command, csv, distance, repo};
use sim_physics::arrays::Field;

/// Distance of world 0 in joint positions from a recorded run: of its start, then a frame each.
pub fn deviations(run: &mut Run, demo: Demo, file: &str, frames: usize) -> Vec<f64> {
    let recorded = csv(repo(file));
    run.forward();
    let from = |run: &Run, row: &[f64]| distance(&run.get(Field::JointQ, 0), &row[1..10]);
    let mut deviations = vec![from(run, &recorded[0])];
    for frame in 0..frames {
        let (field, row) = command(demo, frame);
        run.command(field, &row);
        run.step();
        deviations.push(from(run, &recorded[frame + 1]));
    }
    deviations
}

/// Distances of world 0 in joint positions and in the cube's position from the recorded grasp, a frame each.
pub fn grasp_deviations(run: &mut Run) -> [Vec<f64>; 2] {
    let recorded = csv(repo("tests/data/mujoco_grasp.csv"));
    run.forward();
    let mut deviations = [vec![], vec![]];
    for (targets, row) in csv(repo("tests/data/grasp_targets.csv"))
        .iter()
        .zip(&recorded[1..])
    {
        let targets: Vec<f64> = targets.iter().map(|&x| f64::from(x as f32)).collect();
        run.command(Field::JointTargetQ, &targets);
        run.step();
        let q = run.get(Field::JointQ, 0);
        deviations[0].push(distance(&q[..9], &row[1..10]));
        deviations[1].push(distance(&q[9..12], &row[10..13]));
    }
    assert_eq!(deviations[0].len(), FRAMES);
    deviations
}

/// The largest up to a frame.
pub fn worst(deviations: &[f64], to_frame: usize) -> f64 {
    deviations[..=to_frame].iter().copied().fold(0.0, f64::max)
}
