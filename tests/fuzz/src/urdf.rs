//! Robots from URDF files.

use std::cell::Cell;

use sim_model::{Description, Robot, UrdfOptions};

use super::files;

/// A mesh that robots may name: a tetrahedron.
const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

thread_local! {
    static HAS_MESH: Cell<bool> = const { Cell::new(false) };
}

/// A URDF file, with a fixed and with a floating base. What is read compiles, or its error is of the scene.
pub fn urdf(bytes: &[u8]) {
    if !HAS_MESH.replace(true) {
        files::file("mesh.obj", MESH.as_bytes());
    }
    let path = files::file("robot.urdf", bytes);
    let folder = path.parent().expect("it is in a folder");
    let folder = format!("{}/", folder.display());
    for floating in [false, true] {
        let options = UrdfOptions {
            floating,
            ..UrdfOptions::default()
        };
        match Robot::from_urdf(&path, options) {
            Ok(robot) => {
                robot.validate().expect("a robot that was read is valid");
                let mut scene = Description::new(1.0 / 480.0, 1);
                scene.robots.push(robot);
                // a scene may give the robot another name than the file's, and its links may touch as it starts
                let _ = scene.compile();
            }
            Err(error) => {
                let message = error.to_string().replace(&folder, "");
                assert!(message.starts_with("robot.urdf:"), "{message}");
                assert!(!message.contains('\n'), "{message}");
                assert!(message.len() < 4096, "{} bytes: {message}", message.len());
            }
        }
    }
}
