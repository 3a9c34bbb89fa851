//! Depths and labels of random scenes beside rays in `f64`, which are tested against MuJoCo's.

mod random;

use std::sync::Arc;

use fastrand::Rng;
use random::{Seen, field, frame, part, rotation};
use sim_model::Pose;
use sim_model::geometry::{Shape, TriMesh};
use sim_render::{Camera, Frame, Image, Look, NOTHING, Paint, Part, Scene, Scratch, draw};

/// Distances of surfaces along a ray from which on the nearer one is certain [m].
const CLOSE: f64 = 1e-4;
/// Largest error of a depth [m].
const PRECISE: f64 = 1e-5;

fn bits(depths: &[f32]) -> Vec<u32> {
    depths.iter().map(|depth| depth.to_bits()).collect()
}

/// Depths and labels of a small image, from the origin along z.
fn seen_from_the_origin(parts: &[Part], camera: &Camera) -> (Vec<f32>, Vec<i32>) {
    let mut depth = vec![f32::NAN; camera.width * camera.height];
    let mut labels = vec![7777; depth.len()];
    let mut image = Image {
        depth: &mut depth,
        labels: Some(&mut labels),
        rgb: None,
    };
    if let Some(draw) = draw() {
        let scratch = &mut Scratch::default();
        let scene = Scene::new(parts);
        draw(&scene, &[], &Frame::IDENTITY, camera, scratch, &mut image);
    }
    (depth, labels)
}

#[test]
fn a_solid_is_seen_from_outside_between_near_and_far_and_a_plane_from_above() {
    if draw().is_none() {
        return;
    }
    let fixed = |shape, pose, label| Part {
        body: None,
        pose,
        look: Look::Shape(shape),
        label,
        paint: Paint::PLAIN,
    };
    let ball = |radius, z, label| fixed(Shape::Sphere { radius }, Pose::at([0.0, 0.0, z]), label);
    let turned = Pose::from_rpy([0.0, 0.0, 4.0], [std::f64::consts::PI, 0.0, 0.0]);
    let parts = [
        ball(0.5, 0.0, 0), // around the camera
        ball(0.1, 1.0, 1),
        ball(0.1, 3.0, 2),
        fixed(Shape::Plane, Pose::at([0.0, 0.0, 2.0]), 3), // from below
        fixed(Shape::Plane, turned, 4),
    ];
    let middle = |near, far| {
        let camera = Camera {
            near,
            far,
            ..Camera::with_fov(3, 3, 0.3, 10.0)
        };
        let (depth, labels) = seen_from_the_origin(&parts, &camera);
        (depth[4], labels[4])
    };
    let at = |depth: f32, (seen, label): (f32, i32), expected: i32| {
        assert!(
            (seen - depth).abs() < 1e-6 && label == expected,
            "{seen} {label}"
        );
    };
    at(0.9, middle(0.0, 10.0), 1);
    at(2.9, middle(1.5, 10.0), 2);
    at(4.0, middle(3.5, 10.0), 4);
    at(0.0, middle(3.5, 3.9), NOTHING);
    let (depth, _) = seen_from_the_origin(&parts, &Camera::with_fov(0, 5, 0.3, 10.0));
    assert!(depth.is_empty());
}

#[test]
fn depths_and_labels_are_those_of_rays_in_double_precision() {
    let Some(draw) = draw() else {
        return;
    };
    let rng = &mut Rng::with_seed(1);
    // what one image leaves there is nothing to the next
    let scratch = &mut Scratch::default();
    let (mut pixels, mut seen_pixels, mut worst, mut wrong) = (0, 0, 0.0_f64, 0);
    for _ in 0..60 {
        let count = rng.usize(1..30);
        let mut parts: Vec<Seen> = (0..count as i32).map(|label| part(rng, label)).collect();
        for at in (1..count).step_by(2) {
            parts[at].body = parts[at - 1].body;
        }
        let bodies: Vec<Frame> = parts
            .iter()
            .step_by(2)
            .map(|seen| frame(&seen.body))
            .collect();
        if rng.bool() {
            let samples = [rng.usize(2..100), rng.usize(2..100)];
            parts.push(field(rng, samples, 77));
        }
        let given: Vec<Part> = parts.iter().map(|seen| seen.part.clone()).collect();
        let scene = Scene::new(&given);
        // no part is around the camera
        let back = Pose::at([0.0, 0.0, -2.5]);
        let eye = Pose {
            pos: [0.0; 3],
            quat: rotation(rng),
        }
        .mul(&back);
        let eye = Pose {
            pos: eye.pos.map(|x| f64::from(x as f32)),
            quat: eye.quat.map(|x| f64::from(x as f32)),
        };
        let camera = Camera::with_fov(rng.usize(1..70), rng.usize(1..70), 0.2 + rng.f32(), 100.0);
        let mut depth = vec![f32::NAN; camera.width * camera.height];
        let mut labels = vec![7777; depth.len()];
        let mut image = Image {
            depth: &mut depth,
            labels: Some(&mut labels),
            rgb: None,
        };
        draw(&scene, &bodies, &frame(&eye), &camera, scratch, &mut image);
        let mut again = vec![f32::NAN; depth.len()];
        let mut image = Image {
            depth: &mut again,
            labels: None,
            rgb: None,
        };
        let fresh = &mut Scratch::default();
        draw(&scene, &bodies, &frame(&eye), &camera, fresh, &mut image);
        assert_eq!(bits(&again), bits(&depth));
        for row in 0..camera.height {
            for column in 0..camera.width {
                let at = |pixel: usize, axis: usize| {
                    (pixel as f64 + 0.5 - f64::from(camera.center[axis]))
                        / f64::from(camera.focal[axis])
                };
                let tip = [at(column, 0), at(row, 1), 1.0];
                let mut met: Vec<(f64, i32)> = parts
                    .iter()
                    .filter_map(|seen| {
                        let back = seen.body.mul(&seen.part.pose).inverse().mul(&eye);
                        let start = back.pos;
                        let end = back.transform(tip);
                        let direction = [0, 1, 2].map(|k| end[k] - start[k]);
                        let met = seen.ray.cast(start, direction, f64::INFINITY)?;
                        Some((met.0, seen.part.label))
                    })
                    .collect();
                met.sort_by(|a, b| a.0.total_cmp(&b.0));
                let pixel = row * camera.width + column;
                pixels += 1;
                let ours = f64::from(depth[pixel]);
                let is_certain = met.len() < 2 || met[1].0 - met[0].0 > CLOSE;
                match met.first() {
                    None if labels[pixel] == NOTHING && depth[pixel].to_bits() == 0 => {}
                    Some(first)
                        if labels[pixel] == first.1 && (ours - first.0).abs() <= PRECISE =>
                    {
                        worst = worst.max((ours - first.0).abs());
                        seen_pixels += 1;
                    }
                    _ if !is_certain => {}
                    other => {
                        wrong += 1;
                        if wrong < 20 {
                            println!("{other:?}: {} at {ours}", labels[pixel]);
                        }
                    }
                }
            }
        }
    }
    println!("{pixels} pixels, {seen_pixels} see something, worst {worst:e}, {wrong} differ");
    assert!(seen_pixels > 10_000);
    // edges and rays along surfaces
    assert!(wrong * 1000 < pixels, "{wrong} of {pixels}");
}

/// So many triangles in few pixels are met ray by ray, those in the middle along two sides of the box around them.
#[test]
fn a_dense_mesh_is_seen_by_rays_along_its_axes() {
    let Some(draw) = draw() else {
        return;
    };
    const CELLS: usize = 80;
    let mut mesh = TriMesh::default();
    let corner = |place: usize| place as f64 / CELLS as f64 - 0.5;
    for place in 0..(CELLS + 1) * (CELLS + 1) {
        let [x, y] = [place % (CELLS + 1), place / (CELLS + 1)].map(corner);
        mesh.vertices.push([x, y, 0.1 * x * y]);
    }
    for place in 0..CELLS * CELLS {
        let first = place / CELLS * (CELLS + 1) + place % CELLS;
        let [a, b, c, d] = [0, 1, CELLS + 1, CELLS + 2].map(|k| (first + k) as u32);
        // seen from below
        mesh.triangles.extend([[a, d, b], [a, c, d]]);
    }
    let part = Part {
        body: None,
        pose: Pose::at([0.0, 0.0, 2.0]),
        look: Look::Triangles(Arc::new(mesh)),
        label: 3,
        paint: Paint::PLAIN,
    };
    let scene = Scene::new(&[part]);
    let camera = Camera::with_fov(5, 5, 0.3, 10.0);
    let (mut depth, mut labels) = (vec![0.0; 25], vec![7; 25]);
    let mut image = Image {
        depth: &mut depth,
        labels: Some(&mut labels),
        rgb: None,
    };
    let eye = frame(&Pose::identity());
    draw(
        &scene,
        &[],
        &eye,
        &camera,
        &mut Scratch::default(),
        &mut image,
    );
    assert_eq!(labels, [3; 25]);
    assert!(
        depth.iter().all(|depth| (depth - 2.0).abs() < 0.03),
        "{depth:?}"
    );
    assert!((depth[12] - 2.0).abs() < 1e-6, "{}", depth[12]);
}
