//! Light that falls on a scene: a key light from far off, which may cast shadows, a fill light from the camera's side, and a
//! sky, as in our pictures and films.
//!
//! ```text
//! light = colour² (0.22 + 0.24 (1 + n·z)/2 + 0.66 max(n·k, 0) s + 0.14 max(n·f, 0)),  byte = 255 √light
//! ```
//!
//! n is the normal of a face, z up in the world, k and f where key and fill light come from. s is 1 where the key light
//! arrives, else 0. There are no highlights.

use sim_model::geometry::vector::{Vector as Point, cross, dot};

use crate::vector::{Frame, Vector};

/// Where the key light comes from, in the world.
const KEY: [f64; 3] = [0.33, -0.52, 0.79];
/// Where the fill light comes from, in the frame of a camera, with length 1.
pub(crate) const FILL: [f32; 3] = [0.751_882_1, -0.100_250_94, -0.651_631_1];
/// What all surfaces reflect of light from everywhere, and more of it the more they look up [–].
pub(crate) const AMBIENT: f32 = 0.22;
pub(crate) const UPWARD: f32 = 0.24;
/// Of the key light and the fill light, where they fall straight on a surface [–].
pub(crate) const BRIGHT: f32 = 0.66;
pub(crate) const FILLED: f32 = 0.14;
/// Behind everything: at the horizon and below, and from this sine of the elevation on.
pub(crate) const HORIZON: [f32; 3] = light_of([226, 230, 236]);
pub(crate) const SKY: [f32; 3] = light_of([250, 251, 253]);
pub(crate) const HIGH: f32 = 0.6;

/// The light that bytes stand for.
const fn light_of([red, green, blue]: [u8; 3]) -> [f32; 3] {
    const SCALE: f32 = 1.0 / (255.0 * 255.0);
    [
        red as f32 * red as f32 * SCALE,
        green as f32 * green as f32 * SCALE,
        blue as f32 * blue as f32 * SCALE,
    ]
}

fn norm(v: Point) -> f64 {
    dot(v, v).sqrt()
}

/// The key light of a scene: from far off, white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyLight {
    /// Its frame in the world: z points to where it comes from.
    pub(crate) axes: Frame,
    /// Whether it casts shadows.
    pub shadows: bool,
}

impl KeyLight {
    /// Light that comes from this direction in the world, of any length, and casts shadows; none if it is no direction.
    pub fn from_direction(towards: [f64; 3]) -> Option<KeyLight> {
        let length = norm(towards);
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let key = towards.map(|part| part / length);
        let side = match cross([0.0, 0.0, 1.0], key) {
            // straight from above, or from below
            side if dot(side, side) < 1e-12 => [1.0, 0.0, 0.0],
            side => side.map(|part| part / norm(side)),
        };
        let columns = [side, cross(key, side), key];
        Some(KeyLight {
            axes: Frame {
                pos: [0.0; 3],
                rot: [0, 1, 2].map(|k| columns.map(|column| column[k] as f32)),
            },
            shadows: true,
        })
    }
}

/// Lights as a camera sees them.
pub(crate) struct Lights {
    /// The frame of the key light, at the camera; its z points to where the light comes from.
    pub(crate) key: Frame,
    /// Up in the world.
    pub(crate) up: Vector,
    pub(crate) shadows: bool,
}

impl Lights {
    #[inline(always)]
    pub(crate) fn new(light: &KeyLight, eye: &Frame) -> Lights {
        let at_eye = Frame {
            pos: eye.pos,
            ..light.axes
        };
        Lights {
            key: eye.relative(&at_eye),
            up: eye.rot[2],
            shadows: light.shadows,
        }
    }
}

impl Default for KeyLight {
    /// That of films: from behind the left shoulder of who looks along y.
    fn default() -> KeyLight {
        KeyLight::from_direction(KEY).unwrap_or(KeyLight {
            axes: Frame::IDENTITY,
            shadows: true,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_has_right_handed_axes_and_comes_from_somewhere() {
        for towards in [KEY, [0.0, 0.0, 2.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]] {
            let rot = KeyLight::from_direction(towards).unwrap().axes.rot;
            let column = |k: usize| rot.map(|row| f64::from(row[k]));
            let third = cross(column(0), column(1));
            for k in 0..3 {
                assert!((third[k] - towards[k] / norm(towards)).abs() < 1e-6);
                assert!((norm(column(k)) - 1.0).abs() < 1e-6);
            }
        }
        assert!(KeyLight::from_direction([0.0; 3]).is_none());
        assert!(KeyLight::from_direction([f64::NAN, 0.0, 1.0]).is_none());
        let fill = FILL.map(f64::from);
        assert!((norm(fill) - 1.0).abs() < 1e-6);
    }
}
