//! What scene files say of contacts: shapes, surfaces, filters and capacities.

use std::path::{Path, PathBuf};

use sim_daemon::config::{self, SceneFile};
use sim_model::{Cone, Shape, Surface};

use crate::{assert_says, assets, parse};

/// Every shape and bearer that contacts can have; the mesh lies beside the scene.
const CONTACTS: &str = r#"
dt = 0.002
substeps = 8
contacts_max = 40
rows_max = 120
contact_filters = [["ground", "arm/fr3_link0"], ["cube", "ramp"]]

[solver]
cone = "pyramidal"
impratio = 10

[[shape]]
name = "ground"
type = "plane"
pos = [0.0, 0.0, -0.5]
mu = 0.6
group = -1

[[shape]]
name = "ramp"
type = "mesh"
path = "wedge.obj"
scale = [1.0, 2.0, 0.5]
max_hull_vertices = 8
convex_decomposition = true
margin = 0.001
gap = 0.002

[[shape]]
type = "box"
half_extents = [0.025, 0.025, 0.025]
body = "cube"
density = 400
ke = 5000
kd = 200
kf = 500
condim = 1

[[shape]]
name = "pad"
type = "sphere"
radius = 0.01
body = "arm/fr3_hand"
mu = 2

[[robot]]
name = "arm"
urdf = "fr3_franka_hand.urdf"
mu = 0.8
margin = 0.003

[[body]]
name = "cube"
"#;

/// A folder with the wedge and the arm, and no more, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Folder {
        let name = format!("tightloop-contacts-{}-{test}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).unwrap();
        let wedge = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
        std::fs::write(folder.join("wedge.obj"), wedge).unwrap();
        let arm = assets().join("fr3/fr3_franka_hand.urdf");
        std::fs::copy(arm, folder.join("fr3_franka_hand.urdf")).unwrap();
        Folder(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn contacts_of_a_file_become_those_of_its_description() {
    let folder = Folder::new("describe");
    let scene = parse(CONTACTS).describe(&folder.0).unwrap();
    assert_eq!((scene.contacts_max, scene.rows_max), (Some(40), Some(120)));
    assert_eq!(
        scene.filters,
        [["ground", "arm/fr3_link0"], ["cube", "ramp"]].map(|pair| pair.map(str::to_owned))
    );
    assert_eq!(
        (scene.solver.cone, scene.solver.impratio),
        (Cone::Pyramidal, 10.0)
    );

    let usual = Surface::default();
    let [ground, ramp] = &scene.shapes[..] else {
        panic!("{} static shapes", scene.shapes.len());
    };
    assert_eq!((&ground.shape, ground.pose.pos[2]), (&Shape::Plane, -0.5));
    let rough = Surface {
        mu: 0.6,
        group: -1,
        ..usual
    };
    assert_eq!(ground.surface, rough);
    let Shape::Mesh(mesh) = &ramp.shape else {
        panic!("{:?} is no mesh", ramp.shape);
    };
    assert_eq!(mesh.triangles.extent(), [[0.0; 3], [1.0, 2.0, 0.5]]);
    let wide = Surface {
        margin: 0.001,
        gap: 0.002,
        ..usual
    };
    assert_eq!(ramp.surface, wide);

    let cube = &scene.robots[1].links[0].collisions[0];
    let slick = Surface {
        ke: 5000.0,
        kd: 200.0,
        kf: 500.0,
        condim: 1,
        ..usual
    };
    assert_eq!(cube.surface, slick);
    for link in &scene.robots[0].links {
        for shape in &link.collisions {
            let expected = match shape.name.as_deref() {
                Some("pad") => Surface { mu: 2.0, ..usual },
                _ => Surface {
                    mu: 0.8,
                    margin: 0.003,
                    ..usual
                },
            };
            assert_eq!(shape.surface, expected, "{}: {:?}", link.name, shape.name);
        }
    }
    let names = scene.shape_names();
    for name in ["ground", "ramp", "cube/0", "arm/fr3_hand/pad"] {
        assert!(
            names.contains(&name.to_owned()),
            "{name} is not in {names:?}"
        );
    }
}

#[test]
fn contacts_survive_toml_json_and_another_folder() {
    let folder = Folder::new("round-trip");
    let scene = parse(CONTACTS);
    assert_eq!(parse(&scene.to_toml()), scene);
    let json = SceneFile::from_json(&scene.to_json().to_string());
    assert_eq!(json.unwrap(), scene);
    let below = folder.0.join("below");
    std::fs::create_dir_all(&below).unwrap();
    scene.save(&below.join("scene.toml"), &folder.0).unwrap();
    let saved = config::load(&below.join("scene.toml")).unwrap();
    let path = saved.shapes[1].path.as_deref();
    assert_eq!(path, Some(Path::new("../wedge.obj")));
    assert_eq!(saved.describe(&below).unwrap().shapes.len(), 2);
}

#[test]
fn what_contacts_cannot_have_is_refused_by_name() {
    let folder = Folder::new("refused");
    let cases: &[(&str, &str, &[&str])] = &[
        ("mu = 0.6", "mu = -0.6", &["shape `ground`", "mu is -0.6"]),
        ("mu = 0.8", "mu = -0.8", &["robot `arm`", "mu is -0.8"]),
        (
            "condim = 1",
            "condim = 4",
            &["condim is 4", "not supported"],
        ),
        ("condim = 1", "condim = -1", &["condim"]),
        ("group = -1", "group = 1.5", &["group", "1.5"]),
        (
            "group = -1",
            "radius = 1",
            &["shape `ground`", "a plane has no radius"],
        ),
        (
            "group = -1",
            "body = \"cube\"",
            &["shape `ground`", "a plane has no end"],
        ),
        (
            "group = -1",
            "scale = [1, 1, 1]",
            &["shape `ground`", "a plane has no scale"],
        ),
        (
            "path = \"wedge.obj\"",
            "",
            &["shape `ramp`", "path is missing"],
        ),
        ("wedge.obj", "ghost.obj", &["shape `ramp`", "ghost.obj"]),
        (
            "max_hull_vertices = 8",
            "max_hull_vertices = 7",
            &["shape `ramp`", "between 8 and 1024"],
        ),
        (
            "arm/fr3_hand\"",
            "arm/fr3_foot\"",
            &["robot `arm`", "no link `fr3_foot`"],
        ),
        (
            "arm/fr3_hand\"",
            "leg/fr3_hand\"",
            &["no robot `leg`", "`arm`"],
        ),
        (
            "arm/fr3_hand\"",
            "arm\"",
            &["shape `pad`", "`arm`", "`robot/link`"],
        ),
        ("mu = 2", "density = 2", &["shape `pad`", "has no density"]),
        (
            "contacts_max = 40",
            "contacts_max = 0",
            &["contacts_max is 0"],
        ),
        ("rows_max = 120", "rows_max = 99999", &["rows_max is 99999"]),
        (
            "\"ramp\"]",
            "\"ramq\"]",
            &["contact filter", "`ramq`", "`ground`, `ramp`"],
        ),
        (", \"ramp\"]", "]", &["contact_filters"]),
        ("impratio = 10", "impratio = 0", &["impratio is 0"]),
    ];
    for (from, to, says) in cases {
        assert!(CONTACTS.contains(from), "`{from}` is not in the scene");
        let text = CONTACTS.replacen(from, to, 1);
        let scene = config::parse(&text, "scene.toml");
        let error = scene.and_then(|scene| scene.describe(&folder.0));
        let error = error.map(|_| ()).expect_err(&format!("accepted `{to}`"));
        assert_says(&error.to_string(), says);
    }
}

#[test]
fn mesh_summary_tells_what_touches() {
    let folder = Folder::new("mesh");
    let file = folder.0.join("wedge.obj");
    let summary_at = |scale| config::mesh_summary(&file, scale, &config::MeshOptions::default());
    let summary = summary_at([2.0; 3]).unwrap();
    assert_eq!(summary["hull_vertices"], serde_json::json!([4]));
    assert_eq!(summary["closed"], true);
    assert_eq!(summary["extent"][1], serde_json::json!([2.0, 2.0, 2.0]));
    let message = summary_at([1e-9; 3]).unwrap_err().to_string();
    assert_says(&message, &["wedge.obj", "mend the scale"]);
}
