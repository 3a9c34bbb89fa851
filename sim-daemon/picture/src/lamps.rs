//! The lights of a scene, which take the place of the fixed ones. They shine as MuJoCo's viewer has it:
//!
//! ```text
//! byte' = byte Σ fade (ambient + diffuse n·l shadow) + Σ fade ½ specular (n·h)⁶⁴ shadow
//! fade  = (cos θ)ᵉ / (a + b d + c d²), 0 outside of the cone
//! ```
//!
//! One of them casts shadows: the first that may.

use crate::shadow::Shadow;
use crate::single::{along, dot, unit};
use crate::vector::{self, Vector};

/// What a surface without a material reflects of a highlight in MuJoCo [–].
const SHINE: f32 = 0.5;

/// A light of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Where it is [m]; none where it shines from far off.
    pub position: Option<Vector>,
    /// Where it shines to; need not have length 1.
    pub direction: Vector,
    /// Red, green and blue, in parts of a surface's colour, from everywhere.
    pub ambient: [f32; 3],
    /// On surfaces that face it.
    pub diffuse: [f32; 3],
    /// Of highlights.
    pub specular: [f32; 3],
    /// What its light is divided by: a number, per distance [1/m], and per its square [1/m²].
    pub attenuation: [f32; 3],
    /// Half the angle of its cone [rad]; π shines everywhere.
    pub cutoff: f32,
    /// Power of the cosine of the angle from its direction.
    pub exponent: f32,
    /// Whether it may cast shadows.
    pub shadows: bool,
}

impl Lamp {
    /// Where its light comes from at a place, of length 1.
    fn towards(&self, place: Vector) -> Vector {
        vector::unit(match self.position {
            Some(position) => vector::sub(position, place),
            None => self.direction.map(|part| -part),
        })
    }
}

/// Which lamp casts shadows, and where its light comes from in the middle of the scene.
pub(crate) fn caster(lamps: &[Lamp], middle: Vector) -> Option<(usize, Vector)> {
    let place = lamps.iter().position(|lamp| lamp.shadows)?;
    let towards = lamps[place].towards(middle);
    (towards != [0.0; 3]).then_some((place, towards))
}

/// A lamp as surfaces see it.
struct Placed {
    lamp: Lamp,
    /// From the eye [m].
    position: Option<[f32; 3]>,
    direction: [f32; 3],
    /// Cosine of the cone's half angle; less than any where there is no cone.
    rim: f32,
}

/// The lamps of a picture.
pub(crate) struct Lamps {
    all: Vec<Placed>,
    caster: Option<usize>,
}

impl Lamps {
    pub fn new(lamps: &[Lamp], eye: Vector, caster: Option<usize>) -> Lamps {
        let single = |vector: Vector| vector.map(|part| part as f32);
        let place = |lamp: &Lamp| Placed {
            lamp: *lamp,
            position: lamp.position.map(|at| single(vector::sub(at, eye))),
            direction: single(vector::unit(lamp.direction)),
            // a cosine may be a rounding below -1
            rim: match lamp.cutoff < std::f32::consts::PI {
                true => lamp.cutoff.cos(),
                false => f32::NEG_INFINITY,
            },
        };
        Lamps {
            all: lamps.iter().map(place).collect(),
            caster,
        }
    }

    /// Whether there are any.
    pub fn shine(&self) -> bool {
        !self.all.is_empty()
    }

    /// Light from a surface that reflects `surface_light`, at a point with a normal and that of its face, seen along a
    /// ray; all from the eye.
    pub fn lit(
        &self,
        surface_light: [f32; 3],
        [normal, flat]: [[f32; 3]; 2],
        point: [f32; 3],
        ray: [f32; 3],
        shadow: &Shadow,
    ) -> [f32; 3] {
        let (mut amount, mut gleam) = ([0.0; 3], [0.0; 3]);
        for (place, placed) in self.all.iter().enumerate() {
            let lamp = &placed.lamp;
            let (towards, fade) = placed.reach(point);
            if fade <= 0.0 {
                continue;
            }
            let facing = dot(normal, towards).max(0.0);
            let reached = match facing > 0.0 && dot(flat, towards) > 0.0 {
                true if self.caster == Some(place) => shadow.light(point, flat),
                true => 1.0,
                false => 0.0,
            };
            let half = unit(along(towards, -1.0, unit(ray)));
            let shine = SHINE * dot(normal, half).max(0.0).powi(64) * reached * fade;
            for k in 0..3 {
                amount[k] += fade * (lamp.ambient[k] + lamp.diffuse[k] * facing * reached);
                gleam[k] += shine * lamp.specular[k];
            }
        }
        // a byte is the square root of light
        std::array::from_fn(|k| {
            let byte = (surface_light[k].sqrt() * amount[k] + gleam[k]).clamp(0.0, 1.0);
            byte * byte
        })
    }
}

impl Placed {
    /// Where light comes from at a point, and how much of it.
    fn reach(&self, point: [f32; 3]) -> ([f32; 3], f32) {
        let Some(position) = self.position else {
            return (self.direction.map(|part| -part), 1.0);
        };
        let apart = along(position, -1.0, point);
        let square = dot(apart, apart);
        let towards = unit(apart);
        let [constant, linear, quadratic] = self.lamp.attenuation;
        let divisor = constant + linear * square.sqrt() + quadratic * square;
        let cosine = -dot(towards, self.direction);
        let lost = divisor <= 0.0 || cosine < self.rim;
        let cone = match self.lamp.exponent {
            0.0 => 1.0,
            exponent => cosine.max(0.0).powf(exponent),
        };
        (towards, if lost { 0.0 } else { cone / divisor })
    }
}
