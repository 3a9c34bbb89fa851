//! Colours of parts.
//!
//! A byte of an image is the square root of light, as in our pictures and films: `byte = 255 √light`. A square root is
//! correctly rounded everywhere, unlike the powers of sRGB, from which it differs by at most 0.04.

use sim_model::geometry::HeightField;
use sim_model::geometry::vector::{Vector as Point, cross, dot, sub};

/// Parts that are less opaque are not seen at all [–].
pub(crate) const OPAQUE_MIN: f32 = 0.01;
/// Width of squares on a plane, as in films [m].
const SQUARE: f64 = 0.5;
/// How much lighter and darker than a plane its squares are [–].
const CONTRAST: f32 = 0.07;
/// Cosines of the slopes from which height fields are darker, 8°, 25° and 45°, and tones of light and dark squares [–].
const STEEP: [f64; 3] = [
    0.990_268_068_741_570_3,
    0.906_307_787_036_65,
    std::f64::consts::FRAC_1_SQRT_2,
];
const TONES: [[f32; 2]; 4] = [[1.0, 0.93], [0.92, 0.86], [0.78, 0.78], [0.66, 0.66]];

/// Red, green and blue from 0 to 1, as a screen shows them [–].
pub(crate) type Color = [f32; 3];

/// What the surface of a part looks like in an image of colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    /// Red, green, blue and opacity from 0 to 1, as a screen shows them: bytes over 255 [–].
    ///
    /// A part of an opacity below 0.01 is seen in no image. All others are opaque.
    pub color: [f32; 4],
    /// Whether planes and height fields have squares of two tones. They are 0.5 m wide on planes, and whole cells, about 1 m
    /// wide, on height fields, which are darker where they are steep. Other shapes have one tone.
    pub squares: bool,
}

impl Paint {
    /// What has no colour of its own.
    pub const PLAIN: Paint = Paint {
        color: [214.0 / 255.0, 216.0 / 255.0, 220.0 / 255.0, 1.0],
        squares: false,
    };
    /// Ground without a colour of its own.
    pub const GROUND: Paint = Paint {
        color: [184.0 / 255.0, 191.0 / 255.0, 200.0 / 255.0, 1.0],
        squares: true,
    };

    /// A colour without squares.
    pub fn of_color(color: [f64; 4]) -> Paint {
        Paint {
            color: color.map(|part| part as f32),
            squares: false,
        }
    }

    /// Whether it is seen.
    pub(crate) fn is_seen(&self) -> bool {
        self.color[3] >= OPAQUE_MIN
    }

    /// Its colour in a tone.
    pub(crate) fn toned(&self, tone: f32) -> Color {
        [0, 1, 2].map(|k| (tone * self.color[k]).clamp(0.0, 1.0))
    }

    /// How a plane with these half edges [m] is painted.
    pub(crate) fn on_plane(&self, half: [f64; 2]) -> Coat {
        if !self.squares {
            return self.on_solid();
        }
        Coat {
            tones: [1.0 + CONTRAST, 1.0 - CONTRAST].map(|tone| self.toned(tone)),
            // an even number of equal squares along an edge
            per: half.map(|half| {
                let per = match half.is_finite() {
                    true => (half / SQUARE).round().max(1.0) / half,
                    false => 1.0 / SQUARE,
                };
                per as f32
            }),
        }
    }

    /// How a shape with one tone is painted.
    pub(crate) fn on_solid(&self) -> Coat {
        Coat {
            tones: [self.toned(1.0); 2],
            per: [0.0; 2],
        }
    }

    /// The colour of walls of height fields.
    pub(crate) fn wall(&self) -> Color {
        self.toned(if self.squares { TONES[3][0] } else { 1.0 })
    }

    /// The colour of a triangle of a height field.
    pub(crate) fn on_field(&self, field: &HeightField, corners: &[Point; 3]) -> Color {
        if !self.squares {
            return self.toned(1.0);
        }
        let [a, b, c] = *corners;
        let normal = cross(sub(b, a), sub(c, a));
        let upright = normal[2] / dot(normal, normal).sqrt().max(f64::MIN_POSITIVE);
        let steep = STEEP.iter().filter(|&&cosine| upright < cosine);
        let squares = field.squares();
        let place = [0, 1].map(|k| {
            let middle = (a[k] + b[k] + c[k]) / 3.0;
            ((middle + field.half[k]) / squares[k]).floor()
        });
        let is_dark = (place[0] + place[1]).rem_euclid(2.0) > 0.5;
        self.toned(TONES[steep.count()][usize::from(is_dark)])
    }
}

impl Default for Paint {
    fn default() -> Paint {
        Paint::PLAIN
    }
}

/// Paint on a solid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coat {
    /// Of its two kinds of squares.
    pub(crate) tones: [Color; 2],
    /// Squares per length along x and y; 0 where it has one tone [1/m].
    pub(crate) per: [f32; 2],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finite_plane_has_an_even_number_of_squares_and_a_shape_one_tone() {
        let per = |half| Paint::GROUND.on_plane([half; 2]).per[0];
        assert!((per(f64::INFINITY) - 2.0).abs() < 1e-6);
        assert!((per(1.1) * 1.1 - 2.0).abs() < 1e-6);
        assert!((per(0.1) * 0.1 - 1.0).abs() < 1e-6);
        let coat = Paint::GROUND.on_solid();
        assert_eq!(
            coat.tones[0].map(f32::to_bits),
            coat.tones[1].map(f32::to_bits)
        );
    }

    #[test]
    fn a_field_has_squares_of_whole_cells_and_is_darker_where_it_is_steep() {
        let field = HeightField::new([9, 9], vec![0.0; 81], [8.0, 8.0], 1.0).unwrap();
        let [x, y] = field.squares();
        let tone = |dx: f64, dy: f64, rise: f64| {
            let low = [-4.0 + dx, -4.0 + dy, 0.0];
            let corners = [
                low,
                [low[0] + 0.1, low[1], rise],
                [low[0], low[1] + 0.1, 0.0],
            ];
            Paint::GROUND.on_field(&field, &corners)[0].to_bits()
        };
        assert_eq!(tone(0.0, 0.0, 0.0), tone(x, y, 0.0));
        assert!(tone(0.0, 0.0, 0.0) > tone(x, 0.0, 0.0));
        assert!(tone(0.0, 0.0, 0.0) > tone(0.0, 0.0, 0.05));
        assert!(tone(0.0, 0.0, 0.05) > tone(0.0, 0.0, 0.2));
    }
}
