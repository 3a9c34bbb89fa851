//! An image: its tiles of 8 × 8 pixels, and what each of them may see.

use sim_physics::lane::simd::widths;

use crate::camera::Camera;
use crate::scene::{Scene, Surface};
use crate::shade::{Lights, Shown};
use crate::shadow::Casters;
use crate::tile::{EDGE, Tile};
use crate::tree::{Bundle, Waiting, Walk};
use crate::vector::{Frame, Vector, dot, three};

/// Depths below which a corner of a box is not projected [m].
const SMALL: f32 = 1e-6;

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
    things: Vec<Seen>,
    order: Vec<u32>,
    /// Of each tile, things from the nearest to the farthest.
    tiles: Vec<Vec<u32>>,
    casters: Casters,
    shown: Shown,
    waiting: Waiting,
}

/// A thing in the frame of the camera.
#[derive(Clone, Copy, Debug)]
struct Seen {
    thing: usize,
    frame: Frame,
    /// Least depth of its box [m].
    near: f32,
    /// First and last columns and rows of tiles that it may be in.
    tiles: [[usize; 2]; 2],
    /// First and last rows of pixels.
    rows: [usize; 2],
}

/// A thing of the tree of those that rest, in an image.
#[derive(Clone, Copy, Debug, Default)]
struct Resting {
    image: u64,
    seen: Option<Seen>,
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
        let lights = image.rgb.is_some().then(|| Lights::new(scene, eye));
        if let Some(lights) = lights.as_ref().filter(|_| scene.light.shadows) {
            self.casters.place(scene, &self.frames, eye, &lights.key);
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
                .extend(Seen::new(number, frame, thing.half(), camera));
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
            let seen = &self.things[at as usize];
            if tile.farthest() < seen.near {
                break;
            }
            match &scene.things[seen.thing].surface {
                Surface::Solid { solid, .. } => {
                    let lines = seen.lines(place[1]);
                    solid.fill(&seen.frame, seen.thing as u32, lines, &mut tile)
                }
                Surface::Field { field, .. } => {
                    field.fill(&seen.frame, seen.thing as u32, &mut tile)
                }
                Surface::Triangles { tree, .. } => {
                    tree.fill(&seen.frame, seen.thing as u32, &mut self.waiting, &mut tile);
                }
            }
        }
        self.rest(scene, eye, camera, place, &mut tile);
        let [width, height] = [camera.width, camera.height];
        let columns = EDGE.min(width - EDGE * place[0]);
        for line in 0..EDGE.min(height - EDGE * place[1]) {
            let start = (EDGE * place[1] + line) * width + EDGE * place[0];
            for lane in 0..columns {
                let is_seen = tile.things[line][lane] != Tile::NOTHING;
                image.depth[start + lane] = if is_seen { tile.depth[line][lane] } else { 0.0 };
            }
            if let Some(to) = &mut image.labels {
                for lane in 0..columns {
                    to[start + lane] =
                        scene.label(tile.things[line][lane], tile.triangles[line][lane]);
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
                let pixels = &lights.line(&tile, &self.shown, line)[..columns];
                to[3 * start..3 * (start + columns)].copy_from_slice(pixels.as_flattened());
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
                        seen: Seen::new(number, frame, thing.half(), camera),
                    };
                }
                let Some(seen) = &self.resting[number].seen else {
                    continue;
                };
                let [columns, rows] = seen.tiles;
                let is_here = (columns[0]..=columns[1]).contains(&place[0])
                    && (rows[0]..=rows[1]).contains(&place[1]);
                if let (true, Surface::Solid { solid, .. }) = (is_here, &thing.surface) {
                    solid.fill(&seen.frame, number as u32, seen.lines(place[1]), tile);
                }
            }
        }
    }
}

impl Seen {
    /// A thing in a box about the origin of its frame; none where it is behind the camera or beside the image.
    #[inline(always)]
    fn new(thing: usize, frame: Frame, half: Vector, camera: &Camera) -> Option<Seen> {
        let pixels = [camera.width, camera.height];
        let mut seen = Seen {
            thing,
            frame,
            near: camera.near,
            tiles: pixels.map(|count| [0, (count - 1) / EDGE]),
            rows: [0, camera.height - 1],
        };
        if half.iter().any(|x| x.is_infinite()) {
            return Some(seen);
        }
        let reach = dot(three!(k => frame.rot[2][k].abs()), half);
        let (near, far) = (frame.pos[2] - reach, frame.pos[2] + reach);
        if far < camera.near || near > camera.far {
            return None;
        }
        if near < SMALL {
            return Some(seen);
        }
        seen.near = near;
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for corner in 0..8 {
            let side = three!(k => if corner >> k & 1 == 0 { -half[k] } else { half[k] });
            let turned = frame.turn(side);
            let [x, y, z] = three!(k => frame.pos[k] + turned[k]);
            let place = [x / z, y / z];
            for k in 0..2 {
                low[k] = low[k].min(place[k]);
                high[k] = high[k].max(place[k]);
            }
        }
        for k in 0..2 {
            // a pixel more on each side than the middles of pixels inside
            let first = low[k].mul_add(camera.focal[k], camera.center[k]) - 1.0;
            let last = high[k].mul_add(camera.focal[k], camera.center[k]) + 1.0;
            if last < 0.0 || first > pixels[k] as f32 {
                return None;
            }
            let range = [first, last].map(|pixel| (pixel.max(0.0) as usize).min(pixels[k] - 1));
            seen.tiles[k] = range.map(|pixel| pixel / EDGE);
            if k == 1 {
                seen.rows = range;
            }
        }
        Some(seen)
    }

    /// Lines of a row of tiles that it may be in.
    #[inline(always)]
    fn lines(&self, row: usize) -> std::ops::Range<usize> {
        let start = EDGE * row;
        let last = self.rows[1].min(start + EDGE - 1);
        self.rows[0].saturating_sub(start)..(last + 1).saturating_sub(start)
    }
}
