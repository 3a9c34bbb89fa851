//! Joints that follow others.

use proptest::prelude::*;
use sim_model::{Mimic, Robot};

use crate::build::{INERTIAL, LIMIT, assert_says, joint, link, read};

/// A base and links `l0`, `l1`, … on it by the joints `j0`, `j1`, …, each holding this.
fn fan(joints: &[(&str, String)]) -> String {
    let mut body = link("base", "");
    for (index, (kind, inside)) in joints.iter().enumerate() {
        body += &link(&format!("l{index}"), INERTIAL);
        body += &joint(
            &format!("j{index}"),
            kind,
            "base",
            &format!("l{index}"),
            &format!("{LIMIT}{inside}"),
        );
    }
    body
}

fn follows(leader: &str) -> String {
    format!("<mimic joint=\"{leader}\"/>")
}

#[test]
fn multiplier_is_1_and_offset_0_by_default() {
    let robot = read(&fan(&[
        ("revolute", String::new()),
        ("prismatic", follows("j0")),
    ]))
    .unwrap();
    assert_eq!(robot.joints[0].mimic, None);
    assert_eq!(
        robot.joints[1].mimic,
        Some(Mimic {
            joint: 0,
            multiplier: 1.0,
            offset: 0.0
        })
    );
}

#[test]
fn mimic_of_a_fixed_joint_is_ignored_with_a_note() {
    let robot = read(&fan(&[
        ("revolute", String::new()),
        ("fixed", follows("j0")),
    ]))
    .unwrap();
    assert_eq!(robot.joints[1].mimic, None);
    assert_says(
        &robot.notes.join("\n"),
        &["<mimic> of a fixed joint is ignored"],
    );
}

#[test]
fn circle_of_followers_is_refused_with_its_members_only() {
    // j0 → j1 → j2 → j3 → j1
    let circle = fan(&[
        ("revolute", follows("j1")),
        ("revolute", follows("j2")),
        ("revolute", follows("j3")),
        ("revolute", follows("j1")),
    ]);
    assert_eq!(
        read(&circle).unwrap_err().to_string(),
        "robot.urdf:6: robot `r`: joints `j1`, `j2`, `j3` mimic one another in a circle; let one of them lead"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn flattened_chain_equals_the_chain_followed_step_by_step(
        links in prop::collection::vec((-3.0..3.0_f64, -3.0..3.0_f64), 1..8),
        order in any::<prop::sample::Index>(),
        q in -2.0..2.0_f64,
    ) {
        // joint k of the chain follows joint k + 1, the last one leads; file order is rotated
        let count = links.len() + 1;
        let turn = order.index(count);
        let place = |k: usize| (k + turn) % count;
        let mut joints = vec![("revolute", String::new()); count];
        for (k, (multiplier, offset)) in links.iter().enumerate() {
            joints[place(k)].1 =
                format!("<mimic joint=\"j{}\" multiplier=\"{multiplier}\" offset=\"{offset}\"/>", place(k + 1));
        }
        let robot = read(&fan(&joints)).unwrap();
        let mut expected = q;
        prop_assert_eq!(robot.joints[place(links.len())].mimic, None);
        for (k, (multiplier, offset)) in links.iter().enumerate().rev() {
            expected = offset + multiplier * expected;
            let mimic = robot.joints[place(k)].mimic.unwrap();
            prop_assert_eq!(mimic.joint, place(links.len()));
            let flat = mimic.offset + mimic.multiplier * q;
            // at most 8 factors and sums, none above 3^8 of the start
            prop_assert!((flat - expected).abs() <= 32.0 * f64::EPSILON * 3.0_f64.powi(9), "{} {}", flat, expected);
        }
    }
}

#[test]
fn followers_start_where_their_leader_puts_them() {
    // j0 follows j2, which follows j1
    let mimic = |leader, ratio, offset| {
        format!("<mimic joint=\"{leader}\" multiplier=\"{ratio}\" offset=\"{offset}\"/>")
    };
    let mut robot = read(&fan(&[
        ("revolute", mimic("j2", 2.0, 0.25)),
        ("revolute", String::new()),
        ("prismatic", mimic("j1", -0.5, 0.125)),
    ]))
    .unwrap();
    let starts = |robot: &Robot| {
        let joints = robot.joints.iter();
        joints.map(|joint| joint.q.clone()).collect::<Vec<_>>()
    };
    assert_eq!(starts(&robot), [[0.5], [0.0], [0.125]]);
    robot.joints[1].q = vec![1.0];
    robot.start_followers();
    assert_eq!(starts(&robot), [[-0.5], [1.0], [-0.375]]);
    // their targets are their starts, until the leader has one
    robot.aim_followers();
    assert_eq!(robot.joints[0].dofs[0].target_q, None);
    robot.joints[1].dofs[0].target_q = Some(0.5);
    robot.joints[1].dofs[0].target_qd = 2.0;
    robot.aim_followers();
    robot.pace_followers();
    let targets = [0, 2].map(|joint| {
        let dof = &robot.joints[joint].dofs[0];
        (dof.target_q, dof.target_qd)
    });
    assert_eq!(targets, [(Some(0.0), -2.0), (Some(-0.125), -1.0)]);
}
