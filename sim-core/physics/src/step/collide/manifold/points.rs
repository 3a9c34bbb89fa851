//! The list that contact points go to, and the room that a world has for them.

use crate::constants::contact::{row, soft};
use crate::lane::{Cx, MaskOf, Num, Table};
use crate::math::vec3::Vec3;
use crate::{push, when};

/// The list of contact points of a pair's class.
pub struct Points<C: Cx> {
    /// Where they go.
    pub list: C::List,
    /// The rows; see [`crate::constants::contact::row`].
    pub table: Table,
    /// Index of the pair.
    pub pair: C::F,
    /// Centre of the pair's first shape, from the reference point of the rows [m].
    pub base: Vec3<C::F>,
    /// -1 where rows have the normal from the second shape to the first, else 1.
    pub flip: C::F,
    /// Coefficient of friction, where it varies [–].
    pub mu: Option<C::F>,
    /// Torsional and rolling friction over that of sliding [m], and inverse weight [1/kg], where one of them varies.
    pub varying: Option<[C::F; 3]>,
    /// Softness, where it varies; see [`soft`].
    pub softness: Option<[C::F; soft::COLUMNS]>,
    /// How the second surface of rows moves relative to the first, beside the shapes: velocity at their reference point [m/s], and
    /// angular velocity [rad/s]. None where no surface does.
    pub surface_motion: Option<[Vec3<C::F>; 2]>,
    /// Direction of the first tangent where it is not 0 [–]; none where tangents may have any direction.
    pub along: Option<Vec3<C::F>>,
    /// What a world has room for.
    pub room: Room<C::F>,
}

/// Contacts and constraint rows of a world, and its limits for both.
#[derive(Clone, Copy)]
pub struct Room<F> {
    /// The table of counts.
    pub counts: Table,
    /// Its row of contacts.
    pub contacts: usize,
    /// Its row of constraint rows.
    pub rows: usize,
    /// Its row of contacts that did not fit.
    pub left_out: usize,
    /// Most contacts.
    pub contacts_max: F,
    /// Most constraint rows.
    pub rows_max: F,
    /// Constraint rows per contact.
    pub of_a_contact: F,
    /// Can it become full?
    pub is_tight: bool,
}

impl<C: Cx> Points<C> {
    /// Adds a point in the worlds of the mask.
    ///
    /// The point is half-way between the surfaces, relative to the centre of the pair's first shape [m]. The distance of the
    /// surfaces is negative in penetration [m]. The normal points from the first shape to the second.
    #[inline(always)]
    pub fn add(
        &mut self,
        cx: &mut C,
        mask: MaskOf<C>,
        point: Vec3<C::F>,
        distance: C::F,
        normal: Vec3<C::F>,
    ) {
        // room is counted only where a world can become full; else every point has room
        let mask = if self.room.is_tight {
            self.room.reserve(cx, mask)
        } else {
            mask
        };
        let (list, table, pair) = (&mut self.list, self.table, self.pair);
        let (along, mu, varying, softness) = (self.along, self.mu, self.varying, self.softness);
        let surface_motion = self.surface_motion;
        // from the reference point of the rows, with the direction of normals that the rows have
        let (point, normal) = (self.base + point, normal * self.flip);
        push!(cx, *list, mask, fresh, {
            let (Vec3([x, y, z]), Vec3([u, v, w])) = (point, normal);
            // in the order of `row`
            cx.init_all(table, fresh, &[x, y, z, distance, u, v, w, pair]);
            // optional scalars of the row: friction where it varies, the first tangent where its direction matters
            if let Some(mu) = mu {
                cx.init(table, fresh, row::MU, mu);
            }
            if let Some(varying) = varying {
                for (i, x) in varying.iter().enumerate() {
                    cx.init(table, fresh, row::VARYING + i, *x);
                }
            }
            if let Some(softness) = softness {
                for (i, x) in softness.iter().enumerate() {
                    cx.init(table, fresh, row::SOFTNESS + i, *x);
                }
            }
            if let Some([linear, spin]) = surface_motion {
                // v + ω × p at the point, and ω · n
                let Vec3([x, y, z]) = spin.cross_add(point, linear);
                for (i, x) in [x, y, z, spin.dot(normal)].into_iter().enumerate() {
                    cx.init(table, fresh, row::SURFACE_VELOCITY + i, x);
                }
            }
            if let Some(along) = along {
                for (i, x) in along.iter().enumerate() {
                    cx.init(table, fresh, row::TANGENTS + i, *x);
                }
            }
        });
    }
}

impl<F: Num> Room<F> {
    /// Counts what a pair left out before it became a contact, such as prisms of a height field.
    #[inline(always)]
    pub(in crate::step::collide) fn leave_out<C: Cx<F = F>>(&self, cx: &mut C, count: F) {
        let left_out = cx.at(self.left_out);
        // counts are whole: above a half means at least one
        when!(cx, F::c(0.5).lt(count), {
            let more = cx.load(self.counts, left_out, 0) + count;
            cx.store(self.counts, left_out, 0, more);
        });
    }

    /// Reserves room for a contact, and returns the worlds that have it.
    #[inline(always)]
    fn reserve<C: Cx<F = F>>(&self, cx: &mut C, mask: MaskOf<C>) -> MaskOf<C> {
        let one = F::c(1.0);
        let (contacts, rows, left_out) =
            (cx.at(self.contacts), cx.at(self.rows), cx.at(self.left_out));
        // contacts before this one, and constraint rows with those of this one
        let used = cx.load(self.counts, contacts, 0);
        let used_rows = cx.load(self.counts, rows, 0) + self.of_a_contact;
        // counts are whole: half of one keeps the comparison clear of rounding
        let fits =
            (used + F::c(0.5)).lt(self.contacts_max) & used_rows.lt(self.rows_max + F::c(0.5));
        // a contact takes its place and its constraint rows together, so that none is without rows
        when!(cx, mask & fits, {
            cx.store(self.counts, contacts, 0, used + one);
            cx.store(self.counts, rows, 0, used_rows);
        });
        // a point without room is counted, not stored: the world then gets a bit in `status`
        when!(cx, mask & !fits, {
            let more = cx.load(self.counts, left_out, 0) + one;
            cx.store(self.counts, left_out, 0, more);
        });
        mask & fits
    }
}
