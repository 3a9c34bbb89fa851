//! The samples of a height field, seen from a shape: the ground at a place, the cells under the shape, and their prisms.
//!
//! Places are found from the centre of the shape. Samples and reference points are subtracted from each other first, so `f32`
//! keeps its digits far from the world's origin.

use crate::constants::height_field::{FieldTables, TILE, field};
use crate::lane::{Cx, Fixed, Num, Real};
use crate::math::vec3::Vec3;
use crate::step::collide::convex::prism::{Half, Lattice, Prism};

/// The largest integer that is not above x.
#[inline(always)]
fn floor<F: Num>(x: F) -> F {
    // backends round to the nearest, which may be above
    let near = x.round();
    near - F::select(x.lt(near), F::c(1.0), F::c(0.0))
}

/// Samples of a field, from the centre of a shape.
pub(in crate::step) struct Samples<F> {
    tables: FieldTables,
    /// The first sample from the world's origin, in the field's axes; of z, where elevations count from [m].
    base: Vec3<F>,
    cell: [F; 2],
    cells: [F; 2],
    first: F,
    /// Height of the field's bottom, as elevations are [m].
    bottom: F,
    extent: F,
    /// First tile, and tiles along x.
    tiles: [F; 2],
    lattice: Lattice<F>,
    /// The reference point of the shape in the field's axes, and its centre from there [m].
    origin: Vec3<F>,
    center: Vec3<F>,
}

/// The cells of a field that a shape may touch.
pub(in crate::step::collide) struct Cells<F> {
    /// The first column and row.
    first: [F; 2],
    /// How many columns and rows.
    counts: [F; 2],
    /// 1 over the number of columns.
    inverse: F,
}

/// A cell.
struct Cell<F> {
    column: F,
    row: F,
    /// Its lowest corner along x and y among the samples.
    at: F,
}

impl<F: Num> Cells<F> {
    /// Their number.
    #[inline(always)]
    pub fn count(&self) -> F {
        self.counts[0] * self.counts[1]
    }
}

impl<F: Num> Samples<F> {
    /// Reads a field. The reference point of the shape, and its centre from there, are in the field's axes.
    #[inline(always)]
    pub(in crate::step) fn read<C: Cx<F = F>>(
        cx: &mut C,
        tables: FieldTables,
        at: C::I,
        origin: Vec3<F>,
        center: Vec3<F>,
    ) -> Samples<F> {
        let n: [F; field::LEN] = cx.constants(tables.sizes, at, 0);
        Samples {
            tables,
            base: Vec3([n[field::BASE], n[field::BASE + 1], n[field::BASE + 2]]),
            cell: [n[field::CELL], n[field::CELL + 1]],
            cells: [n[field::CELLS], n[field::CELLS + 1]],
            first: n[field::FIRST],
            bottom: n[field::BOTTOM],
            extent: n[field::EXTENT],
            tiles: [n[field::TILES_FIRST], n[field::TILES]],
            lattice: Lattice {
                inverse: [n[field::INVERSE], n[field::INVERSE + 1]],
                across: [n[field::ACROSS], n[field::ACROSS + 1]],
                diagonal: n[field::DIAGONAL],
            },
            origin,
            center,
        }
    }

    /// A coordinate of sample line `i`, from the shape's centre.
    #[inline(always)]
    fn line(&self, axis: usize, i: F) -> F {
        (i.fma(self.cell[axis], self.base[axis]) - self.origin[axis]) - self.center[axis]
    }

    /// A height of elevation `h`, from the shape's centre.
    #[inline(always)]
    fn height(&self, h: F) -> F {
        ((h + self.base[2]) - self.origin[2]) - self.center[2]
    }

    /// The field's bottom, from the shape's centre.
    #[inline(always)]
    pub(in crate::step::collide) fn lowest(&self) -> F {
        self.height(self.bottom)
    }

    /// Unit normal of the diagonals of cells.
    #[inline(always)]
    pub(in crate::step::collide) fn across(&self) -> Vec3<F> {
        let [x, y] = self.lattice.across;
        Vec3([x, y, F::c(0.0)])
    }

    /// The shape's centre in the field's axes, from the first sample.
    #[inline(always)]
    fn place(&self, axis: usize) -> F {
        (self.origin[axis] - self.base[axis]) + self.center[axis]
    }

    /// The cells under a box around the shape.
    #[inline(always)]
    pub(in crate::step::collide) fn cells_under(&self, half: Vec3<F>) -> Cells<F> {
        let c = F::c;
        // rounding of coordinates must not lose a cell
        let slack = self.extent * c(8.0 * F::Real::EPSILON);
        let (mut first, mut counts) = ([c(0.0); 2], [c(0.0); 2]);
        for axis in 0..2 {
            let (place, reach) = (self.place(axis), half[axis] + slack);
            let inverse = self.lattice.inverse[axis];
            // first and last cell under the box, in the field; the count is 0 where the box is beside it
            let low = floor((place - reach) * inverse).max(c(0.0));
            let high = floor((place + reach) * inverse).min(self.cells[axis] - c(1.0));
            first[axis] = low;
            counts[axis] = (high - low + c(1.0)).max(c(0.0));
        }
        Cells {
            first,
            counts,
            inverse: c(1.0).div(counts[0].max(c(1.0))),
        }
    }

    /// The highest elevation around the shape's centre, as far as any shape reaches, from that centre.
    #[inline(always)]
    pub(in crate::step::collide) fn ceiling<C: Cx<F = F>>(&self, cx: &mut C) -> F {
        let c = F::c;
        let mut tile = [c(0.0); 2];
        for (axis, tile) in tile.iter_mut().enumerate() {
            // the cell under the centre, in the field; half a cell keeps its tile clear of rounding
            let cell = floor(self.place(axis) * self.lattice.inverse[axis]);
            let cell = cell.max(c(0.0)).min(self.cells[axis] - c(1.0));
            *tile = floor((cell + c(0.5)) * c(1.0 / TILE as f64));
        }
        // tiles are in rows along x
        let at = self.tiles[0] + tile[1].fma(self.tiles[1], tile[0]);
        let h = cx.pick(self.tables.ceilings, at, 0);
        self.height(h)
    }

    /// The ground at a place, both from the shape's centre in the field's axes; far below beyond the field.
    #[inline(always)]
    pub(in crate::step) fn height_at<C: Cx<F = F>>(&self, cx: &mut C, way: Vec3<F>) -> F {
        let c = F::c;
        let (zero, one) = (c(0.0), c(1.0));
        let mut cell = [zero; 2];
        let mut share = [zero; 2];
        for axis in 0..2 {
            // the cell of the place, in the field, and where it is in that cell, from 0 to 1
            let last = self.cells[axis] - one;
            let inverse = self.lattice.inverse[axis];
            let near = floor((self.place(axis) + way[axis]) * inverse);
            cell[axis] = near.max(zero).min(last);
            share[axis] = (way[axis] - self.line(axis, cell[axis])) * inverse;
        }
        let [u, v] = share;
        // rounding may put a place just beyond its cell
        let slack = c(64.0 * F::Real::EPSILON) * self.cells[0].max(self.cells[1]);
        let beyond = u.min(v).lt(-slack) | (one + slack).lt(u.max(v));
        // elevations at P, Q and K; left of the diagonal K is the upper left corner
        let is_left = u.lt(v);
        let samples = self.cells[0] + one;
        let at = cell[1].fma(samples, cell[0] + self.first);
        let heights: Fixed = self.tables.heights;
        let p = cx.pick(heights, at, 0);
        let q = cx.pick(heights, at + samples + one, 0);
        let k = cx.pick(heights, at + F::select(is_left, samples, one), 0);
        // linear over the triangle: p + (k - p) to_k + (q - k) to_q
        let (to_k, to_q) = (F::select(is_left, v, u), F::select(is_left, u, v));
        let h = (k - p).fma(to_k, (q - k).fma(to_q, p));
        F::select(beyond, c(-1e18), self.height(h))
    }

    /// Cell `k` of the cells.
    #[inline(always)]
    fn cell(&self, cells: &Cells<F>, k: F) -> Cell<F> {
        // half a cell keeps the product clear of rounding
        let row = floor((k + F::c(0.5)) * cells.inverse);
        let column = row.fnma(cells.counts[0], k);
        let (column, row) = (cells.first[0] + column, cells.first[1] + row);
        Cell {
            column,
            row,
            at: row.fma(self.cells[0] + F::c(1.0), column + self.first),
        }
    }

    /// The highest corner of cell `k` of the cells, from the shape's centre.
    #[inline(always)]
    pub(in crate::step::collide) fn top_of_cell<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        cells: &Cells<F>,
        k: F,
    ) -> F {
        let at = self.cell(cells, k).at;
        let h = cx.pick(self.tables.tops, at, 0);
        self.height(h)
    }

    /// The upper left prism of cell `k` of the cells, and the lower right one; `size` is a bound of the shape's radius.
    #[inline(always)]
    pub(in crate::step::collide) fn prisms_of_cell<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        cells: &Cells<F>,
        k: F,
        size: F,
    ) -> [Prism<F>; 2] {
        // both prisms share P and Q, the ends of the diagonal
        let (cell, one) = (self.cell(cells, k), F::c(1.0));
        let (heights, samples): (Fixed, F) = (self.tables.heights, self.cells[0] + one);
        let p = cx.pick(heights, cell.at, 0);
        let q = cx.pick(heights, cell.at + samples + one, 0);
        let left = cx.pick(heights, cell.at + samples, 0);
        let right = cx.pick(heights, cell.at + one, 0);
        [
            self.prism_at(&cell, [p, q, left], Half::UpperLeft, size),
            self.prism_at(&cell, [p, q, right], Half::LowerRight, size),
        ]
    }

    /// Prism `k` of the cells: each has two. `size` is a bound of the shape's radius.
    #[inline(always)]
    pub(in crate::step::collide) fn prism<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        cells: &Cells<F>,
        k: F,
        size: F,
    ) -> Prism<F> {
        let (half, one) = (F::c(0.5), F::c(1.0));
        // even prisms are the upper left ones
        let place = floor(k * half);
        let is_left = (k - (place + place)).lt(half);
        let cell = self.cell(cells, place);
        let (heights, samples): (Fixed, F) = (self.tables.heights, self.cells[0] + one);
        let p = cx.pick(heights, cell.at, 0);
        let q = cx.pick(heights, cell.at + samples + one, 0);
        let k = cx.pick(heights, cell.at + F::select(is_left, samples, one), 0);
        self.prism_at(&cell, [p, q, k], Half::Of(is_left), size)
    }

    /// A prism of a cell, with the elevations of P, Q and K.
    #[inline(always)]
    fn prism_at(
        &self,
        cell: &Cell<F>,
        [p, q, k]: [F; 3],
        half: Half<F::Mask>,
        size: F,
    ) -> Prism<F> {
        let (c, one) = (F::c, F::c(1.0));
        // P is the lowest corner along x and y, Q the highest, K one of the other two
        let (x, y) = (self.line(0, cell.column), self.line(1, cell.row));
        let (u, v) = (
            self.line(0, cell.column + one),
            self.line(1, cell.row + one),
        );
        let (p, q, k) = (self.height(p), self.height(q), self.height(k));
        let top = [
            Vec3([x, y, p]),
            Vec3([u, v, q]),
            Vec3([half.pick(x, u), half.pick(v, y), k]),
        ];
        // the bottom no farther away than the way out through the top could be: sizes of the prism stay those of the shape
        let (low, high) = (p.min(q).min(k), p.max(q).max(k));
        let floor = low.min(-high.abs()) - size * c(3.0);
        let bottom = self.lowest().max(floor);
        Prism::new(top, bottom, half, &self.lattice)
    }
}
