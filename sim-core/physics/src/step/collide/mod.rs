//! Collision detection: which pairs of shapes are near each other, and where they touch.
//!
//! The broad phase tests bounding spheres, then bounding boxes, of every pair of the model's table. The narrow phase has one
//! stage for each pair of kinds ([`narrow`]). Positions of shapes are relative to the reference point of their tree, and
//! those of a pair are relative to its first shape, so that `f32` keeps its digits far from the origin.
//!
//! The model lists all pairs of convex pieces that may touch, sorted by their kinds. Contacts of a world stand in the order of
//! these pairs, whatever other worlds of its block found. Contacts that do not fit are counted (`contacts_left_out`), and the
//! world gets a bit in `status`; contacts are taken in the order of the pairs, so other worlds keep their bits.
//!
//! | Pairs | Method | File |
//! |---|---|---|
//! | plane, sphere, capsule | closed form | `primitive/{planes,spheres,capsules}` |
//! | plane and ellipsoid | the lowest point | `primitive/ellipsoids` |
//! | plane and hull | the deepest vertex, with corners of a polygon beside it or others | `convex/plane_hull` |
//! | capsule and box, of models from MuJoCo | MuJoCo's choice of features | `primitive/capsule_box` |
//! | box and box | separating axes, clipping | `primitive/{boxes,box_faces}` |
//! | sphere and ellipsoid | the point of the ellipsoid that is nearest to the centre | `primitive/ellipsoids` |
//! | with an ellipsoid | GJK from the best of a few axes | `primitive/ellipsoids` |
//! | with a cylinder or a hull | [`convex::pairs`]: axes, GJK, clipping | `primitive/cylinders`, `convex/hulls` |
//! | height field | a convex prism below each of its triangles | `height_field`, `convex/{prisms,prism_ellipsoid,prism_hull}` |
//! | in `f64`, of models from MuJoCo: all without a closed form there | MuJoCo's iterations | `reference` |

mod convex;
mod height_field;
mod manifold;
mod narrow;
mod primitive;
mod reference;
mod surfaces;
mod variables;

use super::{BlockOf, ConstantsOf, Stage};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::{
    COUNT_CONTACTS, COUNT_LEFT_OUT, COUNT_ROWS, Contacts, Kind, pair, surface,
};
use crate::constants::pair_groups::BLOCK;
use crate::lane::{Cx, MaskOf, Num, Real, Table};
use crate::math::vec3::{Mat3, Vec3, load_vec3};
use crate::{span, when};
pub(super) use height_field::field_samples::Samples;
pub use height_field::fields::{
    FieldBox, FieldCapsule, FieldCylinder, FieldEllipsoid, FieldHull, FieldSphere,
};
use manifold::points::{Points, Room};
pub use narrow::*;
use surfaces::{friction, place_pairs, place_surface, softness, surface_motion, varying};

/// Poses of shapes.
pub struct Place;

impl Stage for Place {
    const READS: &'static [A] = &[A::Params, A::Rotation, A::Origin, A::Reference];
    const WRITES: &'static [A] = &[A::ShapePoses, A::ContactPoints];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.contacts.groups.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        place_shapes(cx, m, b);
    }
}

/// Writes poses of all shapes and the reference points that they are relative to, and empties the lists of contacts.
#[inline(always)]
fn place_shapes<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &BlockOf<C>) {
    let (w, memory) = (&b.work, &m.contacts.memory);
    // no contacts yet, none of the room used, none left out
    for count in 0..memory.counts.rows {
        let (row, zero) = (cx.at(count), C::F::c(0.0));
        cx.fill(memory.counts, row, 0, zero);
    }
    for (k, solid) in m.contacts.solids.iter().enumerate() {
        // R A and R c + o of a shape on a body; an upright shape has A = 1
        let mut axes = Mat3::constant(solid.axes);
        let mut center = Vec3::constant(solid.center);
        if let Some(body) = solid.body {
            let r = &w.rotation[body];
            if solid.is_upright {
                axes = *r;
            } else {
                axes = Mat3([r * axes[0], r * axes[1], r * axes[2]]);
            }
            center = r.mul_add(center, w.origin[body]);
        }
        // axes by columns, then the centre from the reference point of the tree
        let row = cx.at(k);
        cx.fill_all(memory.poses, row, 0, axes[0].0);
        cx.fill_all(memory.poses, row, 3, axes[1].0);
        cx.fill_all(memory.poses, row, 6, axes[2].0);
        cx.fill_all(memory.poses, row, 9, center.0);
        if m.contacts.varying.any() {
            place_surface(cx, m, &b.params, solid, row);
        }
    }
    if m.contacts.varying.pairs {
        place_pairs(cx, m, &b.params);
    }
    // origins: the reference point of each tree
    for (t, reference) in w.reference.iter().enumerate() {
        let row = cx.at(t);
        cx.fill_all(memory.origins, row, 0, reference.0);
    }
    // static shapes are relative to the origin of the world, the last row
    let world = cx.at(w.reference.len());
    cx.fill_all(memory.origins, world, 0, [C::F::c(0.0); 3]);
}

/// Adds the contacts of all pairs of two kinds.
#[inline(always)]
fn collide_group<C: Cx, N: Narrow>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>) {
    if let Some(group) = t.group(N::KINDS) {
        // where loads are slow, several pairs are tested at once
        if C::GATHERS_LOADS && t.handles.pair_blocks.rows > 0 && group.blocks() > 0 {
            return collide_blocks::<C, N>(cx, t);
        }
        let (first, end) = (cx.at(group.first), cx.at(group.end));
        span!(cx, p in first, end, {
            collide_pair::<C, N>(cx, t, p);
        });
    }
}

/// As [`collide_group`], with the bounding spheres of a block of pairs tested together: a GPU's thread waits once for the loads of all of
/// them. Then the near pairs are taken in their order.
#[inline(always)]
fn collide_blocks<C: Cx, N: Narrow>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>) {
    let (blocks, pairs) = (t.handles.pair_blocks, t.pairs.len());
    let rows = t.blocks(N::KINDS);
    let (first, end) = (cx.at(rows.start), cx.at(rows.end));
    let (zero, half) = (C::F::c(0.0), C::F::c(0.5));
    span!(cx, block in first, end, {
        // pair k is bit k of a whole number
        let mut near = zero;
        for k in 0..BLOCK {
            let p = cx.index(blocks, block, k, pairs);
            let is_near = PairTest::read(cx, t, p).spheres_near::<N>(cx, t, p);
            near = near + C::F::select(is_near, C::F::c(f64::from(1u32 << k)), zero);
        }
        when!(cx, half.lt(near), {
            // bits from the lowest: half of the rest, rounded down, are the others
            let mut rest = cx.var(near);
            let first = cx.index(blocks, block, 0, pairs);
            let end = cx.index(blocks, block, BLOCK, pairs + 1);
            span!(cx, p in first, end, {
                let now = cx.get(&rest);
                let others = now.fma(half, C::F::c(-0.25)).round();
                cx.set(&mut rest, others);
                let is_near = half.lt(C::F::c(2.0).fnma(others, now));
                when!(cx, is_near, {
                    collide_pair::<C, N>(cx, t, p);
                });
            });
        });
    });
}

/// Where the shapes of a pair are.
struct PairTest<C: Cx> {
    a: C::I,
    b: C::I,
    /// Centre of the first shape relative to its origin [m].
    center_a: Vec3<C::F>,
    origin_a: Vec3<C::F>,
    /// Centre of the second shape relative to that of the first [m].
    center: Vec3<C::F>,
}

impl<C: Cx> PairTest<C> {
    #[inline(always)]
    fn read(cx: &mut C, t: &Contacts<<C::F as Num>::Real>, p: C::I) -> PairTest<C> {
        let indices = t.handles.pair_indices;
        let (poses, origins) = (t.memory.poses, t.memory.origins);
        // rows of both shapes, and of the reference points of their trees
        let a = cx.index(indices, p, pair::SOLID_A, poses.rows);
        let b = cx.index(indices, p, pair::SOLID_B, poses.rows);
        let origin_a = cx.index(indices, p, pair::ORIGIN_A, origins.rows);
        let origin_b = cx.index(indices, p, pair::ORIGIN_B, origins.rows);
        // c = (c_b - c_a) + (o_b - o_a): large origins enter only by their difference, so `f32` keeps the digits
        let center_a = load_vec3(cx, poses, a, 9);
        let origin_a = load_vec3(cx, origins, origin_a, 0);
        let between = load_vec3(cx, origins, origin_b, 0) - origin_a;
        let center = (load_vec3(cx, poses, b, 9) - center_a) + between;
        PairTest {
            a,
            b,
            center_a,
            origin_a,
            center,
        }
    }

    /// Do the bounding spheres overlap, or that of the second shape and the plane?
    #[inline(always)]
    fn spheres_near<N: Narrow>(
        &self,
        cx: &mut C,
        t: &Contacts<<C::F as Num>::Real>,
        p: C::I,
    ) -> MaskOf<C> {
        // |c|² < r², or n · c < r above a plane; r contains the reach
        let radius = cx.constant(t.handles.pair_numbers, p, pair::RADIUS);
        match N::KINDS.0 {
            Kind::Plane => load_vec3(cx, t.memory.poses, self.a, 6)
                .dot(self.center)
                .lt(radius),
            _ => self.center.dot(self.center).lt(radius * radius),
        }
    }
}

/// Adds the contacts of a pair that the broad phase does not reject.
#[inline(always)]
fn collide_pair<C: Cx, N: Narrow>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>, p: C::I) {
    let kinds = N::KINDS;
    let (scalars, poses) = (t.handles.pair_numbers, t.memory.poses);
    let test = PairTest::read(cx, t, p);
    let near = test.spheres_near::<N>(cx, t, p);
    let PairTest {
        a,
        b,
        center_a,
        origin_a,
        center,
    } = test;
    when!(cx, near, {
        // only near pairs load the rest
        let axes_a = axes_of(cx, poses, a);
        let shape_a = Shape::read(cx, t, kinds.0, p, pair::SIZE_A, pair::HULL_A);
        // sphere against bounding box: the sphere around a table is as wide as the table
        let mut near = near;
        if kinds.0 >= Kind::Box {
            let radius = cx.constant(scalars, p, pair::RADIUS_B);
            near = sphere_near_box(&axes_a, shape_a.bounding_box(kinds.0), center, radius);
        }
        when!(cx, near, {
            // the pair for the narrow phase; its margin is the reach and the rounding of distances
            let pose_b = ShapePose {
                axes: axes_of(cx, poses, b),
                center,
            };
            let shape_b = Shape::read(cx, t, kinds.1, p, pair::SIZE_B, pair::HULL_B);
            let smaller = cx.constant(scalars, p, pair::SMALLER);
            let reach = cx.constant(scalars, p, pair::REACH);
            let shapes = ShapePair {
                axes_a: &axes_a,
                a: shape_a,
                pose_b: &pose_b,
                b: shape_b,
                margin: reach + contact_slack(t, smaller),
                reach,
                reference: &t.reference,
                hull_tables: &t.hulls,
                clip_tables: t.memory.cut,
                two_point_capsule_boxes: t.two_point_capsule_boxes,
                ordered_corners: t.ordered_corners,
            };
            // bounding box of the second shape, and of both where it pays
            let near = boxes_near::<C, N>(cx, t, p, &shapes, near);
            when!(cx, near, {
                let mut points = points_of::<C>(cx, t, p, center_a, origin_a);
                N::contacts(cx, &shapes, &mut points);
            });
        });
    });
}

/// Whether the bounding boxes of a pair are near each other; `near` for kinds that are not tested.
#[inline(always)]
fn boxes_near<C: Cx, N: Narrow>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    shapes: &ShapePair<'_, C>,
    near: MaskOf<C>,
) -> MaskOf<C> {
    // the sphere around the first shape against the bounding box of the second
    let (kinds, mut near, pose_b) = (N::KINDS, near, shapes.pose_b);
    if kinds.1 >= Kind::Box && kinds.0 != Kind::Plane {
        let radius = cx.constant(t.handles.pair_numbers, p, pair::RADIUS_A);
        let half = shapes.b.bounding_box(kinds.1);
        near = sphere_near_box(&pose_b.axes, half, pose_b.center, radius);
    }
    // box against box where the narrow phase is expensive; boxes themselves begin with this test
    if kinds.0 >= Kind::Box && kinds.1 > Kind::Box {
        let halves = [
            shapes.a.bounding_box(kinds.0),
            shapes.b.bounding_box(kinds.1),
        ];
        near = near & boxes_overlap(shapes.axes_a, pose_b, halves, shapes.margin);
    }
    near
}

/// Rounding of the distances of a face's corners, for a shape with this radius [m].
///
/// Contacts begin that much early: of a face that just touches, all corners do, not only those that were rounded down. Models
/// from MuJoCo in double precision begin as late instead: what just touches does not count there, since sums of round numbers
/// are exact in its frames. In ours they may be a rounding off.
#[inline(always)]
pub(super) fn contact_slack<F: Num>(t: &Contacts<F::Real>, radius: F) -> F {
    let is_late = <F::Real as Real>::DOUBLE && t.reference.is_used;
    let side = if is_late { -1.0 } else { 1.0 };
    radius * F::c(side * 2.0 * <F::Real as Real>::EPSILON)
}

/// Axes of a shape, by columns.
#[inline(always)]
fn axes_of<C: Cx>(cx: &mut C, poses: Table, row: C::I) -> Mat3<C::F> {
    Mat3([
        load_vec3(cx, poses, row, 0),
        load_vec3(cx, poses, row, 3),
        load_vec3(cx, poses, row, 6),
    ])
}

/// Is the sphere at `center` from a box, or the box at `center` from the sphere, nearer than a radius? (Arvo 1990)
#[inline(always)]
fn sphere_near_box<F: Num>(axes: &Mat3<F>, half: Vec3<F>, center: Vec3<F>, radius: F) -> F::Mask {
    // squared distance of a point from a box: Σ max(|a · c| - h, 0)²
    let mut square = F::c(0.0);
    for (axis, half) in axes.iter().zip(*half) {
        let beyond = ((*axis).dot(center).abs() - half).max(F::c(0.0));
        square = beyond.fma(beyond, square);
    }
    square.lt(radius * radius)
}

/// Do two boxes overlap along all face axes, up to `reach`? The centre of the first box is the origin. Edge axes are left
/// out: they cost more than they reject.
#[inline(always)]
fn boxes_overlap<F: Num>(
    axes: &Mat3<F>,
    other: &ShapePose<F>,
    [half, other_half]: [Vec3<F>; 2],
    reach: F,
) -> F::Mask {
    // the largest gap along any axis; overlapping boxes have none
    let mut gap = F::c(-1.0);
    let mut widths = [F::c(0.0); 3];
    // axes of the first box: |a · c| - (h + Σ |a · bⱼ| hⱼ); its widths along bⱼ are summed beside
    for (axis, half) in axes.iter().zip(*half) {
        let mut width = half;
        for j in 0..3 {
            let cosine = (*axis).dot(other.axes[j]).abs();
            width = cosine.fma(other_half[j], width);
            widths[j] = cosine.fma(half, widths[j]);
        }
        gap = gap.max((*axis).dot(other.center).abs() - (width + reach));
    }
    // axes of the second box, with these widths
    for j in 0..3 {
        let width = widths[j] + other_half[j] + reach;
        gap = gap.max(other.axes[j].dot(other.center).abs() - width);
    }
    gap.lt(F::c(0.0))
}

/// First row and capacity of a class, which has this part of the table of rows.
#[inline(always)]
pub(crate) fn read_room<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    class: C::I,
) -> [C::I; 2] {
    // bounds for backends that check what they read
    let [first_end, capacity_end] = t.row_ends();
    let first = cx.index(t.handles.class_rows, class, 0, first_end);
    let capacity = cx.index(t.handles.class_rows, class, 1, capacity_end);
    [first, capacity]
}

/// The list of a pair's contacts. Its rows count from the reference point of the pair's class.
#[inline(always)]
fn points_of<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    center_a: Vec3<C::F>,
    origin_a: Vec3<C::F>,
) -> Points<C> {
    let (scalars, indices) = (t.handles.pair_numbers, t.handles.pair_indices);
    let origins = t.memory.origins;
    // the reference point that rows of the class count from
    let origin = cx.index(indices, p, pair::ORIGIN, origins.rows);
    let origin = load_vec3(cx, origins, origin, 0);
    let class = cx.index(indices, p, pair::CLASS, t.classes.len());
    let [first, capacity] = read_room(cx, t, class);
    let mu = t.varying.mu.then(|| friction(cx, t, p, surface::MU));
    Points {
        list: cx.kept(t.memory.counts, class, first, capacity),
        table: t.memory.rows,
        pair: cx.number(p),
        base: (center_a + (origin_a - origin)),
        flip: cx.constant(scalars, p, pair::FLIP),
        mu,
        varying: varying(cx, t, p, mu),
        softness: softness(cx, t, p),
        surface_motion: surface_motion(cx, t, p),
        // the forces of a pyramidal cone depend on the tangents' direction, as does friction that differs between them
        along: t.has_directions().then_some(Vec3([C::F::c(0.0); 3])),
        room: Room {
            counts: t.memory.counts,
            contacts: t.classes.len() + COUNT_CONTACTS,
            rows: t.classes.len() + COUNT_ROWS,
            left_out: t.classes.len() + COUNT_LEFT_OUT,
            contacts_max: C::F::c(t.contacts_max as f64),
            rows_max: C::F::c(t.rows_max as f64),
            of_a_contact: cx.constant(scalars, p, pair::ROWS),
            is_tight: t.may_overflow,
        },
    }
}
