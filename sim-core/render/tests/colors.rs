//! Colours of random scenes beside rays in `f64`: normals, lights, and shadows by a ray to the light from each pixel.

mod random;

use fastrand::Rng;
use random::{Seen, field, frame, part, rotation};
use sim_model::Pose;
use sim_model::geometry::vector::{Vector, dot};
use sim_model::geometry::{RayShape, Shape};
use sim_render::{Camera, Frame, Image, KeyLight, Look, Paint, Part, Scene, Scratch, draw};

/// Lights of films, as `sim-daemon/picture/src/shade.rs` has them.
const KEY: Vector = [0.33, -0.52, 0.79];
const FILL: Vector = [0.75, -0.1, -0.65];
const HORIZON: [f64; 3] = [226.0, 230.0, 236.0];
const SKY: [f64; 3] = [250.0, 251.0, 253.0];
/// How far places in a pixel are apart that may see another surface, or be in its shadow [pixels].
const NEAR: f64 = 0.01;

fn scaled(v: Vector, factor: f64) -> Vector {
    v.map(|part| part * factor)
}

fn sum(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|k| a[k] + b[k])
}

fn unit(v: Vector) -> Vector {
    scaled(v, 1.0 / dot(v, v).sqrt())
}

/// Where a ray in the world first meets something: the part's number, the distance and the normal.
fn cast(parts: &[Seen], from: Vector, direction: Vector) -> Option<(usize, f64, Vector)> {
    let met = parts.iter().enumerate().filter_map(|(number, seen)| {
        let place = seen.body.mul(&seen.part.pose);
        let back = place.inverse();
        let (start, along) = (back.transform(from), back.rotate(direction));
        let (far, normal) = seen.ray.cast(start, along, f64::INFINITY)?;
        Some((number, far, place.rotate(normal)))
    });
    met.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Whether a ray enters something from outside.
fn is_stopped(parts: &[Seen], from: Vector, direction: Vector) -> bool {
    parts.iter().any(|seen| {
        let met = cast(std::slice::from_ref(seen), from, direction);
        met.is_some_and(|(_, far, normal)| far > 1e-9 && dot(normal, direction) < 0.0)
    })
}

/// The colour of a part at a place in the world, as light.
fn light(seen: &Seen, at: Vector) -> [f64; 3] {
    let Paint { color, squares } = seen.part.paint;
    let tone = match seen.part.look {
        Look::Sheet(half) if squares => {
            let place = seen.body.mul(&seen.part.pose).inverse().transform(at);
            let square = |k: usize| {
                let width = half[k] / (half[k] / 0.5).round().max(1.0);
                (place[k] / width).floor() as i64
            };
            if (square(0) + square(1)) % 2 == 0 {
                1.07
            } else {
                0.93
            }
        }
        _ => 1.0,
    };
    [0, 1, 2].map(|k| (tone * f64::from(color[k])).min(1.0).powi(2))
}

/// Bytes that a ray of a camera sees.
fn reference(parts: &[Seen], eye: &Pose, tip: Vector, key: Option<Vector>) -> [f64; 3] {
    let ray = unit(eye.rotate(tip));
    let Some((number, far, n)) = cast(parts, eye.pos, ray) else {
        let t = (ray[2] / 0.6).clamp(0.0, 1.0);
        let share = t * t * (3.0 - 2.0 * t);
        return [0, 1, 2].map(|k| {
            let [low, high] = [HORIZON, SKY].map(|all| (all[k] / 255.0_f64).powi(2));
            255.0 * (low + share * (high - low)).sqrt()
        });
    };
    let at = sum(eye.pos, scaled(ray, far));
    let towards = unit(key.unwrap_or(KEY));
    let facing = dot(n, towards).max(0.0);
    let start = sum(at, scaled(towards, 1e-5 * far));
    let arrives = f64::from(facing > 0.0 && !is_stopped(parts, start, towards));
    let fill = dot(n, unit(eye.rotate(FILL))).max(0.0);
    let amount = 0.22 + 0.24 * (0.5 + 0.5 * n[2]) + 0.66 * facing * arrives + 0.14 * fill;
    light(&parts[number], at).map(|part| 255.0 * (part * amount).clamp(0.0, 1.0).sqrt())
}

fn is_near(ours: &[u8], expected: [f64; 3]) -> bool {
    (0..3).all(|k| (f64::from(ours[k]) - expected[k]).abs() <= 1.0)
}

fn tip(camera: &Camera, column: f64, row: f64) -> Vector {
    let at = |pixel: f64, axis: usize| {
        (pixel + 0.5 - f64::from(camera.center[axis])) / f64::from(camera.focal[axis])
    };
    [at(column, 0), at(row, 1), 1.0]
}

/// A large sheet below all parts.
fn floor() -> Seen {
    let half = [3.0, 2.5];
    Seen {
        part: Part {
            body: None,
            pose: Pose::at([0.0, 0.0, -1.5]),
            look: Look::Sheet(half),
            label: -2,
            paint: Paint::GROUND,
        },
        ray: RayShape::Plane(half),
        body: Pose::identity(),
    }
}

/// What is different in images.
#[derive(Default)]
struct Counts {
    pixels: usize,
    shaded: usize,
    at_edges: usize,
    wrong: usize,
}

impl Counts {
    /// Draws parts, of which those that move are in pairs, and compares each pixel.
    fn compare(&mut self, parts: &[Seen], key: Option<Vector>, eye: &Pose, camera: &Camera) {
        let Some(draw) = draw() else {
            return;
        };
        let moving = parts.iter().filter(|seen| seen.part.body.is_some());
        let bodies: Vec<Frame> = moving.step_by(2).map(|seen| frame(&seen.body)).collect();
        let given: Vec<Part> = parts.iter().map(|seen| seen.part.clone()).collect();
        let light = KeyLight::from_direction(key.unwrap_or(KEY)).unwrap();
        let mut dark = light;
        dark.shadows = false;
        let scratch = &mut Scratch::default();
        let [rgb, bright] = [light, dark].map(|light| {
            let scene = Scene::new(&given).lit_by(light);
            let mut depth = vec![f32::NAN; camera.width * camera.height];
            let mut rgb = vec![77; 3 * depth.len()];
            let mut image = Image {
                depth: &mut depth,
                labels: None,
                rgb: Some(&mut rgb),
            };
            draw(&scene, &bodies, &frame(eye), camera, scratch, &mut image);
            rgb
        });
        let pairs = rgb.chunks(3).zip(bright.chunks(3));
        self.shaded += pairs.filter(|(ours, bright)| ours != bright).count();
        for row in 0..camera.height {
            for column in 0..camera.width {
                let ours = &rgb[3 * (row * camera.width + column)..][..3];
                let seen = |right: f64, down: f64| {
                    let tip = tip(camera, column as f64 + right, row as f64 + down);
                    reference(parts, eye, tip, key)
                };
                self.pixels += 1;
                let expected = seen(0.0, 0.0);
                if is_near(ours, expected) {
                    continue;
                }
                self.at_edges += 1;
                let around = (0..8).map(|k| std::f64::consts::FRAC_PI_4 * f64::from(k));
                let mut around = around.map(|angle| seen(NEAR * angle.cos(), NEAR * angle.sin()));
                if !around.any(|expected| is_near(ours, expected)) {
                    self.wrong += 1;
                    if self.wrong < 20 {
                        println!("{column} {row}: {ours:?}, not {expected:?}");
                    }
                }
            }
        }
    }

    fn check(&self) {
        let Counts {
            pixels,
            shaded,
            at_edges,
            wrong,
        } = self;
        println!("{pixels} pixels, {shaded} in shadows, {at_edges} at edges, {wrong} differ");
        if draw().is_some() {
            assert!(*pixels > 10_000 && *shaded > 500);
            assert!(at_edges * 500 < *pixels, "{at_edges} of {pixels}");
            assert!(wrong * 20_000 < *pixels, "{wrong} of {pixels}");
        }
    }
}

/// A camera around the origin that looks at it, as a frame in shared memory has it.
fn eye(rng: &mut Rng, away: f64) -> Pose {
    let turned = Pose {
        pos: [0.0; 3],
        quat: rotation(rng),
    };
    let eye = turned.mul(&Pose::at([0.0, 0.0, -away]));
    Pose {
        pos: eye.pos.map(|x| f64::from(x as f32)),
        quat: eye.quat.map(|x| f64::from(x as f32)),
    }
}

#[test]
fn colours_are_those_of_rays_in_double_precision() {
    let rng = &mut Rng::with_seed(3);
    let mut counts = Counts::default();
    for scene in 0..40 {
        let count = rng.usize(1..30);
        let mut parts: Vec<Seen> = (0..count as i32).map(|label| part(rng, label)).collect();
        for at in (1..count).step_by(2) {
            parts[at].body = parts[at - 1].body;
        }
        parts.push(floor());
        let key = (scene % 3 == 0).then(|| [rng.f64() - 0.5, rng.f64() - 0.5, 0.6]);
        let camera = Camera::with_fov(rng.usize(1..60), rng.usize(1..60), 0.9, 100.0);
        counts.compare(&parts, key, &eye(rng, 2.8), &camera);
    }
    counts.check();
}

#[test]
fn height_fields_look_like_their_triangles() {
    let rng = &mut Rng::with_seed(4);
    let mut counts = Counts::default();
    for scene in 0..40 {
        let samples = [rng.usize(2..60), rng.usize(2..60)];
        let mut parts: Vec<Seen> = (0..4).map(|label| part(rng, label)).collect();
        for at in [1, 3] {
            parts[at].body = parts[at - 1].body;
        }
        let mut ground = field(rng, samples, 77);
        if scene % 3 == 0 {
            // a field that moves has another light in each world
            ground.part.body = Some(2);
            ground.body.quat = rotation(rng);
        }
        parts.push(ground);
        let key = (scene % 2 == 0).then(|| [rng.f64() - 0.5, rng.f64() - 0.5, 0.3]);
        let camera = Camera::with_fov(rng.usize(1..60), rng.usize(1..60), 0.9, 100.0);
        counts.compare(&parts, key, &eye(rng, 2.8), &camera);
    }
    counts.check();
}

#[test]
fn many_parts_at_rest_look_as_few_do() {
    let rng = &mut Rng::with_seed(6);
    let mut counts = Counts::default();
    for scene in 0..20 {
        let count = rng.usize(20..150) as i32;
        let mut parts: Vec<Seen> = (0..count).map(|label| part(rng, label)).collect();
        for seen in &mut parts[2..] {
            // of which those of triangles are one thing, and the others are in a tree
            seen.part.body = None;
            seen.part.pose = seen.body;
            seen.body = Pose::identity();
        }
        parts[1].body = parts[0].body;
        parts.push(floor());
        let key = (scene % 2 == 0).then(|| [rng.f64() - 0.5, rng.f64() - 0.5, 0.3]);
        let camera = Camera::with_fov(rng.usize(1..80), rng.usize(1..60), 0.9, 100.0);
        counts.compare(&parts, key, &eye(rng, 2.8), &camera);
    }
    counts.check();
}

#[test]
fn a_transparent_part_is_not_seen_and_casts_no_shadow() {
    let Some(draw) = draw() else {
        return;
    };
    let image = |opacity: f64| {
        let ball = Part {
            body: None,
            pose: Pose::at([0.0, 0.0, 0.5]),
            look: Look::Shape(Shape::Sphere { radius: 0.3 }),
            label: 7,
            paint: Paint::of_color([0.9, 0.1, 0.1, opacity]),
        };
        let parts = [floor().part, ball];
        let camera = Camera::with_fov(40, 40, 0.9, 100.0);
        let (mut depth, mut rgb) = (vec![0.0; 1600], vec![0; 4800]);
        let mut image = Image {
            depth: &mut depth,
            labels: None,
            rgb: Some(&mut rgb),
        };
        let above = Pose::from_rpy([0.0, 0.0, 3.0], [std::f64::consts::PI, 0.0, 0.0]);
        let scratch = &mut Scratch::default();
        draw(
            &Scene::new(&parts),
            &[],
            &frame(&above),
            &camera,
            scratch,
            &mut image,
        );
        (depth.iter().map(|x| x.to_bits()).collect::<Vec<_>>(), rgb)
    };
    assert_eq!(image(0.005), image(0.0));
    assert_ne!(image(0.005), image(0.5));
    assert_eq!(image(0.5), image(1.0));
}

#[test]
fn a_scene_looks_the_same_after_one_of_other_parts_in_another_light() {
    let Some(draw) = draw() else {
        return;
    };
    let rng = &mut Rng::with_seed(7);
    let bodies: Vec<Frame> = (0..20).map(|k| frame(&part(rng, k).body)).collect();
    let scenes: Vec<Scene> = [40, 6, 90]
        .into_iter()
        .map(|count| {
            let parts: Vec<Part> = (0..count).map(|k| part(rng, k % 40).part).collect();
            let key = [rng.f64() - 0.5, rng.f64() - 0.5, 0.3];
            Scene::new(&parts).lit_by(KeyLight::from_direction(key).unwrap())
        })
        .collect();
    let camera = Camera::with_fov(40, 40, 0.9, 100.0);
    let eye = frame(&Pose::at([0.0, 0.0, -3.0]));
    let drawn = |scene: &Scene, scratch: &mut Scratch| {
        let (mut depth, mut rgb) = (vec![0.0; 1600], vec![0; 4800]);
        let mut image = Image {
            depth: &mut depth,
            labels: None,
            rgb: Some(&mut rgb),
        };
        draw(scene, &bodies, &eye, &camera, scratch, &mut image);
        rgb
    };
    let scratch = &mut Scratch::default();
    for place in [0, 1, 2, 1, 0, 2] {
        let alone = drawn(&scenes[place], &mut Scratch::default());
        assert_eq!(drawn(&scenes[place], scratch), alone, "{place}");
    }
}

#[test]
fn colours_change_no_depth_and_are_the_same_after_any_image_on_any_thread() {
    let Some(draw) = draw() else {
        return;
    };
    let rng = &mut Rng::with_seed(5);
    let mut parts: Vec<Part> = (0..20).map(|label| part(rng, label).part).collect();
    parts.push(floor().part);
    let bodies: Vec<Frame> = (0..10).map(|k| frame(&part(rng, k).body)).collect();
    let scene = Scene::new(&parts);
    let camera = Camera::with_fov(50, 43, 0.9, 100.0);
    let pixels = camera.width * camera.height;
    let drawn = |scratch: &mut Scratch, with_rgb: bool, turn: f64| {
        let eye = Pose::from_rpy([0.0; 3], [2.0, 0.0, turn]).mul(&Pose::at([0.0, 0.0, -3.0]));
        let (mut depth, mut rgb) = (vec![0.0; pixels], vec![0; 3 * pixels]);
        let mut image = Image {
            depth: &mut depth,
            labels: None,
            rgb: with_rgb.then_some(&mut rgb[..]),
        };
        draw(&scene, &bodies, &frame(&eye), &camera, scratch, &mut image);
        (depth.iter().map(|x| x.to_bits()).collect::<Vec<_>>(), rgb)
    };
    let alone: Vec<_> = (0..5)
        .map(|k| drawn(&mut Scratch::default(), true, f64::from(k)))
        .collect();
    let scratch = &mut Scratch::default();
    for k in [4_u8, 1, 3, 0, 2, 2] {
        let (depth, _) = drawn(scratch, false, f64::from(k));
        assert_eq!(depth, alone[usize::from(k)].0);
        assert_eq!(drawn(scratch, true, f64::from(k)), alone[usize::from(k)]);
    }
    let (drawn, alone) = (&drawn, &alone);
    std::thread::scope(|scope| {
        for worker in 0..4 {
            scope.spawn(move || {
                let scratch = &mut Scratch::default();
                for k in (0..5_u8).map(|k| (k * (worker + 1)) % 5) {
                    assert_eq!(drawn(scratch, true, f64::from(k)), alone[usize::from(k)]);
                }
            });
        }
    });
}
