//! Shapes in random places, the points that the text finds between them, and what parry3d says.

use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query::details::contact_support_map_support_map;
use parry3d_f64::query::{contact, distance};
use parry3d_f64::shape::{Ball, Capsule, Cuboid, Segment};
use sim_core::lane::memory::Cpu;
use sim_core::lane::{Cx, Lane, Real, Table, Tables};
use sim_core::math::vec3::{Mat3, Vec3};
use sim_core::step::collide::points::{Placed, Points};
use sim_core::step::collide::{boxes, capsules, planes, spheres};

/// SplitMix64 (Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    /// Uniform in [low, high).
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        low + (high - low) * (z >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform on the sphere.
    pub fn direction(&mut self) -> Vec3<f64> {
        loop {
            let x = [0; 3].map(|_| self.range(-1.0, 1.0));
            let square = dot(x, x);
            if square < 1.0 && square > 1e-2 {
                return x.map(|x| x / square.sqrt());
            }
        }
    }

    /// The axes of a random attitude.
    pub fn axes(&mut self) -> Mat3<f64> {
        let x = self.direction();
        loop {
            let y = self.direction();
            let along = dot(x, y);
            if along.abs() < 0.9 {
                let y: Vec3<f64> = std::array::from_fn(|i| y[i] - along * x[i]);
                let length = dot(y, y).sqrt();
                let y = y.map(|y| y / length);
                return [x, y, cross(x, y)];
            }
        }
    }
}

pub fn dot(a: Vec3<f64>, b: Vec3<f64>) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: Vec3<f64>, b: Vec3<f64>) -> Vec3<f64> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// m a
pub fn turn(m: &Mat3<f64>, a: Vec3<f64>) -> Vec3<f64> {
    std::array::from_fn(|i| m[0][i] * a[0] + m[1][i] * a[1] + m[2][i] * a[2])
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    Plane,
    Sphere(f64),
    /// Radius, half height.
    Capsule(f64, f64),
    Box(Vec3<f64>),
    /// Radius, half height.
    Cylinder(f64, f64),
}

impl Shape {
    fn sizes(self) -> Vec3<f64> {
        match self {
            Shape::Plane => [0.0; 3],
            Shape::Sphere(r) => [r, 0.0, 0.0],
            Shape::Capsule(r, h) | Shape::Cylinder(r, h) => [r, h, 0.0],
            Shape::Box(half) => half,
        }
    }

    /// Radius of the sphere about it.
    pub fn reach(self) -> f64 {
        match self {
            Shape::Plane => 0.0,
            Shape::Sphere(r) => r,
            Shape::Capsule(r, h) => r + h,
            Shape::Cylinder(r, h) => r.hypot(h),
            Shape::Box(half) => dot(half, half).sqrt(),
        }
    }

    /// Its furthest extent along a direction in its own frame.
    pub fn support(self, d: Vec3<f64>) -> f64 {
        match self {
            Shape::Plane => unreachable!("a plane has no end"),
            Shape::Sphere(r) => r,
            Shape::Capsule(r, h) => r + h * d[2].abs(),
            Shape::Cylinder(r, h) => r * d[0].hypot(d[1]) + h * d[2].abs(),
            Shape::Box(half) => (0..3).map(|i| half[i] * d[i].abs()).sum(),
        }
    }
}

/// Two shapes; the first one's centre is the origin.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub shapes: [Shape; 2],
    pub axes: [Mat3<f64>; 2],
    pub center: Vec3<f64>,
    pub margin: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point<R> {
    pub at: Vec3<R>,
    pub distance: R,
    pub normal: Vec3<R>,
}

const CAPACITY: usize = 16;

/// The points of many pairs of one kind, a pair a world.
#[inline(always)]
pub fn points<F: Lane>(pairs: &[Pair]) -> Vec<Vec<Point<F::Real>>> {
    let table = Table {
        base: 0,
        stride: Points::<Cpu<F>>::STRIDE,
        rows: CAPACITY,
    };
    let tables = Tables::default();
    let mut found = Vec::new();
    for block in pairs.chunks(F::WIDTH) {
        let mut memory = vec![F::default(); table.stride * table.rows];
        let mut cx = Cpu::new(&mut memory, &tables);
        let list = cx.list(CAPACITY);
        let mut out = Points {
            list,
            table,
            pair: F::c(0.0),
        };
        collide(&mut cx, block, &mut out);
        let counts = cx.pushed(&out.list);
        for lane in 0..block.len() {
            let count = counts.lane(lane).to_usize();
            assert!(count <= CAPACITY, "{count} points");
            let number = |row: usize, k: usize| memory[row * table.stride + k].lane(lane);
            found.push(
                (0..count)
                    .map(|row| Point {
                        at: [0, 1, 2].map(|k| number(row, k)),
                        distance: number(row, 3),
                        normal: [4, 5, 6].map(|k| number(row, k)),
                    })
                    .collect(),
            );
        }
    }
    found
}

#[inline(always)]
fn lanes<F: Lane>(block: &[Pair], number: impl Fn(&Pair) -> f64) -> F {
    let last = block.len() - 1;
    let numbers: Vec<F::Real> = (0..F::WIDTH)
        .map(|lane| F::Real::of(number(&block[lane.min(last)])))
        .collect();
    F::load(&numbers)
}

#[inline(always)]
fn collide<'a, F: Lane>(cx: &mut Cpu<'a, F>, block: &[Pair], out: &mut Points<Cpu<'a, F>>) {
    let axes = |which: usize| -> Mat3<F> {
        std::array::from_fn(|i| std::array::from_fn(|k| lanes(block, |p| p.axes[which][i][k])))
    };
    let size = |which: usize| -> Vec3<F> {
        std::array::from_fn(|k| lanes(block, |p| p.shapes[which].sizes()[k]))
    };
    let a = &axes(0);
    let b = &Placed {
        axes: axes(1),
        center: std::array::from_fn(|k| lanes(block, |p| p.center[k])),
    };
    let margin = lanes(block, |p| p.margin);
    let (s, t) = (size(0), size(1));
    match block[0].shapes {
        [Shape::Plane, Shape::Sphere(_)] => planes::plane_sphere(cx, a, b, t[0], margin, out),
        [Shape::Plane, Shape::Capsule(..)] => {
            planes::plane_capsule(cx, a, b, t[0], t[1], margin, out)
        }
        [Shape::Plane, Shape::Box(_)] => planes::plane_box(cx, a, b, t, margin, out),
        [Shape::Plane, Shape::Cylinder(..)] => {
            planes::plane_cylinder(cx, a, b, t[0], t[1], margin, out)
        }
        [Shape::Sphere(_), Shape::Sphere(_)] => {
            spheres::sphere_sphere(cx, s[0], b, t[0], margin, out)
        }
        [Shape::Sphere(_), Shape::Capsule(..)] => {
            spheres::sphere_capsule(cx, s[0], b, t[0], t[1], margin, out)
        }
        [Shape::Sphere(_), Shape::Box(_)] => spheres::sphere_box(cx, s[0], b, t, margin, out),
        [Shape::Capsule(..), Shape::Capsule(..)] => {
            capsules::capsule_capsule(cx, a, s[0], s[1], b, t[0], t[1], margin, out)
        }
        [Shape::Capsule(..), Shape::Box(_)] => {
            capsules::capsule_box(cx, a, s[0], s[1], b, t, margin, out)
        }
        [Shape::Box(_), Shape::Box(_)] => boxes::box_box(cx, a, s, b, t, margin, out),
        other => unreachable!("{other:?}"),
    }
}

fn pose(axes: &Mat3<f64>, center: Vec3<f64>) -> Pose {
    let columns = axes.map(|a| Vector::new(a[0], a[1], a[2]));
    let matrix = parry3d_f64::math::Matrix::from_cols(columns[0], columns[1], columns[2]);
    Pose::from_parts(
        Vector::new(center[0], center[1], center[2]),
        Rotation::from_mat3(&matrix),
    )
}

/// Signed distance and normal by parry3d. Round shapes are their cores, whose distance it knows to rounding, and a radius.
pub fn oracle(pair: &Pair) -> (f64, Vec3<f64>) {
    let a = pose(&pair.axes[0], [0.0; 3]);
    let b = pose(&pair.axes[1], pair.center);
    let segment = |h: f64| Segment::new(Vector::new(0.0, 0.0, -h), Vector::new(0.0, 0.0, h));
    let cuboid = |h: Vec3<f64>| Cuboid::new(Vector::new(h[0], h[1], h[2]));
    let between = a.inv_mul(&b);
    let cores = |found: Option<parry3d_f64::query::Contact>, radius: f64| {
        let found = found.expect("nothing is out of reach");
        let normal = a.rotation * found.normal1;
        (found.dist - radius, [normal.x, normal.y, normal.z])
    };
    let balls = |found: Option<parry3d_f64::query::Contact>| {
        let found = found.expect("nothing is out of reach");
        let normal = found.normal1;
        (found.dist, [normal.x, normal.y, normal.z])
    };
    match pair.shapes {
        [Shape::Sphere(r), Shape::Sphere(s)] => {
            balls(contact(&a, &Ball::new(r), &b, &Ball::new(s), 10.0).unwrap())
        }
        [Shape::Sphere(r), Shape::Capsule(s, h)] => {
            let capsule = Capsule::new_z(h, s);
            balls(contact(&a, &Ball::new(r), &b, &capsule, 10.0).unwrap())
        }
        [Shape::Sphere(r), Shape::Box(half)] => {
            balls(contact(&a, &Ball::new(r), &b, &cuboid(half), 10.0).unwrap())
        }
        [Shape::Capsule(r, h), Shape::Capsule(s, k)] => {
            let found = distance(&a, &segment(h), &b, &segment(k)).unwrap();
            (found.distance - r - s, [0.0; 3])
        }
        [Shape::Capsule(r, h), Shape::Box(half)] => {
            let (segment, cuboid) = (segment(h), cuboid(half));
            cores(
                contact_support_map_support_map(&between, &segment, &cuboid, 10.0),
                r,
            )
        }
        [Shape::Box(half), Shape::Box(other)] => {
            let (one, two) = (cuboid(half), cuboid(other));
            cores(
                contact_support_map_support_map(&between, &one, &two, 10.0),
                0.0,
            )
        }
        other => unreachable!("{other:?}"),
    }
}
