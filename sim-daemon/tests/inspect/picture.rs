//! What is drawn.

use std::path::Path;

use super::{FR3, Folder, inspect, one_link, root};

/// Size of the page, and where its parts lie [pixels].
const PAGE: [usize; 2] = [1600, 1200];
/// Middle of the view from the side.
const SIDE: [usize; 2] = [1330, 259];
/// Radius of a ball that fills that view up to its margins.
const RADIUS: usize = 143;

type Rgb = [u8; 3];

struct Picture(Vec<Rgb>);

impl Picture {
    fn read(path: &Path) -> Picture {
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!([info.width as usize, info.height as usize], PAGE);
        assert_eq!(info.color_type, png::ColorType::Rgb);
        let (pixels, rest) = bytes.as_chunks::<3>();
        assert!(rest.is_empty());
        Picture(pixels.to_vec())
    }

    fn at(&self, x: usize, y: usize) -> Rgb {
        self.0[y * PAGE[0] + x]
    }

    fn colours(&self) -> usize {
        let mut colours = self.0.clone();
        colours.sort_unstable();
        colours.dedup();
        colours.len()
    }
}

/// The first link's colour in some light.
fn is_blue([red, _, blue]: Rgb) -> bool {
    blue > red.saturating_add(30) && blue > 90
}

/// Paper, with or without a line of its grid.
fn is_paper(colour: Rgb) -> bool {
    colour.iter().all(|&part| part > 215)
}

fn ball(radius: f64) -> String {
    format!("<collision><geometry><sphere radius=\"{radius}\"/></geometry></collision>")
}

#[test]
fn a_picture_is_written_only_where_it_is_asked_for() {
    let folder = Folder::new("default");
    folder.file("a.urdf", &one_link(".my robot:2", &ball(1.0)));
    for options in [&["a.urdf"][..], &["a.urdf", "--json"]] {
        let said = inspect(&folder.0, options);
        assert_eq!((said.code, said.err.as_str()), (0, ""));
        assert_eq!(folder.files(), ["a.urdf"]);
        assert!(!said.out.contains("Picture"), "{}", said.out);
    }
    // again, over the old one
    for _ in 0..2 {
        let said = inspect(&folder.0, &["a.urdf", "--png", "r.png"]);
        assert_eq!((said.code, said.err.as_str()), (0, ""));
        assert_eq!(said.out.lines().last(), Some("Picture    r.png"));
        Picture::read(&folder.0.join("r.png"));
    }
}

#[test]
fn a_picture_that_cannot_be_written_is_an_error_with_the_cure() {
    let folder = Folder::new("nowhere");
    folder.file("a.urdf", &one_link("r", &ball(1.0)));
    let said = inspect(&folder.0, &["a.urdf", "--png", "no/such/r.png"]);
    assert_eq!(said.code, 1);
    // the rest is reported all the same
    assert!(said.out.starts_with("Robot      r\n") && !said.out.contains("Picture"));
    assert!(
        said.err.contains("no/such/r.png") && said.err.contains("leave it out"),
        "{}",
        said.err
    );
}

#[test]
fn a_ball_is_a_disc_of_its_size() {
    let folder = Folder::new("ball");
    for radius in [1e-3, 1.0, 30.0] {
        folder.file("a.urdf", &one_link("r", &ball(radius)));
        assert_eq!(inspect(&folder.0, &["a.urdf", "--png", "r.png"]).code, 0);
        let picture = Picture::read(&folder.0.join("r.png"));
        let [x, y] = SIDE;
        assert!(
            is_blue(picture.at(x + 3, y + 3)),
            "{:?}",
            picture.at(x + 3, y + 3)
        );
        // 45° off the grid's lines through the middle
        let diagonal = |away: usize| (away as f64 / f64::sqrt(2.0)) as usize;
        let (inside, outside) = (diagonal(RADIUS - 4), diagonal(RADIUS + 6));
        assert!(is_blue(picture.at(x + inside, y - inside)));
        assert!(is_blue(picture.at(x - inside, y - inside)));
        assert!(is_paper(picture.at(x + outside, y - outside)));
        assert!(is_paper(picture.at(x - outside, y + outside)));
    }
}

#[test]
fn joints_are_drawn_where_they_are() {
    let folder = Folder::new("slide");
    let inertial = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>";
    let ball = ball(0.5);
    let text = format!(
        "<robot name=\"r\"><link name=\"a\">{ball}</link><link name=\"b\">{inertial}{ball}</link><joint name=\"j\" type=\"prismatic\"><parent link=\"a\"/><child link=\"b\"/><axis xyz=\"1 0 0\"/><limit lower=\"-5\" upper=\"5\"/></joint></robot>"
    );
    folder.file("a.urdf", &text);
    let [x, y] = SIDE;
    let middle = |q: &str| {
        assert_eq!(
            inspect(&folder.0, &["a.urdf", "--joint-q", q, "--png", "r.png"]).code,
            0
        );
        Picture::read(&folder.0.join("r.png")).at(x + 3, y + 3)
    };
    assert!(!is_paper(middle("0")));
    // 4 m apart they leave the middle empty, whichever way
    assert!(is_paper(middle("4")));
    assert!(is_paper(middle("-4")));
    let drawn = inspect(
        &folder.0,
        &["a.urdf", "--joint-q", "6", "--json", "--png", "q.png"],
    );
    assert!(
        drawn.out.contains("\"picture\": \"q.png\""),
        "{}",
        drawn.out
    );
}

#[test]
fn the_fr3_is_drawn_in_colours_and_the_same_each_time() {
    let folder = Folder::new("fr3");
    let urdf = root().join(FR3);
    let bytes = |name: &str| {
        let said = inspect(&folder.0, &[urdf.to_str().unwrap(), "--png", name]);
        assert_eq!((said.code, said.err.as_str()), (0, ""));
        std::fs::read(folder.0.join(name)).unwrap()
    };
    assert_eq!(bytes("one.png"), bytes("two.png"));
    let picture = Picture::read(&folder.0.join("one.png"));
    assert!(picture.colours() > 5000, "{}", picture.colours());
}

#[test]
fn without_collisions_the_frames_are_drawn() {
    let folder = Folder::new("frames");
    folder.file("a.urdf", &one_link("r", ""));
    let said = inspect(&folder.0, &["a.urdf", "--png", "r.png"]);
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(
        said.out
            .contains("Collisions 0, so the picture shows the frames of the links"),
        "{}",
        said.out
    );
    let picture = Picture::read(&folder.0.join("r.png"));
    // a red arrow, a green and a blue one
    for part in 0..3 {
        let pure = |colour: &&Rgb| {
            (0..3).all(|other| other == part || colour[other].saturating_add(60) < colour[part])
        };
        assert!(picture.0.iter().filter(pure).count() > 100, "{part}");
    }
}

/// An L of 2 m by 2 m in x and z as an OBJ file, its notch at the upper right.
fn corner_piece() -> String {
    let outline = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)];
    let mut text = String::new();
    for y in [-0.5, 0.5] {
        for (x, z) in outline {
            text += &format!("v {x} {y} {z}\n");
        }
    }
    for k in 1..5 {
        // all of it is seen from its first corner
        text += &format!("f 1 {} {}\nf 7 {} {}\n", k + 1, k + 2, k + 8, k + 7);
    }
    for k in 0..6 {
        let (a, b) = (k + 1, (k + 1) % 6 + 1);
        text += &format!("f {a} {} {b}\nf {b} {} {}\n", a + 6, a + 6, b + 6);
    }
    text
}

#[test]
fn a_mesh_is_drawn_as_it_is_or_as_what_stands_for_it_in_contacts() {
    let folder = Folder::new("hulls");
    folder.file("l.obj", &corner_piece());
    let mesh = "<collision><geometry><mesh filename=\"l.obj\"/></geometry></collision>";
    folder.file("a.urdf", &one_link("r", mesh));
    let [x, y] = SIDE;
    let notch = |options: &[&str], hulls: &str| {
        let said = inspect(
            &folder.0,
            &[&["a.urdf", "--png", "r.png"], options].concat(),
        );
        assert_eq!(said.code, 0, "{}", said.err);
        let line = said
            .out
            .lines()
            .find(|line| line.contains("l.obj"))
            .unwrap();
        let expected = format!("mesh l.obj: 2 × 1 × 2 m, 20 triangles, closed, {hulls}");
        assert_eq!(line.trim_start(), expected);
        let picture = Picture::read(&folder.0.join("r.png"));
        assert!(is_blue(picture.at(x - 43, y + 43)));
        picture.at(x + 43, y - 43)
    };
    // 0.3 m to the right of the inner corner and above it: in the hull, not in the mesh
    assert!(is_paper(notch(&[], "hull of 10 vertices")));
    assert!(is_blue(notch(&["--hulls"], "hull of 10 vertices")));
    let json = inspect(&folder.0, &["a.urdf", "--json"]).out;
    let all: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(all["links"][0]["collisions"][0]["hull_vertices"][0], 10);
    assert_eq!(all["links"][0]["collisions"][0]["triangles"], 20);
}

#[test]
fn a_robot_without_collisions_is_drawn_as_it_looks() {
    let folder = Folder::new("looks");
    let looks = ball(1.0).replace("collision", "visual");
    folder.file("a.urdf", &one_link("r", &looks));
    assert_eq!(inspect(&folder.0, &["a.urdf", "--png", "r.png"]).code, 0);
    let picture = Picture::read(&folder.0.join("r.png"));
    let [x, y] = SIDE;
    assert!(is_blue(picture.at(x + RADIUS / 2, y + RADIUS / 2)));
    assert!(is_paper(picture.at(x + RADIUS, y + RADIUS)));
}

#[test]
fn a_link_without_collisions_is_drawn_as_it_looks_beside_links_that_have_some() {
    let folder = Folder::new("bare");
    let picture = |visual: &str| {
        let text = format!(
            "<robot name=\"r\"><link name=\"base\">{}</link><link name=\"head\">{visual}</link>\
             <joint name=\"neck\" type=\"fixed\"><parent link=\"base\"/><child link=\"head\"/>\
             <origin xyz=\"0 0 3\"/></joint></robot>",
            ball(1.0)
        );
        folder.file("a.urdf", &text);
        assert_eq!(inspect(&folder.0, &["a.urdf", "--png", "r.png"]).code, 0);
        std::fs::read(folder.0.join("r.png")).unwrap()
    };
    let head = ball(1.0).replace("collision", "visual");
    let [without, with, twice] = [String::new(), head.clone(), head.repeat(2)].map(|v| picture(&v));
    assert_ne!(without, with);
    assert_eq!(with, twice);
}

#[test]
fn a_mesh_is_drawn_as_a_body() {
    let folder = Folder::new("mesh");
    let corners = "v 0 0 0\nv 1 0 0\nv 0 6 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    folder.file("my part.obj", corners);
    let said = inspect(&folder.0, &["my part.obj", "--png", "r.png"]);
    assert_eq!(said.code, 0, "{}", said.err);
    // a cubic metre of water
    for part in ["my_part", "1000 kg", "1 mesh"] {
        assert!(said.out.contains(part), "{}", said.out);
    }
    let [x, y] = SIDE;
    assert!(is_blue(
        Picture::read(&folder.0.join("r.png")).at(x - RADIUS / 2, y + RADIUS / 2)
    ));
}
