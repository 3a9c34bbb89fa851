//! Shadows: which points of a tile the key light reaches.
//!
//! A ray is stopped by what it enters from outside, as rays of cameras are: a triangle that faces the light stops nothing,
//! and the part behind it does. So a surface never shades itself by a rounding.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::lit::{Few, Lit};
use crate::normals::{mask, turned_back};
use crate::parallel::Slabs;
use crate::scene::{Scene, Surface};
use crate::shown::Shown;
use crate::solids::Solid;
use crate::tile::{EDGE, Tile};
use crate::tree::{Beam, Waiting, Walk};
use crate::vector::{Frame, Vector, dot, three};

/// By how much boxes around trees are larger, relative to their size and to the distance from the camera.
const WIDER: f32 = 1e-5;

/// A thing in the frame of a light.
#[derive(Clone, Copy)]
struct Caster {
    thing: usize,
    frame: Frame,
    low: [f32; 2],
    high: [f32; 2],
    top: f32,
    /// The box around it, and whether it is one.
    slabs: Slabs,
    is_box: bool,
}

/// What casts shadows.
pub(crate) struct Casters {
    all: Vec<Caster>,
    /// Least and largest a and b of eight of them, and the largest c: a group that is not full ends with none.
    bounds: Vec<[[f32; EDGE]; 5]>,
    /// Those that rest, once a tile asked for them, and the image that it was in.
    resting: Vec<(u64, Option<Caster>)>,
    image: u64,
    walk: Walk,
    /// Frames of the camera in the world, and of the light at the camera.
    eye: Frame,
    light: Frame,
    below: Below,
}

/// What may be below a caster.
#[derive(Default)]
struct Below {
    /// Which points of each line are below its box: bits.
    lines: [u32; EDGE],
    few: Few,
}

impl Caster {
    /// A thing in the frame of the light; none if it casts no shadow.
    #[inline(always)]
    fn new(scene: &Scene, thing: usize, frame: Frame) -> Option<Caster> {
        let (half, surface) = (scene.things[thing].half(), &scene.things[thing].surface);
        let solid = match surface {
            Surface::Solid { solid, .. } => Some(solid),
            Surface::Triangles { .. } | Surface::Field { .. } => None,
        };
        let is_box = matches!(solid, Some(Solid::Box(_)));
        // a plane that faces the light is met from behind
        if matches!(solid, Some(Solid::Plane(_))) && frame.rot[2][2] >= 0.0 {
            return None;
        }
        let reach = three!(k => reach(frame.rot[k], half));
        let wider = match is_box {
            true => half,
            false => {
                let away = dot(frame.pos, frame.pos).sqrt();
                three!(k => WIDER.mul_add(half[0] + half[1] + half[2] + away, half[k]))
            }
        };
        Some(Caster {
            thing,
            frame,
            low: [frame.pos[0] - reach[0], frame.pos[1] - reach[1]],
            high: [frame.pos[0] + reach[0], frame.pos[1] + reach[1]],
            top: frame.pos[2] + reach[2],
            slabs: Slabs::new(&frame, wider),
            is_box,
        })
    }

    /// Which points of a line are below it, or rather below the rectangle around it.
    #[inline(always)]
    fn is_over(&self, lit: &Lit, line: usize) -> <F32x8 as Num>::Mask {
        let (a, b) = (F32x8::load(&lit.a[line]), F32x8::load(&lit.b[line]));
        F32x8::k(self.low[0]).lt(a)
            & a.lt(F32x8::k(self.high[0]))
            & F32x8::k(self.low[1]).lt(b)
            & b.lt(F32x8::k(self.high[1]))
            & F32x8::load(&lit.c[line]).lt(F32x8::k(self.top))
    }

    /// Which rays from a line meet the box around it, or enter it from outside if it is a box.
    #[inline(always)]
    fn meets(&self, lit: &Lit, line: usize) -> <F32x8 as Num>::Mask {
        let (a, b) = (F32x8::load(&lit.a[line]), F32x8::load(&lit.b[line]));
        let c = F32x8::load(&lit.c[line]);
        match self.is_box {
            true => self.slabs.stop(a, b, c),
            false => self.slabs.hold(a, b, c),
        }
    }

    /// Shades points of a line below a shape that is no box and has no tree.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    fn shade(&self, surface: &Surface, lit: &mut Lit, line: usize, below: u32) {
        let is_below = mask(below);
        let frame = &self.frame;
        let c = F32x8::select(is_below, F32x8::load(&lit.c[line]), F32x8::k(0.0));
        let from = [
            F32x8::load(&lit.a[line]) - F32x8::k(frame.pos[0]),
            F32x8::load(&lit.b[line]) - F32x8::k(frame.pos[1]),
            c - F32x8::k(frame.pos[2]),
        ];
        let (o, d) = (turned_back(frame, &from), frame.rot[2]);
        let is_stopped = match surface {
            Surface::Solid { solid, .. } => solid.stops(&o, d),
            Surface::Field { field, .. } => field.stops(&o, d, is_below),
            Surface::Triangles { .. } => return,
        };
        lit.shade(line, is_below & is_stopped);
    }
}

impl Default for Casters {
    fn default() -> Casters {
        Casters {
            all: Vec::new(),
            bounds: Vec::new(),
            resting: Vec::new(),
            image: 0,
            walk: Walk::default(),
            eye: Frame::IDENTITY,
            light: Frame::IDENTITY,
            below: Below::default(),
        }
    }
}

impl Casters {
    /// Those of a scene, from the frames of its things and the light in the frame of a camera.
    #[inline(always)]
    pub(crate) fn place(&mut self, scene: &Scene, frames: &[Frame], eye: &Frame, light: &Frame) {
        self.all.clear();
        self.image += 1;
        (self.eye, self.light) = (*eye, *light);
        self.resting.resize(scene.resting, (0, None));
        for (thing, frame) in frames.iter().enumerate().skip(scene.resting) {
            self.all
                .extend(Caster::new(scene, thing, light.relative(frame)));
        }
        self.bounds.clear();
        for group in self.all.chunks(EDGE) {
            let mut bounds = [[f32::NEG_INFINITY; EDGE]; 5];
            for (lane, caster) in group.iter().enumerate() {
                let ([low_a, low_b], [high_a, high_b]) = (caster.low, caster.high);
                let numbers = [low_a, low_b, high_a, high_b, caster.top];
                for k in 0..5 {
                    bounds[k][lane] = numbers[k];
                }
            }
            self.bounds.push(bounds);
        }
    }

    /// Shades the points of a tile.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn shade(
        &mut self,
        scene: &Scene,
        waiting: &mut Waiting,
        tile: &Tile,
        shown: &mut Shown,
    ) {
        let Some(columns) = shown.lit.columns() else {
            return;
        };
        let (ends, deep) = columns.all();
        for (bounds, casters) in self.bounds.iter().zip(self.all.chunks(EDGE)) {
            let mut bits = are_over(bounds, &ends, deep);
            while bits != 0 {
                let caster = &casters[bits.trailing_zeros() as usize & (EDGE - 1)];
                bits &= bits - 1;
                if columns.are_below(caster.low, caster.high, caster.top) {
                    self.below
                        .shade(scene, caster, columns.lines, waiting, tile, shown);
                }
            }
        }
        let Some(tree) = &scene.tree else {
            return;
        };
        let world = self.light.relative(&self.eye.relative(&Frame::IDENTITY));
        let beam = Beam::new(&world, tree.slack_in(&world), ends, deep);
        self.walk.start();
        while let Some(leaf) = self.walk.next_over(tree, &beam) {
            for &number in leaf {
                if self.resting[number].0 != self.image {
                    let frame = self.eye.relative(&scene.things[number].frame);
                    let caster = Caster::new(scene, number, self.light.relative(&frame));
                    self.resting[number] = (self.image, caster);
                }
                let Some(caster) = &self.resting[number].1 else {
                    continue;
                };
                if columns.are_below(caster.low, caster.high, caster.top) {
                    self.below
                        .shade(scene, caster, columns.lines, waiting, tile, shown);
                }
            }
        }
    }
}

impl Below {
    /// Shades the points of lines that are below a caster.
    #[inline]
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    fn shade(
        &mut self,
        scene: &Scene,
        caster: &Caster,
        mut lines: u32,
        waiting: &mut Waiting,
        tile: &Tile,
        shown: &mut Shown,
    ) {
        self.lines = [0; EDGE];
        let number = caster.thing as f32;
        let lit = &mut shown.lit;
        while lines != 0 {
            let line = lines.trailing_zeros() as usize & (EDGE - 1);
            lines &= lines - 1;
            let own_part = shown.outer[line] & F32x8::bits(tile.sees(line, number));
            if own_part == 0xff {
                continue;
            }
            let mut is_below = caster.is_over(lit, line);
            if own_part != 0 {
                is_below = is_below & !mask(own_part);
            }
            if !F32x8::any(is_below) {
                continue;
            }
            let is_met = is_below & caster.meets(lit, line);
            if caster.is_box {
                lit.shade(line, is_met);
            } else {
                self.lines[line] = F32x8::bits(is_met);
            }
        }
        if caster.is_box {
            return;
        }
        let surface = &scene.things[caster.thing].surface;
        let Surface::Triangles { tree, .. } = surface else {
            for line in 0..EDGE {
                if self.lines[line] != 0 {
                    caster.shade(surface, lit, line, self.lines[line]);
                }
            }
            return;
        };
        self.few.gather(lit, &self.lines);
        if self.few.count > 0 {
            tree.shade(&caster.frame, waiting, &mut self.few);
            self.few.scatter(lit);
        }
    }
}

/// Which of eight casters may be over points between two a and two b, from a c on: bits.
#[inline(always)]
fn are_over(bounds: &[[f32; EDGE]; 5], [a, b]: &[[f32; 2]; 2], deep: f32) -> u32 {
    let [low_a, low_b, high_a, high_b, top] = bounds;
    let is_over = F32x8::load(low_a).lt(F32x8::k(a[1]))
        & F32x8::k(a[0]).lt(F32x8::load(high_a))
        & F32x8::load(low_b).lt(F32x8::k(b[1]))
        & F32x8::k(b[0]).lt(F32x8::load(high_b))
        & F32x8::k(deep).lt(F32x8::load(top));
    F32x8::bits(is_over)
}

/// How far a box with these half edges reaches along a direction in its frame.
#[inline(always)]
fn reach(direction: Vector, half: Vector) -> f32 {
    let mut sum = 0.0;
    for k in 0..3 {
        // 0 times the half edge of an endless plane is no number
        if direction[k] != 0.0 {
            sum = direction[k].abs().mul_add(half[k], sum);
        }
    }
    sum
}
