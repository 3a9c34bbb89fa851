//! Images per second of one core: depth, with labels, and with colours, of 64 × 64 pixels.
//!
//! `cargo bench --package sim-render --bench depth -- [robot.urdf [subdivisions]]`: each subdivision makes four triangles of
//! one. The robot is over a table, with joints bent as in the lesson. The other scenes are a humanoid on rough ground, and
//! many boxes. With the variable `IMAGES`, a folder, the images of colours are written there.

use std::sync::Arc;
use std::time::{Duration, Instant};

use sim_model::geometry::{HeightField, Shape, TriMesh};
use sim_model::{Pose, Robot, UrdfOptions};
use sim_render::{Camera, Draw, Frame, Image, KeyLight, Look, Paint, Part, Scene, Scratch, draw};

/// Pixels of a row, and rows.
const SIZE: usize = 64;
/// Labels of what is no link.
const FIXED: i32 = 1000;
/// Angles of the first joints [rad].
const BENT: [f64; 7] = [0.0, -0.4, 0.0, -2.2, 0.0, 1.9, 0.8];
/// Rounds of all kinds of images; the best counts, since the machine may be busy with others.
const ROUNDS: usize = 60;
const ROUND: Duration = Duration::from_millis(6);
/// Boxes along an edge of a square of them.
const BOXES: usize = 64;
/// Samples along an edge of rough ground, and their distance [m].
const SAMPLES: usize = 201;
const CELL: f64 = 0.1;

/// Four triangles for each.
fn subdivided(mesh: &TriMesh) -> TriMesh {
    let mut finer = TriMesh::default();
    for &triangle in &mesh.triangles {
        let [a, b, c] = mesh.corners(triangle);
        let middle = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|k| 0.5 * (p[k] + q[k]));
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        for corners in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            let first = finer.vertices.len() as u32;
            finer.vertices.extend(corners);
            finer.triangles.push([first, first + 1, first + 2]);
        }
    }
    finer
}

/// Poses of the links.
fn bent(robot: &Robot) -> Vec<Pose> {
    let mut poses = vec![Pose::identity(); robot.links.len()];
    let mut angles = BENT.into_iter();
    for joint in &robot.joints {
        let parent = joint
            .parent
            .map_or(Pose::identity(), |parent| poses[parent]);
        let at = parent.mul(&joint.origin);
        let angle = joint.range.and_then(|_| angles.next());
        poses[joint.child] = at.mul(&Pose::about(joint.axis, angle.unwrap_or(0.0)));
    }
    poses
}

/// What is seen, and how many triangles links have.
fn parts(robot: &Robot, subdivisions: usize) -> (Vec<Part>, usize) {
    let (mut parts, mut count) = (Vec::new(), 0);
    for (body, link) in robot.links.iter().enumerate() {
        for collision in &link.collisions {
            let look = match &collision.shape {
                Shape::Mesh(mesh) => {
                    let mesh = mesh.triangles.clone();
                    let mesh = (0..subdivisions).fold(mesh, |mesh, _| subdivided(&mesh));
                    count += mesh.triangles.len();
                    Look::Triangles(Arc::new(mesh))
                }
                shape => Look::Shape(shape.clone()),
            };
            parts.push(Part {
                body: Some(body),
                pose: collision.pose,
                look,
                label: body as i32,
                paint: Paint::PLAIN,
            });
        }
    }
    (parts, count)
}

fn fixed(shape: Shape, at: [f64; 3], paint: Paint) -> Part {
    Part {
        body: None,
        pose: Pose::at(at),
        look: Look::Shape(shape),
        label: FIXED,
        paint,
    }
}

fn table() -> Vec<Part> {
    let boxed = |half_extents| Shape::Box { half_extents };
    vec![
        fixed(Shape::Plane, [0.0, 0.0, -0.4], Paint::GROUND),
        fixed(boxed([0.4, 0.6, 0.2]), [0.5, 0.0, -0.2], Paint::PLAIN),
        fixed(boxed([0.03; 3]), [0.5, 0.1, 0.03], Paint::PLAIN),
    ]
}

/// Ground with bumps of 10 cm.
fn rough() -> Part {
    let mut rng = fastrand::Rng::with_seed(1);
    let elevations = (0..SAMPLES * SAMPLES).map(|_| 0.1 * rng.f64()).collect();
    let size = [CELL * (SAMPLES - 1) as f64; 2];
    let field = HeightField::new([SAMPLES; 2], elevations, size, 0.5).expect("a height field");
    fixed(Shape::HeightField(Arc::new(field)), [0.0; 3], Paint::GROUND)
}

/// A square of boxes of random heights.
fn boxes() -> Vec<Part> {
    let mut rng = fastrand::Rng::with_seed(1);
    let places = (0..BOXES * BOXES).map(|k| [k / BOXES, k % BOXES]);
    let place = |i: usize| 0.2 * (i as f64 - 0.5 * BOXES as f64);
    let boxes = places.map(|[i, j]| {
        let half_extents = [0.05, 0.05, 0.05 + 0.2 * rng.f64()];
        let at = [place(i), place(j), half_extents[2]];
        fixed(Shape::Box { half_extents }, at, Paint::PLAIN)
    });
    let ground = fixed(Shape::Plane, [0.0; 3], Paint::GROUND);
    boxes.chain([ground]).collect()
}

fn single(pose: &Pose) -> Frame {
    Frame::new(pose.pos.map(|x| x as f32), pose.quat.map(|x| x as f32))
}

/// A camera at `eye` that looks at a place, with z up [m].
fn looking(eye: [f64; 3], at: [f64; 3]) -> Frame {
    let apart = [0, 1, 2].map(|k| at[k] - eye[k]);
    let across = apart[0].hypot(apart[1]);
    let turn = apart[1].atan2(apart[0]) - 0.5 * std::f64::consts::PI;
    let tilt = apart[2].atan2(across) - 0.5 * std::f64::consts::PI;
    single(&Pose::from_rpy(eye, [tilt, 0.0, turn]))
}

/// Images that are compared: whether they have labels, colours and shadows.
const KINDS: [(&str, [bool; 3]); 4] = [
    ("depth", [false; 3]),
    ("and labels", [true, false, false]),
    ("and rgb without shadows", [false, true, false]),
    ("and rgb", [false, true, true]),
];

fn measure(draw: Draw, name: &str, parts: &[Part], bodies: &[Frame], eye: &Frame) {
    let began = Instant::now();
    let scene = Scene::new(parts);
    let built = began.elapsed();
    let mut dark = KeyLight::default();
    dark.shadows = false;
    let scenes = [Scene::new(parts).lit_by(dark), scene];
    let camera = Camera::with_fov(SIZE, SIZE, 0.9, 10.0);
    let (mut depth, mut labels) = (vec![0.0; SIZE * SIZE], vec![0; SIZE * SIZE]);
    let mut rgb = vec![0; 3 * SIZE * SIZE];
    let mut scratch = Scratch::default();
    let mut best = [0.0_f64; KINDS.len()];
    for _ in 0..ROUNDS {
        for (best, (_, [with_labels, with_rgb, with_shadows])) in best.iter_mut().zip(KINDS) {
            let scene = &scenes[usize::from(with_shadows)];
            let (began, mut images) = (Instant::now(), 0);
            while began.elapsed() < ROUND {
                let mut image = Image {
                    depth: &mut depth,
                    labels: with_labels.then_some(&mut labels[..]),
                    rgb: with_rgb.then_some(&mut rgb[..]),
                };
                draw(scene, bodies, eye, &camera, &mut scratch, &mut image);
                images += 1;
            }
            *best = best.max(f64::from(images) / began.elapsed().as_secs_f64());
        }
    }
    let on_links = labels.iter().filter(|label| (0..FIXED).contains(label));
    println!(
        "{name}: built in {:.1} ms, {} of {} pixels on links",
        1e3 * built.as_secs_f64(),
        on_links.count(),
        SIZE * SIZE,
    );
    for ((kind, _), speed) in KINDS.iter().zip(best) {
        println!("  {kind:24} {speed:8.0} images/s  {:.2}", speed / best[0]);
    }
    if let Some(folder) = std::env::var_os("IMAGES") {
        let path = std::path::Path::new(&folder).join(format!("{name}.ppm"));
        let mut file = format!("P6 {SIZE} {SIZE} 255\n").into_bytes();
        file.extend(&rgb);
        std::fs::write(path, file).expect("a folder for images");
    }
}

fn load(path: &str) -> Robot {
    Robot::from_urdf(path, UrdfOptions::default()).expect("a robot")
}

fn main() {
    // cargo passes `--bench`
    let given: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let default = format!("{root}/examples/assets/fr3/fr3_franka_hand.urdf");
    let path = given.first().unwrap_or(&default);
    let subdivisions = given.get(1).map_or(0, |times| {
        times.parse().expect("subdivisions are a whole number")
    });
    let Some(draw) = draw() else {
        return println!("this processor has neither AVX2 with FMA nor NEON");
    };
    let robot = load(path);
    let (mut seen, triangles) = parts(&robot, subdivisions);
    seen.extend(table());
    let bodies: Vec<Frame> = bent(&robot).iter().map(single).collect();
    // looks at the hand from the front and above
    let eye = Pose::at([1.5, 0.6, 0.9]).mul(&Pose::from_rpy([0.0; 3], [-1.85, 0.0, 1.9]));
    let name = format!("arm over a table, {triangles} triangles");
    measure(draw, &name, &seen, &bodies, &single(&eye));

    let humanoid = load(&format!("{root}/benches/robots/humanoid.urdf"));
    let mut seen = parts(&humanoid, 0).0;
    seen.push(rough());
    let at = Pose::at([0.0, 0.0, 1.0]);
    let bodies: Vec<Frame> = bent(&humanoid)
        .iter()
        .map(|pose| single(&at.mul(pose)))
        .collect();
    let behind = looking([2.0, -1.2, 1.8], [0.0, 0.0, 0.8]);
    measure(draw, "humanoid on rough ground", &seen, &bodies, &behind);
    let ahead = looking([0.3, 0.0, 1.5], [2.0, 0.0, 0.0]);
    measure(draw, "rough ground ahead of it", &seen, &bodies, &ahead);

    let above = looking([0.0, -4.0, 3.0], [0.0, 0.0, 0.0]);
    measure(draw, "4096 boxes", &boxes(), &[], &above);
}
