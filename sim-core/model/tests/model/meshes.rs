//! Where meshes are looked for.

use std::fs;
use std::path::{Path, PathBuf};

use sim_model::{ModelError, Robot, Shape, UrdfOptions};

use crate::build::assert_says;

/// Half a unit square pyramid, as text.
const TETRAHEDRON: &str = "solid t
outer loop\n vertex 0 0 0\n vertex 0 1 0\n vertex 1 0 0\n endloop
outer loop\n vertex 0 0 0\n vertex 1 0 0\n vertex 0 0 1\n endloop
outer loop\n vertex 0 0 0\n vertex 0 0 1\n vertex 0 1 0\n endloop
outer loop\n vertex 1 0 0\n vertex 0 1 0\n vertex 0 0 1\n endloop
endsolid";

/// A folder of its own for each test, removed at the end: `pkg/urdf`, `pkg/meshes/hand.stl`.
struct Package {
    root: PathBuf,
}

impl Package {
    fn new(test: &str) -> Package {
        let root =
            std::env::temp_dir().join(format!("tightloop-meshes-{}-{test}", std::process::id()));
        fs::create_dir_all(root.join("pkg/urdf")).unwrap();
        fs::create_dir_all(root.join("pkg/meshes")).unwrap();
        fs::write(root.join("pkg/meshes/hand.stl"), TETRAHEDRON).unwrap();
        Package { root }
    }

    fn mesh(&self) -> PathBuf {
        self.root.join("pkg/meshes/hand.stl")
    }

    /// Reads a robot whose only link has this mesh; the file lies in `folder`.
    fn read(
        &self,
        folder: &str,
        element: &str,
        uri: &str,
        options: UrdfOptions,
    ) -> Result<Robot, ModelError> {
        let text = format!(
            "<robot name=\"r\"><link name=\"hand\"><{element}><geometry>\
             <mesh filename=\"{uri}\" scale=\"1 2 3\"/></geometry></{element}></link></robot>"
        );
        Robot::from_urdf_text(&text, self.root.join(folder).join("r.urdf"), options)
    }
}

impl Drop for Package {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.root);
    }
}

#[track_caller]
fn assert_leads_to(robot: Result<Robot, ModelError>, mesh: &Path) {
    match &robot.unwrap().links[0].collisions[0].shape {
        Shape::Mesh(loaded) => {
            assert_eq!(
                loaded.path.canonicalize().unwrap(),
                mesh.canonicalize().unwrap()
            );
            assert_eq!(loaded.scale, [1.0, 2.0, 3.0]);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn relative_absolute_and_file_paths_are_followed() {
    let package = Package::new("paths");
    let none = UrdfOptions::default;
    let mesh = package.mesh();
    assert_leads_to(
        package.read("pkg/urdf", "collision", "../meshes/hand.stl", none()),
        &mesh,
    );
    assert_leads_to(
        package.read("pkg/urdf", "collision", mesh.to_str().unwrap(), none()),
        &mesh,
    );
    assert_leads_to(
        package.read(
            "pkg/urdf",
            "collision",
            &format!("file://{}", mesh.display()),
            none(),
        ),
        &mesh,
    );
}

#[test]
fn more_slashes_than_needed_lead_to_the_same_file() {
    let package = Package::new("slashes");
    let absolute = package.mesh().display().to_string();
    let uris = [
        "package://pkg//meshes/hand.stl".to_owned(),
        "package:///pkg/meshes/hand.stl".to_owned(),
        "package://pkg///meshes////hand.stl".to_owned(),
        "package:/pkg/meshes/hand.stl".to_owned(),
        "PACKAGE://pkg/./meshes//hand.stl".to_owned(),
        "model://pkg/meshes/hand.stl".to_owned(),
        "model://pkg//meshes//hand.stl".to_owned(),
        "model:////pkg//meshes/hand.stl".to_owned(),
        "..//meshes//hand.stl".to_owned(),
        format!("file://{absolute}"),
        format!("file:{absolute}"),
        format!("file:///{absolute}"),
        format!("file://localhost{absolute}"),
        format!("/{absolute}"),
    ];
    for uri in uris {
        for element in ["collision", "visual"] {
            let robot = package.read("pkg/urdf", element, &uri, UrdfOptions::default());
            assert_eq!(
                robot.as_ref().unwrap().warnings,
                Vec::<String>::new(),
                "{uri}"
            );
            if element == "collision" {
                assert_leads_to(robot, &package.mesh());
            }
        }
    }
}

#[test]
fn paths_as_windows_and_the_web_write_them_lead_to_the_file() {
    let package = Package::new("respelt");
    let spaced = package.root.join("pkg/meshes/my hand.stl");
    fs::write(&spaced, TETRAHEDRON).unwrap();
    let read = |uri: &str| package.read("pkg/urdf", "collision", uri, UrdfOptions::default());
    for uri in [
        "..\\meshes\\my hand.stl",
        "../meshes/my%20hand.stl",
        "package://pkg/meshes/my%20hand.stl",
        "package://pkg\\meshes\\my%20hand.stl",
        "  ../meshes/my hand.stl ",
    ] {
        assert_leads_to(read(uri), &spaced);
    }
    // a file of that very name counts first
    let plain = package.root.join("pkg/meshes/my%20hand.stl");
    fs::write(&plain, TETRAHEDRON).unwrap();
    assert_leads_to(read("../meshes/my%20hand.stl"), &plain);
    for uri in [
        "..\\..\\..\\secret.stl",
        "%2e%2e/%2e%2e/secret.stl",
        "../meshes/%zz.stl",
    ] {
        fs::write(package.root.join("secret.stl"), TETRAHEDRON).unwrap();
        assert!(read(uri).is_err(), "{uri}");
    }
}

#[test]
fn more_slashes_lead_out_of_no_package() {
    let package = Package::new("slashes-out");
    for uri in [
        "package://pkg//../../secret.stl",
        "model:///..//pkg/meshes/hand.stl",
    ] {
        let error = package.read("pkg/urdf", "collision", uri, UrdfOptions::default());
        assert_says(
            &error.unwrap_err().to_string(),
            &["leaves its package", "`..`"],
        );
    }
}

/// A COLLADA file of a box of 0.1 x 0.2 x 0.6 m that says this of its units and axes.
fn collada(asset: &str) -> String {
    let corners: Vec<String> = (0..8)
        .map(|i| {
            let half = |bit: usize, size: f64| {
                if i >> bit & 1 == 1 {
                    0.5 * size
                } else {
                    -0.5 * size
                }
            };
            format!("{} {} {}", half(0, 10.0), half(1, 20.0), half(2, 60.0))
        })
        .collect();
    let faces = "0 2 3 0 3 1 4 5 7 4 7 6 0 1 5 0 5 4 2 6 7 2 7 3 0 4 6 0 6 2 1 3 7 1 7 5";
    format!(
        "<COLLADA version=\"1.4.1\"><asset><unit meter=\"0.01\"/>{asset}</asset><library_geometries><geometry id=\"g\"><mesh>\
         <source id=\"p\"><float_array id=\"a\" count=\"24\">{}</float_array><technique_common>\
         <accessor source=\"#a\" count=\"8\" stride=\"3\"/></technique_common></source>\
         <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>\
         <triangles count=\"12\"><input semantic=\"VERTEX\" offset=\"0\" source=\"#v\"/><p>{faces}</p></triangles>\
         </mesh></geometry></library_geometries></COLLADA>",
        corners.join(" "),
    )
}

#[test]
fn in_a_urdf_collada_is_turned_to_z_up_only_if_asked_for() {
    let package = Package::new("up-axis");
    let size_of = |robot: &Robot, link: usize| {
        let Shape::Mesh(mesh) = &robot.links[link].collisions[0].shape else {
            panic!("no mesh");
        };
        let [low, high] = mesh.triangles.extent();
        [0, 1, 2].map(|axis| ((high[axis] - low[axis]) * 1e9).round() / 1e9)
    };
    let axes = [
        ("<up_axis>Y_UP</up_axis>", Some("Y_UP"), [0.1, 0.6, 0.2]),
        ("<up_axis>X_UP</up_axis>", Some("X_UP"), [0.2, 0.6, 0.1]),
        ("", Some("Y_UP"), [0.1, 0.6, 0.2]),
        ("<up_axis>Z_UP</up_axis>", None, [0.1, 0.2, 0.6]),
    ];
    let mut links = String::new();
    for (index, (axis, ..)) in axes.iter().enumerate() {
        fs::write(package.root.join(format!("{index}.dae")), collada(axis)).unwrap();
        links += &format!(
            "<link name=\"l{index}\"><collision><geometry><mesh filename=\"{index}.dae\"/></geometry></collision></link>"
        );
        if index > 0 {
            links += &format!(
                "<joint name=\"j{index}\" type=\"fixed\"><parent link=\"l0\"/><child link=\"l{index}\"/></joint>"
            );
        }
    }
    let text = format!("<robot name=\"r\">{links}</robot>");
    let read = |turned: bool| {
        let mut options = UrdfOptions::default();
        options.meshes.collada_up_axis |= turned;
        Robot::from_urdf_text(&text, package.root.join("r.urdf"), options).unwrap()
    };
    let (plain, turned) = (read(false), read(true));
    for (link, (axis, _, expected)) in axes.iter().enumerate() {
        assert_eq!(size_of(&plain, link), [0.1, 0.2, 0.6], "{axis}");
        assert_eq!(size_of(&turned, link), *expected, "{axis}");
    }
    let notes: Vec<_> = plain
        .notes
        .iter()
        .filter(|note| note.contains("up_axis"))
        .collect();
    assert_eq!(notes.len(), 1, "{notes:?}");
    assert_says(
        notes[0],
        &[
            "collada_up_axis",
            "0.dae (Y_UP), 1.dae (X_UP), 2.dae (Y_UP)",
        ],
    );
    assert!(!notes[0].contains("3.dae"), "{}", notes[0]);
    assert!(
        !turned
            .notes
            .iter()
            .any(|note| note.contains("collada_up_axis"))
    );
}

#[test]
fn packages_are_found_above_the_file_and_in_package_dirs() {
    let package = Package::new("packages");
    let uri = "package://pkg/meshes/hand.stl";
    assert_leads_to(
        package.read("pkg/urdf", "collision", uri, UrdfOptions::default()),
        &package.mesh(),
    );
    assert_leads_to(
        package.read("elsewhere", "collision", uri, UrdfOptions::default()),
        &package.mesh(),
    );
    for dir in [package.root.clone(), package.root.join("pkg")] {
        let options = UrdfOptions {
            package_dirs: vec![dir],
            ..UrdfOptions::default()
        };
        let text = "<robot name=\"r\"><link name=\"hand\"><collision><geometry>\
            <mesh filename=\"package://pkg/meshes/hand.stl\" scale=\"1 2 3\"/></geometry></collision></link></robot>";
        assert_leads_to(
            Robot::from_urdf_text(text, "/r.urdf", options),
            &package.mesh(),
        );
    }
}

#[test]
fn a_copy_of_a_package_under_another_name_is_taken_for_it_with_a_note() {
    let package = Package::new("renamed");
    fs::write(package.root.join("pkg/urdf/wheel.stl"), TETRAHEDRON).unwrap();
    for (uri, file) in [
        ("package://published_name/meshes/hand.stl", package.mesh()),
        (
            "package://wheel.stl",
            package.root.join("pkg/urdf/wheel.stl"),
        ),
    ] {
        let robot = package.read("pkg/urdf", "collision", uri, UrdfOptions::default());
        let notes = robot.as_ref().unwrap().notes.join("\n");
        assert_says(&notes, &["is not found by its name", "are taken from"]);
        assert_leads_to(robot, &file);
    }
    // one folder further up is no longer the robot's
    let error = package
        .read(
            "pkg/urdf/deep/er",
            "collision",
            "package://published_name/meshes/hand.stl",
            UrdfOptions::default(),
        )
        .unwrap_err();
    assert_says(&error.to_string(), &["is missing"]);
}

#[test]
fn missing_collision_mesh_is_refused_with_link_and_path() {
    let package = Package::new("missing");
    let error = package
        .read(
            "pkg/urdf",
            "collision",
            "../meshes/palm.stl",
            UrdfOptions::default(),
        )
        .unwrap_err();
    assert_says(
        &error.to_string(),
        &[
            "`hand`",
            "../meshes/palm.stl",
            "pkg/urdf/../meshes/palm.stl",
        ],
    );
    let error = package
        .read(
            "pkg/urdf",
            "collision",
            "package://ghost/palm.stl",
            UrdfOptions::default(),
        )
        .unwrap_err();
    assert_says(&error.to_string(), &["`hand`", "package://ghost/palm.stl"]);
}

#[test]
fn missing_visual_mesh_is_a_note() {
    let package = Package::new("visual");
    let robot = package
        .read("pkg/urdf", "visual", "palm.stl", UrdfOptions::default())
        .unwrap();
    assert_says(
        &robot.notes[0],
        &["`hand`", "visual mesh `palm.stl` is missing"],
    );
}

#[test]
fn paths_out_of_their_package_and_other_protocols_are_refused() {
    let package = Package::new("escape");
    for uri in [
        "package://pkg/../pkg/meshes/hand.stl",
        "package://pkg/a/../../x.stl",
        "package://../pkg/x.stl",
    ] {
        let error = package
            .read("pkg/urdf", "collision", uri, UrdfOptions::default())
            .unwrap_err();
        assert_says(&error.to_string(), &["`hand`", uri, "leaves its package"]);
    }
    let error = package
        .read(
            "pkg/urdf",
            "collision",
            "http://x/y.stl",
            UrdfOptions::default(),
        )
        .unwrap_err();
    assert_says(&error.to_string(), &["`hand`", "http://x/y.stl", "file://"]);
}

#[test]
fn relative_paths_climb_within_the_robots_folder_only() {
    let package = Package::new("climb");
    let none = UrdfOptions::default;
    fs::create_dir_all(package.root.join("pkg/robots/arm/urdf")).unwrap();
    let deep = |uri: &str, options| package.read("pkg/robots/arm/urdf", "collision", uri, options);
    let uri = "../../../meshes/hand.stl";
    // the file's folder is urdf, the robot's arm: two above is outside, however it is written
    for uri in [
        uri,
        "x/../../../../meshes/hand.stl",
        "file://../../../meshes/hand.stl",
    ] {
        let error = deep(uri, none()).unwrap_err();
        assert_says(
            &error.to_string(),
            &["`hand`", uri, "leaves the robot's folder", "package_dirs"],
        );
    }
    // a folder above both says that it belongs together
    let options = UrdfOptions {
        package_dirs: vec![package.root.join("pkg")],
        ..none()
    };
    assert_leads_to(deep(uri, options), &package.mesh());
    // so does a package's own mark
    fs::write(package.root.join("pkg/package.xml"), "<package/>").unwrap();
    assert_leads_to(deep(uri, none()), &package.mesh());
    let above = deep("../../../../pkg/meshes/../../x.stl", none()).unwrap_err();
    assert_says(&above.to_string(), &["leaves the robot's folder"]);
    // from anywhere, the classic
    let error = package
        .read(
            "pkg/urdf",
            "collision",
            "../../../../../../../etc/passwd",
            none(),
        )
        .unwrap_err();
    assert_says(&error.to_string(), &["leaves the robot's folder"]);
}

#[cfg(unix)] // Windows lets few users make links
#[test]
fn symbolic_links_are_followed_as_installed_workspaces_need() {
    let package = Package::new("links");
    fs::create_dir_all(package.root.join("install/pkg")).unwrap();
    std::os::unix::fs::symlink(package.mesh(), package.root.join("install/pkg/hand.stl")).unwrap();
    let uri = "package://pkg/hand.stl";
    let robot = package.read("install/pkg", "collision", uri, UrdfOptions::default());
    assert_leads_to(robot, &package.mesh());
}
