//! Images of depth per second: a robot over a table, on one core.
//!
//! `cargo bench --bench depth -- [robot.urdf [subdivisions]]`: each subdivision makes four triangles of one. The robot's joints
//! have the values of the lesson's arm; other robots are bent likewise.

use std::sync::Arc;
use std::time::{Duration, Instant};

use sim_model::geometry::{Shape, TriMesh};
use sim_model::{Pose, Robot, UrdfOptions};
use sim_render::{Camera, Frame, Image, Look, Part, Scene, Scratch, draw};

/// Pixels of a row, and rows.
const SIZE: usize = 64;
/// Labels of what is no link.
const FIXED: i32 = 1000;
/// Angles of the first joints [rad].
const BENT: [f64; 7] = [0.0, -0.4, 0.0, -2.2, 0.0, 1.9, 0.8];
/// Rounds; the best counts, since the machine may be busy with others.
const ROUNDS: usize = 20;
const ROUND: Duration = Duration::from_millis(50);

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
            });
        }
    }
    let boxed = |half_extents| Shape::Box { half_extents };
    let fixed = [
        (Shape::Plane, [0.0, 0.0, -0.4]),
        (boxed([0.4, 0.6, 0.2]), [0.5, 0.0, -0.2]),
        (boxed([0.03; 3]), [0.5, 0.1, 0.03]),
    ];
    parts.extend(fixed.into_iter().map(|(shape, at)| Part {
        body: None,
        pose: Pose::at(at),
        look: Look::Shape(shape),
        label: FIXED,
    }));
    (parts, count)
}

fn single(pose: &Pose) -> Frame {
    Frame::new(pose.pos.map(|x| x as f32), pose.quat.map(|x| x as f32))
}

fn main() {
    // cargo passes `--bench`
    let given: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    let default = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/examples/assets/fr3/fr3_franka_hand.urdf"
    );
    let path = given.first().map_or(default, |path| path);
    let subdivisions = given.get(1).map_or(0, |times| {
        times.parse().expect("subdivisions are a whole number")
    });
    let robot = Robot::from_urdf(path, UrdfOptions::default()).expect("a robot");
    let (parts, triangles) = parts(&robot, subdivisions);
    let began = Instant::now();
    let scene = Scene::new(&parts);
    let built = began.elapsed();
    let bodies: Vec<Frame> = bent(&robot).iter().map(single).collect();
    // looks at the hand from the front and above
    let eye = Pose::at([1.5, 0.6, 0.9]).mul(&Pose::from_rpy([0.0; 3], [-1.85, 0.0, 1.9]));
    let (eye, camera) = (single(&eye), Camera::with_fov(SIZE, SIZE, 0.9, 10.0));
    let (mut depth, mut labels) = (vec![0.0; SIZE * SIZE], vec![0; SIZE * SIZE]);
    let mut scratch = Scratch::default();
    let Some(draw) = draw() else {
        return println!("this processor has neither AVX2 with FMA nor NEON");
    };
    let mut best = 0.0_f64;
    for _ in 0..ROUNDS {
        let (began, mut images) = (Instant::now(), 0);
        while began.elapsed() < ROUND {
            let mut image = Image {
                depth: &mut depth,
                labels: Some(&mut labels),
            };
            draw(&scene, &bodies, &eye, &camera, &mut scratch, &mut image);
            images += 1;
        }
        best = best.max(f64::from(images) / began.elapsed().as_secs_f64());
    }
    let on_links = labels.iter().filter(|label| (0..FIXED).contains(label));
    println!(
        "{triangles} triangles, tree in {:.1} ms, {} of {} pixels on links: {best:.0} images/s",
        1e3 * built.as_secs_f64(),
        on_links.count(),
        SIZE * SIZE,
    );
}
