//! An image: its tiles of 8 × 8 pixels, and what each of them may see.

use sim_physics::lane::simd::widths;

use crate::camera::Camera;
use crate::scene::{Scene, Surface};
use crate::shade::{Lights, Shown};
use crate::shadow::Casters;
use crate::tile::{EDGE, Tile};
use crate::tree::Waiting;
use crate::vector::{Frame, Vector, dot, three};

/// Depths below which a corner of a box is not projected [m].
const SMALL: f32 = 1e-6;

/// Memory that images need meanwhile: one for each thread.
#[derive(Default)]
pub struct Scratch {
    /// Of all things, in the frame of the camera.
    frames: Vec<Frame>,
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
            self.casters.place(scene, &self.frames, &lights.key);
        }
        for row in 0..down {
            for column in 0..across {
                self.tile(scene, camera, lights.as_ref(), [column, row], image);
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
        for (number, thing) in scene.things.iter().enumerate() {
            let in_world = match thing.body {
                Some(body) => bodies[body].then(&thing.frame),
                None => thing.frame,
            };
            let frame = eye.relative(&in_world);
            self.frames.push(frame);
            if let Some((near, tiles)) = extent(&frame, thing.half(), camera, tiles) {
                self.things.push(Seen {
                    thing: number,
                    frame,
                    near,
                    tiles,
                });
            }
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
                    solid.fill(&seen.frame, seen.thing as u32, &mut tile)
                }
                Surface::Field { field, .. } => {
                    field.fill(&seen.frame, seen.thing as u32, &mut tile)
                }
                Surface::Triangles { tree, .. } => {
                    tree.fill(&seen.frame, seen.thing as u32, &mut self.waiting, &mut tile);
                }
            }
        }
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
}

/// Least depth of a box about the origin of a frame, and the tiles that it may be in; none where it is behind the camera or
/// beside the image.
#[inline(always)]
fn extent(
    frame: &Frame,
    half: Vector,
    camera: &Camera,
    tiles: [usize; 2],
) -> Option<(f32, [[usize; 2]; 2])> {
    let all = [[0, tiles[0] - 1], [0, tiles[1] - 1]];
    if half.iter().any(|x| x.is_infinite()) {
        return Some((camera.near, all));
    }
    let reach = dot(three!(k => frame.rot[2][k].abs()), half);
    let (near, far) = (frame.pos[2] - reach, frame.pos[2] + reach);
    if far < camera.near || near > camera.far {
        return None;
    }
    if near < SMALL {
        return Some((camera.near, all));
    }
    let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    for corner in 0..8 {
        let side = |k: usize| {
            if corner >> k & 1 == 0 {
                -half[k]
            } else {
                half[k]
            }
        };
        let turned = frame.turn([side(0), side(1), side(2)]);
        let [x, y, z] = three!(k => frame.pos[k] + turned[k]);
        let place = [x / z, y / z];
        for k in 0..2 {
            low[k] = low[k].min(place[k]);
            high[k] = high[k].max(place[k]);
        }
    }
    let pixels = [camera.width, camera.height];
    let mut range = [[0; 2]; 2];
    for k in 0..2 {
        // a pixel more on each side than the middles of pixels inside
        let first = low[k].mul_add(camera.focal[k], camera.center[k]) - 1.0;
        let last = high[k].mul_add(camera.focal[k], camera.center[k]) + 1.0;
        if last < 0.0 || first > pixels[k] as f32 {
            return None;
        }
        range[k] = [first, last].map(|pixel| (pixel.max(0.0) as usize / EDGE).min(tiles[k] - 1));
    }
    Some((near, range))
}
