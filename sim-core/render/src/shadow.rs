//! Shadows: which points of a tile the key light reaches.
//!
//! All rays to a light from far off are parallel. In a frame whose z points to it, (a, b, c), a ray keeps its a and b. So
//! what may be in the way of the points of a tile is over the rectangle of their a and b.
//!
//! A ray is stopped by what it enters from outside, as rays of cameras are: a triangle that faces the light stops nothing,
//! and the part behind it does. So a surface never shades itself by a rounding.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::normals::{mask, turned_back};
use crate::parallel::Slabs;
use crate::scene::{Scene, Surface};
use crate::solids::Solid;
use crate::tile::EDGE;
use crate::tree::Waiting;
use crate::vector::{Frame, Vector, dot, three};

/// By how much rays begin nearer to the light, relative to the depth: more than the rounding of places.
const AHEAD: f32 = 2e-5;
/// By how much boxes around trees are larger, relative to their size and to the distance from the camera.
const WIDER: f32 = 1e-5;

/// Points of a tile in the frame of a light.
pub(crate) struct Lit {
    /// Coordinates across the light [m].
    pub(crate) a: [[f32; EDGE]; EDGE],
    pub(crate) b: [[f32; EDGE]; EDGE],
    /// Along it [m]; infinite where the light does not arrive, or nothing is seen.
    pub(crate) c: [[f32; EDGE]; EDGE],
}

impl Lit {
    pub(crate) const NONE: Lit = Lit {
        a: [[0.0; EDGE]; EDGE],
        b: [[0.0; EDGE]; EDGE],
        c: [[f32::INFINITY; EDGE]; EDGE],
    };

    /// Keeps the points of a line, `p` in the frame of the light.
    #[inline(always)]
    pub(crate) fn keep(
        &mut self,
        line: usize,
        p: &[F32x8; 3],
        depth: F32x8,
        is_lit: <F32x8 as Num>::Mask,
    ) {
        p[0].store(&mut self.a[line]);
        p[1].store(&mut self.b[line]);
        let ahead = depth.fma(F32x8::k(AHEAD), p[2]);
        F32x8::select(is_lit, ahead, F32x8::k(f32::INFINITY)).store(&mut self.c[line]);
    }

    /// Bounds of the points of each column that the light may reach; none where it reaches no point.
    #[inline(always)]
    fn columns(&self) -> Option<Columns> {
        let endless = F32x8::k(f32::INFINITY);
        let (mut low, mut high) = ([endless; 2], [-endless; 2]);
        let (mut deep, mut lines) = (endless, 0);
        for line in 0..EDGE {
            let c = F32x8::load(&self.c[line]);
            let is_lit = c.lt(endless);
            lines |= u32::from(F32x8::any(is_lit)) << line;
            deep = c.min(deep);
            let places = [F32x8::load(&self.a[line]), F32x8::load(&self.b[line])];
            for k in 0..2 {
                low[k] = F32x8::select(is_lit, places[k], endless).min(low[k]);
                high[k] = F32x8::select(is_lit, places[k], -endless).max(high[k]);
            }
        }
        (lines != 0).then_some(Columns {
            low,
            high,
            deep,
            lines,
        })
    }

    /// Marks points of a line as shaded.
    #[inline(always)]
    pub(crate) fn shade(&mut self, line: usize, is_shaded: <F32x8 as Num>::Mask) {
        let c = F32x8::load(&self.c[line]);
        F32x8::select(is_shaded, F32x8::k(f32::INFINITY), c).store(&mut self.c[line]);
    }
}

/// Least and largest a and b, and least c, of the points of each column of a tile.
struct Columns {
    low: [F32x8; 2],
    high: [F32x8; 2],
    deep: F32x8,
    /// Lines with such points: bits.
    lines: u32,
}

impl Columns {
    /// Whether a caster may be over points of any column.
    #[inline(always)]
    fn are_below(&self, caster: &Caster) -> bool {
        let is_below = self.low[0].lt(F32x8::k(caster.high[0]))
            & F32x8::k(caster.low[0]).lt(self.high[0])
            & self.low[1].lt(F32x8::k(caster.high[1]))
            & F32x8::k(caster.low[1]).lt(self.high[1])
            & self.deep.lt(F32x8::k(caster.top));
        F32x8::any(is_below)
    }
}

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
#[derive(Default)]
pub(crate) struct Casters {
    all: Vec<Caster>,
    /// Which points of each line are below the box of a caster: bits.
    below: [u32; EDGE],
    few: Few,
}

impl Caster {
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

/// Points that a tree may shade, close together.
pub(crate) struct Few {
    pub(crate) count: usize,
    /// Coordinates as those of [`Lit`], of groups of eight; what is behind the last point has an infinite c.
    pub(crate) groups: [[[f32; EDGE]; 3]; EDGE],
    /// Least and largest a and b of each group, and of all.
    pub(crate) bounds: [[[f32; 2]; 2]; EDGE],
    pub(crate) all: [[f32; 2]; 2],
    pub(crate) deep: f32,
    /// Where the points are in the tile.
    places: [u8; EDGE * EDGE],
}

impl Default for Few {
    fn default() -> Few {
        Few {
            count: 0,
            groups: [[[0.0; EDGE]; 3]; EDGE],
            bounds: [[[0.0; 2]; 2]; EDGE],
            all: [[0.0; 2]; 2],
            deep: 0.0,
            places: [0; EDGE * EDGE],
        }
    }
}

impl Few {
    /// Groups in use.
    #[inline(always)]
    pub(crate) fn in_use(&self) -> usize {
        self.count.div_ceil(EDGE)
    }

    /// Whether all are.
    #[inline(always)]
    pub(crate) fn is_shaded(&self) -> bool {
        let endless = F32x8::k(f32::INFINITY);
        let mut least = endless;
        for group in 0..self.in_use() {
            least = F32x8::load(&self.groups[group][2]).min(least);
        }
        !F32x8::any(least.lt(endless))
    }

    #[inline(always)]
    fn gather(&mut self, lit: &Lit, chosen: &[u32; EDGE]) {
        let endless = [f32::INFINITY, f32::NEG_INFINITY];
        (self.count, self.all, self.deep) = (0, [endless; 2], f32::INFINITY);
        for line in 0..EDGE {
            let mut bits = chosen[line];
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & (EDGE - 1);
                bits &= bits - 1;
                let point = [lit.a[line][lane], lit.b[line][lane], lit.c[line][lane]];
                let (group, place) = (self.count / EDGE % EDGE, self.count % EDGE);
                if place == 0 {
                    self.groups[group][2] = [f32::INFINITY; EDGE];
                    self.bounds[group] = [endless; 2];
                }
                for k in 0..3 {
                    self.groups[group][k][place] = point[k];
                }
                for k in 0..2 {
                    let [low, high] = self.bounds[group][k];
                    self.bounds[group][k] = [low.min(point[k]), high.max(point[k])];
                }
                self.deep = self.deep.min(point[2]);
                self.places[self.count % (EDGE * EDGE)] = (EDGE * line + lane) as u8;
                self.count += 1;
            }
        }
        for group in 0..self.in_use() {
            for k in 0..2 {
                let ([low, high], [least, most]) = (self.all[k], self.bounds[group][k]);
                self.all[k] = [low.min(least), high.max(most)];
            }
        }
    }

    /// Marks those that are shaded now.
    #[inline(always)]
    fn scatter(&self, lit: &mut Lit) {
        for point in 0..self.count {
            let place = usize::from(self.places[point % (EDGE * EDGE)]);
            let c = self.groups[point / EDGE % EDGE][2][point % EDGE];
            lit.c[place / EDGE % EDGE][place % EDGE] = c;
        }
    }
}

impl Casters {
    /// Those of a scene, from the frames of its things and the light in the frame of a camera.
    #[inline(always)]
    pub(crate) fn place(&mut self, scene: &Scene, frames: &[Frame], light: &Frame) {
        self.all.clear();
        for (thing, frame) in frames.iter().enumerate() {
            let frame = light.relative(frame);
            let half = scene.things[thing].half();
            let is_plane = matches!(
                scene.things[thing].surface,
                Surface::Solid {
                    solid: Solid::Plane(_),
                    ..
                }
            );
            let is_box = matches!(
                scene.things[thing].surface,
                Surface::Solid {
                    solid: Solid::Box(_),
                    ..
                }
            );
            // a plane that faces the light is met from behind
            if is_plane && frame.rot[2][2] >= 0.0 {
                continue;
            }
            let reach = three!(k => reach(frame.rot[k], half));
            let wider = match &scene.things[thing].surface {
                Surface::Solid { .. } if is_box => half,
                _ => {
                    let away = dot(frame.pos, frame.pos).sqrt();
                    three!(k => WIDER.mul_add(half[0] + half[1] + half[2] + away, half[k]))
                }
            };
            self.all.push(Caster {
                thing,
                frame,
                low: [frame.pos[0] - reach[0], frame.pos[1] - reach[1]],
                high: [frame.pos[0] + reach[0], frame.pos[1] + reach[1]],
                top: frame.pos[2] + reach[2],
                slabs: Slabs::new(&frame, wider),
                is_box,
            });
        }
    }

    /// Shades the points of a tile.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn shade(&mut self, scene: &Scene, waiting: &mut Waiting, lit: &mut Lit) {
        let Some(columns) = lit.columns() else {
            return;
        };
        for caster in &self.all {
            if !columns.are_below(caster) {
                continue;
            }
            self.below = [0; EDGE];
            let mut lines = columns.lines;
            while lines != 0 {
                let line = lines.trailing_zeros() as usize & (EDGE - 1);
                lines &= lines - 1;
                let is_below = caster.is_over(lit, line);
                if !F32x8::any(is_below) {
                    continue;
                }
                let is_met = is_below & caster.meets(lit, line);
                if caster.is_box {
                    lit.shade(line, is_met);
                } else {
                    self.below[line] = F32x8::bits(is_met);
                }
            }
            let surface = &scene.things[caster.thing].surface;
            let Surface::Triangles { tree, .. } = surface else {
                for line in 0..EDGE {
                    if self.below[line] != 0 {
                        caster.shade(surface, lit, line, self.below[line]);
                    }
                }
                continue;
            };
            self.few.gather(lit, &self.below);
            if self.few.count > 0 {
                tree.shade(&caster.frame, waiting, &mut self.few);
                self.few.scatter(lit);
            }
        }
    }
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
