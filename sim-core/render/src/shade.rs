//! Colours of the pixels of a tile, by the equations of `light`.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::light::{AMBIENT, BRIGHT, FILL, FILLED, HIGH, HORIZON, SKY, UPWARD};
use crate::lit::Lit;
use crate::normals::{Points, mask, products, squares, turned, turned_back};
use crate::scene::{Scene, Surface};
use crate::shadow::Casters;
use crate::solids::Solid;
use crate::tile::{EDGE, Tile};
use crate::tree::Waiting;
use crate::vector::{Frame, Vector, each, three};

type Mask = <F32x8 as Num>::Mask;
/// Numbers of a line of pixels: three coordinates, or three colours.
type Line = [[f32; EDGE]; 3];

/// Lights as a camera sees them.
pub(crate) struct Lights {
    /// The frame of the key light, at the camera; its z points to where the light comes from.
    pub(crate) key: Frame,
    /// Up in the world.
    up: Vector,
    shadows: bool,
}

/// What the pixels of a tile show, and where light arrives. Of lines that see nothing, only that.
pub(crate) struct Shown {
    normals: [Line; EDGE],
    colors: [Line; EDGE],
    /// Which of a line see something: bits.
    seen: [u32; EDGE],
    lit: Lit,
}

impl Default for Shown {
    fn default() -> Shown {
        Shown {
            normals: [[[0.0; EDGE]; 3]; EDGE],
            colors: [[[0.0; EDGE]; 3]; EDGE],
            seen: [0; EDGE],
            lit: Lit::NONE,
        }
    }
}

impl Lights {
    #[inline(always)]
    pub(crate) fn new(scene: &Scene, eye: &Frame) -> Lights {
        let at_eye = Frame {
            pos: eye.pos,
            ..scene.light.axes
        };
        Lights {
            key: eye.relative(&at_eye),
            up: eye.rot[2],
            shadows: scene.light.shadows,
        }
    }

    /// Finds what a tile shows and where light arrives, from the frames of all things and what casts shadows.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn fall(
        &self,
        scene: &Scene,
        frames: &[Frame],
        casters: &mut Casters,
        waiting: &mut Waiting,
        tile: &Tile,
        shown: &mut Shown,
    ) {
        for line in 0..EDGE {
            let d = tile.rays(line);
            shown.look(scene, frames, tile, &d, line);
            let seen = shown.seen[line];
            if seen == 0 {
                shown.lit.c[line] = [f32::INFINITY; EDGE];
                continue;
            }
            let normal = three!(k => F32x8::load(&shown.normals[line][k]));
            let mut is_lit = F32x8::k(0.0).lt(products(&normal, self.direction()));
            if seen != 0xff {
                is_lit = is_lit & mask(seen);
            }
            if !F32x8::any(is_lit) {
                shown.lit.c[line] = [f32::INFINITY; EDGE];
                continue;
            }
            let depth = F32x8::load(&tile.depth[line]);
            let towards = turned_back(&self.key, &d);
            let place = three!(k => towards[k] * depth);
            shown.lit.keep(line, &place, depth, is_lit);
        }
        if self.shadows {
            casters.shade(scene, waiting, &mut shown.lit);
        }
    }

    /// Where the key light comes from.
    #[inline(always)]
    fn direction(&self) -> Vector {
        three!(k => self.key.rot[k][2])
    }

    /// Colours of a line of a tile.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn line(&self, tile: &Tile, shown: &Shown, line: usize) -> [[u8; 3]; EDGE] {
        let (zero, one) = (F32x8::k(0.0), F32x8::k(1.0));
        let mut shares = [zero; 3];
        if shown.seen[line] != 0xff {
            let d = tile.rays(line);
            let sine = products(&d, self.up).div(squares(&d).sqrt());
            let t = (sine * F32x8::k(1.0 / HIGH)).max(zero).min(one);
            let share = t * t * (F32x8::k(3.0) - t - t);
            shares = three!(k => {
                let light = share.fma(F32x8::k(SKY[k] - HORIZON[k]), F32x8::k(HORIZON[k]));
                light.sqrt()
            });
        }
        if shown.seen[line] != 0 {
            let n = three!(k => F32x8::load(&shown.normals[line][k]));
            let fill = products(&n, FILL).max(zero);
            let upward =
                products(&n, self.up).fma(F32x8::k(0.5 * UPWARD), F32x8::k(AMBIENT + 0.5 * UPWARD));
            let around = fill.fma(F32x8::k(FILLED), upward);
            let arrives = F32x8::load(&shown.lit.c[line]).lt(F32x8::k(f32::INFINITY));
            let facing = F32x8::select(arrives, products(&n, self.direction()), zero);
            // √(colour² amount)
            let root = facing.fma(F32x8::k(BRIGHT), around).sqrt();
            let seen = three!(k => F32x8::load(&shown.colors[line][k]) * root);
            shares = match shown.seen[line] {
                0xff => seen,
                some => three!(k => F32x8::select(mask(some), seen[k], shares[k])),
            };
        }
        bytes(&shares)
    }
}

impl Shown {
    /// Finds normals and colours of a line, on rays `d`.
    #[inline(always)]
    fn look(&mut self, scene: &Scene, frames: &[Frame], tile: &Tile, d: &Points, line: usize) {
        let things = &tile.things[line];
        let mut rest = !same(things, Tile::NOTHING) & 0xff;
        self.seen[line] = rest;
        while rest != 0 {
            let thing = things[rest.trailing_zeros() as usize & (EDGE - 1)];
            let lanes = same(things, thing);
            rest &= !lanes;
            let frame = &frames[thing as usize];
            let (normal, color) = match &scene.things[thing as usize].surface {
                Surface::Solid { solid, coat, .. } => {
                    let depth = F32x8::load(&tile.depth[line]);
                    let from = three!(k => d[k].fma(depth, F32x8::k(-frame.pos[k])));
                    let p = turned_back(frame, &from);
                    let [light, dark] = coat.tones;
                    let mut color = three!(k => F32x8::k(light[k]));
                    if coat.per[0] != 0.0 {
                        let is_dark = is_dark(coat.per, &p);
                        color = three!(k => F32x8::select(is_dark, F32x8::k(dark[k]), color[k]));
                    }
                    let normal = match solid {
                        Solid::Plane(_) => three!(k => F32x8::k(frame.rot[k][2])),
                        solid => turned(frame, &solid.normals(&p)),
                    };
                    (normal, color)
                }
                Surface::Field { field, .. } => {
                    let numbers = &tile.triangles[line];
                    let mut colors = [[0.0; EDGE]; 3];
                    for lane in 0..EDGE {
                        let tone = field.tone(numbers[lane]);
                        for k in 0..3 {
                            colors[k][lane] = tone[k];
                        }
                    }
                    let normal = turned(frame, &field.normals(numbers));
                    (normal, three!(k => F32x8::load(&colors[k])))
                }
                Surface::Triangles { faces, tones, .. } => {
                    let (mut normals, mut colors) = ([[0.0; EDGE]; 3], [[0.0; EDGE]; 3]);
                    let mut left = lanes;
                    while left != 0 {
                        let lane = left.trailing_zeros() as usize & (EDGE - 1);
                        left &= left - 1;
                        let face = &faces[tile.triangles[line][lane] as usize];
                        let tone = &tones[face.tone as usize];
                        for k in 0..3 {
                            normals[k][lane] = face.normal[k];
                            colors[k][lane] = tone[k];
                        }
                    }
                    let normal = three!(k => F32x8::load(&normals[k]));
                    (turned(frame, &normal), three!(k => F32x8::load(&colors[k])))
                }
            };
            if lanes == 0xff {
                for k in 0..3 {
                    normal[k].store(&mut self.normals[line][k]);
                    color[k].store(&mut self.colors[line][k]);
                }
                return;
            }
            let is_here = mask(lanes);
            for k in 0..3 {
                let before = F32x8::load(&self.normals[line][k]);
                F32x8::select(is_here, normal[k], before).store(&mut self.normals[line][k]);
                let before = F32x8::load(&self.colors[line][k]);
                F32x8::select(is_here, color[k], before).store(&mut self.colors[line][k]);
            }
        }
    }
}

/// Which lanes have a number: bits.
#[inline(always)]
fn same(numbers: &[u32; EDGE], number: u32) -> u32 {
    let mut bits = 0;
    for lane in 0..EDGE {
        bits |= u32::from(numbers[lane] == number) << lane;
    }
    bits
}

/// Which points lie on dark squares, `per` of which are in a metre.
#[inline(always)]
fn is_dark(per: [f32; 2], p: &Points) -> Mask {
    let half = F32x8::k(0.5);
    let x = p[0].fma(F32x8::k(per[0]), -half).round();
    let y = p[1].fma(F32x8::k(per[1]), -half).round();
    let sum = x + y;
    let even = (sum * half - F32x8::k(0.25)).round();
    half.lt(sum - even - even)
}

/// From here on, floats are the whole numbers, in order: the last bits of a sum with it are those of the rounded number.
const WHOLE: f32 = 8_388_608.0;

/// Bytes of shares of the brightest, the same on every processor.
#[inline(always)]
fn bytes(shares: &Points) -> [[u8; 3]; EDGE] {
    let mut lanes = [[0.0; EDGE]; 3];
    for k in 0..3 {
        let share = shares[k].max(F32x8::k(0.0)).min(F32x8::k(1.0));
        share
            .fma(F32x8::k(255.0), F32x8::k(WHOLE))
            .store(&mut lanes[k]);
    }
    each!(lane in 0 1 2 3 4 5 6 7 => three!(k => lanes[k][lane].to_bits() as u8))
}
