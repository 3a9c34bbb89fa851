//! Lines of sight: where each place of the picture looks from, and in which direction.

use crate::vector::{Vector, along};
use crate::view::View;

/// A line of sight in the world.
pub(crate) struct Ray {
    /// Where it starts, relative to the eye [m].
    pub from: [f32; 3],
    /// Its direction; 1 m into the picture.
    pub towards: [f32; 3],
}

/// The lines of sight of a picture.
pub(crate) struct Rays {
    /// Direction of all of them where there is no perspective.
    parallel: Option<[f32; 3]>,
    /// What differs between places: at the first pixel's corner, and how it grows to the right and down, a pixel.
    first: [f32; 3],
    right: [f32; 3],
    down: [f32; 3],
}

impl Rays {
    pub fn new(view: &View) -> Rays {
        let right = view.right.map(|part| part / view.scale);
        let down = view.up.map(|part| -part / view.scale);
        let middle = if view.perspective {
            view.into
        } else {
            [0.0; 3]
        };
        let left = along(middle, -0.5 * view.width, right);
        let single = |a: Vector| a.map(|part| part as f32);
        Rays {
            parallel: (!view.perspective).then_some(single(view.into)),
            first: single(along(left, -0.5 * view.height, down)),
            right: single(right),
            down: single(down),
        }
    }

    /// Through a place of the picture [pixels].
    pub fn at(&self, x: f32, y: f32) -> Ray {
        let (first, right, down) = (&self.first, &self.right, &self.down);
        let place = std::array::from_fn(|k| first[k] + x * right[k] + y * down[k]);
        match self.parallel {
            None => Ray {
                from: [0.0; 3],
                towards: place,
            },
            Some(towards) => Ray {
                from: place,
                towards,
            },
        }
    }
}
