//! What is behind a view without perspective: graph paper.

use sim_picture::View;
use sim_picture::vector::dot;

use super::canvas::{Canvas, PAPER, Rgb, mix};

const FAINT: Rgb = [226, 228, 233];

/// Colours of the x, y and z axes.
pub(super) const AXES: [Rgb; 3] = [[214, 58, 50], [40, 150, 70], [48, 96, 208]];

/// Paper with lines every `spacing` [m] in the plane of a view; those through the world's origin have the colours of the two
/// axes that run to the right and up.
pub(super) fn graph_paper(view: &View, spacing: f64, axes: [usize; 2]) -> Canvas {
    let mut canvas = Canvas::new(view.width as usize, view.height as usize, PAPER);
    for (row, pixels) in canvas.pixels.chunks_exact_mut(canvas.width).enumerate() {
        for (column, pixel) in pixels.iter_mut().enumerate() {
            let at = [column as f64 + 0.5, row as f64 + 0.5];
            *pixel = colour(view, at, spacing, axes);
        }
    }
    canvas
}

fn colour(view: &View, [x, y]: [f64; 2], spacing: f64, axes: [usize; 2]) -> Rgb {
    let aside = [x - 0.5 * view.width, 0.5 * view.height - y];
    let origin = [dot(view.eye, view.right), dot(view.eye, view.up)];
    let mut colour = PAPER;
    let mut axis_colour = None;
    for direction in 0..2 {
        let cells = (origin[direction] + aside[direction] / view.scale) / spacing;
        let distance = (cells - cells.round()).abs() * spacing * view.scale;
        if cells.round() == 0.0 {
            let cover = (1.3 - distance).clamp(0.0, 1.0);
            if cover > 0.0 {
                axis_colour = Some((AXES[axes[1 - direction]], 0.55 * cover));
            }
        } else {
            colour = mix(colour, FAINT, (1.0 - distance).clamp(0.0, 1.0));
        }
    }
    axis_colour.map_or(colour, |(line, cover)| mix(colour, line, cover))
}

/// A round length of 1, 2 or 5 in some power of ten, so that about `count` of them make `size` [m].
pub(super) fn round_spacing(size: f64, count: f64) -> f64 {
    let rough = size / count;
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|step| step * power >= rough * 0.999)
        .unwrap_or(10.0);
    step * power
}
