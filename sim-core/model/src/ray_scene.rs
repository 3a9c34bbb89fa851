//! Rays against the geoms of MuJoCo models in many worlds at once.
//!
//! A sphere around each geom, placed once per world, keeps most geoms from each ray. Threads take worlds from a queue.

use std::sync::{Mutex, PoisonError};

use crate::geometry::{RAY_SMALL, RayShape};
use crate::pose::Pose;

/// Worlds that a thread takes at once.
const TAKEN: usize = 4;
/// Least rays times geoms for a thread of its own: it takes longer than the thread takes to start.
const WORK_MIN: usize = 1 << 14;
/// Width of the spheres around geoms, relative to their radius, which is more than rounding takes.
const MARGIN: f64 = 1e-6;

/// What rays may meet.
#[derive(Default)]
pub struct RayScene {
    /// Geoms, those of a model in MuJoCo's order.
    pub geoms: Vec<RayGeom>,
}

/// A geom.
pub struct RayGeom {
    /// `model/geom`.
    pub name: String,
    /// What MuJoCo calls its type, such as `mjGEOM_BOX`.
    pub kind: String,
    /// Its shape; none of a type that rays cannot meet.
    pub shape: Option<RayShape>,
    /// The body that carries it, among those of the scene.
    pub body: usize,
    /// Its frame in the body's.
    pub pose: Pose,
    /// Its group; unknown where the file is older than groups.
    pub group: Option<i64>,
    /// Whether its body is welded to the world.
    pub is_static: bool,
    /// Whether it or its material has any opacity.
    pub is_visible: bool,
}

/// A ray.
pub struct Ray {
    /// Where it begins [m].
    pub origin: [f64; 3],
    /// Its direction, whose length is the unit of distances.
    pub direction: [f64; 3],
    /// The body that it passes through, among those of the scene; -1 for none.
    pub exclude: i32,
}

/// A frame in the world.
pub struct Placed {
    /// Origin [m].
    pub pos: [f64; 3],
    /// Axes as columns of a matrix, row by row [–].
    pub mat: [f64; 9],
}

/// What rays meet. `(worlds, rays)` each
pub struct Hits<'a> {
    /// Distances in units of the directions; -1 where nothing is met.
    pub dist: &'a mut [f64],
    /// Geoms; -1 where nothing is met.
    pub geom: &'a mut [i32],
    /// Normals of length 1, `(worlds, rays, 3)`; 0 where nothing is met.
    pub normal: &'a mut [f64],
}

/// Which geoms rays meet, and where geoms and rays are in each world.
pub struct Casting<'a> {
    /// Geoms that count, in order.
    pub geoms: &'a [usize],
    /// The frame of a geom in a world.
    pub place: &'a (dyn Fn(usize, usize) -> Placed + Sync),
    /// A ray of a world.
    pub ray: &'a (dyn Fn(usize, usize) -> Ray + Sync),
    /// Rays of each world.
    pub rays: usize,
    /// Most threads.
    pub threads: usize,
}

/// A geom of one world.
struct Target<'a> {
    geom: usize,
    body: i32,
    shape: &'a RayShape,
    placed: Placed,
}

/// A sphere around a geom.
struct Sphere {
    center: [f64; 3],
    square: f64,
}

impl RayScene {
    /// Finds what each ray meets first; geoms without a shape are passed through. Of geoms at the same distance the
    /// first one counts.
    pub fn cast(&self, casting: &Casting<'_>, hits: Hits<'_>) {
        if casting.rays == 0 {
            return;
        }
        let size = TAKEN * casting.rays;
        let tests = hits.dist.len() * (1 + casting.geoms.len());
        let threads = casting.threads.min(1 + tests / WORK_MIN);
        let parts = hits.dist.chunks_mut(size).zip(hits.geom.chunks_mut(size));
        let queue = Mutex::new(parts.zip(hits.normal.chunks_mut(3 * size)).enumerate());
        let run = || {
            let mut world = World::default();
            loop {
                let taken = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
                let Some((part, ((dist, geom), normal))) = taken else {
                    break;
                };
                for first in (0..dist.len()).step_by(casting.rays) {
                    let number = part * TAKEN + first / casting.rays;
                    world.place(self, casting, number);
                    for ray in 0..casting.rays {
                        let met = world.cast(&(casting.ray)(number, ray));
                        let at = first + ray;
                        (dist[at], geom[at]) = (met.0, met.1);
                        normal[3 * at..][..3].copy_from_slice(&met.2);
                    }
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(run);
            }
            run();
        });
    }
}

/// The geoms of a world.
#[derive(Default)]
struct World<'a> {
    spheres: Vec<Sphere>,
    targets: Vec<Target<'a>>,
}

impl<'a> World<'a> {
    fn place(&mut self, scene: &'a RayScene, casting: &Casting<'_>, world: usize) {
        self.spheres.clear();
        self.targets.clear();
        for &geom in casting.geoms {
            let Some(shape) = &scene.geoms[geom].shape else {
                continue;
            };
            let mut placed = (casting.place)(world, geom);
            if let RayShape::Sphere(_) = shape {
                placed.mat = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
            }
            let (center, radius) = shape.bounds();
            let (p, m) = (placed.pos, placed.mat);
            self.spheres.push(Sphere {
                center: [0, 1, 2].map(|k| p[k] + dot3(&m[3 * k..], center)),
                square: (radius * (1.0 + MARGIN)).powi(2),
            });
            self.targets.push(Target {
                geom,
                body: scene.geoms[geom].body as i32,
                shape,
                placed,
            });
        }
    }

    /// Distance, geom and normal of what a ray meets first.
    fn cast(&self, ray: &Ray) -> (f64, i32, [f64; 3]) {
        let d = ray.direction;
        let a = dot3(&d, d);
        let mut nearest = (f64::INFINITY, -1, [0.0; 3]);
        for (sphere, target) in self.spheres.iter().zip(&self.targets) {
            let apart = [0, 1, 2].map(|k| ray.origin[k] - sphere.center[k]);
            let (b, c) = (dot3(&d, apart), dot3(&apart, apart) - sphere.square);
            let inside = b * b - a * c;
            // in the sphere, or on the way to it
            let is_near = c <= 0.0 || (b < 0.0 && inside >= 0.0);
            if !is_near || (target.body == ray.exclude && ray.exclude >= 0) {
                continue;
            }
            // it enters the sphere behind what it meets
            let before = -b - nearest.0 * a;
            if c > 0.0 && before > 0.0 && before * before > inside {
                continue;
            }
            if a < RAY_SMALL && sphere.square < f64::INFINITY {
                continue;
            }
            let (p, m) = (target.placed.pos, &target.placed.mat);
            let apart = [0, 1, 2].map(|k| ray.origin[k] - p[k]);
            let to_local =
                |v: [f64; 3]| [0, 1, 2].map(|k| m[k] * v[0] + m[k + 3] * v[1] + m[k + 6] * v[2]);
            let met = target.shape.cast(to_local(apart), to_local(d), nearest.0);
            if let Some((far, normal)) = met
                && far < nearest.0
            {
                let normal = [0, 1, 2].map(|k| dot3(&m[3 * k..], normal));
                nearest = (far, target.geom as i32, normal);
            }
        }
        match nearest.1 {
            -1 => (-1.0, -1, [0.0; 3]),
            _ => nearest,
        }
    }
}

fn dot3(a: &[f64], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
