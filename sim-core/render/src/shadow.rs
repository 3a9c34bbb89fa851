//! Shadows: which points of a tile the key light reaches.
//!
//! All rays to a light from far off are parallel. In a frame whose z points to it, (a, b, c), a ray keeps its a and b. So
//! what may be in the way of the points of a tile is over the rectangle of their a and b.
//!
//! A ray is stopped by what it enters from outside, as rays of cameras are: a triangle that faces the light stops nothing,
//! and the part behind it does. So a surface never shades itself by a rounding.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::scene::{Scene, Surface};
use crate::solids::Solid;
use crate::tile::EDGE;
use crate::tree::Waiting;
use crate::vector::{Frame, Vector, three};

/// By how much rays begin nearer to the light, relative to the distance from the camera: more than the rounding of places.
const AHEAD: f32 = 1e-5;

/// Points of a tile in the frame of a light.
pub(crate) struct Lit {
    /// Coordinates across the light [m].
    pub(crate) a: [[f32; EDGE]; EDGE],
    pub(crate) b: [[f32; EDGE]; EDGE],
    /// Along it [m]; infinite where the light does not arrive, or nothing is seen.
    pub(crate) c: [[f32; EDGE]; EDGE],
    /// Least and largest a and b, and the least c, of those that the light may reach [m].
    pub(crate) low: [f32; 2],
    pub(crate) high: [f32; 2],
    pub(crate) deep: f32,
}

impl Lit {
    pub(crate) const NONE: Lit = Lit {
        a: [[0.0; EDGE]; EDGE],
        b: [[0.0; EDGE]; EDGE],
        c: [[f32::INFINITY; EDGE]; EDGE],
        low: [0.0; 2],
        high: [0.0; 2],
        deep: 0.0,
    };

    /// Keeps the points of a line, `p` in the frame of the light, at most so far from the camera [m].
    #[inline(always)]
    pub(crate) fn keep(
        &mut self,
        line: usize,
        p: &[F32x8; 3],
        far: F32x8,
        is_lit: <F32x8 as Num>::Mask,
    ) {
        p[0].store(&mut self.a[line]);
        p[1].store(&mut self.b[line]);
        let ahead = far.fma(F32x8::k(AHEAD), p[2]);
        F32x8::select(is_lit, ahead, F32x8::k(f32::INFINITY)).store(&mut self.c[line]);
    }

    /// Finds the bounds; false where there is no point.
    #[inline(always)]
    fn bound(&mut self) -> bool {
        let endless = F32x8::k(f32::INFINITY);
        let (mut low, mut high) = ([endless; 2], [-endless; 2]);
        let mut deep = endless;
        for line in 0..EDGE {
            let c = F32x8::load(&self.c[line]);
            let is_lit = c.lt(endless);
            deep = c.min(deep);
            let a = F32x8::load(&self.a[line]);
            let b = F32x8::load(&self.b[line]);
            low[0] = F32x8::select(is_lit, a, endless).min(low[0]);
            low[1] = F32x8::select(is_lit, b, endless).min(low[1]);
            high[0] = F32x8::select(is_lit, a, -endless).max(high[0]);
            high[1] = F32x8::select(is_lit, b, -endless).max(high[1]);
        }
        self.low = [least(low[0]), least(low[1])];
        self.high = [-least(-high[0]), -least(-high[1])];
        self.deep = least(deep);
        self.deep < f32::INFINITY
    }

    /// Marks points of a line as shaded.
    #[inline(always)]
    pub(crate) fn shade(&mut self, line: usize, is_shaded: <F32x8 as Num>::Mask) {
        let c = F32x8::load(&self.c[line]);
        F32x8::select(is_shaded, F32x8::k(f32::INFINITY), c).store(&mut self.c[line]);
    }
}

#[inline(always)]
fn least(x: F32x8) -> f32 {
    let mut lanes = [0.0; EDGE];
    x.store(&mut lanes);
    let [a, b, c, d] = [0, 1, 2, 3].map(|k: usize| lanes[k].min(lanes[k + 4]));
    a.min(b).min(c.min(d))
}

/// A thing in the frame of a light.
#[derive(Clone, Copy)]
struct Caster {
    thing: usize,
    frame: Frame,
    low: [f32; 2],
    high: [f32; 2],
    top: f32,
}

/// What casts shadows.
#[derive(Default)]
pub(crate) struct Casters {
    all: Vec<Caster>,
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
            // a plane that faces the light is met from behind
            if is_plane && frame.rot[2][2] >= 0.0 {
                continue;
            }
            let reach = three!(k => reach(frame.rot[k], half));
            self.all.push(Caster {
                thing,
                frame,
                low: [frame.pos[0] - reach[0], frame.pos[1] - reach[1]],
                high: [frame.pos[0] + reach[0], frame.pos[1] + reach[1]],
                top: frame.pos[2] + reach[2],
            });
        }
    }

    /// Shades the points of a tile.
    #[inline(always)]
    pub(crate) fn shade(&self, scene: &Scene, waiting: &mut Waiting, lit: &mut Lit) {
        if !lit.bound() {
            return;
        }
        for caster in &self.all {
            let is_beside = caster.high[0] < lit.low[0]
                || caster.low[0] > lit.high[0]
                || caster.high[1] < lit.low[1]
                || caster.low[1] > lit.high[1]
                || caster.top < lit.deep;
            if is_beside {
                continue;
            }
            match &scene.things[caster.thing].surface {
                Surface::Solid { solid, .. } => solid.shade(&caster.frame, lit),
                Surface::Triangles { tree, .. } => tree.shade(&caster.frame, waiting, lit),
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
