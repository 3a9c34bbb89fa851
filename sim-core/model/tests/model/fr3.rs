//! The project's own FR3: its figures, and that they equal the reference's where that is at hand.

use std::path::{Path, PathBuf};

use sim_model::{JointKind, Mimic, Robot, Shape, UrdfOptions};

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn bundled_robot() -> Robot {
    Robot::from_urdf(
        repository().join("examples/assets/fr3/fr3_franka_hand.urdf"),
        UrdfOptions::default(),
    )
    .unwrap()
}

fn names<'a, T>(indices: &[usize], all: &'a [T], name: impl Fn(&'a T) -> &'a str) -> Vec<&'a str> {
    indices.iter().map(|&index| name(&all[index])).collect()
}

#[test]
fn bodies_and_dofs_are_in_the_published_order() {
    let robot = bundled_robot();
    assert_eq!(
        names(&robot.link_order(), &robot.links, |link| &link.name),
        [
            "base",
            "fr3_link0",
            "fr3_link1",
            "fr3_link2",
            "fr3_link3",
            "fr3_link4",
            "fr3_link5",
            "fr3_link6",
            "fr3_link7",
            "fr3_link8",
            "fr3_hand",
            "fr3_hand_tcp",
            "fr3_leftfinger",
            "fr3_rightfinger",
        ]
    );
    assert_eq!(
        names(&robot.moving_joints(), &robot.joints, |joint| &joint.name),
        [
            "fr3_joint1",
            "fr3_joint2",
            "fr3_joint3",
            "fr3_joint4",
            "fr3_joint5",
            "fr3_joint6",
            "fr3_joint7",
            "fr3_finger_joint1",
            "fr3_finger_joint2",
        ]
    );
}

#[test]
fn figures_are_the_published_ones() {
    let robot = bundled_robot();
    let joints: Vec<_> = robot
        .moving_joints()
        .into_iter()
        .map(|dof| &robot.joints[dof])
        .collect();
    let ranges: Vec<_> = joints.iter().map(|joint| joint.range.unwrap()).collect();
    let expected = [
        [-2.7437, 2.7437],
        [-1.7837, 1.7837],
        [-2.9007, 2.9007],
        [-3.0421, -0.1518],
        [-2.8065, 2.8065],
        [0.5445, 4.5169],
        [-3.0159, 3.0159],
        [0.0, 0.04],
        [0.0, 0.04],
    ];
    assert_eq!(ranges, expected);
    let efforts: Vec<_> = joints
        .iter()
        .map(|joint| joint.dofs[0].effort_limit.unwrap())
        .collect();
    assert_eq!(
        efforts,
        [87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0, 100.0, 100.0]
    );
    let speeds: Vec<_> = joints
        .iter()
        .map(|joint| joint.velocity_limit.unwrap())
        .collect();
    assert_eq!(speeds, [2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26, 0.2, 0.2]);
    for (dof, joint) in joints.iter().enumerate() {
        let (kind, damping, friction) = match dof {
            0..7 => (JointKind::Revolute, 0.003, 0.2),
            _ => (JointKind::Prismatic, 0.3, 0.0),
        };
        assert_eq!(
            (joint.kind, joint.dofs[0].damping, joint.dofs[0].friction),
            (kind, damping, friction),
            "{}",
            joint.name
        );
    }
    let leader = robot.moving_joints()[7];
    assert_eq!(
        joints[8].mimic,
        Some(Mimic {
            joint: leader,
            multiplier: 1.0,
            offset: 0.0
        })
    );
    let masses: Vec<f64> = robot
        .links
        .iter()
        .filter_map(|link| link.inertial.map(|inertial| inertial.mass))
        .collect();
    let expected = [
        2.3966,
        2.9274653454,
        2.9355370338,
        2.2449013699,
        2.6155955791,
        2.3271207594,
        1.8170376524,
        0.6271432862,
        0.6544,
        0.0291,
        0.0291,
    ];
    assert_eq!(masses, expected);
}

#[test]
fn own_description_needs_no_mending_and_no_meshes() {
    let robot = bundled_robot();
    assert_eq!(robot.notes, [""; 0]);
    let shapes = robot.links.iter().flat_map(|link| &link.collisions);
    assert!(shapes.clone().count() > 20);
    for collision in shapes {
        assert!(!matches!(collision.shape, Shape::Mesh { .. }));
    }
}

#[test]
fn own_dynamics_equal_the_references_to_the_bit() {
    let path = repository().join("../shared/reference/fr3_franka_hand/urdf/fr3_franka_hand.urdf");
    if !path.exists() {
        eprintln!("skipped: {} is not here", path.display());
        return;
    }
    let mut reference = Robot::from_urdf(&path, UrdfOptions::default()).unwrap();
    let mut bundled = bundled_robot();
    // link order in the file is free, order of bodies is not
    for robot in [&mut bundled, &mut reference] {
        for link in &mut robot.links {
            // shapes of the arm are ours; those of the fingers are the published ones under other names
            if link.name.contains("finger") {
                link.collisions
                    .iter_mut()
                    .for_each(|collision| collision.name = None);
            } else {
                link.collisions.clear();
            }
        }
    }
    let ordered = |robot: &Robot| -> Vec<_> {
        robot
            .link_order()
            .into_iter()
            .map(|link| robot.links[link].clone())
            .collect()
    };
    assert_eq!(ordered(&bundled), ordered(&reference));
    assert_eq!(bundled.joints.len(), reference.joints.len());
    for (a, b) in bundled.joints.iter().zip(&reference.joints) {
        let links = |robot: &Robot, joint: &sim_model::Joint| {
            (
                robot.links[joint.parent.expect("the FR3 is fixed")]
                    .name
                    .clone(),
                robot.links[joint.child].name.clone(),
            )
        };
        assert_eq!(links(&bundled, a), links(&reference, b));
        let mut a = a.clone();
        (a.parent, a.child) = (b.parent, b.child);
        if let (Some(mimic), Some(reference_mimic)) = (&mut a.mimic, &b.mimic) {
            assert_eq!(
                bundled.joints[mimic.joint].name,
                reference.joints[reference_mimic.joint].name
            );
            mimic.joint = reference_mimic.joint;
        }
        assert_eq!(&a, b);
    }
}
