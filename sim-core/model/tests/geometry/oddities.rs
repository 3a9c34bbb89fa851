//! Mesh files that exporters and converters spoil: read as they are meant where that is certain, and refused where a part
//! of the surface would be lost in silence.

use std::time::{Duration, Instant};

use sim_model::geometry::{Mesh, VisualMesh};

use crate::files::{
    Folder, PLAIN, brick, dae, glb, gltf, gltf_buffer, mapped, obj, refusal, stl, stl_text,
    unit_density,
};

const Z_UP: &str = "<up_axis>Z_UP</up_axis>";

#[track_caller]
fn assert_is_the_brick(mesh: &Mesh) {
    assert!(mesh.closed);
    let [low, high] = mesh.triangles.extent();
    let expected = [[0.0; 3], [1.0, 0.5, 0.25]];
    for (actual, expected) in [low, high].iter().flatten().zip(expected.iter().flatten()) {
        assert!((actual - expected).abs() < 1e-6, "{low:?} to {high:?}");
    }
    assert!((unit_density(mesh).mass - 0.125).abs() < 1e-6);
}

#[track_caller]
fn assert_refused(name: &str, bytes: impl AsRef<[u8]>, reason: &str) {
    let message = refusal(name, bytes);
    assert!(message.contains(reason), "{message}");
}

#[test]
fn a_comment_inside_of_collada_numbers_loses_none() {
    let folder = Folder::new("comments");
    let whole = dae(&brick(), Z_UP, PLAIN);
    let places = [
        ("<p>0 0 ", "<p><!-- faces -->0 0 "),
        ("</p>", "<!-- end --></p>"),
        ("</float_array>", "<!-- end --></float_array>"),
    ];
    for (part, other) in places {
        let text = whole.replacen(part, other, 1);
        assert_is_the_brick(&folder.load("a.dae", text).unwrap());
    }
    let (before, after) = whole.split_once("<p>").unwrap();
    let (first, second) = after.split_at(after.find(" 0 ").unwrap());
    let text = format!("{before}<p>{first}<!-- between -->{second}");
    assert_is_the_brick(&folder.load("a.dae", text).unwrap());
}

#[test]
fn collada_lists_that_end_inside_of_a_face_are_refused() {
    let whole = dae(&brick(), Z_UP, PLAIN);
    let end = whole.find("</p>").unwrap();
    let cut = |count: usize| {
        let mut start = end;
        for _ in 0..count {
            start = whole[..start].rfind(' ').unwrap();
        }
        format!("{}{}", &whole[..start], &whole[end..])
    };
    assert_refused("index.dae", cut(1), "a <p> has 71 indices, 2 a corner");
    assert_refused("corner.dae", cut(2), "has 35 corners, 3 a triangle");
    let polygons = whole
        .replace("<triangles", "<polylist")
        .replace("</triangles>", "</polylist>");
    let eleven = polygons.replace("<p>", &format!("<vcount>{}</vcount><p>", "3 ".repeat(11)));
    assert_refused("over.dae", eleven, "<vcount> leaves 3 corners of <p> over");
    assert_refused("none.dae", polygons, "<vcount> leaves 36 corners");
}

#[test]
fn positions_of_collada_are_those_that_an_accessor_names() {
    let whole = dae(&brick(), Z_UP, PLAIN);
    let start = whole.find("count=\"24\">").unwrap() + 11;
    let end = whole.find("</float_array>").unwrap();
    let numbers: Vec<&str> = whole[start..end].split(' ').collect();
    let rows: Vec<String> = numbers
        .chunks(3)
        .map(|row| format!("7 {}", row.join(" ")))
        .collect();
    let params = "<param/><param name=\"X\"/><param name=\"Y\"/><param name=\"Z\"/></accessor>";
    let text = format!("{}{}{}", &whole[..start], rows.join(" "), &whole[end..])
        .replace("stride=\"3\"/>", &format!("stride=\"4\">{params}"));
    assert_is_the_brick(&Folder::new("accessor").load("a.dae", text).unwrap());
}

#[test]
fn a_matrix_of_another_kind_than_affine_is_refused() {
    let node = "<node><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2</matrix><instance_geometry url=\"#mesh\"/></node>";
    let text = dae(&brick(), Z_UP, node);
    assert_refused("matrix.dae", text, "the last row of a <matrix> is");
}

#[test]
fn a_binary_stl_whose_header_counts_too_few_triangles_is_refused() {
    let mut bytes = stl(&brick());
    bytes[80..84].copy_from_slice(&5_u32.to_le_bytes());
    assert_refused(
        "few.stl",
        &bytes,
        "its header tells of 5 triangles, but it holds 12",
    );
    // less than a triangle more is padding
    let padded = [stl(&brick()), vec![0; 49]].concat();
    assert_is_the_brick(&Folder::new("padded").load("a.stl", padded).unwrap());
}

#[test]
fn text_may_follow_the_end_of_an_stl() {
    let folder = Folder::new("after");
    let text = stl_text(&brick());
    for other in [
        text.replace("endsolid brick\n", "end solid brick\n"),
        text.clone() + "; written by hand\n",
        text.clone() + "\n# 12 triangles\n",
    ] {
        assert_is_the_brick(&folder.load("a.stl", other).unwrap());
    }
}

#[test]
fn lines_of_an_obj_may_end_as_on_several_systems_at_once() {
    let folder = Folder::new("ends");
    let text = obj(&brick());
    for count in [1, 8, 15] {
        let mixed = text.replacen('\n', "\r", count);
        assert_is_the_brick(&folder.load("a.obj", mixed).unwrap());
        let mixed = text.replacen('\n', "\r\n", count);
        assert_is_the_brick(&folder.load("a.obj", mixed).unwrap());
    }
    let first = text.find("\nf ").unwrap();
    let mixed = format!("{}\r{}", &text[..first], &text[first + 1..]);
    assert_is_the_brick(&folder.load("a.obj", mixed).unwrap());
}

#[test]
fn words_behind_a_vertex_are_refused() {
    let text = obj(&brick());
    let first = text.find("\nf ").unwrap();
    let glued = format!("{} {}", &text[..first], &text[first + 1..]);
    assert_refused("glued.obj", glued, "line 11 has `f` behind its vertex");
}

#[test]
fn rotations_of_gltf_nodes_are_scaled_to_unit_length() {
    let folder = Folder::new("rotations");
    let y_up = mapped(&brick(), |[x, y, z]| [x, z, -y]);
    let buffer = gltf_buffer(&y_up);
    let load = |rotation: &str| {
        let node = format!(r#"{{"mesh":0,"rotation":{rotation}}}"#);
        folder.load("a.glb", glb(&gltf(&y_up, "", &node), &buffer))
    };
    assert_is_the_brick(&load("[0,0,0,1]").unwrap());
    assert_is_the_brick(&load("[0,0,0,-3.5]").unwrap());
    // a quarter turn about the file's y, which is our z
    for rotation in [
        "[0,0.70710678,0,0.70710678]",
        "[0,2,0,2]",
        "[0,1e-3,0,1e-3]",
    ] {
        let [low, high] = load(rotation).unwrap().triangles.extent();
        for (actual, expected) in low
            .iter()
            .chain(&high)
            .zip([-0.5, 0.0, 0.0, 0.0, 1.0, 0.25])
        {
            assert!((actual - expected).abs() < 1e-6, "{low:?} to {high:?}");
        }
    }
    let error = load("[0,0,0,0]").unwrap_err().to_string();
    assert!(
        error.contains("the rotation of a node is 0 0 0 0"),
        "{error}"
    );
}

#[test]
fn shapes_that_gltf_makes_of_a_mesh_are_refused_or_noted() {
    let folder = Folder::new("made");
    let y_up = mapped(&brick(), |[x, y, z]| [x, z, -y]);
    let buffer = gltf_buffer(&y_up);
    let plain = gltf(&y_up, "", r#"{"mesh":0}"#);
    let blended = plain
        .replace(
            "\"indices\":1",
            "\"indices\":1,\"targets\":[{\"POSITION\":0}]",
        )
        .replace("[{\"mesh\":0}]", "[{\"mesh\":0,\"weights\":[0.5]}]");
    assert_refused("blend.glb", glb(&blended, &buffer), "morph targets");
    let still = blended.replace("[0.5]", "[0.0]");
    assert_is_the_brick(&folder.load("still.glb", glb(&still, &buffer)).unwrap());
    let used = |extension: &str, key: &str| {
        plain.replacen('{', &format!("{{\"{key}\":[\"{extension}\"],"), 1)
    };
    assert_refused(
        "copies.glb",
        glb(&used("EXT_mesh_gpu_instancing", "extensionsUsed"), &buffer),
        "it repeats meshes by the extension EXT_mesh_gpu_instancing",
    );
    assert_refused(
        "packed.glb",
        glb(
            &used("KHR_mesh_quantization", "extensionsRequired"),
            &buffer,
        ),
        "it needs the extension KHR_mesh_quantization; export it without",
    );
    // the joints of a skin place a mesh, and its node does not
    let skin = gltf(&y_up, "", r#"{"mesh":0,"skin":0,"scale":[3,3,3]},{}"#).replacen(
        '{',
        "{\"skins\":[{\"joints\":[1]}],",
        1,
    );
    let mesh = folder.load("skin.glb", glb(&skin, &buffer)).unwrap();
    assert_is_the_brick(&mesh);
    assert!(mesh.notes.iter().any(|note| note.contains("has a skin")));
}

#[test]
fn a_file_of_another_format_is_called_by_its_own() {
    let binary = stl(&brick());
    let collada = dae(&brick(), Z_UP, PLAIN);
    let (text, wavefront) = (stl_text(&brick()), obj(&brick()));
    let cases: [(&str, &[u8], &str); 11] = [
        ("a.obj", &binary, "it is STL; end its name in .stl"),
        ("a.dae", &binary, "it is STL; end its name in .stl"),
        ("a.glb", text.as_bytes(), "it is STL; end"),
        (
            "b.stl",
            wavefront.as_bytes(),
            "it is Wavefront OBJ; end its name in .obj",
        ),
        (
            "c.stl",
            collada.as_bytes(),
            "it is COLLADA; end its name in .dae",
        ),
        (
            "d.obj",
            b"ply\nformat ascii 1.0\n",
            "it is PLY: `.ply` is not read",
        ),
        (
            "e.stl",
            b"version https://git-lfs.github.com/spec/v1\noid",
            "run `git lfs pull`",
        ),
        (
            "f.dae",
            b"version https://git-lfs.github.com/spec/v1\noid",
            "run `git lfs pull`",
        ),
        (
            "g.obj",
            b"\n\n<!DOCTYPE html><html>",
            "this is a web page, not the file",
        ),
        (
            "h.stl",
            b"\x1f\x8b\x08\0\0\0\0\0",
            "this is compressed by gzip",
        ),
        ("i.obj", b"PK\x03\x04\x14\0\0\0", "this is a ZIP archive"),
    ];
    for (name, bytes, reason) in cases {
        assert_refused(name, bytes, reason);
    }
}

#[test]
fn a_buffer_of_gltf_may_have_a_blank_in_its_name() {
    let folder = Folder::new("blank");
    let y_up = mapped(&brick(), |[x, y, z]| [x, z, -y]);
    folder.put("my brick.bin", gltf_buffer(&y_up));
    for name in ["my%20brick.bin", "my brick.bin"] {
        let text = gltf(&y_up, &format!("\"uri\":\"{name}\","), r#"{"mesh":0}"#);
        assert_is_the_brick(&folder.load("a.gltf", text).unwrap());
    }
    let outside = gltf(&y_up, "\"uri\":\"%2e%2e/a.bin\",", r#"{"mesh":0}"#);
    assert_refused("outside.gltf", outside, "is not a file beside it");
}

#[test]
fn a_file_of_materials_that_many_lines_name_is_read_once() {
    let folder = Folder::new("libraries");
    folder.put("a.mtl", "newmtl a\nKd 1 0 0\n".repeat(20_000));
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    // the second loop names a file anew in each line
    let same = "mtllib a.mtl\n".repeat(20_000);
    let other: String = (0..20_000)
        .map(|k| format!("mtllib {}a.mtl\n", "./".repeat(1 + k % 200)))
        .collect();
    for lines in [same, other] {
        let path = folder.put("a.obj", format!("{lines}{triangle}"));
        let start = Instant::now();
        let mesh = VisualMesh::load(&path, false).unwrap();
        assert!(
            start.elapsed() < Duration::from_secs(5),
            "{:?}",
            start.elapsed()
        );
        assert_eq!(mesh.colors, [Some([255, 0, 0, 255])]);
    }
}
