//! Numbers of materials to colours of a screen.

use super::super::visual::Color;

/// Red, green, blue and opacity from 0 to 1 as bytes; what is not finite counts as 0.
pub(super) fn color_of(parts: [f64; 4]) -> Color {
    parts.map(|part| (255.0 * part).round_ties_even() as u8)
}

/// The same, of red, green and blue that are proportional to light (IEC 61966-2-1, sRGB).
pub(super) fn color_of_light([red, green, blue, opacity]: [f64; 4]) -> Color {
    let encode = |light: f64| {
        if light <= 0.003_130_8 {
            12.92 * light
        } else {
            1.055 * light.powf(1.0 / 2.4) - 0.055
        }
    };
    color_of([encode(red), encode(green), encode(blue), opacity])
}

/// Means of the corners' colours of a triangle.
pub(super) fn mean(corners: [[f64; 4]; 3]) -> [f64; 4] {
    let [a, b, c] = corners;
    std::array::from_fn(|part| (a[part] + b[part] + c[part]) / 3.0)
}
