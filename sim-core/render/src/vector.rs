//! Vectors and frames in `f32`.

/// The same expression of each place. A closure in `map` would not have the instructions of its caller.
macro_rules! each {
    ($k:ident in $($place:literal)* => $value:expr) => {
        [$({
            let $k: usize = $place;
            $value
        }),*]
    };
}
/// Of the places 0, 1 and 2.
macro_rules! three {
    ($k:ident => $value:expr) => {
        $crate::vector::each!($k in 0 1 2 => $value)
    };
}
/// Of the places 0 and 1.
macro_rules! two {
    ($k:ident => $value:expr) => {
        $crate::vector::each!($k in 0 1 => $value)
    };
}
pub(crate) use {each, three, two};

/// Three coordinates.
pub(crate) type Vector = [f32; 3];

#[inline(always)]
pub(crate) fn dot(a: Vector, b: Vector) -> f32 {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

#[inline(always)]
pub(crate) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn column(rows: &[Vector; 3], k: usize) -> Vector {
    [rows[0][k], rows[1][k], rows[2][k]]
}

/// A frame in its parent's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Origin [m].
    pub pos: [f32; 3],
    /// Axes as columns of a matrix, row by row [–].
    pub rot: [[f32; 3]; 3],
}

impl Frame {
    /// The parent's frame itself.
    pub const IDENTITY: Frame = Frame {
        pos: [0.0; 3],
        rot: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    };

    /// A frame at `pos` [m] with the orientation of a unit quaternion (x, y, z, w) [–].
    #[inline]
    pub fn new(pos: [f32; 3], [x, y, z, w]: [f32; 4]) -> Frame {
        let twice = |a: f32, b: f32| 2.0 * a * b;
        Frame {
            pos,
            rot: [
                [
                    1.0 - twice(y, y) - twice(z, z),
                    twice(x, y) - twice(z, w),
                    twice(x, z) + twice(y, w),
                ],
                [
                    twice(x, y) + twice(z, w),
                    1.0 - twice(x, x) - twice(z, z),
                    twice(y, z) - twice(x, w),
                ],
                [
                    twice(x, z) - twice(y, w),
                    twice(y, z) + twice(x, w),
                    1.0 - twice(x, x) - twice(y, y),
                ],
            ],
        }
    }

    /// A direction of this frame, in its parent's.
    #[inline(always)]
    pub(crate) fn turn(&self, v: Vector) -> Vector {
        three!(k => dot(self.rot[k], v))
    }

    /// A direction of its parent's frame, in this one.
    #[inline(always)]
    pub(crate) fn turn_back(&self, v: Vector) -> Vector {
        three!(k => {
            self.rot[2][k].mul_add(v[2], self.rot[1][k].mul_add(v[1], self.rot[0][k] * v[0]))
        })
    }

    /// A child of this frame, in its parent's.
    #[inline(always)]
    pub fn then(&self, child: &Frame) -> Frame {
        let columns = three!(k => self.turn(column(&child.rot, k)));
        Frame {
            pos: add(self.pos, self.turn(child.pos)),
            rot: three!(k => column(&columns, k)),
        }
    }

    /// A frame that has the same parent, in this frame.
    #[inline(always)]
    pub(crate) fn relative(&self, other: &Frame) -> Frame {
        let columns = three!(k => self.turn_back(column(&other.rot, k)));
        Frame {
            pos: self.turn_back(sub(other.pos, self.pos)),
            rot: three!(k => column(&columns, k)),
        }
    }
}
