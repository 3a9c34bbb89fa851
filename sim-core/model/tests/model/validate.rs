//! Descriptions made by hand are held to the same rules as files.

use sim_model::{
    Description, Inertial, Joint, JointKind, Link, Mimic, ModelError, Pose, Robot, Shape,
    TargetMode, UrdfOptions,
};

use crate::build::{LIMIT, assert_says, one_joint, read};

fn scene() -> Description {
    let mut scene = Description::new(1.0 / 480.0, 8);
    scene
        .robots
        .push(read(&one_joint("revolute", LIMIT)).unwrap());
    scene
}

/// The message with which the scene is refused after this change.
fn refusal(change: impl FnOnce(&mut Description)) -> String {
    let mut scene = scene();
    change(&mut scene);
    scene.validate().expect_err("accepted").to_string()
}

fn joint_refusal(change: impl FnOnce(&mut Joint)) -> String {
    refusal(|scene| change(&mut scene.robots[0].joints[0]))
}

#[test]
fn sound_scene_is_accepted() {
    assert_eq!(scene().validate(), Ok(()));
}

#[test]
fn bad_dt_is_refused() {
    for dt in [0.0, -0.1, 2.0, f64::NAN, f64::INFINITY] {
        assert_says(&refusal(|scene| scene.dt = dt), &["dt is", &dt.to_string()]);
    }
}

#[test]
fn bad_substeps_and_solver_options_are_refused() {
    assert_says(&refusal(|scene| scene.substeps = 0), &["substeps is 0"]);
    assert_says(
        &refusal(|scene| scene.substeps = 1_000_000),
        &["substeps is 1000000"],
    );
    assert_says(
        &refusal(|scene| scene.solver.iterations = 0),
        &["iterations is 0"],
    );
    assert_says(
        &refusal(|scene| scene.solver.ls_iterations = 0),
        &["ls_iterations is 0"],
    );
    assert_says(
        &refusal(|scene| scene.solver.tolerance = -1.0),
        &["tolerance is -1"],
    );
    assert_says(
        &refusal(|scene| scene.solver.impratio = 0.0),
        &["impratio is 0"],
    );
    assert_says(
        &refusal(|scene| scene.gravity[2] = f64::NAN),
        &["gravity z is NaN"],
    );
}

#[test]
fn tolerance_0_is_accepted() {
    let mut scene = scene();
    scene.solver.tolerance = 0.0;
    assert_eq!(scene.validate(), Ok(()));
}

#[test]
fn quaternions_far_from_unit_length_are_refused() {
    assert_says(
        &refusal(|scene| scene.robots[0].pose.quat = [0.0; 4]),
        &["robot `r`", "length 0"],
    );
    assert_says(
        &joint_refusal(|joint| joint.origin.quat = [0.0, 0.0, 1.0, 1.0]),
        &["`elbow`", "length 1.41"],
    );
    let shape = |scene: &mut Description| {
        scene.add_box(
            "table",
            [1.0; 3],
            Pose {
                pos: [0.0; 3],
                quat: [2.0, 0.0, 0.0, 0.0],
            },
        );
    };
    assert_says(&refusal(shape), &["shape `table`", "length 2"]);
}

#[test]
fn shapes_need_positive_sizes_and_names_of_their_own() {
    let flat = |scene: &mut Description| {
        scene.add_box("table", [1.0, 0.0, 1.0], Pose::identity());
    };
    assert_says(&refusal(flat), &["shape `table`", "half extent"]);
    let twice = |scene: &mut Description| {
        scene.add_box("table", [1.0; 3], Pose::identity());
        scene.add_shape("table", Shape::Sphere { radius: 1.0 }, Pose::identity());
    };
    assert_says(&refusal(twice), &["two shapes", "`table`"]);
    let mut scene = scene();
    scene.add_box("", [1.0; 3], Pose::identity());
    scene.add_box("", [1.0; 3], Pose::identity());
    let names: Vec<&str> = scene
        .shapes
        .iter()
        .map(|shape| shape.name.as_str())
        .collect();
    assert_eq!(names, ["box", "box_2"]);
}

#[test]
fn robots_need_names_of_their_own() {
    assert_says(
        &refusal(|scene| scene.robots.push(scene.robots[0].clone())),
        &["two robots", "`r`"],
    );
}

#[test]
fn joint_values_are_checked() {
    assert_says(
        &joint_refusal(|joint| joint.q[0] = f64::NAN),
        &["`elbow`", "joint_q", "NaN"],
    );
    assert_says(
        &joint_refusal(|joint| joint.dofs[0].armature = -1.0),
        &["`elbow`", "joint_armature", "-1"],
    );
    assert_says(
        &joint_refusal(|joint| joint.dofs[0].target_ke = f64::INFINITY),
        &["`elbow`", "joint_target_ke", "inf"],
    );
    assert_says(
        &joint_refusal(|joint| joint.axis = [0.0, 0.0, 2.0]),
        &["`elbow`", "axis", "2"],
    );
    assert_says(
        &joint_refusal(|joint| joint.axis = [0.0; 3]),
        &["`elbow`", "axis is zero"],
    );
    assert_says(
        &joint_refusal(|joint| joint.child = 7),
        &["`elbow`", "child link `#7`"],
    );
    let mimic = |leader| {
        move |joint: &mut Joint| {
            joint.mimic = Some(Mimic {
                joint: leader,
                multiplier: 1.0,
                offset: 0.0,
            })
        }
    };
    assert_says(&joint_refusal(mimic(0)), &["`elbow`", "is itself"]);
    assert_says(&joint_refusal(mimic(9)), &["`elbow`", "#9"]);
}

#[test]
fn unbalanced_inertia_made_by_hand_is_refused_until_balanced() {
    let mut scene = scene();
    scene.robots[0].links[1].inertial = Some(Inertial {
        mass: 1.0,
        pos: [0.0; 3],
        inertia: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]],
    });
    assert_says(
        &scene.validate().unwrap_err().to_string(),
        &["`arm`", "1.5000", "balance_inertias"],
    );
    scene.robots[0].balance_inertias();
    assert_eq!(scene.validate(), Ok(()));
}

#[test]
fn setters_refuse_wrong_lengths_and_values_and_then_change_nothing() {
    let mut robot = read(&one_joint("revolute", LIMIT)).unwrap();
    let before = robot.clone();
    let error = robot.set_joint_q(&[1.0, 2.0]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "robot `r`: joint_q has 2 values, the robot has 1 coordinates"
    );
    assert_says(
        &robot
            .set_joint_target_q(&[f64::NAN])
            .unwrap_err()
            .to_string(),
        &["joint_target_q", "`elbow`", "NaN"],
    );
    assert_says(
        &robot.set_joint_armature(&[-1.0]).unwrap_err().to_string(),
        &["joint_armature", "`elbow`", "-1"],
    );
    assert_says(
        &robot
            .set_joint_effort_limit(&[f64::NAN])
            .unwrap_err()
            .to_string(),
        &["joint_effort_limit", "NaN"],
    );
    assert!(matches!(
        robot.set_joint_target_mode(&[]),
        Err(ModelError::JointValues {
            got: 0,
            expected: 1,
            ..
        })
    ));
    assert_eq!(robot, before);
}

#[test]
fn setters_write_in_dof_order() {
    let mut robot = Robot {
        name: "r".to_owned(),
        pose: Pose::identity(),
        floating: false,
        self_collisions: false,
        links: ["a", "b", "c"]
            .map(|name| Link {
                name: name.to_owned(),
                inertial: None,
                collisions: vec![],
            })
            .into(),
        // the joint of the second dof comes first
        joints: vec![
            Joint::new(JointKind::Revolute, "second", Some(1), 2),
            Joint::new(JointKind::Revolute, "first", Some(0), 1),
        ],
        notes: vec![],
        warnings: vec![],
        urdf: None,
        precompiled: None,
    };
    robot.set_joint_q(&[1.0, 2.0]).unwrap();
    robot.set_joint_effort_limit(&[f64::INFINITY, 5.0]).unwrap();
    robot
        .set_joint_target_mode(&[TargetMode::Both, TargetMode::Velocity])
        .unwrap();
    assert_eq!((robot.joints[1].q[0], robot.joints[0].q[0]), (1.0, 2.0));
    assert_eq!(
        (
            robot.joints[1].dofs[0].effort_limit,
            robot.joints[0].dofs[0].effort_limit
        ),
        (None, Some(5.0))
    );
    assert_eq!(
        (
            robot.joints[1].dofs[0].target_mode,
            robot.joints[0].dofs[0].target_mode
        ),
        (TargetMode::Both, TargetMode::Velocity)
    );
}

#[test]
fn add_urdf_refuses_a_second_robot_of_one_name_and_leaves_the_scene() {
    let file = std::env::temp_dir().join(format!("tightloop-validate-{}.urdf", std::process::id()));
    std::fs::write(&file, "<robot name=\"r\"><link name=\"a\"/></robot>").unwrap();
    let mut scene = scene();
    let error = scene.add_urdf(&file, UrdfOptions::default()).unwrap_err();
    assert_says(&error.to_string(), &["two robots", "`r`"]);
    assert_eq!(scene.robots.len(), 1);
    scene.add_urdf(&file, UrdfOptions::named("other")).unwrap();
    assert_eq!(scene.robots.len(), 2);
    std::fs::remove_file(&file).unwrap();
}
