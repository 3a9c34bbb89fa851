//! The hash of a model stays what it was: recordings store it and refuse to replay on a model with another one.
//!
//! `sim-core/model/src/hash` writes the text that the hash is of. A key or a word that changes there changes every hash, and
//! so makes every recording unreadable. `sim-daemon/src/recording/tests/earlier.rs` replays recordings of an earlier release.

use std::path::Path;

use sim_model::{Body, Collision, Description, Pose, Robot, Shape, UrdfOptions};

/// Hash of [`lesson`], as its recordings have it.
const LESSON: u64 = 17994171291502531716;
/// Hash of [`table_with_cubes`].
const CONTACTS: u64 = 8815387494124494041;

/// The scene of `examples/lesson`, demo `Target`: an FR3 with drives and without contacts.
fn lesson() -> Description {
    let mut scene = Description::new(1.0 / 480.0, 8);
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples/assets/fr3/fr3_franka_hand.urdf");
    let options = UrdfOptions {
        pose: Pose::at([-0.5, -0.5, 0.1]),
        ..UrdfOptions::named("arm")
    };
    let arm = scene
        .add_robot(Robot::from_urdf(path, options).unwrap())
        .unwrap();
    let start: [f32; 9] = [
        -3.6802115e-3,
        2.3901723e-2,
        3.680411e-3,
        -2.3683236,
        -1.2918962e-4,
        2.3922248,
        7.85492e-1,
        0.05,
        0.05,
    ];
    let ke = [
        4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0, 100.0, 100.0,
    ];
    arm.set_joint_q(&start.map(f64::from)).unwrap();
    arm.set_joint_target_ke(&ke).unwrap();
    arm.set_joint_target_kd(&ke.map(|ke| ke / 10.0)).unwrap();
    arm.set_joint_effort_limit(&[87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0, 100.0, 100.0])
        .unwrap();
    arm.set_joint_armature(&[0.195, 0.195, 0.195, 0.195, 0.074, 0.074, 0.074, 0.1, 0.1])
        .unwrap();
    scene
}

/// The lesson's arm over a table and a ground, with two cubes and a ball.
fn table_with_cubes() -> Description {
    let mut scene = lesson();
    scene.add_box("table", [0.4, 0.4, 0.05], Pose::identity());
    scene.add_ground("", -0.1);
    let half_extents = [0.03; 3];
    let shapes = [
        ("red", Shape::Box { half_extents }),
        ("green", Shape::Box { half_extents }),
        ("ball", Shape::Sphere { radius: 0.03 }),
    ];
    for (place, (name, shape)) in shapes.into_iter().enumerate() {
        let mut body = Body::new(name, Pose::at([0.1 * place as f64, 0.0, 0.08]));
        let shape = Collision::new(None, shape, Pose::identity());
        body.shapes.push((shape, 500.0));
        scene.add_body(body).unwrap();
    }
    scene
}

#[test]
fn hash_of_the_lesson_is_that_of_its_recordings() {
    assert_eq!(lesson().compile().unwrap().hash(), LESSON);
}

#[test]
fn hash_of_a_scene_with_contacts_is_that_of_its_recordings() {
    let model = table_with_cubes().compile().unwrap();
    assert!(model.contacts_max() > 0);
    assert_eq!(model.hash(), CONTACTS);
}
