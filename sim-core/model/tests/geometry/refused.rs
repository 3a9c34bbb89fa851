//! Files that no mesh can be made of: each is refused at once, with a reason and a cure.

use std::time::{Duration, Instant};

use crate::files::{
    Folder, PLAIN, brick, dae, glb, gltf, gltf_buffer, mapped, obj, refusal, stl, stl_text,
};

const Z_UP: &str = "<up_axis>Z_UP</up_axis>";

#[track_caller]
fn assert_refused(name: &str, bytes: impl AsRef<[u8]>, parts: &[&str]) {
    let start = Instant::now();
    let message = refusal(name, bytes);
    assert!(start.elapsed() < Duration::from_secs(1));
    for part in parts.iter().chain(&[name]) {
        assert!(message.contains(part), "`{part}` is not said in: {message}");
    }
}

#[test]
fn a_mesh_that_cannot_be_used_names_robot_link_and_file() {
    let folder = Folder::new("names");
    folder.put("hand.stl", b"");
    let message = folder.robot("hand.stl", "").unwrap_err().to_string();
    assert!(
        message.contains("r.urdf") && message.contains("robot `r`: link `hand`: mesh "),
        "{message}"
    );
    assert!(
        message.contains("hand.stl: it is empty; export it again"),
        "{message}"
    );
}

#[test]
fn unknown_endings_and_things_that_are_no_files_are_refused() {
    assert_refused("a.step", "x", &["`.step` is not read", ".stl, .obj, .dae"]);
    assert_refused("mesh", "x", &["no ending"]);
    let folder = Folder::new("folder");
    std::fs::create_dir(folder.as_ref().join("a.stl")).unwrap();
    let message = sim_model::geometry::Mesh::load(
        &folder.as_ref().join("a.stl"),
        [1.0; 3],
        &Default::default(),
    )
    .unwrap_err()
    .to_string();
    assert!(message.contains("it is not a file"), "{message}");
}

#[test]
fn broken_stl_is_refused() {
    let whole = stl(&brick());
    assert_refused(
        "cut.stl",
        &whole[..whole.len() - 60],
        &["tells of 12 triangles, but it holds 10", "cut short"],
    );
    assert_refused("short.stl", [1; 70], &["70 bytes", "at least 84"]);
    let mut boast = whole.clone();
    boast[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_refused("boast.stl", &boast, &["4294967295 triangles"]);
    let mut none = whole[..84].to_vec();
    none[80..84].fill(0);
    assert_refused("none.stl", &none, &["holds no triangles"]);
    let mut nan = whole;
    nan[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_refused("nan.stl", &nan, &["coordinate NaN", "finite"]);
    let text = stl_text(&brick());
    assert_refused(
        "cut-text.stl",
        &text[..text.len() / 2],
        &["ends before `endsolid`"],
    );
    assert_refused(
        "word.stl",
        text.replacen("vertex 0e0", "vertex zero", 1),
        &["line 4 is not `vertex` and three numbers"],
    );
    assert_refused(
        "two.stl",
        text.replacen("  endloop", "   vertex 1 2 3\n  endloop", 1),
        &["line 8 has 4 corners"],
    );
}

#[test]
fn broken_obj_is_refused_with_its_line() {
    assert_refused(
        "far.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
        &["line 4", "`4`"],
    );
    assert_refused(
        "zero.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
        &["line 4", "`0`"],
    );
    assert_refused(
        "back.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n",
        &["line 4", "`-4`"],
    );
    assert_refused(
        "word.obj",
        "v 0 0\n",
        &["line 1 is not `v` and three numbers"],
    );
    assert_refused("none.obj", "v 0 0 0\nl 1 1\n", &["holds no triangles"]);
    assert_refused("noise.obj", [0xff_u8; 4096], &["holds no triangles"]);
}

#[test]
fn meshes_without_area_or_size_are_refused() {
    let line = mapped(&brick(), |[x, _, _]| [x, 0.0, 0.0]);
    assert_refused("line.obj", obj(&line), &["without area"]);
    let giant = mapped(&brick(), |p| p.map(|x| 1e300 * x));
    assert_refused("giant.obj", obj(&giant), &["coordinate", "at most 1e9"]);
    let city = mapped(&brick(), |p| p.map(|x| 1e8 * x));
    assert_refused("city.obj", obj(&city), &["its size is", "mend the scale"]);
    let dust = mapped(&brick(), |p| p.map(|x| 1e-9 * x));
    assert_refused("dust.obj", obj(&dust), &["its size is", "mend the scale"]);
}

#[test]
fn a_flat_mesh_is_refused_only_where_its_mass_is_needed() {
    let folder = Folder::new("flat");
    folder.put(
        "sheet.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    );
    let message = folder.robot("sheet.obj", "").unwrap_err().to_string();
    for part in ["`hand`", "sheet.obj", "lies in a plane", "<inertial>"] {
        assert!(message.contains(part), "{message}");
    }
    let inertial = "<inertial><mass value=\"3\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
    folder.robot("sheet.obj", inertial).unwrap();
}

#[test]
fn broken_collada_is_refused() {
    let whole = dae(&brick(), Z_UP, PLAIN);
    assert_refused("cut.dae", &whole[..whole.len() / 2], &["broken XML"]);
    assert_refused("other.dae", "<html/>", &["<html>, not <COLLADA>"]);
    assert_refused(
        "bomb.dae",
        format!("<!DOCTYPE a [<!ENTITY b \"c\">]>{whole}"),
        &["DTD"],
    );
    assert_refused(
        "unit.dae",
        dae(&brick(), "<unit meter=\"0\"/>", PLAIN),
        &["<unit meter>"],
    );
    assert_refused(
        "axis.dae",
        dae(&brick(), "<up_axis>W_UP</up_axis>", PLAIN),
        &["`W_UP`", "Z_UP"],
    );
    assert_refused(
        "index.dae",
        whole.replace("<p>0 0 ", "<p>0 8 "),
        &["index in <p> is 8", "8 vertices"],
    );
    assert_refused(
        "word.dae",
        whole.replace("<p>0 0 ", "<p>0 x "),
        &["`x` in <p>"],
    );
    assert_refused(
        "lost.dae",
        whole.replace("url=\"#mesh\"", "url=\"#ghost\""),
        &["#ghost", "refers to nothing"],
    );
    assert_refused(
        "count.dae",
        whole.replace("count=\"8\"", "count=\"9\""),
        &["9 points, there are 8"],
    );
    let skew = "<node><skew>1 2 3 4 5 6 7</skew><instance_geometry url=\"#mesh\"/></node>";
    assert_refused("skew.dae", dae(&brick(), Z_UP, skew), &["<skew>"]);
    let short = "<node><matrix>1 0 0</matrix><instance_geometry url=\"#mesh\"/></node>";
    assert_refused(
        "matrix.dae",
        dae(&brick(), Z_UP, short),
        &["<matrix>", "3 numbers"],
    );
}

#[test]
fn collada_nodes_that_stand_for_billions_are_refused() {
    let itself = "<node id=\"n0\"><instance_node url=\"#n0\"/></node>";
    assert_refused(
        "loop.dae",
        dae(&brick(), Z_UP, itself),
        &["nest deeper than"],
    );
    // each level shows the one below ten times: 10^12 in all
    let level = |n: usize| {
        let below = format!("<instance_node url=\"#n{}\"/>", n - 1).repeat(10);
        format!("<node id=\"n{n}\">{below}</node>")
    };
    let levels: String = (1..=12).map(level).collect();
    assert_refused(
        "empty.dae",
        dae(&brick(), Z_UP, &format!("<node id=\"n0\"/>{levels}")),
        &["simplify the scene"],
    );
    let full = format!("<node id=\"n0\"><instance_geometry url=\"#mesh\"/></node>{levels}");
    assert_refused("full.dae", dae(&brick(), Z_UP, &full), &["simplify"]);
    // a tower of elements, not of scene nodes
    let tower = "<extra>".repeat(20_000) + &"</extra>".repeat(20_000);
    Folder::new("tower")
        .load("a.dae", dae(&brick(), Z_UP, &(tower + PLAIN)))
        .unwrap();
}

#[test]
fn broken_gltf_is_refused() {
    let (mesh, node) = (brick(), r#"{"mesh":0}"#);
    let (json, buffer) = (gltf(&mesh, "", node), gltf_buffer(&mesh));
    let whole = glb(&json, &buffer);
    let (all, json_end) = (whole.len(), whole.len() - 8 - buffer.len());
    let headed = |length: usize, rest: &[u8]| {
        let length = (length as u32).to_le_bytes();
        [&whole[..8], &length, rest].concat()
    };
    let cut = [
        (
            whole[..all - 40].to_vec(),
            format!("it should have {all} bytes and has {}; copy", all - 40),
        ),
        (
            whole[..8].to_vec(),
            "it should have 12 bytes and has 8; copy".to_owned(),
        ),
        (
            headed(11, &whole[12..]),
            "its header declares 11 bytes, fewer than its own 12; export".to_owned(),
        ),
        (
            headed(12, &[]),
            "its JSON part should have 8 bytes and has 0; copy".to_owned(),
        ),
        (
            headed(100, &whole[12..100]),
            format!(
                "its JSON part should have {} bytes and has 88; copy",
                json_end - 12
            ),
        ),
        (
            headed(json_end + 3, &whole[12..json_end + 3]),
            "its binary part should have 8 bytes and has 3; copy".to_owned(),
        ),
        (
            headed(all - 40, &whole[12..all - 40]),
            format!(
                "its binary part should have {} bytes and has {}; copy",
                all - json_end,
                all - json_end - 40
            ),
        ),
    ];
    for (bytes, message) in cut {
        assert_refused("cut.glb", bytes, &[&message]);
    }
    let first = [&whole[..4], &1_u32.to_le_bytes(), &whole[8..]].concat();
    assert_refused("first.glb", first, &["is not glTF 2.0", "version"]);
    assert_refused("word.gltf", "{", &["is not glTF 2.0"]);
    assert_refused(
        "short.glb",
        glb(&json, &buffer[..40]),
        &["should have 240 bytes and has 40"],
    );
    let count = json.replace("\"count\":8", "\"count\":4294967295");
    assert_refused(
        "boast.glb",
        glb(&count, &buffer),
        &["more than 12000000 vertices"],
    );
    let nine = json.replace("\"count\":8", "\"count\":9");
    assert_refused("nine.glb", glb(&nine, &buffer), &["shorter than it tells"]);
    let view = json.replace("\"byteOffset\":96", "\"byteOffset\":200");
    assert_refused("view.glb", glb(&view, &buffer), &["shorter than it tells"]);
    let positions = json.replace("\"POSITION\":0", "\"POSITION\":2");
    assert_refused(
        "positions.glb",
        glb(&positions, &buffer),
        &["positions in accessor 2, and there are 2"],
    );
    let mut index = buffer.clone();
    index[96..100].copy_from_slice(&8_u32.to_le_bytes());
    assert_refused("index.glb", glb(&json, &index), &["an index is 8"]);
    let ring = gltf(&mesh, "", r#"{"mesh":0,"children":[0]}"#);
    assert_refused("ring.glb", glb(&ring, &buffer), &["nest deeper than"]);
    for uri in [
        "../a.bin",
        "/etc/passwd",
        "file:///etc/passwd",
        "http://x/a.bin",
    ] {
        let outside = gltf(&mesh, &format!("\"uri\":\"{uri}\","), node);
        assert_refused("outside.gltf", outside, &[uri, "not a file beside it"]);
    }
    let draco = json.replace(
        "{\"asset\"",
        "{\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],\"asset\"",
    );
    assert_refused(
        "draco.glb",
        glb(&draco, &buffer),
        &["KHR_draco_mesh_compression"],
    );
}
