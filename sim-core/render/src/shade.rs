//! Colours of the pixels of a tile, by the equations of `light`.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::light::{AMBIENT, BRIGHT, FILL, FILLED, GLEAM, HIGH, HORIZON, SKY, UPWARD};
use crate::normals::{Points, turned, turned_back};
use crate::scene::{Scene, Surface};
use crate::shadow::{Casters, Lit};
use crate::tile::{EDGE, Tile};
use crate::tree::Waiting;
use crate::vector::{Frame, Vector, each, three};

type Mask = <F32x8 as Num>::Mask;
/// Numbers of a line of pixels: three coordinates, or three colours.
type Line = [[f32; EDGE]; 3];

/// Bytes of a line of pixels, and one more.
pub(crate) const PIXELS: usize = 3 * EDGE + 1;

/// Lights as a camera sees them.
pub(crate) struct Lights {
    /// The frame of the key light, at the camera; its z points to where the light comes from.
    pub(crate) key: Frame,
    /// Up in the world.
    up: Vector,
    shadows: bool,
}

/// What the pixels of a tile show.
struct Shown {
    normals: [Line; EDGE],
    colors: [Line; EDGE],
    /// Which of a line see something: bits.
    seen: [u32; EDGE],
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

    /// Colours of a tile, line by line, from the frames of all things and what casts shadows.
    #[inline(always)]
    pub(crate) fn shade(
        &self,
        scene: &Scene,
        frames: &[Frame],
        casters: &mut Casters,
        waiting: &mut Waiting,
        tile: &Tile,
    ) -> [[u8; PIXELS]; EDGE] {
        let mut lit = Lit::NONE;
        let mut shown = Shown {
            normals: [[[0.0; EDGE]; 3]; EDGE],
            colors: [[[0.0; EDGE]; 3]; EDGE],
            seen: [0; EDGE],
        };
        for line in 0..EDGE {
            let d = tile.rays(line);
            shown.look(scene, frames, tile, &d, line);
            if shown.seen[line] == 0 {
                continue;
            }
            let normal = three!(k => F32x8::load(&shown.normals[line][k]));
            let is_lit = F32x8::k(0.0).lt(products(&normal, self.direction()));
            let is_lit = is_lit & mask(shown.seen[line]);
            let depth = F32x8::load(&tile.depth[line]);
            let towards = turned_back(&self.key, &d);
            lit.keep(line, &three!(k => towards[k] * depth), depth, is_lit);
        }
        if self.shadows {
            casters.shade(scene, waiting, &mut lit);
        }
        let mut pixels = [[0; PIXELS]; EDGE];
        for line in 0..EDGE {
            pixels[line] = self.line(tile, &shown, &lit, line);
        }
        pixels
    }

    /// Where the key light comes from.
    #[inline(always)]
    fn direction(&self) -> Vector {
        three!(k => self.key.rot[k][2])
    }

    #[inline(always)]
    fn line(&self, tile: &Tile, shown: &Shown, lit: &Lit, line: usize) -> [u8; PIXELS] {
        let (zero, one) = (F32x8::k(0.0), F32x8::k(1.0));
        let d = tile.rays(line);
        let scale = one.div(squares(&d).sqrt());
        let ray = three!(k => d[k] * scale);
        let mut light = [zero; 3];
        if shown.seen[line] != 0xff {
            let t = (products(&ray, self.up) * F32x8::k(1.0 / HIGH))
                .max(zero)
                .min(one);
            let share = t * t * (F32x8::k(3.0) - t - t);
            light = three!(k => share.fma(F32x8::k(SKY[k] - HORIZON[k]), F32x8::k(HORIZON[k])));
        }
        if shown.seen[line] != 0 {
            let n = three!(k => F32x8::load(&shown.normals[line][k]));
            let fill = products(&n, FILL).max(zero);
            let upward =
                products(&n, self.up).fma(F32x8::k(0.5 * UPWARD), F32x8::k(AMBIENT + 0.5 * UPWARD));
            let mut amount = fill.fma(F32x8::k(FILLED), upward);
            let mut gleam = zero;
            let arrives = F32x8::load(&lit.c[line]).lt(F32x8::k(f32::INFINITY));
            if F32x8::any(arrives) {
                let key = self.direction();
                let facing = F32x8::select(arrives, products(&n, key), zero);
                amount = facing.fma(F32x8::k(BRIGHT), amount);
                // n·h with h = (k - r) / |k - r|
                let square = F32x8::k(2.0) - F32x8::k(2.0) * products(&ray, key);
                let along = n[2].fma(ray[2], n[1].fma(ray[1], n[0] * ray[0]));
                let middle = (facing - along)
                    .div(square.max(F32x8::k(1e-12)).sqrt())
                    .max(zero);
                let square = middle * middle;
                let fourth = square * square;
                let eighth = fourth * fourth;
                let sixteenth = eighth * eighth;
                gleam = F32x8::select(arrives, sixteenth * sixteenth * F32x8::k(GLEAM), zero);
            }
            let is_seen = mask(shown.seen[line]);
            light = three!(k => {
                let color = F32x8::load(&shown.colors[line][k]);
                F32x8::select(is_seen, color.fma(amount, gleam), light[k])
            });
        }
        bytes(&light)
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
                    let p = turned_back(
                        frame,
                        &three!(k => d[k].fma(depth, F32x8::k(-frame.pos[k]))),
                    );
                    let is_dark = is_dark(coat.per, &p);
                    let color = three!(k => {
                        F32x8::select(is_dark, F32x8::k(coat.tones[1][k]), F32x8::k(coat.tones[0][k]))
                    });
                    (solid.normals(&p), color)
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
                    (
                        three!(k => F32x8::load(&normals[k])),
                        three!(k => F32x8::load(&colors[k])),
                    )
                }
            };
            let (normal, is_here) = (turned(frame, &normal), mask(lanes));
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

/// The lanes of bits.
#[inline(always)]
fn mask(bits: u32) -> Mask {
    let lanes = each!(lane in 0 1 2 3 4 5 6 7 => (bits >> lane & 1) as f32);
    F32x8::k(0.5).lt(F32x8::load(&lanes))
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

/// Bytes of light, the same on every processor: a square root is correctly rounded.
#[inline(always)]
fn bytes(light: &Points) -> [u8; PIXELS] {
    let mut lanes = [[0.0; EDGE]; 3];
    for k in 0..3 {
        let share = light[k].max(F32x8::k(0.0)).min(F32x8::k(1.0));
        share
            .sqrt()
            .fma(F32x8::k(255.0), F32x8::k(WHOLE))
            .store(&mut lanes[k]);
    }
    let mut pixels = [0; PIXELS];
    for lane in 0..EDGE {
        let [red, green, blue] = three!(k => lanes[k][lane].to_bits() & 0xff);
        // the fourth byte is the next pixel's
        let word = red | green << 8 | blue << 16;
        pixels[3 * lane..3 * lane + 4].copy_from_slice(&word.to_le_bytes());
    }
    pixels
}

#[inline(always)]
fn products(a: &Points, b: Vector) -> F32x8 {
    a[2].fma(
        F32x8::k(b[2]),
        a[1].fma(F32x8::k(b[1]), a[0] * F32x8::k(b[0])),
    )
}

#[inline(always)]
fn squares(a: &Points) -> F32x8 {
    a[2].fma(a[2], a[1].fma(a[1], a[0] * a[0]))
}
