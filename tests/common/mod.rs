//! What several tests share: the lesson's scene, and frames of a simulation as numbers.
#![allow(dead_code)] // each test binary uses its part

pub mod any_program;
pub mod any_scene;
pub mod cases;
pub mod dice;
pub mod drawn;
pub mod grouped;
#[path = "../../examples/lesson/mod.rs"]
mod lesson_scene;
pub mod played;
pub mod program;
pub mod recorded;
pub mod shapes;
pub mod stones;

#[allow(unused_imports)] // as above
pub use lesson_scene::{Demo, FRAMES, START, command, lesson};
use sim_engine::backend::Values;
use sim_engine::simulation::{Lanes, Options, Precision, Simulation};
use sim_model::{Body, Collision, Description, Model, Pose, Shape, Surface};
use sim_physics::arrays::{Dtype, Field};
use std::path::PathBuf;
use std::sync::Arc;

/// The lesson's scene with its table, and the cube on it if asked for.
pub fn lesson_with_table(demo: Demo, has_cube: bool) -> Description {
    let mut scene = lesson(demo);
    scene.add_box("table", [0.4, 0.4, 0.05], Pose::at([0.0, -0.5, 0.05]));
    if has_cube {
        let half_extents = [0.025; 3];
        let mut cube = Collision::new(None, Shape::Box { half_extents }, Pose::identity());
        cube.surface = Surface {
            margin: 1e-3,
            ..Surface::default()
        };
        let mut body = Body::new("cube", Pose::at([0.0, -0.35, 0.125]));
        body.shapes.push((cube, 400.0));
        scene.add_body(body).unwrap();
    }
    scene
}

/// A number in [-1, 1) from a world's seed: no shared generator, so worlds can be moved about.
pub fn noise(seed: usize, k: usize) -> f64 {
    let mut x = (seed as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (k as u64) << 32;
    for _ in 0..3 {
        x ^= x >> 31;
        x = x.wrapping_mul(0xd6e8_feb8_6659_fd93);
    }
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A path in the repository.
pub fn repo(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// So many worlds with these fields, in this precision, width and number of threads.
pub fn options(
    fields: &[Field],
    worlds: usize,
    precision: Precision,
    lanes: Lanes,
    threads: usize,
) -> Options {
    Options {
        worlds,
        precision,
        lanes,
        threads: Some(threads),
        fields: fields.to_vec(),
        ..Options::default()
    }
}

/// A simulation and the arena of its frames.
pub struct Run {
    /// The simulation.
    pub sim: Simulation,
    /// The last frame.
    pub arena: Vec<u64>,
}

impl Run {
    /// Worlds of a model with these fields.
    pub fn new(model: &Arc<Model>, options: Options) -> Run {
        let sim = Simulation::new(model.clone(), &options).unwrap();
        let arena = vec![0; sim.layout().bytes / 8];
        Run { sim, arena }
    }

    /// One world in f64.
    pub fn reference(model: &Arc<Model>, fields: &[Field]) -> Run {
        let options = Options {
            precision: Precision::F64,
            lanes: Lanes::Scalar,
            threads: Some(1),
            fields: fields.to_vec(),
            ..Options::default()
        };
        Run::new(model, options)
    }

    /// Sets a command to the same row in every world.
    pub fn command(&mut self, field: Field, row: &[f64]) {
        let all: Vec<f64> = (0..self.sim.worlds())
            .flat_map(|_| row.iter().copied())
            .collect();
        self.sim
            .command(field, 0..row.len(), Values::F64(&all))
            .unwrap();
    }

    /// Sets a part of the state to the same row in every world.
    pub fn write(&mut self, field: Field, row: &[f64]) {
        let all: Vec<f64> = (0..self.sim.worlds())
            .flat_map(|_| row.iter().copied())
            .collect();
        self.sim
            .write(field, 0..row.len(), Values::F64(&all), None)
            .unwrap();
    }

    /// One control frame.
    pub fn step(&mut self) {
        self.sim.step(&mut self.arena);
    }

    /// Evaluates without stepping.
    pub fn forward(&mut self) {
        self.sim.forward(&mut self.arena);
    }

    /// Fields of numbers of a world, one after another.
    pub fn numbers(&self, fields: &[Field], world: usize) -> Vec<f64> {
        let numbers = fields.iter().flat_map(|field| self.get(*field, world));
        numbers.collect()
    }

    /// A field of numbers of a world.
    pub fn get(&self, field: Field, world: usize) -> Vec<f64> {
        let slot = self
            .sim
            .layout()
            .slots
            .iter()
            .find(|slot| slot.field == field);
        let slot = slot.expect("the field was asked for");
        let n: usize = slot.shape[1..].iter().product();
        let size = slot.dtype.bytes();
        let first = slot.offset + world * n * size;
        let words = first / 8..(first + n * size).div_ceil(8);
        let before = first - 8 * words.start;
        let bytes: Vec<u8> = self.arena[words]
            .iter()
            .flat_map(|word| word.to_ne_bytes())
            .collect();
        bytes[before..before + n * size]
            .chunks_exact(size)
            .map(|x| match slot.dtype {
                Dtype::F32 => f64::from(f32::from_ne_bytes(x.try_into().unwrap())),
                Dtype::F64 => f64::from_ne_bytes(x.try_into().unwrap()),
                Dtype::I32 => f64::from(i32::from_ne_bytes(x.try_into().unwrap())),
                Dtype::U32 => f64::from(u32::from_ne_bytes(x.try_into().unwrap())),
                Dtype::U64 => u64::from_ne_bytes(x.try_into().unwrap()) as f64,
                other => unreachable!("{other:?}"),
            })
            .collect()
    }
}

/// Rows of a CSV file of numbers, comments left out.
pub fn csv(path: PathBuf) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    numbers(&text)
}

/// Rows of the text of such a file.
pub fn numbers(text: &str) -> Vec<Vec<f64>> {
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split(',').map(|x| x.trim().parse().unwrap()).collect())
        .collect()
}

/// Largest absolute difference.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(x, y)| (x - y).abs())
        .fold(0.0, f64::max)
}
