//! A height field against other shapes: the prisms below its triangles, one after another (MuJoCo: `mjc_ConvexHField`).
//!
//! ```text
//! 1. reject    the shape's bounding box against the highest elevation around its tile
//! 2. cells     those under the bounding box with a corner above its bottom; each world has its own, and reads their elevations
//! 3. list      of two prisms per cell, those that a few axes do not separate from the shape
//! 4. touch     each a convex shape of its own (see [`crate::step::collide::convex::prisms`])
//! 5. reduce    of many candidates, the deepest and those that are farthest from the ones kept
//! ```
//!
//! Each prism touches alone, as in MuJoCo: on level ground a sphere near the edge of a triangle touches the next one too, at an
//! angle. MuJoCo keeps one point per prism and 50 per pair; a shape that lies flat on a triangle has up to four here, and a pair
//! keeps eight ([`FIELD_CONTACTS`]).

use super::field_samples::{Cells, Samples};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::{Contacts, Kind, pair, row};
use crate::constants::height_field::{FIELD_CANDIDATES, FIELD_CONTACTS};
use crate::lane::{Cx, MaskOf, Num, Real, Table};
use crate::math::vec3::{Mat3, Vec3, load_vec3};
use crate::step::collide::convex::prism::Prism;
use crate::step::collide::convex::prism_axes::FieldReach;
use crate::step::collide::convex::prism_ellipsoid::OfEllipsoid;
use crate::step::collide::convex::prism_hull::OfHull;
use crate::step::collide::convex::prisms::{FieldNarrow, OfBox, OfCapsule, OfCylinder, OfSphere};
use crate::step::collide::manifold::points::{Points, Room};
use crate::step::collide::narrow::{Shape, ShapePair, ShapePose};
use crate::step::collide::reference::reference_prism;
use crate::step::collide::variables::{get3, set3, var3};
use crate::step::collide::{Stage, axes_of, contact_slack, points_of};
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
    FieldEllipsoid(OfEllipsoid) = "ellipsoid";
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

/// A shape over a field, for the test of a prism.
struct Body<'a, F> {
    size: Vec3<F>,
    axes: &'a Mat3<F>,
    reach: FieldReach<F>,
    /// Its lowest height, less the margin.
    lowest: F,
    margin: F,
}

impl<F: Num> Body<'_, F> {
    /// Whether a few axes leave it near a prism.
    #[inline(always)]
    fn is_near<N: FieldNarrow>(&self, prism: &Prism<F>) -> F::Mask {
        let [p, q, k] = prism.top;
        // a prism whose corners all lie below the shape cannot touch it
        let reaches = self.lowest.lt(p[2].max(q[2]).max(k[2]));
        let gap = N::gap(self.size, self.axes, prism, &self.reach);
        reaches & gap.lt(self.margin)
    }
}

/// Adds the contacts of a pair.
#[inline(always)]
fn collide_field<C: Cx, N: FieldNarrow>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>, p: C::I) {
    let (scalars, indices) = (t.handles.pair_numbers, t.handles.pair_indices);
    let (poses, origins) = (t.memory.poses, t.memory.origins);
    // the field is the first shape of the pair, and static
    let a = cx.index(indices, p, pair::SOLID_A, poses.rows);
    let b = cx.index(indices, p, pair::SOLID_B, poses.rows);
    let origin = cx.index(indices, p, pair::ORIGIN_B, origins.rows);
    let frame = axes_of(cx, poses, a);
    // reference point and centre of the shape in the axes of the field
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
    // axes of the shape in those of the field
    let shape_axes = axes_of(cx, poses, b);
    let axes = Mat3([
        frame.transpose_mul(shape_axes[0]),
        frame.transpose_mul(shape_axes[1]),
        frame.transpose_mul(shape_axes[2]),
    ]);
    let shape = Shape::read(cx, t, N::KIND, p, pair::SIZE_B, pair::HULL_B);
    let size = cx.constant(scalars, p, pair::SMALLER);
    let distance = cx.constant(scalars, p, pair::REACH);
    let margin = distance + contact_slack(t, size);
    // reaches along the normals of sides, which all prisms share: computed once for the pair
    let reach = FieldReach {
        half: N::half_extents(shape.half_extents(), &axes),
        across: N::reach(shape.half_extents(), axes.transpose_mul(samples.across())),
    };
    // bounding box with the margin; cells under it, and the tests of step 1
    let mut half = reach.half;
    for x in half.iter_mut() {
        *x = *x + margin;
    }
    let cells = samples.cells_under(half);
    let ceiling = samples.ceiling(cx);
    let near = (-half[2]).lt(ceiling) & samples.lowest().lt(half[2]);
    let count = cells.count();
    when!(cx, near & C::F::c(0.5).lt(count), {
        // prisms are in the axes of the field from the centre of the shape, which is the first one here
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
            reach: distance,
            reference: &t.reference,
            hull_tables: &t.hulls,
            clip_tables: t.memory.cut,
            two_point_capsule_boxes: false,
            ordered_corners: false,
        };
        // steps 2 and 3: the list of prisms
        let mut out = points_of::<C>(cx, t, p, center, origin);
        let mut candidate_points = candidates(cx, t.memory.field_candidates, &out);
        let body = Body {
            size: shapes.a.half_extents(),
            axes: &axes,
            reach,
            lowest: -half[2],
            margin,
        };
        let listed = near_prisms::<C, N>(cx, t, p, (&samples, &cells, size), &body);
        // step 4: each prism of the list adds candidates
        let table = t.memory.field_prisms;
        each!(cx, at in listed, {
            let number = cx.load(table, at, 0);
            let prism = samples.prism(cx, &cells, number, size);
            let placed = (&axes, &prism, samples.lowest());
            touch::<C, N>(cx, &shapes, placed, &mut candidate_points);
        });
        // prisms and candidates beyond their lists count as contacts left out
        let over = beyond::<C>(cx, &listed) + beyond::<C>(cx, &candidate_points.list);
        out.room.leave_out(cx, over);
        // step 5: all candidates, or those that span most
        keep(cx, &candidate_points, size, &mut out);
    });
}

/// How many rows a list has no room for.
#[inline(always)]
fn beyond<C: Cx>(cx: &mut C, list: &C::List) -> C::F {
    (cx.pushed(list) - C::F::c(FIELD_CANDIDATES as f64)).max(C::F::c(0.0))
}

/// Adds the contacts of a shape with these axes and a prism, in a field with this bottom.
#[inline(always)]
fn touch<C: Cx, N: FieldNarrow>(
    cx: &mut C,
    shapes: &ShapePair<'_, C>,
    (axes, prism, bottom): (&Mat3<C::F>, &Prism<C::F>, C::F),
    out: &mut Points<C>,
) {
    // in double precision, models from MuJoCo have its points
    let is_reference = <<C::F as Num>::Real as Real>::DOUBLE && shapes.reference.is_used;
    if is_reference && reference_prism(cx, N::KIND, shapes, (axes, prism, bottom), out) {
        return;
    }
    N::contacts(cx, shapes, axes, prism, out);
}

/// Lists the prisms that a shape may touch. `ground` has the samples, the cells under the shape, and a bound of its radius.
///
/// Worlds lie over different cells and prisms: each lists its own first, so that the block visits as many as one world has.
#[inline(always)]
fn near_prisms<C: Cx, N: FieldNarrow>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    (samples, cells, size): (&Samples<C::F>, &Cells<C::F>, C::F),
    body: &Body<C::F>,
) -> C::List {
    // step 2: cells with a corner above the lowest point of the shape, as many as this world has
    let zero = cx.at(0);
    let most = cx.index(t.fields.cells, p, 0, t.fields.cells_max + 1);
    let count = cells.count();
    let (high_cells, table) = (t.memory.field_cells, t.memory.field_prisms);
    let mut high = cx.list(high_cells.rows);
    span!(cx, k in zero, most, {
        let number = cx.number(k);
        break_if!(cx, !(number + C::F::c(0.5)).lt(count));
        let top = samples.top_of_cell(cx, cells, number);
        push!(cx, high, body.lowest.lt(top), row, {
            cx.init(high_cells, row, 0, number);
        });
    });
    // step 3: prisms of these cells that a few axes do not separate from the shape
    let mut listed = cx.list(FIELD_CANDIDATES);
    each!(cx, at in high, {
        let cell = cx.load(high_cells, at, 0);
        let first = cell + cell;
        let [left, right] = samples.prisms_of_cell(cx, cells, cell, size);
        // a loop over the two is not unrolled
        let is_near = body.is_near::<N>(&left);
        push!(cx, listed, is_near, row, {
            cx.init(table, row, 0, first);
        });
        let is_near = body.is_near::<N>(&right);
        push!(cx, listed, is_near, row, {
            cx.init(table, row, 0, first + C::F::c(1.0));
        });
    });
    listed
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
        // candidates take no room, and friction and tangents come with the contacts that are kept
        mu: None,
        varying: None,
        softness: None,
        surface_motion: None,
        along: None,
        room: Room {
            is_tight: false,
            ..out.room
        },
    }
}

/// Adds the candidates, or those that span most of them where they are too many.
#[inline(always)]
fn keep<C: Cx>(cx: &mut C, candidates: &Points<C>, size: C::F, out: &mut Points<C>) {
    let c = C::F::c;
    // candidates have place and normal as rows have them
    out.base = Vec3::zero();
    out.flip = c(1.0);
    let few = cx
        .pushed(&candidates.list)
        .lt(c(FIELD_CONTACTS as f64 + 0.5));
    let table = candidates.table;
    when!(cx, few, {
        // few: all, in the order in which they were found
        each!(cx, at in candidates.list, {
            let contact = Candidate::read(cx, table, at);
            contact.add(cx, few, out);
        });
    });
    when!(cx, !few, {
        keep_some(cx, candidates, size, out);
    });
}

/// A candidate.
#[derive(Clone, Copy)]
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

/// The best candidate so far.
struct Best<C: Cx> {
    score: C::V,
    place: [C::V; 3],
    distance: C::V,
    normal: [C::V; 3],
}

impl<C: Cx> Best<C> {
    /// None: candidates count if they are better.
    #[inline(always)]
    fn none(cx: &mut C) -> Best<C> {
        Best {
            score: cx.var(C::F::c(SPREAD)),
            place: var3(cx, Vec3::zero()),
            distance: cx.var(C::F::c(0.0)),
            normal: var3(cx, Vec3::zero()),
        }
    }

    #[inline(always)]
    fn offer(&mut self, cx: &mut C, contact: &Candidate<C::F>, score: C::F) {
        when!(cx, cx.get(&self.score).lt(score), {
            cx.set(&mut self.score, score);
            set3(cx, &mut self.place, contact.place);
            cx.set(&mut self.distance, contact.distance);
            set3(cx, &mut self.normal, contact.normal);
        });
    }

    /// The best one, and whether there is one.
    #[inline(always)]
    fn read(&self, cx: &mut C) -> (Candidate<C::F>, MaskOf<C>) {
        let candidate = Candidate {
            place: get3(cx, &self.place),
            distance: cx.get(&self.distance),
            normal: get3(cx, &self.normal),
        };
        (candidate, C::F::c(SPREAD).lt(cx.get(&self.score)))
    }
}

/// Adds the deepest candidate, then again and again the one that is farthest from those added, in place and normal.
#[inline(always)]
fn keep_some<C: Cx>(cx: &mut C, candidates: &Points<C>, size: C::F, out: &mut Points<C>) {
    let (c, table) = (C::F::c, candidates.table);
    // lengths are divided by the radius of the shape
    let scale = c(1.0).div(size * size);
    let inverse = c(1.0).div(size);
    // scores begin above any squared distance: the deepest wins first, and later minima do not depend on them
    let mut best = Best::none(cx);
    each!(cx, at in candidates.list, {
        let contact = Candidate::read(cx, table, at);
        let score = c(FIRST) - contact.distance * inverse;
        cx.store(table, at, SCORE, score);
        best.offer(cx, &contact, score);
    });
    times!(cx, i in FIELD_CONTACTS, {
        // farthest points: keep the best, then lower each score to the distance from it
        let (kept, is) = best.read(cx);
        kept.add(cx, is, out);
        // the last one needs no successor
        let done = c(FIELD_CONTACTS as f64 - 1.5).lt(cx.number(i));
        let is = is & !done;
        break_if!(cx, !is);
        cx.set(&mut best.score, c(SPREAD));
        each!(cx, at in candidates.list, {
            let other = Candidate::read(cx, table, at);
            // squared distance in place, divided by the squared radius, and in normal
            let (way, turn) = (other.place - kept.place, other.normal - kept.normal);
            let apart = way.dot(way).fma(scale, turn.dot(turn));
            let score = cx.load(table, at, SCORE).min(apart);
            cx.store(table, at, SCORE, score);
            best.offer(cx, &other, score);
        });
    });
}
