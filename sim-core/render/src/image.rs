//! An image: its tiles of 8 × 8 pixels, and what each of them may see.

use sim_physics::lane::simd::widths;

use crate::camera::Camera;
use crate::light::Lights;
use crate::placed::Placed;
use crate::scene::{NOTHING, Scene, Surface};
use crate::shadow::Casters;
use crate::shown::Shown;
use crate::tile::{EDGE, Tile};
use crate::tree::{Bundle, Waiting, Walk};
use crate::vector::Frame;

/// Memory that images need meanwhile: one for each thread.
#[derive(Default)]
pub struct Scratch {
    /// Of all things, in the frame of the camera; of those that rest, of which something is seen.
    frames: Vec<Frame>,
    /// Those that rest, once a tile asked for them.
    resting: Vec<Resting>,
    /// Counts images, so that nothing of an earlier one is taken for one of this.
    image: u64,
    walk: Walk,
    things: Vec<Placed>,
    order: Vec<u32>,
    /// Of each tile, things from the nearest to the farthest.
    tiles: Vec<Vec<u32>>,
    casters: Casters,
    shown: Shown,
    waiting: Waiting,
}

/// A thing of the tree of those that rest, in an image.
#[derive(Clone, Copy, Debug, Default)]
struct Resting {
    image: u64,
    placed: Option<Placed>,
}

/// Where an image goes, row by row. `(height, width)` each, if not said otherwise
#[derive(Debug)]
pub struct Image<'a> {
    /// Depth along the camera's z [m]; 0 where nothing is seen.
    pub depth: &'a mut [f32],
    /// Labels of parts, [`crate::NOTHING`] where none is seen.
    pub labels: Option<&'a mut [i32]>,
    /// Red, green and blue, as a screen shows them. `(height, width, 3)`
    pub rgb: Option<&'a mut [u8]>,
}

/// What draws images on this processor.
///
/// # Panics
/// A body has no frame, the image has another size than the camera, or [`Camera::is_valid`] is false.
pub type Draw = fn(&Scene, &[Frame], &Frame, &Camera, &mut Scratch, &mut Image<'_>);

/// Draws what a camera sees, from the frames of bodies and of the camera in the world; none where the processor lacks AVX2 with
/// FMA or NEON.
pub fn draw() -> Option<Draw> {
    /// # Safety
    /// The processor has the instructions.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    unsafe fn eight(
        scene: &Scene,
        bodies: &[Frame],
        eye: &Frame,
        camera: &Camera,
        scratch: &mut Scratch,
        image: &mut Image<'_>,
    ) {
        scratch.draw(scene, bodies, eye, camera, image);
    }
    // SAFETY: the processor has them
    widths()
        .eight
        .then_some(|scene, bodies, eye, camera, scratch, image| unsafe {
            eight(scene, bodies, eye, camera, scratch, image)
        })
}

impl Scratch {
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    fn draw(
        &mut self,
        scene: &Scene,
        bodies: &[Frame],
        eye: &Frame,
        camera: &Camera,
        image: &mut Image<'_>,
    ) {
        let pixels = camera.width * camera.height;
        assert!(
            bodies.len() >= scene.bodies(),
            "{} frames of {} bodies",
            bodies.len(),
            scene.bodies()
        );
        assert!(
            image.depth.len() == pixels
                && image
                    .labels
                    .as_ref()
                    .is_none_or(|labels| labels.len() == pixels)
                && image.rgb.as_ref().is_none_or(|rgb| rgb.len() == 3 * pixels),
            "an image of another size than its camera's"
        );
        assert!(camera.is_valid(), "{camera:?}");
        if pixels == 0 {
            return;
        }
        let across = camera.width.div_ceil(EDGE);
        let down = camera.height.div_ceil(EDGE);
        self.place(scene, bodies, eye, camera, [across, down]);
        let lights = image.rgb.is_some().then(|| Lights::new(&scene.light, eye));
        if let Some(lights) = &lights {
            self.shown.begin(scene.things.len());
            if scene.light.shadows {
                self.casters.place(scene, &self.frames, eye, &lights.key);
            }
        }
        for row in 0..down {
            for column in 0..across {
                self.tile(scene, eye, camera, lights.as_ref(), [column, row], image);
            }
        }
    }

    /// Finds where things are, and which tiles may see them.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    fn place(
        &mut self,
        scene: &Scene,
        bodies: &[Frame],
        eye: &Frame,
        camera: &Camera,
        tiles: [usize; 2],
    ) {
        self.things.clear();
        self.frames.clear();
        self.frames.resize(scene.resting, Frame::IDENTITY);
        self.resting.resize(scene.resting, Resting::default());
        self.image += 1;
        for (number, thing) in scene.things.iter().enumerate().skip(scene.resting) {
            let in_world = match thing.body {
                Some(body) => bodies[body].then(&thing.frame),
                None => thing.frame,
            };
            let frame = eye.relative(&in_world);
            self.frames.push(frame);
            self.things
                .extend(Placed::new(number, frame, thing.half(), camera));
        }
        self.order.clear();
        self.order.extend(0..self.things.len() as u32);
        let things = &self.things;
        self.order.sort_unstable_by(|&a, &b| {
            let (first, second) = (things[a as usize].near, things[b as usize].near);
            first.total_cmp(&second).then(a.cmp(&b))
        });
        self.tiles.resize_with(tiles[0] * tiles[1], Vec::new);
        self.tiles.iter_mut().for_each(Vec::clear);
        for &at in &self.order {
            let [columns, rows] = self.things[at as usize].tiles;
            for row in rows[0]..=rows[1] {
                for column in columns[0]..=columns[1] {
                    self.tiles[row * tiles[0] + column].push(at);
                }
            }
        }
    }

    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    fn tile(
        &mut self,
        scene: &Scene,
        eye: &Frame,
        camera: &Camera,
        lights: Option<&Lights>,
        place: [usize; 2],
        image: &mut Image<'_>,
    ) {
        let mut tile = Tile::new(camera, place);
        let across = camera.width.div_ceil(EDGE);
        for &at in &self.tiles[place[1] * across + place[0]] {
            let placed = &self.things[at as usize];
            if tile.farthest() < placed.near {
                break;
            }
            match &scene.things[placed.thing].surface {
                Surface::Solid { solid, .. } => {
                    let lines = placed.lines(place[1]);
                    solid.fill(&placed.frame, placed.thing as u32, lines, &mut tile)
                }
                Surface::Field { field, .. } => {
                    field.fill(&placed.frame, placed.thing as u32, &mut tile)
                }
                Surface::Triangles { tree, .. } => {
                    let number = placed.thing as u32;
                    tree.fill(
                        &placed.frame,
                        number,
                        placed.count(),
                        &mut self.waiting,
                        &mut tile,
                    );
                }
            }
        }
        self.rest(scene, eye, camera, place, &mut tile);
        let [width, height] = [camera.width, camera.height];
        let columns = EDGE.min(width - EDGE * place[0]);
        for line in 0..EDGE.min(height - EDGE * place[1]) {
            let start = (EDGE * place[1] + line) * width + EDGE * place[0];
            copied(&tile.depths(line), &mut image.depth[start..start + columns]);
            if let Some(to) = &mut image.labels {
                for lane in 0..columns {
                    let is_seen = tile.things[line][lane] != Tile::NOTHING;
                    to[start + lane] = match is_seen {
                        true => {
                            scene.label(tile.things[line][lane] as usize, tile.triangle(line, lane))
                        }
                        false => NOTHING,
                    };
                }
            }
        }
        if let (Some(lights), Some(to)) = (lights, &mut image.rgb) {
            lights.fall(
                scene,
                &self.frames,
                &mut self.casters,
                &mut self.waiting,
                &tile,
                &mut self.shown,
            );
            for line in 0..EDGE.min(height - EDGE * place[1]) {
                let start = (EDGE * place[1] + line) * width + EDGE * place[0];
                let pixels = lights.line(&tile, &self.shown, line);
                let to = to[3 * start..3 * (start + columns)].as_chunks_mut().0;
                copied(&pixels, to);
            }
        }
    }

    /// Shows things that rest in a tile.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    fn rest(
        &mut self,
        scene: &Scene,
        eye: &Frame,
        camera: &Camera,
        place: [usize; 2],
        tile: &mut Tile,
    ) {
        let Some(tree) = &scene.tree else {
            return;
        };
        let world = eye.relative(&Frame::IDENTITY);
        let bundle = Bundle::new(&world, &tree.origin_at(eye.pos), tile);
        self.walk.start();
        while let Some(leaf) = self.walk.next_seen(tree, &bundle, tile.farthest()) {
            for &number in leaf {
                let thing = &scene.things[number];
                if self.resting[number].image != self.image {
                    let frame = eye.relative(&thing.frame);
                    self.frames[number] = frame;
                    self.resting[number] = Resting {
                        image: self.image,
                        placed: Placed::new(number, frame, thing.half(), camera),
                    };
                }
                let Some(placed) = &self.resting[number].placed else {
                    continue;
                };
                let [columns, rows] = placed.tiles;
                let is_here = (columns[0]..=columns[1]).contains(&place[0])
                    && (rows[0]..=rows[1]).contains(&place[1]);
                if let (true, Surface::Solid { solid, .. }) = (is_here, &thing.surface) {
                    solid.fill(&placed.frame, number as u32, placed.lines(place[1]), tile);
                }
            }
        }
    }
}

/// Copies the pixels of a line that are in the image.
#[inline(always)]
fn copied<T: Copy>(from: &[T; EDGE], to: &mut [T]) {
    match to.first_chunk_mut() {
        // of a length that the compiler knows
        Some(whole) => *whole = *from,
        None => to.copy_from_slice(&from[..to.len()]),
    }
}
