//! What the pixels of a tile show: colours, and how the lights fall on them.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::light::{AMBIENT, FILL, FILLED, Lights, UPWARD};
use crate::lit::Lit;
use crate::normals::{Points, products};
use crate::paint::{Coat, Color};
use crate::scene::{Face, Scene, Surface};
use crate::solids::Solid;
use crate::tile::{EDGE, Tile};
use crate::vector::{Frame, Vector, three};

/// What the pixels of a tile show, and where light arrives. Of lines that see nothing, only that.
pub(crate) struct Shown {
    /// Red, green and blue of each line.
    pub(crate) colors: [[[f32; EDGE]; 3]; EDGE],
    /// Cosines of the angles between normals and the key light.
    pub(crate) facing: [[f32; EDGE]; EDGE],
    /// What all other light gives.
    pub(crate) around: [[f32; EDGE]; EDGE],
    /// Which of a line see something: bits.
    pub(crate) seen: [u32; EDGE],
    /// Which show a place that no part of the same thing is in front of: bits.
    pub(crate) outer: [u32; EDGE],
    pub(crate) lit: Lit,
    /// How light falls on things, once a tile asked for it, and the image that it was in.
    falling: Vec<(u64, Falling)>,
    image: u64,
}

impl Default for Shown {
    fn default() -> Shown {
        Shown {
            colors: [[[0.0; EDGE]; 3]; EDGE],
            facing: [[0.0; EDGE]; EDGE],
            around: [[0.0; EDGE]; EDGE],
            seen: [0; EDGE],
            outer: [0; EDGE],
            lit: Lit::NONE,
            falling: Vec::new(),
            image: 0,
        }
    }
}

impl Shown {
    /// Begins an image of that many things.
    pub(crate) fn begin(&mut self, things: usize) {
        self.image += 1;
        self.falling.resize(things, (0, Falling::default()));
    }

    /// Finds colours of a tile, and what light falls on them where nothing is in the way: thing by thing.
    #[inline(always)]
    pub(crate) fn look(&mut self, lights: &Lights, scene: &Scene, frames: &[Frame], tile: &Tile) {
        for line in 0..EDGE {
            self.seen[line] = F32x8::bits(tile.is_seen(line));
        }
        let mut rest = self.seen;
        self.outer = [0; EDGE];
        for first in 0..EDGE {
            while rest[first] != 0 {
                let lane = rest[first].trailing_zeros() as usize & (EDGE - 1);
                let number = tile.things[first][lane];
                let surface = &scene.things[number as usize].surface;
                let frame = &frames[number as usize];
                let (image, light) = &mut self.falling[number as usize];
                if *image != self.image {
                    (*image, *light) = (self.image, Falling::new(lights, frame));
                }
                let light = *light;
                for line in first..EDGE {
                    let is_here = tile.sees(line, number);
                    let lanes = F32x8::bits(is_here);
                    if lanes == 0 {
                        continue;
                    }
                    rest[line] &= !lanes;
                    let (light, color) = match surface {
                        Surface::Solid { solid, coat, .. } => {
                            let depth = F32x8::load(&tile.depth[line]);
                            let d = tile.directions(frame, line);
                            let p = three!(k => d[k].fma(depth, F32x8::k(light.camera[k])));
                            let light = match solid {
                                Solid::Plane(_) => light.on_upright(),
                                solid => light.on(&solid.normals(&p)),
                            };
                            // solids are convex
                            self.outer[line] |= lanes;
                            (light, colors(coat, &p))
                        }
                        Surface::Field { field, .. } => {
                            let places = &tile.places[line];
                            let (colors, open) = field.colors(places);
                            self.outer[line] |= open & lanes;
                            (light.on(&field.normals(places)), colors)
                        }
                        Surface::Triangles { faces, tones, .. } => {
                            let facets = Facets::new(faces, tones, tile, line, lanes);
                            self.outer[line] |= facets.outer;
                            (light.on(&facets.normals), facets.colors)
                        }
                    };
                    self.keep(line, is_here, light, color);
                }
            }
        }
    }

    /// Keeps light and colours of a thing in a line.
    #[inline(always)]
    fn keep(
        &mut self,
        line: usize,
        is_here: <F32x8 as Num>::Mask,
        [facing, around]: [F32x8; 2],
        colors: Points,
    ) {
        let keep = |x: F32x8, to: &mut [f32; EDGE]| {
            F32x8::select(is_here, x, F32x8::load(to)).store(to);
        };
        keep(facing, &mut self.facing[line]);
        keep(around, &mut self.around[line]);
        for k in 0..3 {
            keep(colors[k], &mut self.colors[line][k]);
        }
    }
}

/// Where light falls on a thing from, in its frame, and where the camera is.
#[derive(Clone, Copy, Default)]
struct Falling {
    camera: Vector,
    key: Vector,
    fill: Vector,
    up: Vector,
}

impl Falling {
    #[inline(always)]
    fn new(lights: &Lights, frame: &Frame) -> Falling {
        Falling {
            camera: frame.turn_back(three!(k => -frame.pos[k])),
            key: frame.turn_back(three!(k => lights.key.rot[k][2])),
            fill: frame.turn_back(FILL),
            up: frame.turn_back(lights.up),
        }
    }

    /// On surfaces with these normals: cosines to the key light, and all other light.
    #[inline(always)]
    fn on(&self, normals: &Points) -> [F32x8; 2] {
        let fill = products(normals, self.fill).max(F32x8::k(0.0));
        let upward = products(normals, self.up)
            .fma(F32x8::k(0.5 * UPWARD), F32x8::k(AMBIENT + 0.5 * UPWARD));
        let around = fill.fma(F32x8::k(FILLED), upward);
        [products(normals, self.key), around]
    }

    /// The same, of surfaces whose normal is z.
    #[inline(always)]
    fn on_upright(&self) -> [F32x8; 2] {
        let upward = self.up[2].mul_add(0.5 * UPWARD, AMBIENT + 0.5 * UPWARD);
        let around = self.fill[2].max(0.0).mul_add(FILLED, upward);
        [F32x8::k(self.key[2]), F32x8::k(around)]
    }
}

/// The triangles that some rays of a line meet.
struct Facets {
    normals: Points,
    colors: Points,
    /// Which of the rays meet one that nothing of the same body is in front of: bits.
    outer: u32,
}

impl Facets {
    #[inline(always)]
    fn new(faces: &[Face], tones: &[Color], tile: &Tile, line: usize, mut lanes: u32) -> Facets {
        let (mut normals, mut colors) = ([[0.0; EDGE]; 3], [[0.0; EDGE]; 3]);
        let mut outer = 0;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & (EDGE - 1);
            lanes &= lanes - 1;
            let face = &faces[tile.triangle(line, lane) as usize];
            let tone = &tones[face.tone as usize];
            for k in 0..3 {
                normals[k][lane] = face.normal[k];
                colors[k][lane] = tone[k];
            }
            outer |= u32::from(face.is_outer) << lane;
        }
        Facets {
            normals: three!(k => F32x8::load(&normals[k])),
            colors: three!(k => F32x8::load(&colors[k])),
            outer,
        }
    }
}

/// Colours of a solid at points in its frame.
#[inline(always)]
fn colors(coat: &Coat, p: &Points) -> Points {
    let [light, dark] = coat.tones;
    if coat.per[0] == 0.0 {
        return three!(k => F32x8::k(light[k]));
    }
    let is_dark = is_dark(coat.per, p);
    three!(k => F32x8::select(is_dark, F32x8::k(dark[k]), F32x8::k(light[k])))
}

/// Which points lie on dark squares, `per` of which are in a metre.
#[inline(always)]
fn is_dark(per: [f32; 2], p: &Points) -> <F32x8 as Num>::Mask {
    let half = F32x8::k(0.5);
    let x = p[0].fma(F32x8::k(per[0]), -half).round();
    let y = p[1].fma(F32x8::k(per[1]), -half).round();
    let sum = x + y;
    let even = (sum * half - F32x8::k(0.25)).round();
    half.lt(sum - even - even)
}
