//! Lines and dots over a picture, such as forces and where they act; what is hidden shines through.

use crate::clip::clipped;
use crate::project::{Lens, TILE};
use crate::shade::{Light, light, mix};

/// How much is seen of a mark behind a surface.
const HIDDEN: f32 = 0.3;
/// How much nearer a surface must be to hide a mark, in parts of the distance: contacts lie in surfaces.
const SLACK: f32 = 0.01;

/// A line between two places of the world, or a dot where they are one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Both ends [m].
    pub ends: [[f64; 3]; 2],
    /// Red, green, blue, opacity.
    pub colour: [u8; 4],
    /// Width [pixels].
    pub width: f32,
}

/// A mark in the picture: a line with round ends, which may be a point.
pub(crate) struct Mark {
    /// Ends [pixels], and how near they are.
    ends: [[f32; 3]; 2],
    light: Light,
    opacity: f32,
    /// Half of its width [pixels].
    half: f32,
}

impl Mark {
    /// Of the ends as `Ahead`; none if it is behind the camera.
    pub fn new(ends: [[f32; 3]; 2], colour: [u8; 4], width: f32, lens: &Lens) -> Option<Mark> {
        let [a, b] = ends;
        let polygon = clipped([a, b, b], lens.nearest);
        let first = *polygon.first()?;
        // along the cut, the corner that is farthest from the first is the other end
        let distance = |p: &[f32; 3]| (0..3).map(|k| (p[k] - first[k]).powi(2)).sum::<f32>();
        let other = polygon
            .iter()
            .copied()
            .max_by(|p, q| distance(p).total_cmp(&distance(q)))?;
        let [red, green, blue, opacity] = colour;
        Some(Mark {
            ends: [lens.screen(first), lens.screen(other)],
            light: light([red, green, blue]),
            opacity: f32::from(opacity) / 255.0,
            half: 0.5 * width,
        })
    }

    /// Lays it over a tile whose first pixel is `corner`; `near` are the surfaces seen at each pixel's samples.
    pub fn draw(&self, lights: &mut [Light], near: &[[f32; 4]], corner: [usize; 2]) {
        let reach = self.half + 1.0;
        let [a, b] = self.ends;
        let span = |axis: usize| {
            let low = a[axis].min(b[axis]) - reach - corner[axis] as f32;
            let high = a[axis].max(b[axis]) + reach - corner[axis] as f32;
            low.clamp(0.0, TILE as f32) as usize..high.clamp(0.0, TILE as f32).ceil() as usize
        };
        let along = [b[0] - a[0], b[1] - a[1]];
        let square = along[0] * along[0] + along[1] * along[1];
        for y in span(1) {
            for x in span(0) {
                let point = [
                    (corner[0] + x) as f32 + 0.5 - a[0],
                    (corner[1] + y) as f32 + 0.5 - a[1],
                ];
                let foot = if square > 0.0 {
                    ((point[0] * along[0] + point[1] * along[1]) / square).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let (right, down) = (point[0] - foot * along[0], point[1] - foot * along[1]);
                let distance = (right * right + down * down).sqrt();
                let cover = (self.half + 0.5 - distance).clamp(0.0, 1.0);
                if cover <= 0.0 {
                    continue;
                }
                let pixel = y * TILE + x;
                let depth = (a[2] + foot * (b[2] - a[2])) * (1.0 + SLACK);
                let open = near[pixel].iter().filter(|&&near| near <= depth).count();
                let shown = HIDDEN + (1.0 - HIDDEN) * open as f32 / near[pixel].len() as f32;
                lights[pixel] = mix(lights[pixel], self.light, cover * self.opacity * shown);
            }
        }
    }
}
