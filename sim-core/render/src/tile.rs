//! Eight rows of eight pixels, whose rays are met together.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::camera::Camera;
use crate::vector::{Frame, each, three};

/// Pixels along an edge of a tile.
pub(crate) const EDGE: usize = 8;

/// A tile of an image: its rays, which are (x, y, 1) in the frame of the camera, and the nearest that they have met.
pub(crate) struct Tile {
    pub(crate) x: [f32; EDGE],
    pub(crate) y: [f32; EDGE],
    /// Least depth that is seen [m].
    pub(crate) near: f32,
    /// Depths [m]; the largest that is seen, where nothing is met.
    pub(crate) depth: [[f32; EDGE]; EDGE],
    /// Numbers of things, of which a scene has less than 2²⁴.
    pub(crate) things: [[f32; EDGE]; EDGE],
    /// Where on them: bits of the number of a triangle, which are only copied and never computed with, or a place of a
    /// field.
    pub(crate) places: [[f32; EDGE]; EDGE],
}

impl Tile {
    /// No thing.
    pub(crate) const NOTHING: f32 = -1.0;

    #[inline(always)]
    pub(crate) fn new(camera: &Camera, place: [usize; 2]) -> Tile {
        let (mut x, mut y) = ([0.0; EDGE], [0.0; EDGE]);
        for pixel in 0..EDGE {
            // what is beside the image is as its edge
            x[pixel] = camera.at(0, (EDGE * place[0] + pixel).min(camera.width - 1));
            y[pixel] = camera.at(1, (EDGE * place[1] + pixel).min(camera.height - 1));
        }
        Tile {
            x,
            y,
            near: camera.near,
            depth: [[camera.far; EDGE]; EDGE],
            things: [[Tile::NOTHING; EDGE]; EDGE],
            places: [[0.0; EDGE]; EDGE],
        }
    }

    /// The largest depth.
    #[inline(always)]
    pub(crate) fn farthest(&self) -> f32 {
        let mut most = F32x8::load(&self.depth[0]);
        for line in 1..EDGE {
            most = F32x8::load(&self.depth[line]).max(most);
        }
        let mut lanes = [0.0; EDGE];
        most.store(&mut lanes);
        let [a, b, c, d] = each!(k in 0 1 2 3 => lanes[k].max(lanes[k + 4]));
        a.max(b).max(c.max(d))
    }

    /// Depths of a line; 0 where nothing is seen.
    #[inline(always)]
    pub(crate) fn depths(&self, line: usize) -> [f32; EDGE] {
        let mut depths = [0.0; EDGE];
        let depth = F32x8::load(&self.depth[line]);
        F32x8::select(self.is_seen(line), depth, F32x8::k(0.0)).store(&mut depths);
        depths
    }

    /// Directions of the rays of a line.
    #[inline(always)]
    pub(crate) fn rays(&self, line: usize) -> [F32x8; 3] {
        let y = F32x8::k(self.y[line]);
        [F32x8::load(&self.x), y, F32x8::k(1.0)]
    }

    /// Directions of the rays of a line, in the frame of a thing.
    #[inline(always)]
    pub(crate) fn directions(&self, frame: &Frame, line: usize) -> [F32x8; 3] {
        let (rot, x) = (&frame.rot, F32x8::load(&self.x));
        three!(k => F32x8::k(rot[0][k]).fma(x, F32x8::k(rot[1][k].mul_add(self.y[line], rot[2][k]))))
    }

    /// Which rays of a line see something.
    #[inline(always)]
    pub(crate) fn is_seen(&self, line: usize) -> <F32x8 as Num>::Mask {
        F32x8::k(Tile::NOTHING).lt(F32x8::load(&self.things[line]))
    }

    /// Which rays of a line see a thing.
    #[inline(always)]
    pub(crate) fn sees(&self, line: usize, thing: f32) -> <F32x8 as Num>::Mask {
        let (things, thing) = (F32x8::load(&self.things[line]), F32x8::k(thing));
        !(things.lt(thing) | thing.lt(things))
    }

    /// Keeps what the rays of a line meet, where that is nearer.
    #[inline(always)]
    pub(crate) fn keep(
        &mut self,
        line: usize,
        depth: F32x8,
        is_met: <F32x8 as Num>::Mask,
        thing: u32,
        triangle: u32,
    ) {
        let triangle = F32x8::k(f32::from_bits(triangle));
        self.keep_each(line, depth, is_met, thing, triangle);
    }

    /// The same, of a place for each ray.
    #[inline(always)]
    pub(crate) fn keep_each(
        &mut self,
        line: usize,
        depth: F32x8,
        is_met: <F32x8 as Num>::Mask,
        thing: u32,
        places: F32x8,
    ) {
        let before = F32x8::load(&self.depth[line]);
        let is_met = is_met & depth.lt(before) & F32x8::k(self.near).lt(depth);
        F32x8::select(is_met, depth, before).store(&mut self.depth[line]);
        let things = F32x8::load(&self.things[line]);
        F32x8::select(is_met, F32x8::k(thing as f32), things).store(&mut self.things[line]);
        let others = F32x8::load(&self.places[line]);
        F32x8::select(is_met, places, others).store(&mut self.places[line]);
    }

    /// Keeps what one ray meets, which is nearer.
    #[inline(always)]
    pub(crate) fn keep_one(
        &mut self,
        [line, lane]: [usize; 2],
        depth: f32,
        thing: u32,
        triangle: u32,
    ) {
        self.depth[line][lane] = depth;
        self.things[line][lane] = thing as f32;
        self.places[line][lane] = f32::from_bits(triangle);
    }

    /// The number of the triangle that a ray meets.
    #[inline(always)]
    pub(crate) fn triangle(&self, line: usize, lane: usize) -> u32 {
        self.places[line][lane].to_bits()
    }
}
