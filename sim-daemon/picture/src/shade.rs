//! Light: a key light with shadows, a fill light from the camera's side, and a sky; a floor with a grid below. Lamps of a
//! scene take the place of these lights.
//!
//! Colours are added up as light, whose square root is what a file holds, so that edges and translucent surfaces mix as
//! they do to the eye.

use crate::Rgb;
use crate::cover::floor;
use crate::lamps::Lamps;
use crate::mesh::Face;
use crate::rays::Ray;
use crate::shadow::Shadow;
use crate::single::{along, cross, dot, sub, unit};

pub(crate) type Light = [f32; 3];

/// Where the key light comes from: over the left shoulder of a camera in front.
pub(crate) const KEY: [f64; 3] = [0.33, -0.52, 0.79];
/// Of the fill light in camera axes: right, up, into.
pub(crate) const FILL: [f64; 3] = [0.75, 0.1, -0.65];

const SKY: Light = light([250, 251, 253]);
const HORIZON: Light = light([226, 230, 236]);
/// What the floor is of the light behind it: it has no edge, because it is a tone of what it fades into.
const FLOOR: f32 = 0.95;
/// Where the floor fades: distance from the middle over the reach, and how far a ray points down, its sine.
const FADE_AWAY: [f32; 2] = [0.9, 3.0];
const FADE_LEVEL: [f32; 2] = [0.0, 0.15];
const LINE: Light = light([178, 185, 196]);
/// Colours of the lines through the origin: along x, along y.
const AXES: [Light; 2] = [light([206, 92, 84]), light([82, 158, 98])];

/// What a byte of a file stands for.
pub(crate) const fn light([red, green, blue]: Rgb) -> Light {
    const SCALE: f32 = 1.0 / (255.0 * 255.0);
    [
        red as f32 * red as f32 * SCALE,
        green as f32 * green as f32 * SCALE,
        blue as f32 * blue as f32 * SCALE,
    ]
}

/// The byte that stands for a light.
pub(crate) fn colour(light: Light) -> Rgb {
    light.map(|part| (255.0 * part.clamp(0.0, 1.0).sqrt() + 0.5) as u8)
}

pub(crate) fn mix(under: Light, over: Light, share: f32) -> Light {
    std::array::from_fn(|k| under[k] + (over[k] - under[k]) * share)
}

/// How a placed mesh is looked at and coloured.
pub(crate) struct Look {
    /// Axes of the mesh in the world: columns of its rotation.
    pub axes: [[f32; 3]; 3],
    /// Its origin, from the eye, in the world [m].
    pub origin: [f32; 3],
    /// Colour laid over its own, and how much of it.
    pub tint: Light,
    pub tinted: f32,
    pub opacity: f32,
}

impl Look {
    fn local(&self, world: [f32; 3]) -> [f32; 3] {
        self.axes.map(|axis| dot(axis, world))
    }

    fn world(&self, local: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|k| (0..3).map(|axis| self.axes[axis][k] * local[axis]).sum())
    }
}

/// The floor.
pub(crate) struct Ground {
    /// Its height over the eye, below 0 [m].
    pub height: f32,
    /// Distance of its lines [m].
    pub spacing: f32,
    /// Where the eye is, in lines: whole ones apart from what is left.
    pub eye: [f32; 2],
    /// How many lines there are from the origin to the eye, less that.
    pub lines: [f32; 2],
    /// What matters, from the eye, and how far it reaches [m].
    pub middle: [f32; 2],
    pub reach: f32,
}

/// Lights and what they fall on.
pub(crate) struct Lights {
    pub key: [f32; 3],
    pub fill: [f32; 3],
    pub lamps: Lamps,
    pub shadow: Shadow,
    /// Whether what lies flat has shadows: some light casts them, from above.
    pub floor_shadows: bool,
    pub ground: Option<Ground>,
}

impl Lights {
    /// Light from a face on a line of sight, and its opacity.
    pub fn surface(
        &self,
        look: &Look,
        face: &Face,
        vertices: [[f32; 3]; 3],
        Ray { from, towards: ray }: Ray,
    ) -> (Light, f32) {
        // where the ray meets the plane of the triangle (Möller and Trumbore 1997), in the mesh's frame
        let towards = look.local(ray);
        let eye = look.local(sub(from, look.origin));
        let [a, b, c] = vertices;
        let (first, second) = (sub(b, a), sub(c, a));
        let aside = cross(towards, second);
        let scale = dot(first, aside);
        let start = sub(eye, a);
        let over = cross(start, first);
        // at its rim a sample may be beside the triangle by a rounding
        let (u, v) = if scale == 0.0 {
            (0.0, 0.0)
        } else {
            let u = (dot(start, aside) / scale).clamp(0.0, 1.0);
            (u, (dot(towards, over) / scale).clamp(0.0, 1.0 - u))
        };
        let at = along(along(a, u, first), v, second);
        let point = along(look.origin, 1.0, look.world(at));
        let weights = [1.0 - u - v, u, v];
        let normal = std::array::from_fn(|axis| {
            (0..3)
                .map(|k| weights[k] * f32::from(face.normals[k][axis]))
                .sum()
        });
        let mut normal = unit(look.world(normal));
        let flat = unit(look.world(cross(first, second)));
        // a surface that is seen from behind shows its other side
        let seen = if dot(flat, ray) > 0.0 { -1.0 } else { 1.0 };
        let flat = flat.map(|part| seen * part);
        if dot(normal, flat) < 0.0 {
            normal = normal.map(|part| -part);
        }
        let [red, green, blue, opacity] = face.colour;
        let surface_light = mix(light([red, green, blue]), look.tint, look.tinted);
        let opacity = look.opacity * f32::from(opacity) / 255.0;
        let lit = if self.lamps.shine() {
            let normals = [normal, flat];
            let shadow = &self.shadow;
            self.lamps.lit(surface_light, normals, point, ray, shadow)
        } else {
            self.lit(surface_light, normal, flat, point, ray)
        };
        (lit, opacity)
    }

    fn lit(
        &self,
        surface_light: Light,
        normal: [f32; 3],
        flat: [f32; 3],
        point: [f32; 3],
        ray: [f32; 3],
    ) -> Light {
        let facing = dot(flat, self.key);
        let key = dot(normal, self.key).max(0.0);
        let shadow = if key > 0.0 && facing > 0.0 {
            self.shadow.light(point, flat)
        } else {
            0.0
        };
        let fill = dot(normal, self.fill).max(0.0);
        let sky = 0.5 + 0.5 * normal[2];
        let half = unit(sub(self.key, unit(ray)));
        let gleam = {
            let one = dot(normal, half).max(0.0);
            let four = (one * one) * (one * one);
            let sixteen = (four * four) * (four * four);
            0.10 * sixteen * sixteen * shadow
        };
        let amount = 0.22 + 0.24 * sky + 0.66 * key * shadow + 0.14 * fill;
        surface_light.map(|part| part * amount + gleam)
    }

    /// Light from behind everything: the sky.
    pub fn sky(&self, ray: [f32; 3]) -> Light {
        mix(HORIZON, SKY, smooth_step(0.0, 0.6, unit(ray)[2]))
    }

    /// Light from the floor on a ray from the eye, which fades into the light `behind`; the other two rays are those of the
    /// next pixels.
    pub fn floor(&self, ray: [f32; 3], beside: [[f32; 3]; 2], behind: impl Fn() -> Light) -> Light {
        let Some(ground) = &self.ground else {
            return behind();
        };
        if ray[2] >= 0.0 {
            return behind();
        }
        let on = |ray: [f32; 3]| {
            let time = ground.height / ray[2].min(-1e-6);
            [time * ray[0], time * ray[1]]
        };
        let (point, [right, below]) = (on(ray), beside.map(on));
        let length = |x: f32, y: f32| (x * x + y * y).sqrt();
        let away = length(point[0] - ground.middle[0], point[1] - ground.middle[1]);
        let [near, far] = FADE_AWAY;
        let [level, down] = FADE_LEVEL;
        let left = 1.0 - smooth_step(near, far, away / ground.reach);
        let left = left * smooth_step(level, down, -ray[2] / dot(ray, ray).sqrt());
        let behind = behind();
        if left <= 0.0 {
            return behind;
        }
        let mut colour = behind.map(|part| FLOOR * part);
        for axis in 0..2 {
            // a pixel's width along this axis [lines]
            let pixel = length(right[axis] - point[axis], below[axis] - point[axis]);
            let pixel = (pixel / ground.spacing).max(1e-6);
            let place = point[axis] / ground.spacing + ground.eye[axis];
            let line = floor(place + 0.5) as f32;
            let distance = (place - line).abs() / pixel;
            // far off, where lines are closer than pixels, they become a tint
            let dense = (0.25 / pixel).min(1.0);
            let origin = line + ground.lines[axis] == 0.0;
            // the line where x is 0 runs along y
            let (line, width) = if origin {
                (AXES[1 - axis], 1.5)
            } else {
                (LINE, 1.0)
            };
            let cover = (width - distance).clamp(0.0, 1.0) * dense;
            colour = mix(colour, line, 0.8 * cover);
        }
        let at = [point[0], point[1], ground.height];
        let shadow = if self.floor_shadows {
            self.shadow.light(at, [0.0, 0.0, 1.0])
        } else {
            1.0
        };
        let lit = colour.map(|part| part * (0.52 + 0.48 * shadow));
        mix(behind, lit, left)
    }
}

fn smooth_step(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
