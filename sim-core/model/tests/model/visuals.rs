//! What URDF files say of looks, and that it does not change the physics.

use std::fs;
use std::path::PathBuf;

use sim_model::{Description, Look, Pose, Robot, Shape, UrdfOptions, Visual, Visuals};

use crate::build::assert_says;

/// A folder of its own for each test, removed at the end; `pkg/meshes` has a file `hand.dae`, of which nobody asks what it is.
struct Package {
    root: PathBuf,
}

impl Package {
    fn new(test: &str) -> Package {
        let root =
            std::env::temp_dir().join(format!("tightloop-visuals-{}-{test}", std::process::id()));
        fs::create_dir_all(root.join("pkg/urdf")).unwrap();
        fs::create_dir_all(root.join("pkg/meshes")).unwrap();
        fs::write(root.join("pkg/meshes/hand.dae"), "no COLLADA at all").unwrap();
        Package { root }
    }

    fn urdf(&self, inside: &str) -> PathBuf {
        let path = self.root.join("pkg/urdf/r.urdf");
        fs::write(
            &path,
            format!("<robot name=\"r\" version=\"1.1\">{inside}</robot>"),
        )
        .unwrap();
        path
    }

    fn visuals(&self, inside: &str) -> Visuals {
        Robot::visuals(self.urdf(inside), &UrdfOptions::default()).unwrap()
    }

    /// The visual of a robot that has one.
    fn visual(&self, inside: &str) -> Visual {
        let text = format!("<link name=\"l\"><visual>{inside}</visual></link>");
        self.visuals(&text).visuals.remove(0)
    }
}

impl Drop for Package {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.root);
    }
}

const CUBE: &str = "<geometry><box size=\"2 4 6\"/></geometry>";

#[test]
fn primitives_and_files_come_with_their_sizes() {
    let package = Package::new("primitives");
    for (element, look) in [
        (
            "<box size=\"2 4 6\"/>",
            Look::Shape(Shape::Box {
                half_extents: [1.0, 2.0, 3.0],
            }),
        ),
        (
            "<sphere radius=\"0.5\"/>",
            Look::Shape(Shape::Sphere { radius: 0.5 }),
        ),
        (
            "<cylinder radius=\"0.5\" length=\"3\"/>",
            Look::Shape(Shape::Cylinder {
                radius: 0.5,
                half_height: 1.5,
            }),
        ),
        (
            "<capsule radius=\"0.5\" length=\"3\"/>",
            Look::Shape(Shape::Capsule {
                radius: 0.5,
                half_height: 1.5,
            }),
        ),
        (
            "<mesh filename=\"package://pkg/meshes/hand.dae\" scale=\"1 -2 3\"/>",
            Look::File {
                path: package.root.join("pkg/meshes/hand.dae"),
                collada_up_axis: false,
                scale: [1.0, -2.0, 3.0],
            },
        ),
        (
            "<mesh filename=\"../meshes/hand.dae\"/>",
            Look::File {
                path: package.root.join("pkg/urdf/../meshes/hand.dae"),
                collada_up_axis: false,
                scale: [1.0; 3],
            },
        ),
    ] {
        let visual = package.visual(&format!("<geometry>{element}</geometry>"));
        assert_eq!(visual.look, look, "{element}");
        assert_eq!(visual.pose, Pose::identity());
        assert_eq!((visual.link.as_str(), visual.name), ("l", None));
        assert_eq!((visual.color, visual.texture), (None, None));
    }
}

#[test]
fn origins_are_those_of_collisions() {
    let package = Package::new("origins");
    for origin in [
        "xyz=\"1 2 3\" rpy=\"0.1 -0.2 0.3\"",
        "xyz=\"1, 2, 3\"",
        "quat_xyzw=\"0 0.6 0 0.8\"",
        "rpy=\"0 1.5707963267948966 0\"",
    ] {
        let inside = format!("<origin {origin}/>{CUBE}");
        let path = package.urdf(&format!(
            "<link name=\"l\"><visual>{inside}</visual><collision>{inside}</collision></link>"
        ));
        let robot = Robot::from_urdf(&path, UrdfOptions::default()).unwrap();
        let visuals = Robot::visuals(&path, &UrdfOptions::default())
            .unwrap()
            .visuals;
        assert_eq!(
            visuals[0].pose, robot.links[0].collisions[0].pose,
            "{origin}"
        );
    }
}

#[test]
fn a_colour_is_the_visuals_own_or_that_of_its_name() {
    let package = Package::new("colours");
    let with_material = |material: &str| format!("<visual name=\"v\">{CUBE}{material}</visual>");
    let visuals = package.visuals(&format!(
        "<material name=\"red\"><color rgba=\"1 0 0 0.5\"/></material>\
         <link name=\"a\">{}{}{}</link><link name=\"b\">{}{}{}</link>",
        with_material("<material name=\"red\"/>"),
        with_material("<material name=\"blue\"/>"),
        with_material("<material name=\"red\"><color rgba=\"0 1 0 1\"/></material>"),
        with_material("<material name=\"\"><color rgba=\"0.25 0.5 2\"/></material>"),
        with_material("<material name=\"blue\"><color rgba=\"0 0 1 1\"/></material>"),
        with_material("<material name=\"unknown\"/>"),
    ));
    let colors: Vec<_> = visuals.visuals.iter().map(|visual| visual.color).collect();
    assert_eq!(
        colors,
        [
            Some([1.0, 0.0, 0.0, 0.5]),
            Some([0.0, 0.0, 1.0, 1.0]),
            Some([0.0, 1.0, 0.0, 1.0]),
            Some([0.25, 0.5, 1.0, 1.0]),
            Some([0.0, 0.0, 1.0, 1.0]),
            None,
        ]
    );
    assert_eq!(visuals.visuals[0].name.as_deref(), Some("v"));
    assert_eq!(visuals.notes, Vec::<String>::new());
}

#[test]
fn textures_are_files_and_bad_materials_are_notes() {
    let package = Package::new("textures");
    let visuals = package.visuals(&format!(
        "<link name=\"l\">\
         <visual>{CUBE}<material name=\"a\"><texture filename=\"package://pkg/meshes/hand.dae\"/></material></visual>\
         <visual>{CUBE}<material name=\"b\"><texture filename=\"skin.png\"/></material></visual>\
         <visual>{CUBE}<material name=\"c\"><color rgba=\"1 nan 0 1\"/></material></visual></link>"
    ));
    let [first, second, third] = &visuals.visuals[..] else {
        panic!("{visuals:?}");
    };
    assert_eq!(
        first.texture,
        Some(package.root.join("pkg/meshes/hand.dae"))
    );
    assert_eq!((&second.texture, second.color), (&None, None));
    assert_eq!(third.color, None);
    assert_eq!(visuals.notes.len(), 2, "{:?}", visuals.notes);
    assert_says(&visuals.notes[0], &["colour \"1 nan 0 1\""]);
    assert_says(&visuals.notes[1], &["texture `skin.png` is missing"]);
}

#[test]
fn what_cannot_be_shown_says_why_and_physics_takes_the_file() {
    let package = Package::new("broken");
    for (inside, words) in [
        ("", &["no shape that is known", "<mesh>"][..]),
        ("<geometry><cone/></geometry>", &["no shape that is known"]),
        (
            "<geometry><box/></geometry>",
            &["`size` of <box> is missing"],
        ),
        (
            "<geometry><box size=\"1 2\"/></geometry>",
            &["`size`", "only 2 numbers"],
        ),
        (
            "<geometry><sphere radius=\"-1\"/></geometry>",
            &["`radius`", "above 0"],
        ),
        (
            "<geometry><mesh filename=\"a.dae\"/></geometry>",
            &["mesh `a.dae` is missing"],
        ),
        ("<geometry><mesh/></geometry>", &["missing"]),
        (
            "<geometry><mesh filename=\"http://x/a.dae\"/></geometry>",
            &["package://, model://, file:// or a path"],
        ),
        (
            "<geometry><mesh filename=\"../meshes/hand.dae\" scale=\"1 0 1\"/></geometry>",
            &["`scale`", "no factor must be 0"],
        ),
        (
            "<origin xyz=\"a b c\"/><geometry><sphere radius=\"1\"/></geometry>",
            &["`xyz`", "is not a number"],
        ),
    ] {
        let path = package.urdf(&format!(
            "<link name=\"l\"><visual>{inside}</visual></link>"
        ));
        Robot::from_urdf(&path, UrdfOptions::default()).unwrap();
        let visual = Robot::visuals(&path, &UrdfOptions::default())
            .unwrap()
            .visuals
            .remove(0);
        let Look::Nothing { problem } = &visual.look else {
            panic!("{inside}: {visual:?}");
        };
        assert_says(problem, words);
    }
}

#[test]
fn looks_are_in_no_model() {
    let package = Package::new("hash");
    let link =
        |visual: &str| format!("<link name=\"l\">{visual}<collision>{CUBE}</collision></link>");
    let hash = |visual: &str| {
        let mut scene = Description::new(1e-3, 1);
        let path = package.urdf(&link(visual));
        scene.add_urdf(path, UrdfOptions::default()).unwrap();
        scene.compile().unwrap().hash()
    };
    let plain = hash("");
    let seen =
        format!("<visual>{CUBE}<material name=\"m\"><color rgba=\"1 0 0 1\"/></material></visual>");
    assert_eq!(hash(&seen), plain);
    assert_eq!(hash("<visual/>"), plain);
}
