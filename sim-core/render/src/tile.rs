//! Eight rows of eight pixels, whose rays are met together.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::camera::Camera;
use crate::vector::{Frame, three};

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
    /// Numbers of things, and of their triangles.
    pub(crate) things: [[u32; EDGE]; EDGE],
    pub(crate) triangles: [[u32; EDGE]; EDGE],
}

impl Tile {
    /// No thing.
    pub(crate) const NOTHING: u32 = u32::MAX;

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
            triangles: [[0; EDGE]; EDGE],
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
        let [a, b, c, d] = [0, 1, 2, 3].map(|k: usize| lanes[k].max(lanes[k + 4]));
        a.max(b).max(c.max(d))
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
        self.keep_each(line, depth, is_met, thing, &[triangle; EDGE]);
    }

    /// The same, of a triangle for each ray.
    #[inline(always)]
    pub(crate) fn keep_each(
        &mut self,
        line: usize,
        depth: F32x8,
        is_met: <F32x8 as Num>::Mask,
        thing: u32,
        triangles: &[u32; EDGE],
    ) {
        let before = F32x8::load(&self.depth[line]);
        let is_met = is_met & depth.lt(before) & F32x8::k(self.near).lt(depth);
        F32x8::select(is_met, depth, before).store(&mut self.depth[line]);
        let mut bits = F32x8::bits(is_met);
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize & (EDGE - 1);
            bits &= bits - 1;
            self.things[line][lane] = thing;
            self.triangles[line][lane] = triangles[lane];
        }
    }
}
