//! One brick in every format.

use base64::Engine as _;
use sim_model::Shape;
use sim_model::geometry::{Mesh, MeshOptions, mass_properties};

use crate::files::{
    Folder, PLAIN, assert_alike, brick, dae, glb, gltf, gltf_buffer, mapped, obj, stl, stl_text,
    unit_density,
};

/// Roundings of sums over a dozen triangles.
const EXACT: f64 = 1e-14;

/// The brick by closed form.
fn expected() -> sim_model::Inertial {
    let half_extents = [0.5, 0.25, 0.125];
    let mut inertial = mass_properties(&Shape::Box { half_extents }, 1.0).unwrap();
    inertial.pos = half_extents;
    inertial
}

#[track_caller]
fn assert_is_the_brick(mesh: &Mesh) {
    assert!(mesh.closed);
    assert_eq!(
        (
            mesh.triangles.vertices.len(),
            mesh.triangles.triangles.len()
        ),
        (8, 12)
    );
    assert_alike(&unit_density(mesh), &expected(), EXACT);
}

#[test]
fn one_brick_weighs_the_same_in_every_format() {
    let folder = Folder::new("formats");
    let brick = brick();
    let z_up = "<unit meter=\"1\"/><up_axis>Z_UP</up_axis>";
    // glTF is y up: its y is our z
    let y_up = mapped(&brick, |[x, y, z]| [x, z, -y]);
    let buffer = gltf_buffer(&y_up);
    let node = r#"{"mesh":0}"#;
    folder.put("brick.bin", &buffer);
    let text = base64::engine::general_purpose::STANDARD.encode(&buffer);
    let inside = format!("\"uri\":\"data:application/octet-stream;base64,{text}\",");
    let files: [(&str, Vec<u8>); 9] = [
        ("binary.stl", stl(&brick)),
        ("text.STL", stl_text(&brick).into()),
        ("macintosh.stl", stl_text(&brick).replace('\n', "\r").into()),
        ("windows.Obj", obj(&brick).replace('\n', "\r\n").into()),
        ("unix.obj", obj(&brick).into()),
        ("scene.DAE", dae(&brick, z_up, PLAIN).into()),
        ("inside.gltf", gltf(&y_up, &inside, node).into()),
        (
            "beside.gltf",
            gltf(&y_up, "\"uri\":\"brick.bin\",", node).into(),
        ),
        ("binary.GLB", glb(&gltf(&y_up, "", node), &buffer)),
    ];
    for (name, bytes) in files {
        let mesh = folder
            .load(name, bytes)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_is_the_brick(&mesh);
    }
}

/// A text in UTF-16, low bytes first or last, after its byte order mark.
fn utf16(text: &str, low_first: bool) -> Vec<u8> {
    let units = "\u{feff}".encode_utf16().chain(text.encode_utf16());
    let bytes = units.map(|unit| match low_first {
        true => unit.to_le_bytes(),
        false => unit.to_be_bytes(),
    });
    bytes.flatten().collect()
}

#[test]
fn a_byte_order_mark_changes_nothing() {
    let folder = Folder::new("mark");
    let brick = brick();
    let y_up = mapped(&brick, |[x, y, z]| [x, z, -y]);
    folder.put("brick.bin", gltf_buffer(&y_up));
    // without its comments, the first line is a vertex: lost, it would shift every face
    let bare = obj(&brick).replace("# a comment\nmtllib none.mtl\no one\n", "");
    let repeated = bare.replace("\nv ", "\n\u{feff}v ");
    let texts = [
        ("a.obj", bare.clone()),
        ("mac.obj", bare.replace('\n', "\r")),
        ("repeated.obj", repeated),
        ("hidden.obj", format!("\u{200b}{bare}")),
        ("a.stl", stl_text(&brick)),
        ("a.dae", dae(&brick, "<up_axis>Z_UP</up_axis>", PLAIN)),
        (
            "a.gltf",
            gltf(&y_up, "\"uri\":\"brick.bin\",", r#"{"mesh":0}"#),
        ),
    ];
    for (name, text) in texts {
        let mesh = folder.load(name, format!("\u{feff}{text}"));
        assert_is_the_brick(&mesh.unwrap_or_else(|error| panic!("{name}: {error}")));
        for bytes in [
            utf16(&text, true),
            utf16(&text, false),
            utf16(&text, true)[2..].to_vec(),
        ] {
            let error = folder.load(name, bytes).unwrap_err().to_string();
            assert!(
                error.contains("it is UTF-16 or UTF-32 text; save it as UTF-8"),
                "{error}"
            );
        }
    }
}

#[test]
fn a_binary_file_may_begin_with_the_bytes_of_a_mark() {
    let folder = Folder::new("binary-mark");
    for start in [&b"\xef\xbb\xbfsolid"[..], b"\xff\xfes\0o\0l\0i\0d\0"] {
        let mut bytes = stl(&brick());
        bytes[..start.len()].copy_from_slice(start);
        assert_is_the_brick(&folder.load("a.stl", bytes).unwrap());
    }
}

#[test]
fn text_keeps_the_digits_that_f32_would_lose() {
    let folder = Folder::new("digits");
    let tenth = mapped(&brick(), |vertex| vertex.map(|x| 0.1 * x));
    for (name, text) in [("a.stl", stl_text(&tenth)), ("a.obj", obj(&tenth))] {
        let mesh = folder.load(name, text).unwrap();
        let high = mesh.triangles.extent()[1];
        assert_eq!(high, [0.1, 0.05, 0.025], "{name}");
    }
}

#[test]
fn polygons_of_an_obj_are_cut_into_triangles_and_continued_lines_joined() {
    let folder = Folder::new("polygons");
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
        f 4 3 2 1\nf 5 6 7 \\\n 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\nl 1 2\np 3\n";
    let cube = unit_density(&folder.load("cube.obj", text).unwrap());
    assert_alike(&cube, &cube_at([0.5; 3]), EXACT);
}

fn cube_at(pos: [f64; 3]) -> sim_model::Inertial {
    let mut inertial = mass_properties(
        &Shape::Box {
            half_extents: [0.5; 3],
        },
        1.0,
    )
    .unwrap();
    inertial.pos = pos;
    inertial
}

#[test]
fn collada_units_and_up_axes_become_metres_and_z_up_outside_of_urdf() {
    let folder = Folder::new("axes");
    let inches = |[x, y, z]: [f64; 3]| [x / 0.0254, y / 0.0254, z / 0.0254];
    // where each convention has our x, y, z
    type Turn = fn([f64; 3]) -> [f64; 3];
    let turns: [(&str, Turn, bool); 4] = [
        ("<up_axis>Z_UP</up_axis>", |p| p, false),
        ("<up_axis>Y_UP</up_axis>", |[x, y, z]| [x, z, -y], true),
        ("<up_axis>X_UP</up_axis>", |[x, y, z]| [z, -x, -y], true),
        // the specification's default
        ("", |[x, y, z]| [x, z, -y], true),
    ];
    for (axis, turn, noted) in turns {
        let there = mapped(&brick(), |point| inches(turn(point)));
        let asset = format!("<unit name=\"inch\" meter=\"0.0254\"/>{axis}");
        let mesh = folder.load("a.dae", dae(&there, &asset, PLAIN)).unwrap();
        assert_alike(&unit_density(&mesh), &expected(), 1e-13);
        assert_eq!(
            mesh.notes
                .iter()
                .any(|note| note.contains("is turned from")),
            noted,
            "{axis}"
        );
    }
}

#[test]
fn collada_nodes_nest_turn_mirror_and_repeat() {
    let folder = Folder::new("nodes");
    let z_up = "<up_axis>Z_UP</up_axis>";
    let load = |nodes: &str| folder.load("a.dae", dae(&brick(), z_up, nodes)).unwrap();
    // the brick's centre (0.5, 0.25, 0.125): scaled by 2, turned by 90 degrees about z, shifted by (10, 0, 0)
    let nested = "<node><translate>10 0 0</translate><rotate>0 0 2 90</rotate><node><scale>2 2 2</scale>\
        <instance_geometry url=\"#mesh\"/></node></node>";
    let mesh = load(nested);
    let body = unit_density(&mesh);
    for (actual, expected) in body.pos.iter().zip([9.5, 1.0, 0.25]) {
        assert!((actual - expected).abs() < 1e-12, "{body:?}");
    }
    assert!((body.mass - 8.0 * 0.125).abs() < 1e-12);
    // the same as one matrix, by rows
    let matrix = "<node><matrix>0 -2 0 10 2 0 0 0 0 0 2 0 0 0 0 1</matrix><instance_geometry url=\"#mesh\"/></node>";
    assert_alike(&unit_density(&load(matrix)), &body, 1e-13);
    // a mirrored part keeps its outside
    let mirrored = load("<node><scale>-1 1 1</scale><instance_geometry url=\"#mesh\"/></node>");
    assert!(mirrored.closed && mirrored.triangles.signed_volume() > 0.0);
    assert!((unit_density(&mirrored).pos[0] + 0.5).abs() < 1e-14);
    // two bricks by reference
    let twice = "<node id=\"one\"><instance_geometry url=\"#mesh\"/></node>\
        <node><translate>0 0 5</translate><instance_node url=\"#one\"/></node>";
    let body = unit_density(&load(twice));
    assert!(
        (body.mass - 0.25).abs() < 1e-14 && (body.pos[2] - 2.625).abs() < 1e-13,
        "{body:?}"
    );
}

#[test]
fn gltf_nodes_nest_and_mirror() {
    let folder = Folder::new("gltf");
    let mesh = brick();
    let nodes = r#"{"translation":[1,2,3],"children":[1]},{"scale":[-2,1,1],"mesh":0}"#;
    let loaded = folder
        .load("a.glb", glb(&gltf(&mesh, "", nodes), &gltf_buffer(&mesh)))
        .unwrap();
    let body = unit_density(&loaded);
    // in the file at (1 - 2 0.5, 2 + 0.25, 3 + 0.125), y up
    for (actual, expected) in body.pos.iter().zip([0.0, -3.125, 2.25]) {
        assert!((actual - expected).abs() < 1e-12, "{body:?}");
    }
    assert!((body.mass - 0.25).abs() < 1e-13 && loaded.triangles.signed_volume() > 0.0);
}

#[test]
fn scale_mirrors_and_keeps_the_outside_outside() {
    let folder = Folder::new("scale");
    let path = folder.put("brick.stl", stl(&brick()));
    let mesh = Mesh::load(&path, [-2.0, 1.0, 4.0], &MeshOptions::default()).unwrap();
    assert!(mesh.closed);
    assert!((mesh.triangles.signed_volume() - 1.0).abs() < 1e-14);
    assert_eq!(
        unit_density(&mesh).pos.map(|x| (x * 1e12).round() / 1e12),
        [-1.0, 0.25, 0.5]
    );
}
