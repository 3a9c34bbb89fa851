//! A height field against other shapes: the prisms below its triangles, one after another (MuJoCo: `mjc_ConvexHField`).
//!
//! ```text
//! 1. reject    the shape's bounding box against the highest elevation around its tile
//! 2. cells     those under the bounding box; each world has its own, and reads their elevations
//! 3. list      of two prisms per cell, those of which no face separates the shape
//! 4. touch     each a convex shape of its own (see [`super::prisms`])
//! 5. reduce    of many candidates, the deepest and those that are farthest from the ones kept
//! ```
//!
//! Each prism touches alone, as in MuJoCo: on level ground a sphere near the edge of a triangle touches the next one too, at an
//! angle. MuJoCo keeps one point per prism and 50 per pair; a shape that lies flat on a triangle has up to four here, and a pair
//! keeps eight ([`FIELD_CONTACTS`]).
//!
//! Places are found from the centre of the shape. Samples and reference points are subtracted from each other first, so `f32`
//! keeps its digits far from the world's origin.

use super::narrow::{Shape, ShapePair, ShapePose};
use super::points::{Points, Room};
use super::prism::Prism;
use super::prism_hull::OfHull;
use super::prisms::{FieldNarrow, OfBox, OfCapsule, OfCylinder, OfSphere};
use super::variables::{get3, set3, var3};
use super::{Stage, axes_of, contact_slack, points_of};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::{Contacts, Kind, pair, row};
use crate::constants::height_field::{FIELD_CANDIDATES, FIELD_CONTACTS, FieldTables, TILE, field};
use crate::lane::{Cx, Fixed, MaskOf, Num, Real, Table};
use crate::math::vec3::{Mat3, Vec3, load_vec3};
use crate::step::{BlockOf, ConstantsOf};
use crate::{break_if, each, push, span, times, when};

/// Places of a candidate's scalars after those of a contact.
const SCORE: usize = row::PAIR + 1;

/// A score above that of any distance between candidates, in which the depth of the first one counts.
const FIRST: f64 = 64.0;

/// Candidates nearer to those kept than this, relative to the shape's radius, are left out, squared.
const SPREAD: f64 = 1e-6;

/// Defines a stage for each kind of shape.
macro_rules! fields {
    ($($name:ident($of:ident) = $what:literal;)*) => {
        $(
            #[doc = concat!("Contacts of a height field and a ", $what, ".")]
            pub struct $name;

            impl Stage for $name {
                const READS: &'static [A] = &[A::ShapePoses, A::ContactPoints];
                const WRITES: &'static [A] = &[A::ContactPoints];

                fn is_needed<R: Real>(m: &Constants<R>) -> bool {
                    m.contacts.group((Kind::Field, $of::KIND)).is_some()
                }

                #[inline(always)]
                fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, _b: &mut BlockOf<C>) {
                    collide_fields::<C, $of>(cx, &m.contacts);
                }
            }
        )*
    };
}

fields! {
    FieldSphere(OfSphere) = "sphere";
    FieldCapsule(OfCapsule) = "capsule";
    FieldBox(OfBox) = "box";
    FieldCylinder(OfCylinder) = "cylinder";
    FieldHull(OfHull) = "convex hull";
}

/// Adds the contacts of all pairs with a kind of shape.
#[inline(always)]
fn collide_fields<C: Cx, N: FieldNarrow>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>) {
    let Some(group) = t.group((Kind::Field, N::KIND)) else {
        return;
    };
    // a recorded program has no room for another loop around those of GJK with hulls
    if N::KIND == Kind::Hull && !C::LOCKSTEP {
        for p in group.first..group.end {
            let p = cx.at(p);
            collide_field::<C, N>(cx, t, p);
        }
    } else {
        let (first, end) = (cx.at(group.first), cx.at(group.end));
        span!(cx, p in first, end, {
            collide_field::<C, N>(cx, t, p);
        });
    }
}

/// The largest integer that is not above x.
#[inline(always)]
fn floor<F: Num>(x: F) -> F {
    let near = x.round();
    near - F::select(x.lt(near), F::c(1.0), F::c(0.0))
}

/// Samples of a field, from the centre of a shape.
pub(in crate::step) struct Samples<F> {
    tables: FieldTables,
    /// The first sample from the world's origin, in the field's axes; of z, where elevations count from [m].
    base: Vec3<F>,
    cell: [F; 2],
    inverse: [F; 2],
    cells: [F; 2],
    first: F,
    bottom: F,
    extent: F,
    /// First tile, and tiles along x.
    tiles: [F; 2],
    across: [F; 2],
    /// The reference point of the shape in the field's axes, and its centre from there [m].
    origin: Vec3<F>,
    center: Vec3<F>,
}

/// The cells of a field that a shape may touch.
struct Cells<F> {
    /// The first column and row.
    first: [F; 2],
    /// How many columns and rows.
    counts: [F; 2],
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
            inverse: [n[field::INVERSE], n[field::INVERSE + 1]],
            cells: [n[field::CELLS], n[field::CELLS + 1]],
            first: n[field::FIRST],
            bottom: n[field::BOTTOM],
            extent: n[field::EXTENT],
            tiles: [n[field::TILES_FIRST], n[field::TILES]],
            across: [n[field::ACROSS], n[field::ACROSS + 1]],
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

    /// The shape's centre in cells.
    #[inline(always)]
    fn place(&self, axis: usize) -> F {
        (self.origin[axis] - self.base[axis]) + self.center[axis]
    }

    /// The cells under a box around the shape.
    #[inline(always)]
    fn cells_under(&self, half: Vec3<F>) -> Cells<F> {
        let c = F::c;
        let slack = self.extent * c(8.0 * F::Real::EPSILON);
        let mut cells = Cells {
            first: [c(0.0); 2],
            counts: [c(0.0); 2],
        };
        for axis in 0..2 {
            let (place, reach) = (self.place(axis), half[axis] + slack);
            let low = floor((place - reach) * self.inverse[axis]).max(c(0.0));
            let high = floor((place + reach) * self.inverse[axis]).min(self.cells[axis] - c(1.0));
            cells.first[axis] = low;
            cells.counts[axis] = (high - low + c(1.0)).max(c(0.0));
        }
        cells
    }

    /// The highest elevation around the shape's centre, as far as any shape reaches, from that centre.
    #[inline(always)]
    fn ceiling<C: Cx<F = F>>(&self, cx: &mut C) -> F {
        let c = F::c;
        let mut tile = [c(0.0); 2];
        for (axis, tile) in tile.iter_mut().enumerate() {
            let cell = floor(self.place(axis) * self.inverse[axis]);
            let cell = cell.max(c(0.0)).min(self.cells[axis] - c(1.0));
            *tile = floor((cell + c(0.5)) * c(1.0 / TILE as f64));
        }
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
            let last = self.cells[axis] - one;
            let near = floor((self.place(axis) + way[axis]) * self.inverse[axis]);
            cell[axis] = near.max(zero).min(last);
            share[axis] = (way[axis] - self.line(axis, cell[axis])) * self.inverse[axis];
        }
        let [u, v] = share;
        // rounding may put a place just beyond its cell
        let slack = c(64.0 * F::Real::EPSILON) * self.cells[0].max(self.cells[1]);
        let beyond = u.min(v).lt(-slack) | (one + slack).lt(u.max(v));
        let is_left = u.lt(v);
        let samples = self.cells[0] + one;
        let at = cell[1].fma(samples, cell[0] + self.first);
        let heights: Fixed = self.tables.heights;
        let p = cx.pick(heights, at, 0);
        let q = cx.pick(heights, at + samples + one, 0);
        let k = cx.pick(heights, at + F::select(is_left, samples, one), 0);
        let (to_k, to_q) = (F::select(is_left, v, u), F::select(is_left, u, v));
        let h = (k - p).fma(to_k, (q - k).fma(to_q, p));
        F::select(beyond, c(-1e18), self.height(h))
    }

    /// Prism `k` of the cells; `size` is a bound of the shape's radius.
    #[inline(always)]
    fn prism<C: Cx<F = F>>(&self, cx: &mut C, cells: &Cells<F>, k: F, size: F) -> Prism<F> {
        let c = F::c;
        let (half, one) = (c(0.5), c(1.0));
        let cell = floor(k * half);
        let is_left = (k - (cell + cell)).lt(half);
        let side = F::select(is_left, one, c(-1.0));
        let row = floor((cell + half).div(cells.counts[0]));
        let column = row.fnma(cells.counts[0], cell);
        let (column, row) = (cells.first[0] + column, cells.first[1] + row);
        let samples = self.cells[0] + one;
        let at = row.fma(samples, column + self.first);
        let heights: Fixed = self.tables.heights;
        let p = cx.pick(heights, at, 0);
        let q = cx.pick(heights, at + samples + one, 0);
        let k = cx.pick(heights, at + F::select(is_left, samples, one), 0);
        let (x, y) = (self.line(0, column), self.line(1, row));
        let (u, v) = (self.line(0, column + one), self.line(1, row + one));
        let top = [
            Vec3([x, y, self.height(p)]),
            Vec3([u, v, self.height(q)]),
            Vec3([
                F::select(is_left, x, u),
                F::select(is_left, v, y),
                self.height(k),
            ]),
        ];
        // the bottom no farther away than the way out through the top could be: sizes of the prism stay those of the shape
        let (low, high) = (
            top[0][2].min(top[1][2]).min(top[2][2]),
            top[0][2].max(top[1][2]).max(top[2][2]),
        );
        let floor = low.min(-high.abs()) - size * c(3.0);
        let bottom = self.height(self.bottom).max(floor);
        Prism::new(top, bottom, side, self.across)
    }
}

/// Adds the contacts of a pair.
#[inline(always)]
fn collide_field<C: Cx, N: FieldNarrow>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>, p: C::I) {
    let (scalars, indices) = (t.handles.pair_numbers, t.handles.pair_indices);
    let (poses, origins) = (t.memory.poses, t.memory.origins);
    let a = cx.index(indices, p, pair::SOLID_A, poses.rows);
    let b = cx.index(indices, p, pair::SOLID_B, poses.rows);
    let origin = cx.index(indices, p, pair::ORIGIN_B, origins.rows);
    let frame = axes_of(cx, poses, a);
    let origin = load_vec3(cx, origins, origin, 0);
    let center = load_vec3(cx, poses, b, 9);
    let at = cx.index(indices, p, pair::HULL_A, t.fields.sizes.rows);
    let samples = Samples::read(
        cx,
        t.fields,
        at,
        frame.transpose_mul(origin),
        frame.transpose_mul(center),
    );
    let own = axes_of(cx, poses, b);
    let axes = Mat3([
        frame.transpose_mul(own[0]),
        frame.transpose_mul(own[1]),
        frame.transpose_mul(own[2]),
    ]);
    let shape = Shape::read(cx, t, N::KIND, p, pair::SIZE_B, pair::HULL_B);
    let size = cx.constant(scalars, p, pair::SMALLER);
    let margin = cx.constant(scalars, p, pair::REACH) + contact_slack(size);
    let mut half = N::half_extents(shape.half_extents(), &axes);
    for x in half.iter_mut() {
        *x = *x + margin;
    }
    let cells = samples.cells_under(half);
    let ceiling = samples.ceiling(cx);
    let near = (-half[2]).lt(ceiling) & samples.height(samples.bottom).lt(half[2]);
    let count = (cells.counts[0] * cells.counts[1]) * C::F::c(2.0);
    when!(cx, near & C::F::c(0.5).lt(count), {
        let ground = ShapePose {
            axes: frame,
            center: Vec3::zero(),
        };
        let shapes = ShapePair {
            axes_a: &frame,
            a: shape,
            pose_b: &ground,
            b: Shape::none(a),
            margin,
            hull_tables: &t.hulls,
            clip_tables: t.memory.cut,
        };
        let mut out = points_of::<C>(cx, t, p, center, origin);
        let mut found = candidates(cx, t.memory.field_candidates, &out);
        let zero = cx.at(0);
        let most = cx.index(t.fields.prisms, p, 0, t.fields.prisms_max + 1);
        // worlds lie over different prisms: each lists its own first, so that the block visits as many as one world has
        let mut listed = cx.list(FIELD_CANDIDATES);
        let table = t.memory.field_prisms;
        span!(cx, k in zero, most, {
            let number = cx.number(k);
            break_if!(cx, !(number + C::F::c(0.5)).lt(count));
            let prism = samples.prism(cx, &cells, number, size);
            let [p, q, k] = prism.top;
            let reaches = (-half[2]).lt(p[2].max(q[2]).max(k[2]));
            let mut gap = C::F::c(-1e18);
            for (distance, m) in prism.beyond(Vec3::zero()).into_iter().zip(prism.normals()) {
                gap = gap.max(distance - N::reach(shapes.a.half_extents(), axes.transpose_mul(m)));
            }
            push!(cx, listed, reaches & gap.lt(margin), row, {
                cx.init(table, row, 0, number);
            });
        });
        each!(cx, at in listed, {
            let number = cx.load(table, at, 0);
            let prism = samples.prism(cx, &cells, number, size);
            N::contacts(cx, &shapes, &axes, &prism, &mut found);
        });
        let (none, full) = (C::F::c(0.0), C::F::c(FIELD_CANDIDATES as f64));
        let prisms = (cx.pushed(&listed) - full).max(none);
        let over = prisms + (cx.pushed(&found.list) - full).max(none);
        out.room.leave_out(cx, over);
        keep(cx, &found, size, &mut out);
    });
}

/// An empty list of candidates for contacts of a pair whose first shape is not the field.
#[inline(always)]
fn candidates<C: Cx>(cx: &mut C, table: Table, out: &Points<C>) -> Points<C> {
    Points {
        list: cx.list(FIELD_CANDIDATES),
        table,
        pair: out.pair,
        base: out.base,
        flip: -out.flip,
        mu: None,
        along: None,
        room: Room {
            is_tight: false,
            ..out.room
        },
    }
}

/// Adds the candidates, or those that span most of them where they are too many.
#[inline(always)]
fn keep<C: Cx>(cx: &mut C, found: &Points<C>, size: C::F, out: &mut Points<C>) {
    let c = C::F::c;
    // candidates have place and normal as rows have them
    out.base = Vec3::zero();
    out.flip = c(1.0);
    let few = cx.pushed(&found.list).lt(c(FIELD_CONTACTS as f64 + 0.5));
    let table = found.table;
    when!(cx, few, {
        each!(cx, at in found.list, {
            let contact = Candidate::read(cx, table, at);
            contact.add(cx, few, out);
        });
    });
    when!(cx, !few, {
        keep_some(cx, found, size, out);
    });
}

/// A candidate.
struct Candidate<F> {
    place: Vec3<F>,
    distance: F,
    normal: Vec3<F>,
}

impl<F: Num> Candidate<F> {
    #[inline(always)]
    fn read<C: Cx<F = F>>(cx: &mut C, table: Table, at: C::I) -> Candidate<F> {
        Candidate {
            place: load_vec3(cx, table, at, row::POINT),
            distance: cx.load(table, at, row::DISTANCE),
            normal: load_vec3(cx, table, at, row::NORMAL),
        }
    }

    #[inline(always)]
    fn add<C: Cx<F = F>>(self, cx: &mut C, mask: MaskOf<C>, out: &mut Points<C>) {
        out.add(cx, mask, self.place, self.distance, self.normal);
    }
}

/// Adds the deepest candidate, then again and again the one that is farthest from those added, in place and normal.
#[inline(always)]
fn keep_some<C: Cx>(cx: &mut C, found: &Points<C>, size: C::F, out: &mut Points<C>) {
    let (c, table) = (C::F::c, found.table);
    let scale = c(1.0).div(size * size);
    let inverse = c(1.0).div(size);
    each!(cx, at in found.list, {
        let depth = cx.load(table, at, row::DISTANCE) * inverse;
        cx.store(table, at, SCORE, c(FIRST) - depth);
    });
    times!(cx, FIELD_CONTACTS, {
        let mut best = cx.var(c(SPREAD));
        let mut place = var3(cx, Vec3::zero());
        let mut normal = var3(cx, Vec3::zero());
        let mut distance = cx.var(c(0.0));
        each!(cx, at in found.list, {
            let score = cx.load(table, at, SCORE);
            let old = cx.get(&best);
            when!(cx, old.lt(score), {
                let contact = Candidate::read(cx, table, at);
                cx.set(&mut best, score);
                set3(cx, &mut place, contact.place);
                set3(cx, &mut normal, contact.normal);
                cx.set(&mut distance, contact.distance);
            });
        });
        let is = c(SPREAD).lt(cx.get(&best));
        let kept = Candidate {
            place: get3(cx, &place),
            distance: cx.get(&distance),
            normal: get3(cx, &normal),
        };
        each!(cx, at in found.list, {
            let other = Candidate::read(cx, table, at);
            let (way, turn) = (other.place - kept.place, other.normal - kept.normal);
            let apart = way.dot(way).fma(scale, turn.dot(turn));
            let score = cx.load(table, at, SCORE);
            cx.store(table, at, SCORE, score.min(apart));
        });
        kept.add(cx, is, out);
        break_if!(cx, !is);
    });
}
