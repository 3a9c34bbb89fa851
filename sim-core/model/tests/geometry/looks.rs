//! What mesh files look like: colours and images of their materials, on the triangles that collisions have.

use std::path::Path;

use sim_model::geometry::{
    Color, Image, Mesh, MeshOptions, TRIANGLES_SHOWN_MAX, TriMesh, VisualMesh,
};

use crate::files::{
    Folder, PLAIN, brick, dae, glb, gltf, gltf_buffer, inside_out, joined, mapped, obj, stl,
};

const RED: Color = [255, 0, 0, 255];
const GREEN: Color = [0, 255, 0, 255];
const Z_UP: &str = "<up_axis>Z_UP</up_axis>";
/// Two triangles, each with texture coordinates of its own.
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

fn look(path: &Path) -> VisualMesh {
    VisualMesh::load(path, true).unwrap_or_else(|error| panic!("{error}"))
}

#[track_caller]
fn file_of(image: &Image) -> &Path {
    match image {
        Image::File(path) => path,
        Image::Bytes(_) => panic!("the image lies in the file"),
    }
}

#[test]
fn looks_lie_where_collisions_do() {
    let folder = Folder::new("looks-places");
    let whole = brick();
    let buffer = gltf_buffer(&whole);
    let two = r#"{"mesh":0,"children":[1]},{"mesh":0,"translation":[1,2,3],"scale":[1,-1,2]}"#;
    let turned = "<node><translate>1 2 3</translate><rotate>0 1 0 30</rotate><scale>1 -2 1</scale>\
        <instance_geometry url=\"#mesh\"/></node>";
    let files: [(&str, Vec<u8>); 4] = [
        ("a.stl", stl(&whole)),
        ("a.obj", obj(&whole).into()),
        ("a.dae", dae(&whole, "<unit meter=\"0.1\"/>", turned).into()),
        ("a.glb", glb(&gltf(&whole, "", two), &buffer)),
    ];
    for (name, bytes) in files {
        let path = folder.put(name, bytes);
        let physics = Mesh::load(&path, [1.0; 3], &MeshOptions::default()).unwrap();
        let seen = look(&path);
        let seen_as = TriMesh {
            vertices: seen.vertices.iter().map(|v| v.map(f64::from)).collect(),
            triangles: seen.triangles.clone(),
        };
        assert_eq!(seen.vertices.len(), physics.triangles.vertices.len());
        assert_eq!(seen.triangles.len(), physics.triangles.triangles.len());
        let (a, b) = (seen_as.signed_volume(), physics.triangles.signed_volume());
        assert!((a - b).abs() < 1e-5 * b, "{name}: {a} {b}");
        for (a, b) in seen_as.extent().iter().zip(physics.triangles.extent()) {
            for axis in 0..3 {
                assert!((a[axis] - b[axis]).abs() < 1e-6, "{name}: {a:?} {b:?}");
            }
        }
        assert!(seen.colors.iter().all(Option::is_none), "{name}");
        assert!(seen.textures.is_empty());
    }
}

#[test]
fn mtl_colours_the_faces_that_use_it() {
    let folder = Folder::new("looks-mtl");
    folder.put(
        "two of it.mtl",
        "# materials\nnewmtl red one\nKd 1 0 0\nnewmtl glass\n\tKd 0.2 0.4 1.0\nTr 0.75\n\
         newmtl slip\nKd 0 1 0\nd 0\nnewmtl grey\nKd 0.5\nnewmtl bare\nKs 1 1 1\n",
    );
    let mut text = format!("mtllib two of it.mtl\n{SQUARE}");
    for material in ["red one", "glass", "slip", "grey", "bare", "unknown"] {
        text += &format!("usemtl {material}\nf 1 2 3\nf 3 4 1\n");
    }
    let seen = look(&folder.put("a.obj", text));
    let expected = [
        Some(RED),
        Some([51, 102, 255, 64]),
        // what would be invisible is meant to be opaque
        Some(GREEN),
        Some([128, 128, 128, 255]),
        None,
        None,
    ];
    for (index, color) in seen.colors.iter().enumerate() {
        assert_eq!(*color, expected[index / 2], "triangle {index}");
    }
}

#[test]
fn images_of_an_mtl_are_named_with_the_faces_places_in_them() {
    let folder = Folder::new("looks-map");
    folder.put("a b.png", "");
    folder.put("c.png", "");
    folder.put(
        "a.mtl",
        "newmtl a\nKd 0 1 0\nd 0.5\nmap_Kd a b.png\nnewmtl c\nmap_Kd -s 1 1 1 c.png\n\
         newmtl lost\nmap_Kd sub\\lost.png\n",
    );
    let text = format!(
        "mtllib a.mtl\n{SQUARE}usemtl a\nf 1/1 2/2 3/3 4/4\nusemtl c\nf 1 3 2\nusemtl lost\nf -4/-1 -2/-2 -1/-3\n"
    );
    let seen = look(&folder.put("a.obj", text));
    let [a, c, lost] = &seen.textures[..] else {
        panic!("{:?}", seen.textures)
    };
    assert_eq!(file_of(&a.image), folder.as_ref().join("a b.png"));
    assert_eq!(a.triangles, [0, 1]);
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let fan = [[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|corner| corners[corner]));
    assert_eq!(a.uv.as_deref(), Some(&fan[..]));
    assert_eq!(a.tints, [[255, 255, 255, 128]; 2]);
    // the colour is there for where the image is not
    assert_eq!(seen.colors[0], Some([0, 255, 0, 128]));
    assert_eq!(file_of(&c.image), folder.as_ref().join("c.png"));
    assert_eq!((&c.uv, seen.colors[2]), (&None, None));
    assert_eq!(file_of(&lost.image), folder.as_ref().join("sub/lost.png"));
    assert_eq!(
        lost.uv.as_deref(),
        Some(&[[corners[3], corners[2], corners[1]]][..])
    );
}

#[test]
fn vertices_of_an_obj_may_have_colours() {
    let folder = Folder::new("looks-vertices");
    let text = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 0 0\nv 1 1 0\nf 1 2 3\n";
    let seen = look(&folder.put("a.obj", text));
    assert_eq!(seen.colors, [Some([170, 0, 0, 255])]);
    // a weight is no colour, and what only some vertices have is none
    let text = text
        .replace("f 1", "f 2 4 3\nf 1")
        .replace("v 1 1 0", "v 1 1 0 0.5");
    let seen = look(&folder.put("a.obj", text));
    assert_eq!(seen.colors, [None, None]);
}

/// A COLLADA file whose parts have the symbol `s`, with these libraries of effects and materials, shown by these nodes.
fn painted(effects: &str, nodes: &str) -> String {
    let materials = "<library_materials><material id=\"m\"><instance_effect url=\"#e\"/></material>\
        <material id=\"other\"><instance_effect url=\"#f\"/></material></library_materials>";
    dae(&brick(), Z_UP, nodes)
        .replace("<triangles ", "<triangles material=\"s\" ")
        .replace(
            "<library_geometries>",
            &format!("<library_effects>{effects}</library_effects>{materials}<library_geometries>"),
        )
}

fn effect(id: &str, shader: &str) -> String {
    format!(
        "<effect id=\"{id}\"><profile_COMMON>\
         <newparam sid=\"surface\"><surface type=\"2D\"><init_from>i</init_from></surface></newparam>\
         <newparam sid=\"sampler\"><sampler2D><source>surface</source></sampler2D></newparam>\
         <newparam sid=\"new\"><sampler2D><instance_image url=\"#i\"/></sampler2D></newparam>\
         <newparam sid=\"pale\"><float4>0.2 0.4 0.6 1</float4></newparam>\
         <technique sid=\"t\"><lambert>{shader}</lambert></technique></profile_COMMON></effect>"
    )
}

fn bound(material: &str) -> String {
    format!(
        "<node><instance_geometry url=\"#mesh\"><bind_material><technique_common>\
         <instance_material symbol=\"s\" target=\"#{material}\"/></technique_common></bind_material>\
         </instance_geometry></node>"
    )
}

#[test]
fn collada_materials_have_colour_and_opacity() {
    let folder = Folder::new("looks-dae");
    let see = |shader: &str| {
        let text = painted(&effect("e", shader), &bound("m"));
        look(&folder.put("a.dae", text))
    };
    let red = "<diffuse><color>1 0 0 1</color></diffuse>";
    let cases = [
        (red.to_owned(), Some(RED)),
        // an alpha of the diffuse colour says nothing
        (
            "<diffuse><color>0 1 0 0</color></diffuse>".into(),
            Some(GREEN),
        ),
        (
            "<diffuse><param ref=\"pale\"/></diffuse>".into(),
            Some([51, 102, 153, 255]),
        ),
        (
            format!(
                "{red}<transparent><color>1 1 1 0.4</color></transparent><transparency><float>0.5</float></transparency>"
            ),
            Some([255, 0, 0, 51]),
        ),
        (
            format!(
                "{red}<transparent opaque=\"RGB_ZERO\"><color>0.6 0.6 0.6 1</color></transparent>\
                 <transparency><float>1</float></transparency>"
            ),
            Some([255, 0, 0, 102]),
        ),
        (
            format!(
                "{red}<transparent><color>0 0 0 1</color></transparent><transparency><float>0</float></transparency>"
            ),
            Some(RED),
        ),
        (String::new(), None),
    ];
    for (shader, color) in cases {
        let seen = see(&shader);
        assert!(
            seen.colors.iter().all(|actual| *actual == color),
            "{shader}: {:?}",
            seen.colors
        );
        assert!(seen.notes.is_empty() && seen.textures.is_empty());
    }
    // broken in one way or another: the shape is there, and a note
    for shader in [
        "<diffuse><color>red</color></diffuse>",
        "<diffuse/>",
        "<diffuse><texture texture=\"sampler\"/></diffuse>",
        "<diffuse><texture/></diffuse>",
    ] {
        let seen = see(shader);
        assert!(seen.colors.iter().all(Option::is_none), "{shader}");
        assert!(
            seen.notes.len() == 1 && seen.notes[0].contains("materials that are broken"),
            "{shader}: {:?}",
            seen.notes
        );
    }
}

#[test]
fn each_instance_of_a_geometry_has_its_own_material() {
    let folder = Folder::new("looks-bound");
    let effects = effect("e", "<diffuse><color>1 0 0 1</color></diffuse>")
        + &effect("f", "<diffuse><color>0 1 0 1</color></diffuse>");
    let nodes = [
        bound("m"),
        format!(
            "<node><translate>2 0 0</translate>{}</node>",
            bound("other")
        ),
        format!("<node><translate>4 0 0</translate>{PLAIN}</node>"),
        format!("<node><translate>6 0 0</translate>{}</node>", bound("none")),
    ];
    let seen = look(&folder.put("a.dae", painted(&effects, &nodes.concat())));
    assert_eq!(seen.colors.len(), 48);
    for (color, expected) in seen
        .colors
        .chunks(12)
        .zip([Some(RED), Some(GREEN), None, None])
    {
        assert!(color.iter().all(|actual| *actual == expected));
    }
    assert_eq!(seen.notes.len(), 1);
}

#[test]
fn images_of_a_collada_file_are_found_by_any_of_their_ways() {
    let folder = Folder::new("looks-images");
    for (texture, init) in [
        ("sampler", "<init_from> ../skins/a b.png </init_from>"),
        ("new", "<init_from><ref>../skins/a b.png</ref></init_from>"),
        ("i", "<init_from>../skins\\a b.png</init_from>"),
    ] {
        let shader = format!("<diffuse><texture texture=\"{texture}\" texcoord=\"UV\"/></diffuse>");
        let images = format!("<library_images><image id=\"i\">{init}</image></library_images>");
        let text = painted(&effect("e", &shader), &bound("m"))
            .replace("<library_effects>", &format!("{images}<library_effects>"));
        let plain = look(&folder.put("plain.dae", &text));
        assert_eq!(plain.textures.len(), 1, "{texture}");
        assert_eq!(plain.textures[0].uv, None);
        // its points, of which x and y are taken, as texture coordinates, mirrored with their corners
        let text = text
            .replace(
                "semantic=\"NORMAL\" offset=\"0\"",
                "semantic=\"TEXCOORD\" offset=\"1\"",
            )
            .replace("<node>", "<node><scale>1 1 -1</scale>");
        let seen = look(&folder.put("a.dae", text));
        let [texture] = &seen.textures[..] else {
            panic!()
        };
        assert_eq!(
            file_of(&texture.image),
            folder.as_ref().join("../skins/a b.png")
        );
        assert_eq!(texture.tints, [[255; 4]; 12]);
        assert!(seen.colors.iter().all(Option::is_none));
        for (triangle, uv) in texture.triangles.iter().zip(texture.uv.as_ref().unwrap()) {
            let corners = seen.triangles[*triangle as usize];
            let places = corners.map(|corner| seen.vertices[corner as usize]);
            assert_eq!(places.map(|[x, y, _]| [x, y]), *uv);
        }
    }
}

#[test]
fn vertex_colours_of_a_collada_file_count_where_no_material_does() {
    let folder = Folder::new("looks-colours");
    let effects = effect("e", "<diffuse><color>1 0 0 1</color></diffuse>");
    let nodes = PLAIN.to_owned() + &bound("m").replace("<node>", "<node><scale>1 1 -1</scale>");
    // the brick's coordinates as red, green and blue
    let text = painted(&effects, &nodes).replace(
        "semantic=\"NORMAL\" offset=\"0\"",
        "semantic=\"COLOR\" offset=\"1\"",
    );
    let seen = look(&folder.put("a.dae", text));
    let (vertex_colors, red) = seen.colors.split_at(12);
    for (color, corners) in vertex_colors.iter().zip(&seen.triangles) {
        let places = corners.map(|corner| seen.vertices[corner as usize]);
        let mean = |axis: usize| places.iter().map(|place| place[axis]).sum::<f32>() / 3.0;
        let expected = [0, 1, 2].map(|axis| (255.0 * mean(axis)).round());
        let [r, g, b, opacity] = color.unwrap();
        for (channel, expected) in [r, g, b].into_iter().zip(expected) {
            assert!((f32::from(channel) - expected).abs() <= 1.0);
        }
        assert_eq!(opacity, 255);
    }
    assert!(red.iter().all(|color| *color == Some(RED)));
}

/// The brick in glTF with more attributes: four numbers a vertex of this kind, and a material.
fn gltf_with(attributes: &str, material: &str, numbers: &[u8], kind: &str) -> Vec<u8> {
    let whole = brick();
    let mut buffer = gltf_buffer(&whole);
    let start = buffer.len();
    buffer.extend(numbers);
    let json = gltf(&whole, "", r#"{"mesh":0}"#)
        .replace("\"POSITION\":0", &format!("\"POSITION\":0{attributes}"))
        .replace("\"indices\":1", &format!("\"indices\":1{}", if material.is_empty() { "" } else { ",\"material\":0" }))
        .replace(&format!("\"byteLength\":{start}}}],"), &format!("\"byteLength\":{}}}],{material}", buffer.len()))
        .replace(
            "}],\n        \"accessors\":[",
            &format!(
                "}},{{\"buffer\":0,\"byteOffset\":{start},\"byteLength\":{}}}],\n\"accessors\":[{{\"bufferView\":2,\"count\":8,{kind}}},",
                numbers.len()
            ),
        );
    // the new accessor is the first, so that the others move
    let json = json
        .replace("\"POSITION\":0", "\"POSITION\":1")
        .replace("\"indices\":1", "\"indices\":2");
    glb(&json, &buffer)
}

const U8_COLORS: &str = r#""componentType":5121,"normalized":true,"type":"VEC4""#;
const F32_PLACES: &str = r#""componentType":5126,"type":"VEC2""#;

#[test]
fn gltf_colours_are_proportional_to_light() {
    let folder = Folder::new("looks-gltf");
    let half = [255, 0, 0, 255].repeat(4);
    let numbers: Vec<u8> = half
        .into_iter()
        .chain([255, 255, 0, 51].repeat(4))
        .collect();
    let factor = r#""materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0.5,0,1,0.2]}}],"#;
    let see = |attributes: &str, material: &str| {
        let bytes = gltf_with(attributes, material, &numbers, U8_COLORS);
        look(&folder.put("a.glb", bytes)).colors
    };
    // half the light is 188 of 255 on a screen
    assert!(
        see("", factor)
            .iter()
            .all(|color| *color == Some([188, 0, 255, 51]))
    );
    assert!(
        see("", r#""materials":[{}],"#)
            .iter()
            .all(|color| *color == Some([255; 4]))
    );
    assert!(see("", "").iter().all(Option::is_none));
    let vertex_colors = see(",\"COLOR_0\":0", "");
    // four vertices are red and four yellow, of which some triangles have all three
    let top = |color: &Option<Color>| color.is_some_and(|color| color[0] == 255 && color[2] == 0);
    assert!(vertex_colors.iter().all(top));
    assert!(
        vertex_colors.contains(&Some(RED)) && vertex_colors.contains(&Some([255, 255, 0, 51])),
        "{vertex_colors:?}"
    );
    let both = see(",\"COLOR_0\":0", factor);
    assert!(both.contains(&Some([188, 0, 0, 51])), "{both:?}");
}

#[test]
fn gltf_images_lie_in_the_file_or_beside_it() {
    let folder = Folder::new("looks-gltf-images");
    let places: Vec<u8> = [0.25_f32, 0.125]
        .repeat(8)
        .into_iter()
        .flat_map(f32::to_le_bytes)
        .collect();
    let see = |image: &str, attributes: &str| {
        let material = format!(
            r#""materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,0.2],"baseColorTexture":{{"index":0}}}}}}],
            "textures":[{{"source":0}}],"images":[{{{image}}}],"#
        );
        let bytes = gltf_with(attributes, &material, &places, F32_PLACES);
        look(&folder.put("a.glb", bytes)).textures
    };
    let [inside] = &see(
        r#""bufferView":2,"mimeType":"image/png""#,
        ",\"TEXCOORD_0\":0",
    )[..] else {
        panic!()
    };
    assert_eq!(inside.image, Image::Bytes(places.clone()));
    // glTF counts from the top
    assert_eq!(inside.uv.as_deref(), Some(&[[[0.25, 0.875]; 3]; 12][..]));
    assert_eq!(inside.tints, [[255, 255, 255, 51]; 12]);
    let [written] = &see(r#""uri":"data:image/png;base64,aGVsbG8=""#, "")[..] else {
        panic!()
    };
    assert_eq!(
        (&written.image, &written.uv),
        (&Image::Bytes(b"hello".to_vec()), &None)
    );
    let [beside] = &see(r#""uri":"skin.png""#, "")[..] else {
        panic!()
    };
    assert_eq!(file_of(&beside.image), folder.as_ref().join("skin.png"));
    assert!(see(r#""uri":"data:image/png,broken""#, "").is_empty());
    // what an image should say of itself, and does not
    let untyped = see(r#""bufferView":2"#, "");
    assert_eq!(untyped[0].image, Image::Bytes(places.clone()));
    assert!(see(r#""name":"nowhere""#, "").is_empty());
}

#[test]
fn too_many_triangles_are_shown_with_fewer() {
    let folder = Folder::new("looks-thin");
    // bricks in rows, the first half of them red
    let (count, row) = (TRIANGLES_SHOWN_MAX / 12 + 1000, 133);
    folder.put("a.mtl", "newmtl a\nKd 1 0 0\n");
    let bricks: Vec<TriMesh> = (0..count)
        .map(|index| {
            let (across, along) = ((index % row) as f64, (index / row) as f64);
            mapped(&brick(), |[x, y, z]| [x + across, y + along, z])
        })
        .collect();
    let text = obj(&joined(&bricks)).replace("mtllib none.mtl", "mtllib a.mtl\nusemtl a");
    let path = folder.put("a.obj", text);
    let seen = look(&path);
    assert!(seen.triangles.len() <= TRIANGLES_SHOWN_MAX);
    assert!(seen.triangles.len() > TRIANGLES_SHOWN_MAX / 100);
    let [note] = &seen.notes[..] else {
        panic!("{:?}", seen.notes)
    };
    assert!(
        note.starts_with("has 211,992 triangles and is shown with "),
        "{note}"
    );
    let middle = (count / row) as f32 / 2.0;
    for (corners, color) in seen.triangles.iter().zip(&seen.colors) {
        let y = seen.vertices[corners[0] as usize][1];
        if (y - middle).abs() > 2.0 {
            assert_eq!(color.is_some(), y < middle, "{y}");
        }
    }
    let mesh = Mesh::load(&path, [1.0; 3], &MeshOptions::default()).unwrap();
    let (thin, told) = mesh.triangles.thinned();
    assert_eq!(thin.triangles.len(), seen.triangles.len());
    assert_eq!(told.as_ref(), Some(note));
    let (same, told) = brick().thinned();
    assert_eq!((same, told), (brick(), None));
}

#[test]
fn files_without_a_surface_are_refused_by_name() {
    let folder = Folder::new("looks-refused");
    for (name, bytes, reason) in [
        ("a.obj", "v 0 0 0\nv 1 0 0\nf 1 1 2\n", "without area"),
        ("b.obj", "v 0 0 0\n", "holds no triangles"),
        ("c.obj", "v 0 0 1e30\nf 1 1 1\n", "finite numbers"),
        ("d.blend", "", "`.blend` is not read"),
    ] {
        let error = VisualMesh::load(&folder.put(name, bytes), true).unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains(reason) && message.contains(name),
            "{message}"
        );
    }
    let turned = inside_out(&brick());
    let seen = look(&folder.put("inside.stl", stl(&turned)));
    // what is inside out to its author stays so: only collisions are mended
    let seen = TriMesh {
        vertices: seen.vertices.iter().map(|v| v.map(f64::from)).collect(),
        triangles: seen.triangles,
    };
    assert!(seen.signed_volume() < 0.0);
}
