//! Random pairs of shapes, and the contacts that a simulation finds of them: one shape stands still, the other is free.

use sim_engine::backend::{Lanes, Precision, Values};
use sim_engine::simulation::{Options, Simulation};
use sim_model::geometry::{Hull, Mesh, TriMesh};
use sim_model::{Body, Collision, Description, GeomContact, Pose, Softness};
use sim_physics::arrays::{Dtype, Field};
use std::path::PathBuf;
use std::sync::Arc;

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
        Hull::from_points(&cloud, 64).unwrap()
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

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    Plane,
    Sphere(f64),
    /// Radius and half height.
    Capsule(f64, f64),
    Box(Vector),
    /// Radius and half height.
    Cylinder(f64, f64),
    /// Radii.
    Ellipsoid(Vector),
    /// Its number.
    Hull(usize),
}

impl Shape {
    fn described(self, hulls: &[Hull]) -> sim_model::Shape {
        match self {
            Shape::Plane => sim_model::Shape::Plane,
            Shape::Sphere(radius) => sim_model::Shape::Sphere { radius },
            Shape::Capsule(radius, half_height) => sim_model::Shape::Capsule {
                radius,
                half_height,
            },
            Shape::Box(half_extents) => sim_model::Shape::Box { half_extents },
            Shape::Cylinder(radius, half_height) => sim_model::Shape::Cylinder {
                radius,
                half_height,
            },
            Shape::Ellipsoid(radii) => sim_model::Shape::Ellipsoid { radii },
            Shape::Hull(number) => sim_model::Shape::Mesh(Arc::new(mesh(&hulls[number]))),
        }
    }
}

/// A mesh that is its hull.
fn mesh(hull: &Hull) -> Mesh {
    let fan = |corners: &[u32]| -> Vec<[u32; 3]> {
        let pairs = corners[1..].windows(2);
        pairs.map(|pair| [corners[0], pair[0], pair[1]]).collect()
    };
    let faces = hull.faces.iter();
    Mesh {
        path: PathBuf::from("hull"),
        scale: [1.0; 3],
        triangles: TriMesh {
            vertices: hull.vertices.clone(),
            triangles: faces.flat_map(|face| fan(&face.corners)).collect(),
        },
        closed: true,
        hulls: vec![hull.clone()],
        notes: Vec::new(),
        ignored_up_axis: None,
    }
}

/// Two shapes, the first at the origin.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub shapes: [Shape; 2],
    /// Their axes, one per column.
    pub axes: [[Vector; 3]; 2],
    /// Where the second is.
    pub center: Vector,
}

/// A contact point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    pub point: Vector,
    pub distance: f64,
    pub normal: Vector,
}

/// What finds contacts.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    pub precision: Precision,
    pub lanes: Lanes,
}

pub const DOUBLE: Machine = Machine {
    precision: Precision::F64,
    lanes: Lanes::Scalar,
};
pub const SINGLE: Machine = Machine {
    precision: Precision::F32,
    lanes: Lanes::Scalar,
};

/// The contacts of each pair, found within the margin. Neighbours that differ in nothing but where the second shape is
/// share a model, and are a world each.
pub fn contacts(
    machine: Machine,
    hulls: &[Hull],
    pairs: &[Pair],
    margin: f64,
) -> Vec<Vec<Contact>> {
    contacts_of(machine, hulls, pairs, margin, None)
}

/// The same where the second shape is a geom of MuJoCo's.
pub fn contacts_of_geoms(machine: Machine, pairs: &[Pair], margin: f64) -> Vec<Vec<Contact>> {
    let geom = GeomContact {
        contype: 1,
        conaffinity: 1,
        condim: 3,
        priority: 0,
        solmix: 1.0,
        softness: Softness::default(),
        friction: [1.0, 0.005, 0.0001],
        margin: 0.0,
        gap: 0.0,
        surface_velocity: [0.0; 6],
        adhesion: 0.0,
    };
    contacts_of(machine, &[], pairs, margin, Some(geom))
}

fn contacts_of(
    machine: Machine,
    hulls: &[Hull],
    pairs: &[Pair],
    margin: f64,
    geom: Option<GeomContact>,
) -> Vec<Vec<Contact>> {
    pairs
        .chunk_by(|a, b| a.shapes == b.shapes && a.axes[0] == b.axes[0])
        .flat_map(|group| {
            let [first, second] = group[0].shapes;
            let still = posed(&group[0].axes[0], [0.0; 3]);
            let places = group.iter().map(|pair| posed(&pair.axes[1], pair.center));
            let places: Vec<Pose> = places.collect();
            let free = (second, &places[..], geom);
            touching(machine, hulls, (first, still), free, margin)
        })
        .collect()
}

/// The same of one pair where the first shape is free and the second stands still.
pub fn contacts_exchanged(hulls: &[Hull], pair: &Pair, margin: f64) -> Vec<Contact> {
    let [first, second] = pair.shapes;
    let still = posed(&pair.axes[1], pair.center);
    let place = posed(&pair.axes[0], [0.0; 3]);
    touching(
        DOUBLE,
        hulls,
        (second, still),
        (first, &[place], None),
        margin,
    )
    .remove(0)
}

/// Contacts of a shape that stands still and a free one in many places.
fn touching(
    machine: Machine,
    hulls: &[Hull],
    (still, pose): (Shape, Pose),
    (free, places, geom): (Shape, &[Pose], Option<GeomContact>),
    margin: f64,
) -> Vec<Vec<Contact>> {
    let mut scene = Description::new(1e-3, 1);
    let shape = scene.add_shape("still", still.described(hulls), pose);
    shape.surface.margin = margin;
    let mut body = Body::new("free", Pose::identity());
    let mut shape = Collision::new(None, free.described(hulls), Pose::identity());
    shape.geom = geom;
    body.shapes.push((shape, 1000.0));
    scene.add_body(body).unwrap();
    let options = Options {
        worlds: places.len(),
        precision: machine.precision,
        lanes: machine.lanes,
        threads: Some(1),
        fields: vec![
            Field::ContactCount,
            Field::ContactPos,
            Field::ContactDistance,
            Field::ContactNormal,
        ],
        ..Options::default()
    };
    let mut sim = Simulation::new(scene.compile().unwrap(), &options).unwrap();
    let mut arena = vec![0; sim.layout().bytes / 8];
    let rows = places
        .iter()
        .flat_map(|place| place.pos.into_iter().chain(place.quat));
    let rows: Vec<f64> = rows.collect();
    sim.write(Field::JointQ, 0..7, Values::F64(&rows), None)
        .unwrap();
    sim.forward(&mut arena);
    let read = |field| numbers(&sim, &arena, field);
    let (counts, points) = (read(Field::ContactCount), read(Field::ContactPos));
    let (distances, normals) = (read(Field::ContactDistance), read(Field::ContactNormal));
    let room = distances.len() / places.len();
    let three = |x: &[f64], row: usize| [x[3 * row], x[3 * row + 1], x[3 * row + 2]];
    let contacts = counts.iter().enumerate().map(|(world, &count)| {
        (0..count as usize)
            .map(|row| world * room + row)
            .map(|row| Contact {
                point: three(&points, row),
                distance: distances[row],
                normal: three(&normals, row),
            })
            .collect()
    });
    let contacts: Vec<Vec<Contact>> = contacts.collect();
    // the model has room for all that the shapes may have
    sim.step(&mut arena);
    let left_out = numbers(&sim, &arena, Field::ContactsLeftOut);
    assert!(
        left_out.iter().all(|&count| count == 0.0),
        "{still:?} {free:?}"
    );
    contacts
}

/// All numbers of a field, world by world.
fn numbers(sim: &Simulation, arena: &[u64], field: Field) -> Vec<f64> {
    let slots = &sim.layout().slots;
    let slot = slots.iter().find(|slot| slot.field == field).unwrap();
    let bytes: Vec<u8> = arena.iter().flat_map(|word| word.to_ne_bytes()).collect();
    let count: usize = slot.shape.iter().product();
    let size = slot.dtype.bytes();
    bytes[slot.offset..slot.offset + count * size]
        .chunks_exact(size)
        .map(|x| match slot.dtype {
            Dtype::F32 => f64::from(f32::from_ne_bytes(x.try_into().unwrap())),
            Dtype::F64 => f64::from_ne_bytes(x.try_into().unwrap()),
            Dtype::I32 | Dtype::U32 => f64::from(i32::from_ne_bytes(x.try_into().unwrap())),
            other => unreachable!("no field of these tests is {other:?}"),
        })
        .collect()
}

/// The pose with these axes (Shepperd 1978).
fn posed(axes: &[Vector; 3], pos: Vector) -> Pose {
    let m = |row: usize, column: usize| axes[column][row];
    let [xx, yy, zz] = [m(0, 0), m(1, 1), m(2, 2)];
    // four times the product of two parts of the quaternion; the largest part divides
    let products = [
        [
            1.0 + xx - yy - zz,
            m(0, 1) + m(1, 0),
            m(0, 2) + m(2, 0),
            m(2, 1) - m(1, 2),
        ],
        [
            m(0, 1) + m(1, 0),
            1.0 - xx + yy - zz,
            m(1, 2) + m(2, 1),
            m(0, 2) - m(2, 0),
        ],
        [
            m(0, 2) + m(2, 0),
            m(1, 2) + m(2, 1),
            1.0 - xx - yy + zz,
            m(1, 0) - m(0, 1),
        ],
        [
            m(2, 1) - m(1, 2),
            m(0, 2) - m(2, 0),
            m(1, 0) - m(0, 1),
            1.0 + xx + yy + zz,
        ],
    ];
    let largest = (0..4).max_by(|&a, &b| products[a][a].total_cmp(&products[b][b]));
    let row = products[largest.unwrap()];
    let length = row.iter().map(|x| x * x).sum::<f64>().sqrt();
    Pose {
        pos,
        quat: row.map(|x| x / length),
    }
}
