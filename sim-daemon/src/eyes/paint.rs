//! Colours of parts, as pictures and films choose them (`py-client/python/tightloop/view/parts.py`).

use sim_model::geometry::{Color, VisualMesh};
use sim_render::Paint;

use crate::config::{PartKind, SeenPart};

/// What stands still and has no colour of its own.
const STILL: [u8; 4] = [178, 170, 158, 255];
/// Hues that follow one another by the golden angle are well apart [turns].
const GOLDEN: f64 = 137.507_764 / 360.0;

/// The paint of a part that stands for itself, on a body if it moves.
pub(super) fn of_part(part: &SeenPart, body: Option<usize>) -> Paint {
    if let Some(color) = part.color {
        return Paint::of_color(color);
    }
    match (part.kind, body) {
        (PartKind::Collision { .. }, None) => of_bytes(STILL),
        (PartKind::Collision { added: true }, Some(body)) => palette(body),
        _ => Paint::PLAIN,
    }
}

/// The paint of each triangle of a mesh file, in a part's colour where the part has one and the file has not several of its own.
pub(super) fn of_file(part: &SeenPart, mesh: &VisualMesh) -> Vec<Paint> {
    let of_part = part.color.map(Paint::of_color);
    let mut colors = mesh.colors.iter().flatten();
    let first = colors.next();
    // most files of one colour have it from an exporter's default
    let is_plain = colors.all(|color| Some(color) == first);
    let paint = |color: &Option<Color>| match (color, of_part) {
        (_, Some(paint)) if is_plain => paint,
        (Some(color), _) => of_bytes(*color),
        (None, paint) => paint.unwrap_or(Paint::PLAIN),
    };
    mesh.colors.iter().map(paint).collect()
}

/// The colour of the body with this number where nothing gives it one.
fn palette(body: usize) -> Paint {
    let hue = (0.58 + GOLDEN * body as f64).fract();
    let lightness = if body.is_multiple_of(2) { 0.6 } else { 0.7 };
    of_bytes(hls(hue, lightness, 0.5))
}

fn of_bytes(color: [u8; 4]) -> Paint {
    Paint::of_color(color.map(|part| f64::from(part) / 255.0))
}

/// Hue [turns], lightness and saturation as bytes of red, green and blue.
fn hls(hue: f64, lightness: f64, saturation: f64) -> [u8; 4] {
    let high = match lightness <= 0.5 {
        true => lightness * (1.0 + saturation),
        false => lightness + saturation - lightness * saturation,
    };
    let low = 2.0 * lightness - high;
    let part = |turned: f64| {
        let hue = (hue + turned).rem_euclid(1.0);
        let value = match hue {
            hue if hue < 1.0 / 6.0 => low + (high - low) * hue * 6.0,
            hue if hue < 0.5 => high,
            hue if hue < 2.0 / 3.0 => low + (high - low) * (2.0 / 3.0 - hue) * 6.0,
            _ => low,
        };
        (255.0 * value).round() as u8
    };
    [part(1.0 / 3.0), part(0.0), part(-1.0 / 3.0), 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hues_are_those_of_the_color_wheel() {
        assert_eq!(hls(0.0, 0.5, 1.0), [255, 0, 0, 255]);
        assert_eq!(hls(1.0 / 3.0, 0.5, 1.0), [0, 255, 0, 255]);
        assert_eq!(hls(2.0 / 3.0, 0.5, 1.0), [0, 0, 255, 255]);
        assert_eq!(hls(0.25, 0.7, 0.0), [179, 179, 179, 255]);
    }
}
