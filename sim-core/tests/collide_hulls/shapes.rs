//! Random pairs of shapes, and the narrow phase run on them by any machine.

use sim_core::lane::memory::Cpu;
use sim_core::lane::{Cx, Lane, Real, Table, Tables};
use sim_core::model::cut::Cut;
use sim_core::model::geometry::Hull;
use sim_core::model::hull_tables::{HullFrame, HullTables};
use sim_core::step::collide::points::{Placed, Points};
use sim_core::step::collide::{cylinders, hulls};

pub type Vector = [f64; 3];

/// A generator of random numbers (Steele 2014, splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn direction(&mut self) -> Vector {
        loop {
            let x: Vector = std::array::from_fn(|_| self.between(-1.0, 1.0));
            let square = dot(x, x);
            if square < 1.0 && square > 1e-2 {
                return x.map(|x| x / square.sqrt());
            }
        }
    }

    /// Columns of a rotation.
    pub fn rotation(&mut self) -> [Vector; 3] {
        let z = self.direction();
        let x = loop {
            let x = cross(self.direction(), z);
            if dot(x, x) > 1e-2 {
                break unit(x);
            }
        };
        [x, cross(z, x), z]
    }

    /// The hull of random points, long up to three times its width.
    pub fn hull(&mut self, points: usize) -> Hull {
        let size: Vector = std::array::from_fn(|_| self.between(0.03, 0.1));
        let outside = self.unit() < 0.5;
        let cloud: Vec<Vector> = (0..points)
            .map(|_| {
                let far = if outside { 1.0 } else { self.unit().cbrt() };
                let way = self.direction();
                std::array::from_fn(|i| 0.02 + size[i] * far * way[i])
            })
            .collect();
        Hull::of(&cloud, 64).unwrap()
    }
}

pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub fn sub(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] - b[i])
}

pub fn add(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] + b[i])
}

pub fn scale(a: Vector, s: f64) -> Vector {
    a.map(|x| x * s)
}

pub fn unit(a: Vector) -> Vector {
    scale(a, 1.0 / dot(a, a).sqrt())
}

/// m a
pub fn transform(m: &[Vector; 3], a: Vector) -> Vector {
    std::array::from_fn(|i| m[0][i] * a[0] + m[1][i] * a[1] + m[2][i] * a[2])
}

/// Hulls in tables, and as they are about their centres.
pub struct Hulls {
    pub tables: Tables<f64>,
    pub single: Tables<f32>,
    pub places: HullTables,
    pub frames: Vec<HullFrame>,
    /// Vertices about the centre.
    pub vertices: Vec<Vec<Vector>>,
    pub hulls: Vec<Hull>,
}

impl Hulls {
    pub fn new(hulls: Vec<Hull>) -> Hulls {
        let mut tables = Tables::default();
        let (places, frames) = HullTables::append(&hulls, &mut tables);
        let single = Tables {
            numbers: tables.numbers.iter().map(|&x| x as f32).collect(),
            indices: tables.indices.clone(),
        };
        let vertices = hulls
            .iter()
            .zip(&frames)
            .map(|(hull, frame)| {
                hull.vertices
                    .iter()
                    .map(|&v| sub(v, frame.center))
                    .collect()
            })
            .collect();
        Hulls {
            tables,
            single,
            places,
            frames,
            vertices,
            hulls,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    Plane,
    Sphere(f64),
    /// Radius and half height.
    Capsule(f64, f64),
    Box(Vector),
    /// Radius and half height.
    Cylinder(f64, f64),
    Hull(usize),
}

/// Two shapes; the second is placed relative to the first's centre.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub a: Shape,
    pub axes_a: [Vector; 3],
    pub b: Shape,
    pub axes_b: [Vector; 3],
    pub center: Vector,
}

/// A contact point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    pub point: Vector,
    pub distance: f64,
    pub normal: Vector,
}

pub const ROWS: usize = 8;
const POINTS: Table = Table {
    base: 0,
    stride: 8,
    rows: ROWS,
};
const CUT: Cut = Cut {
    corners: Table {
        base: 8 * ROWS,
        stride: Cut::CORNERS[1],
        rows: Cut::CORNERS[0],
    },
    candidates: Table {
        base: 8 * ROWS + Cut::CORNERS[0] * Cut::CORNERS[1],
        stride: Cut::CANDIDATES[1],
        rows: Cut::CANDIDATES[0],
    },
    edges: Table {
        base: EDGES,
        stride: Cut::EDGES[1],
        rows: Cut::EDGES[0],
    },
};
const EDGES: usize =
    8 * ROWS + Cut::CORNERS[0] * Cut::CORNERS[1] + Cut::CANDIDATES[0] * Cut::CANDIDATES[1];
pub const MEMORY: usize = EDGES + Cut::EDGES[0] * Cut::EDGES[1];

/// Contact points of pairs with the same shapes but for their sizes, one a lane.
#[inline(always)]
pub fn contacts<F: Lane>(
    pairs: &[Pair],
    hulls: &HullTables,
    tables: &Tables<F::Real>,
    margin: f64,
    memory: &mut [F],
) -> Vec<Vec<Contact>> {
    let load = |value: &dyn Fn(&Pair) -> f64| -> F {
        let mut numbers = F::default();
        for lane in 0..F::WIDTH {
            numbers.set_lane(lane, F::Real::of(value(&pairs[lane.min(pairs.len() - 1)])));
        }
        numbers
    };
    let vector = |value: &dyn Fn(&Pair) -> Vector| -> [F; 3] {
        std::array::from_fn(|i| load(&|pair| value(pair)[i]))
    };
    let axes_a: [[F; 3]; 3] = std::array::from_fn(|j| vector(&|pair| pair.axes_a[j]));
    let b = Placed {
        axes: std::array::from_fn(|j| vector(&|pair| pair.axes_b[j])),
        center: vector(&|pair| pair.center),
    };
    let sizes = |shape: Shape| match shape {
        Shape::Plane | Shape::Hull(_) => [0.0; 3],
        Shape::Sphere(radius) => [radius, 0.0, 0.0],
        Shape::Capsule(radius, half) | Shape::Cylinder(radius, half) => [radius, half, 0.0],
        Shape::Box(half) => half,
    };
    let size_a = vector(&|pair| sizes(pair.a));
    let size_b = vector(&|pair| sizes(pair.b));
    let (a_kind, b_kind) = (pairs[0].a, pairs[0].b);
    let count = compute(
        a_kind,
        b_kind,
        &axes_a,
        &b,
        size_a,
        size_b,
        hulls,
        tables,
        F::c(margin),
        memory,
    );
    (0..pairs.len())
        .map(|lane| {
            (0..(count.lane(lane).to_usize()).min(ROWS))
                .map(|row| {
                    let number = |k: usize| memory[row * 8 + k].lane(lane).to_f64();
                    Contact {
                        point: [number(0), number(1), number(2)],
                        distance: number(3),
                        normal: [number(4), number(5), number(6)],
                    }
                })
                .collect()
        })
        .collect()
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn compute<F: Lane>(
    a_kind: Shape,
    b_kind: Shape,
    axes_a: &[[F; 3]; 3],
    b: &Placed<F>,
    size_a: [F; 3],
    size_b: [F; 3],
    t: &HullTables,
    tables: &Tables<F::Real>,
    margin: F,
    memory: &mut [F],
) -> F {
    let machine = &mut Cpu::new(memory, tables);
    let mut out = Points::<Cpu<F>> {
        list: machine.list(ROWS),
        table: POINTS,
        pair: F::c(0.0),
    };
    let (cx, o, m) = (machine, &mut out, margin);
    match (a_kind, b_kind) {
        (Shape::Plane, Shape::Hull(h)) => hulls::plane_hull(cx, axes_a, b, h, t, m, o),
        (Shape::Sphere(_), Shape::Hull(h)) => hulls::sphere_hull(cx, size_a[0], b, h, t, m, o),
        (Shape::Capsule(..), Shape::Hull(h)) => {
            hulls::capsule_hull(cx, axes_a, size_a[0], size_a[1], b, h, t, m, CUT, o);
        }
        (Shape::Box(_), Shape::Hull(h)) => hulls::box_hull(cx, axes_a, size_a, b, h, t, m, CUT, o),
        (Shape::Hull(g), Shape::Hull(h)) => hulls::hull_hull(cx, axes_a, g, b, h, t, m, CUT, o),
        (Shape::Cylinder(..), Shape::Hull(h)) => {
            cylinders::cylinder_hull(cx, axes_a, size_a[0], size_a[1], b, h, t, m, CUT, o);
        }
        (Shape::Sphere(_), Shape::Cylinder(..)) => {
            cylinders::sphere_cylinder(cx, size_a[0], b, size_b[0], size_b[1], m, o);
        }
        (Shape::Capsule(..), Shape::Cylinder(..)) => {
            cylinders::capsule_cylinder(
                cx, axes_a, size_a[0], size_a[1], b, size_b[0], size_b[1], m, CUT, o,
            );
        }
        (Shape::Box(_), Shape::Cylinder(..)) => {
            cylinders::box_cylinder(cx, axes_a, size_a, b, size_b[0], size_b[1], m, CUT, o);
        }
        (Shape::Cylinder(..), Shape::Cylinder(..)) => {
            cylinders::cylinder_cylinder(
                cx, axes_a, size_a[0], size_a[1], b, size_b[0], size_b[1], m, CUT, o,
            );
        }
        _ => panic!("no such pair: {a_kind:?} and {b_kind:?}"),
    }
    cx.pushed(&out.list)
}
