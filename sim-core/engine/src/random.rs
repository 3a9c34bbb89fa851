//! Counter-based random numbers: each is a function of its purpose. So it is the same on every backend, in every order of calls, and for
//! any number of worlds.
//!
//! Philox4x32-10 (Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011): ten rounds of
//! multiplications turn a counter into 128 random bits under a key. The key is a seed, the counter (world, episode, stream,
//! index), or for what is drawn in each frame (world, episode, step, stream and index).

use sim_model::Distribution;
use sim_physics::constants::params::Param;

/// How many streams a task has, [`Stream::Task`].
pub const TASK_STREAMS: u8 = 32;

/// How many cameras have a stream of noise, [`Stream::DepthNoise`].
pub const CAMERA_STREAMS: u8 = 100;

/// What the draws of a world depend on, besides stream and step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Episode {
    /// Its seed.
    pub seed: u64,
    /// Its number in draws.
    pub world: u32,
    /// Resets since it got its seed.
    pub episode: u32,
}

/// Purpose of random numbers; different streams are independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Positions after a reset; the index is a dof.
    StartPosition,
    /// Velocities after a reset; the index is a dof.
    StartVelocity,
    /// Offsets of a camera after a reset; the index is eight times the camera's, and the part's.
    Camera,
    /// A parameter after a reset; the index is a column of it.
    Param(Param),
    /// Draws of a task, such as goals. It has 32 streams, from 0, and defines the index.
    Task(u8),
    /// Of `joint_f` in a frame; the index is a dof. Streams of frames begin here.
    ForceNoise,
    /// Of `joint_target_q`, likewise.
    TargetNoise,
    /// Of `joint_target_qd`, likewise.
    TargetRateNoise,
    /// Of `joint_q_measured`; the index is a dof.
    PositionNoise,
    /// Of `joint_qd_measured`, likewise.
    VelocityNoise,
    /// Of `joint_torque`, likewise.
    TorqueNoise,
    /// Of `site_q`; the index is six times the site's, and three of the position, three of the turn.
    SitePoseNoise,
    /// Of `site_qd`; the index is the column.
    SiteVelocityNoise,
    /// Of `gyro`; the index is the column.
    GyroNoise,
    /// Of `accelerometer`; the index is the column.
    AccelerometerNoise,
    /// Of `contact_sensor`; the index is the column.
    ContactSensorNoise,
    /// Of the depths of a camera, by its number, below [`CAMERA_STREAMS`]; the index is a pixel.
    DepthNoise(u8),
}

impl Stream {
    /// Its part of the counter.
    pub fn number(self) -> u32 {
        match self {
            Stream::StartPosition => 0,
            Stream::StartVelocity => 1,
            Stream::Camera => 2,
            Stream::Task(stream) => {
                assert!(stream < TASK_STREAMS, "a task has {TASK_STREAMS} streams");
                64 + u32::from(stream)
            }
            Stream::ForceNoise => 128,
            Stream::TargetNoise => 129,
            Stream::TargetRateNoise => 130,
            Stream::PositionNoise => 131,
            Stream::VelocityNoise => 132,
            Stream::TorqueNoise => 133,
            Stream::SitePoseNoise => 134,
            Stream::SiteVelocityNoise => 135,
            Stream::GyroNoise => 136,
            Stream::AccelerometerNoise => 137,
            Stream::ContactSensorNoise => 138,
            Stream::DepthNoise(camera) => {
                assert!(camera < CAMERA_STREAMS, "no stream of camera {camera}");
                139 + u32::from(camera)
            }
            // FNV-1a of its name, so that a row that joins the table moves no draw; the upper half is the parameters'
            Stream::Param(param) => {
                let name = param.row().name.bytes();
                let hash = name.fold(0x811c_9dc5_u32, |hash, byte| {
                    (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
                });
                1 << 31 | hash
            }
        }
    }
}

/// Whether the world's number is part of what a draw depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Draws {
    /// It is: worlds with one seed draw different numbers.
    #[default]
    World,
    /// It is not: worlds with one seed draw the same numbers.
    Seed,
}

impl Draws {
    /// The one of a name.
    pub fn named(name: &str) -> Option<Draws> {
        [Draws::World, Draws::Seed]
            .into_iter()
            .find(|draws| draws.name() == name)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Draws::World => "world",
            Draws::Seed => "seed",
        }
    }
}

/// World numbers in draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Numbering {
    /// Whether draws depend on the world's number.
    pub draws: Draws,
    /// World number of the first world; other groups may come before.
    pub first_world: usize,
}

impl Numbering {
    /// The number of the world at an offset from the first.
    pub fn number(self, world: usize) -> u32 {
        match self.draws {
            Draws::World => (self.first_world + world) as u32,
            Draws::Seed => 0,
        }
    }

    /// The numbering of worlds that begin at an offset.
    pub fn after(self, worlds: usize) -> Numbering {
        Numbering {
            first_world: self.first_world + worlds,
            ..self
        }
    }
}

/// The numbers of one stream in one episode of one world, each with its index.
#[derive(Clone, Copy, Debug)]
pub struct Draw {
    key: [u32; 2],
    counter: [u32; 3],
    /// Added to the index.
    offset: u32,
}

impl Draw {
    /// Numbers of a world's episode under a seed.
    pub fn new(seed: u64, world: u32, episode: u32, stream: Stream) -> Draw {
        Draw {
            key: [seed as u32, (seed >> 32) as u32],
            counter: [world, episode, stream.number()],
            offset: 0,
        }
    }

    /// Numbers of a frame of a world's episode, those of one of the streams of frames; indices below 2²⁴. After 2³² steps the
    /// first come again.
    pub fn at_step(seed: u64, world: u32, episode: u32, step: u64, stream: Stream) -> Draw {
        Draw {
            key: [seed as u32, (seed >> 32) as u32],
            counter: [world, episode, step as u32],
            // its highest bit is set, which no index of the other streams reaches
            offset: stream.number() << 24,
        }
    }

    /// A number in [low, high], uniformly distributed.
    pub fn uniform(&self, index: u32, low: f64, high: f64) -> f64 {
        let [unit, _] = self.units(index);
        // rounding of the sum may reach the end, not pass it
        (low + (high - low) * unit).min(high)
    }

    /// A number of a normal distribution (Box and Muller 1958), at most 8.6 `std` from the mean.
    pub fn normal(&self, index: u32, mean: f64, std: f64) -> f64 {
        let [a, b] = self.units(index);
        // 1 - a is above 0, and its logarithm finite
        let radius = (-2.0 * libm::log(1.0 - a)).sqrt();
        mean + std * radius * libm::cos(std::f64::consts::TAU * b)
    }

    /// A number of a distribution.
    pub fn sample(&self, index: u32, distribution: Distribution) -> f64 {
        match distribution {
            Distribution::Uniform { low, high } => self.uniform(index, low, high),
            Distribution::Normal { mean, std } => self.normal(index, mean, std),
        }
    }

    /// Two independent numbers in [0, 1), multiples of 2⁻⁵³.
    fn units(&self, index: u32) -> [f64; 2] {
        let [world, episode, third] = self.counter;
        let [a, b, c, d] = philox([world, episode, third, self.offset + index], self.key);
        let unit = |high: u32, low: u32| {
            let bits = u64::from(high) << 32 | u64::from(low);
            (bits >> 11) as f64 / (1u64 << 53) as f64
        };
        [unit(a, b), unit(c, d)]
    }
}

/// Philox4x32-10: 128 random bits of a counter under a key.
pub fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    const MULTIPLIERS: [u32; 2] = [0xd251_1f53, 0xcd9e_8d57];
    // the golden ratio and √3 - 1: Weyl's sequence turns one key into ten
    const STEPS: [u32; 2] = [0x9e37_79b9, 0xbb67_ae85];
    for _ in 0..10 {
        let [a, b] = [counter[0], counter[2]];
        let product = |i: usize, x: u32| u64::from(MULTIPLIERS[i]) * u64::from(x);
        let (p, q) = (product(0, a), product(1, b));
        let high = |product: u64| (product >> 32) as u32;
        counter = [
            high(q) ^ counter[1] ^ key[0],
            q as u32,
            high(p) ^ counter[3] ^ key[1],
            p as u32,
        ];
        key = [key[0].wrapping_add(STEPS[0]), key[1].wrapping_add(STEPS[1])];
    }
    counter
}
