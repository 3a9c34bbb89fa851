//! Shapes of a pair where they are, and the list that their contact points go to.

use crate::lane::{Cx, MaskOf, Num, Table};
use crate::math::vec3::{Mat3, Vec3};
use crate::push;

/// A shape where it is, relative to the centre of the pair's first shape.
#[derive(Clone, Copy)]
pub struct Placed<F> {
    /// Its axes, one a column [–].
    pub axes: Mat3<F>,
    /// Its centre [m].
    pub center: Vec3<F>,
}

/// The list of contact points of a pair's class.
///
/// A row: point between the surfaces, relative to the centre of the pair's first shape (3) [m]; distance of the surfaces,
/// negative in penetration [m]; unit normal from the first shape to the second (3) [–]; number of the pair.
pub struct Points<C: Cx> {
    /// Where they go.
    pub list: C::List,
    /// The rows.
    pub table: Table,
    /// The pair.
    pub pair: C::F,
}

impl<C: Cx> Points<C> {
    /// Numbers of a row.
    pub const STRIDE: usize = 8;

    /// Adds a point in the worlds of the mask.
    #[inline(always)]
    pub fn add(
        &mut self,
        cx: &mut C,
        mask: MaskOf<C>,
        point: Vec3<C::F>,
        distance: C::F,
        normal: Vec3<C::F>,
    ) {
        let (list, table, pair) = (&mut self.list, self.table, self.pair);
        push!(cx, *list, mask, row, {
            for i in 0..3 {
                cx.init(table, row, i, point[i]);
                cx.init(table, row, 4 + i, normal[i]);
            }
            cx.init(table, row, 3, distance);
            cx.init(table, row, 7, pair);
        });
    }
}
