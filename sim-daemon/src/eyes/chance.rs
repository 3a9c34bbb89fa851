//! What is random of a camera: where it is and how it projects in an episode, and the noise of its depths in a frame.

use sim_engine::random::{Draw, Episode, Stream};
use sim_model::{Camera, CameraPart, Distribution, Pose};
use sim_render::Frame;

/// Parts of a camera that draws have room for.
const PARTS: u32 = 8;
/// Least and largest factors on focal lengths [–].
const FOCAL: [f64; 2] = [0.1, 10.0];

/// What draws depend on.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Moment {
    pub(super) episode: Episode,
    pub(super) step: u64,
}

impl Moment {
    /// Whether its frame repeats an image that was drawn then, with so many frames from one image to the next.
    pub(super) fn repeats(&self, then: &Moment, every: u64) -> bool {
        let is_later = then.step < self.step || *then == *self;
        then.episode == self.episode
            && is_later
            && !self.step.is_multiple_of(every)
            && then.step / every == self.step / every
    }
}

/// The random part of a camera.
pub(super) struct Chance {
    /// The camera's index in the scene.
    number: u32,
    draws: [Option<Distribution>; CameraPart::ALL.len()],
    /// Standard deviation of depths [m], and times their squares [1/m].
    noise: [f64; 2],
}

impl Chance {
    pub(super) fn new(number: usize, camera: &Camera) -> Chance {
        Chance {
            number: number as u32,
            draws: camera.draws,
            noise: camera.depth_noise,
        }
    }

    /// Whether there is anything random.
    pub(super) fn is_random(&self) -> bool {
        self.moves() || self.noise != [0.0; 2]
    }

    fn moves(&self) -> bool {
        self.draws.iter().any(Option::is_some)
    }

    /// Where the camera is in this episode, and how it projects.
    pub(super) fn moved(
        &self,
        moment: &Moment,
        place: &Frame,
        camera: &sim_render::Camera,
    ) -> (Frame, sim_render::Camera) {
        if !self.moves() {
            return (*place, *camera);
        }
        let Episode {
            seed,
            world,
            episode,
        } = moment.episode;
        let draw = Draw::new(seed, world, episode, Stream::Camera);
        let offset = |part: CameraPart| {
            let index = PARTS * self.number + part as u32;
            self.draws[part as usize].map_or(0.0, |drawn| draw.sample(index, drawn))
        };
        use CameraPart::{Focal, Pitch, Roll, X, Y, Yaw, Z};
        let offset_pose = Pose::from_rpy([X, Y, Z].map(offset), [Roll, Pitch, Yaw].map(offset));
        let factor = (1.0 + offset(Focal)).clamp(FOCAL[0], FOCAL[1]) as f32;
        let camera = sim_render::Camera {
            focal: camera.focal.map(|focal| factor * focal),
            ..*camera
        };
        (place.then(&Frame::from(&offset_pose)), camera)
    }

    /// Adds noise to the depths of what is seen, which stay between the nearest and the farthest one.
    pub(super) fn add_noise(
        &self,
        moment: &Moment,
        camera: &sim_render::Camera,
        depth: &mut [f32],
    ) {
        let [least, square] = self.noise;
        if self.noise == [0.0; 2] {
            return;
        }
        let Episode {
            seed,
            world,
            episode,
        } = moment.episode;
        let stream = Stream::DepthNoise(self.number as u8);
        let draw = Draw::at_step(seed, world, episode, moment.step, stream);
        for (pixel, depth) in depth.iter_mut().enumerate() {
            if *depth > 0.0 {
                let exact = f64::from(*depth);
                let std = least + square * exact * exact;
                let noisy = draw.normal(pixel as u32, exact, std) as f32;
                *depth = noisy.clamp(camera.near, camera.far);
            }
        }
    }
}
