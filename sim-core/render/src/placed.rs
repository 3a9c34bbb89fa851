//! Where things are in an image: which tiles and lines may see them.

use crate::camera::Camera;
use crate::tile::EDGE;
use crate::vector::{Frame, Vector, dot, three};

/// Depths below which a corner of a box is not projected [m].
const SMALL: f32 = 1e-6;

/// A thing in the frame of the camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub(crate) thing: usize,
    pub(crate) frame: Frame,
    /// Least depth of its box [m].
    pub(crate) near: f32,
    /// First and last columns and rows of tiles that it may be in.
    pub(crate) tiles: [[usize; 2]; 2],
    /// First and last rows of pixels.
    rows: [usize; 2],
}

impl Placed {
    /// A thing in a box about the origin of its frame; none where it is behind the camera or beside the image.
    #[inline(always)]
    pub(crate) fn new(thing: usize, frame: Frame, half: Vector, camera: &Camera) -> Option<Placed> {
        let pixels = [camera.width, camera.height];
        let mut placed = Placed {
            thing,
            frame,
            near: camera.near,
            tiles: pixels.map(|count| [0, (count - 1) / EDGE]),
            rows: [0, camera.height - 1],
        };
        if half.iter().any(|x| x.is_infinite()) {
            return Some(placed);
        }
        let reach = dot(three!(k => frame.rot[2][k].abs()), half);
        let (near, far) = (frame.pos[2] - reach, frame.pos[2] + reach);
        if far < camera.near || near > camera.far {
            return None;
        }
        if near < SMALL {
            return Some(placed);
        }
        placed.near = near;
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for corner in 0..8 {
            let side = three!(k => if corner >> k & 1 == 0 { -half[k] } else { half[k] });
            let turned = frame.turn(side);
            let [x, y, z] = three!(k => frame.pos[k] + turned[k]);
            let place = [x / z, y / z];
            for k in 0..2 {
                low[k] = low[k].min(place[k]);
                high[k] = high[k].max(place[k]);
            }
        }
        for k in 0..2 {
            // a pixel more on each side than the middles of pixels inside
            let first = low[k].mul_add(camera.focal[k], camera.center[k]) - 1.0;
            let last = high[k].mul_add(camera.focal[k], camera.center[k]) + 1.0;
            if last < 0.0 || first > pixels[k] as f32 {
                return None;
            }
            let range = [first, last].map(|pixel| (pixel.max(0.0) as usize).min(pixels[k] - 1));
            placed.tiles[k] = range.map(|pixel| pixel / EDGE);
            if k == 1 {
                placed.rows = range;
            }
        }
        Some(placed)
    }

    /// How many tiles it may be in.
    #[inline(always)]
    pub(crate) fn count(&self) -> usize {
        let [columns, rows] = self.tiles;
        (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1)
    }

    /// Lines of a row of tiles that it may be in.
    #[inline(always)]
    pub(crate) fn lines(&self, row: usize) -> std::ops::Range<usize> {
        let start = EDGE * row;
        let last = self.rows[1].min(start + EDGE - 1);
        self.rows[0].saturating_sub(start)..(last + 1).saturating_sub(start)
    }
}
