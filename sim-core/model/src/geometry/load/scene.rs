//! Places of the parts of a COLLADA or glTF scene: matrices of nested nodes.

use super::super::vector::Vector;
use super::super::vector::{cross, dot};

/// An affine map: three rows of four numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine(pub [[f64; 4]; 3]);

impl Affine {
    pub const IDENTITY: Affine = Affine([
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]);

    /// A turn from y up to z up, which leaves x: (x, y, z) → (x, −z, y).
    pub const Y_UP: Affine = Affine([
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
    ]);

    /// A turn from x up to z up, COLLADA's: its right is −y and its inward z, so (x, y, z) → (−y, −z, x)
    /// with x right, −y inward and z up.
    pub const X_UP: Affine = Affine([
        [0.0, -1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0],
        [1.0, 0.0, 0.0, 0.0],
    ]);

    pub fn translation(t: Vector) -> Affine {
        let mut map = Affine::IDENTITY;
        for axis in 0..3 {
            map.0[axis][3] = t[axis];
        }
        map
    }

    pub fn scaling(s: Vector) -> Affine {
        let mut map = Affine::IDENTITY;
        for axis in 0..3 {
            map.0[axis][axis] = s[axis];
        }
        map
    }

    /// From the rows of a rotation matrix.
    pub fn rotation(rows: [Vector; 3]) -> Affine {
        Affine(rows.map(|[a, b, c]| [a, b, c, 0.0]))
    }

    /// This map after `inner`.
    pub fn after(self, inner: Affine) -> Affine {
        let mut product = [[0.0; 4]; 3];
        for (row, left) in product.iter_mut().zip(&self.0) {
            for (column, entry) in row.iter_mut().enumerate() {
                *entry = (0..3).map(|k| left[k] * inner.0[k][column]).sum();
            }
            row[3] += left[3];
        }
        Affine(product)
    }

    pub fn apply(&self, p: Vector) -> Vector {
        self.0
            .map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3])
    }

    /// Whether it turns the inside out.
    pub fn mirrors(&self) -> bool {
        let [a, b, c] = self.0.map(|row| [row[0], row[1], row[2]]);
        dot(a, cross(b, c)) < 0.0
    }
}
