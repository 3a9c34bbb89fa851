//! What is behind the robot: a floor with a grid and a soft shadow, or graph paper.

use super::canvas::{PAPER, Rgb, mix};
use super::raster::cover;
use super::surface::Surface;
use sim_picture::View;
use sim_picture::vector::Vector;

const FLOOR: Rgb = [229, 231, 235];
const LINE: Rgb = [176, 181, 190];
const FAINT: Rgb = [226, 228, 233];
/// Cells of the shadow along each side.
const CELLS: usize = 192;

/// Colours of the x, y and z axes.
pub(super) const AXES: [Rgb; 3] = [[214, 58, 50], [40, 150, 70], [48, 96, 208]];

/// What is seen where the robot is not.
pub(super) enum Backdrop {
    /// A floor with lines every `spacing` [m].
    Floor { spacing: f64, shadow: Shadow },
    /// Lines every `spacing` [m] in the plane of the panel, those through the world's origin in the colours of the two
    /// axes that run to the right and up.
    Paper { spacing: f64, axes: [usize; 2] },
}

impl Backdrop {
    /// Colour of a pixel.
    pub fn colour(&self, view: &View, x: usize, y: usize) -> Rgb {
        let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
        match self {
            Backdrop::Floor { spacing, shadow } => floor(view, x, y, *spacing, shadow),
            Backdrop::Paper { spacing, axes } => paper(view, x, y, *spacing, *axes),
        }
    }
}

fn floor(view: &View, x: f64, y: f64, spacing: f64, shadow: &Shadow) -> Rgb {
    let at = |x: f64, y: f64| view.on_plane(x, y, shadow.floor);
    let (Some(point), Some(right), Some(below)) = (at(x, y), at(x + 1.0, y), at(x, y + 1.0)) else {
        return PAPER;
    };
    // the floor fades into the paper around the robot
    let away = (point[0] - shadow.middle[0]).hypot(point[1] - shadow.middle[1]) / shadow.size;
    let here = (1.0 - smooth_step(0.55, 1.35, away)).clamp(0.0, 1.0);
    let mut colour = FLOOR;
    for axis in 0..2 {
        let pixel = (right[axis] - point[axis]).hypot(below[axis] - point[axis]);
        let cells = point[axis] / spacing;
        let distance = (cells - cells.round()).abs() * spacing / pixel;
        // far off, where lines are closer than pixels, they become a tint
        let dense = (spacing / (4.0 * pixel)).clamp(0.0, 1.0);
        let cover = (1.1 - distance).clamp(0.0, 1.0) * dense;
        let through_origin = cells.round() == 0.0;
        // the line where x is 0 runs along y
        let (line, width) = if through_origin {
            (AXES[1 - axis], (1.6 - distance).clamp(0.0, 1.0) * dense)
        } else {
            (LINE, cover)
        };
        colour = mix(colour, line, 0.75 * width);
    }
    let shaded = mix(colour, [60, 66, 80], 0.5 * shadow.at(point));
    mix(PAPER, shaded, here)
}

fn paper(view: &View, x: f64, y: f64, spacing: f64, axes: [usize; 2]) -> Rgb {
    let aside = [x - 0.5 * view.width, 0.5 * view.height - y];
    let origin = [
        sim_picture::vector::dot(view.eye, view.right),
        sim_picture::vector::dot(view.eye, view.up),
    ];
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

fn smooth_step(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// What the robot keeps from a sky right above it, on the floor: the darker, the nearer it is to the floor.
pub(super) struct Shadow {
    /// Height of the floor [m].
    pub floor: f64,
    /// Middle of the robot [m].
    pub middle: Vector,
    /// Length of the robot's diagonal [m].
    pub size: f64,
    /// Darkness from 0 to 1, rows along y. `(CELLS, CELLS)`
    cells: Vec<f32>,
    /// Width of a cell [m].
    cell: f64,
}

impl Shadow {
    /// Of a surface on a floor.
    pub fn new(surface: &Surface, floor: f64) -> Shadow {
        let middle = surface.middle();
        let size = surface.size();
        let [low, high] = surface.extent;
        // room for the blur around it
        let wide = 1.5 * (high[0] - low[0]).max(high[1] - low[1]).max(0.05 * size);
        let cell = wide / CELLS as f64;
        let mut cells = vec![0.0_f32; CELLS * CELLS];
        for facet in &surface.facets {
            let place = facet.corners.map(|corner| {
                [corner[0], corner[1]]
                    .map(|part| (16.0 * (f64::from(part) / cell + 0.5 * CELLS as f64)) as i64)
            });
            let dark = facet.corners.map(|corner| {
                let height = f64::from(corner[2]) + middle[2] - floor;
                (-4.0 * height.max(0.0) / size).exp() as f32
            });
            cover(&place, CELLS, 0, CELLS, |index, weights| {
                let dark: f32 = (0..3).map(|k| weights[k] * dark[k]).sum();
                cells[index] = cells[index].max(dark);
            });
        }
        // three boxes in a row are nearly a bell
        for _ in 0..3 {
            blur(&mut cells, 1);
            blur(&mut cells, CELLS);
        }
        Shadow {
            floor,
            middle,
            size,
            cells,
            cell,
        }
    }

    /// Darkness at a place of the floor.
    fn at(&self, point: [f64; 2]) -> f64 {
        let [x, y]: [f64; 2] = std::array::from_fn(|axis| {
            (point[axis] - self.middle[axis]) / self.cell + 0.5 * CELLS as f64 - 0.5
        });
        let inside = |part: f64| part >= 0.0 && part < (CELLS - 1) as f64;
        if !inside(x) || !inside(y) {
            return 0.0;
        }
        let (column, row) = (x as usize, y as usize);
        let (right, up) = (x - column as f64, y - row as f64);
        let cell = |row: usize, column: usize| f64::from(self.cells[row * CELLS + column]);
        let low = cell(row, column) * (1.0 - right) + cell(row, column + 1) * right;
        let high = cell(row + 1, column) * (1.0 - right) + cell(row + 1, column + 1) * right;
        low * (1.0 - up) + high * up
    }
}

/// Each cell becomes the mean of those near it in a line; `stride` is from cell to cell.
fn blur(cells: &mut [f32], stride: usize) {
    const REACH: usize = 4;
    let pitch = if stride == 1 { CELLS } else { 1 };
    let mut line = [0.0_f32; CELLS];
    for start in (0..CELLS).map(|line| line * pitch) {
        for (place, value) in line.iter_mut().enumerate() {
            *value = cells[start + place * stride];
        }
        for place in 0..CELLS {
            let near = place.saturating_sub(REACH)..(place + REACH + 1).min(CELLS);
            let sum: f32 = line[near].iter().sum();
            cells[start + place * stride] = sum / (2 * REACH + 1) as f32;
        }
    }
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
