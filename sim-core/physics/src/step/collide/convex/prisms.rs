//! A prism of a height field against sphere, capsule, box and cylinder: the contacts of one prism. A hull is in
//! [`super::prism_hull`], an ellipsoid in [`super::prism_ellipsoid`].
//!
//! All is in the field's axes, from the centre of the shape, which is the first of the pair; the prism is the second.
//!
//! - Sphere: closed form. Capsule: closed form of its axis, and all separating axes where that passes through the prism.
//! - Box: all separating axes, which are exact in penetration; GJK from the best of them otherwise.
//! - Cylinder: GJK at a stand-off from the best axis.
//!
//! Where the shape lies flat on the triangle, the contact is a polygon ([`add_manifold`]).

use super::features::{Feature, aligned};
use super::gjk::closest_points;
use super::hull_axes::{BoxReach, CylinderReach, PointReach, Reach, SegmentReach, axis_tolerance};
use super::posed::{FacetedShape, PosedBox, PosedCapsule, PosedCylinder, PosedShape};
use super::prism::{Nearest, Prism};
use super::prism_axes::{FieldReach, PrismAxis};
use super::restart::{DirectionSamples, NoRestart};
use super::support::Support;
use crate::constants::contact::Kind;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::manifold::clipped::{FeaturePair, Separation, add_manifold};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::narrow::{ShapePair, ShapePose};
use crate::step::collide::variables::{get3, set3, var3};
use crate::when;

/// Least cosine of a contact's normal to that of its triangle, of boxes, cylinders and hulls: 60°.
///
/// A prism has walls where others begin. Along those the way out is short where a shape overlaps the prism by little: MuJoCo takes
/// it, and shapes that slide over level ground catch on every triangle. Where the ground is a wall, its own triangles are steep.
pub(in crate::step::collide) const FACING: f64 = 0.5;
/// Any normal is a way out: of spheres, capsules and ellipsoids, as in MuJoCo.
pub(in crate::step::collide) const ANY: f64 = -2.0;

/// The narrow phase of a height field and a kind of shape.
pub trait FieldNarrow {
    /// The kind.
    const KIND: Kind;

    /// Half the extents of the shape along the field's axes [m]; the shape's own axes are given in those.
    fn half_extents<F: Num>(size: Vec3<F>, axes: &Mat3<F>) -> Vec3<F>;
    /// How far it reaches along a unit direction of its own axes, or more [m].
    fn reach<F: Num>(size: Vec3<F>, d: Vec3<F>) -> F;
    /// A lower bound of its distance to a prism, before all that [`FieldNarrow::contacts`] computes.
    fn gap<F: Num>(size: Vec3<F>, axes: &Mat3<F>, prism: &Prism<F>, field: &FieldReach<F>) -> F;
    /// Adds the contacts of a prism. In the pair the shape is the first one, with the field's axes; `pose_b` is that of the prism.
    fn contacts<C: Cx>(
        cx: &mut C,
        pair: &ShapePair<'_, C>,
        axes: &Mat3<C::F>,
        prism: &Prism<C::F>,
        out: &mut Points<C>,
    );
}

/// |axes| half: how far a box reaches.
#[inline(always)]
pub(in crate::step::collide) fn box_extents<F: Num>(half: Vec3<F>, axes: &Mat3<F>) -> Vec3<F> {
    let mut reach = Vec3::zero();
    for (j, half) in half.iter().enumerate() {
        for i in 0..3 {
            reach[i] = axes[j][i].abs().fma(*half, reach[i]);
        }
    }
    reach
}

/// The top of a prism as a feature.
pub(in crate::step::collide) struct PrismTop<'a, F>(pub &'a Prism<F>);

impl<C: Cx> Feature<C> for PrismTop<'_, C::F> {
    #[inline(always)]
    fn normal(&self) -> Vec3<C::F> {
        self.0.up
    }
    #[inline(always)]
    fn count(&self) -> C::F {
        C::F::c(3.0)
    }
    #[inline(always)]
    fn corner(&self, cx: &mut C, i: C::I) -> Vec3<C::F> {
        // P, Q, K and P again; counter-clockwise where the third corner is on the left
        let (c, place) = (C::F::c, cx.number(i));
        let [p, q, k] = self.0.top;
        let is_left = c(0.0).lt(self.0.side);
        let (second, third) = (select(is_left, q, k), select(is_left, k, q));
        let is_second = c(0.5).lt(place) & place.lt(c(1.5));
        let is_third = c(1.5).lt(place) & place.lt(c(2.5));
        select(is_second, second, select(is_third, third, p))
    }
}

/// A shape with its centre at the origin.
#[inline(always)]
pub(in crate::step::collide) fn centred<F: Num>(axes: &Mat3<F>) -> ShapePose<F> {
    ShapePose {
        axes: *axes,
        center: Vec3::zero(),
    }
}

/// The point half-way between surfaces, from what is nearest to a point that has a radius around it.
#[inline(always)]
fn around<F: Num>(near: &Nearest<F>, radius: F) -> Separation<F> {
    // distance of the surfaces; their middle is half of it away from the place on the prism
    let distance = near.distance - radius;
    Separation {
        normal: -near.normal,
        distance,
        point: near.normal.scale_add(distance * F::c(0.5), near.place),
    }
}

/// A sphere.
pub struct OfSphere;

impl FieldNarrow for OfSphere {
    const KIND: Kind = Kind::Sphere;

    #[inline(always)]
    fn half_extents<F: Num>(size: Vec3<F>, _: &Mat3<F>) -> Vec3<F> {
        Vec3([size[0]; 3])
    }
    #[inline(always)]
    fn reach<F: Num>(size: Vec3<F>, _: Vec3<F>) -> F {
        size[0]
    }
    #[inline(always)]
    fn gap<F: Num>(size: Vec3<F>, axes: &Mat3<F>, prism: &Prism<F>, field: &FieldReach<F>) -> F {
        prism.gap(axes, &PointReach, size[0], field, false)
    }
    #[inline(always)]
    fn contacts<C: Cx>(
        cx: &mut C,
        pair: &ShapePair<'_, C>,
        _: &Mat3<C::F>,
        prism: &Prism<C::F>,
        out: &mut Points<C>,
    ) {
        // the nearest place in the field's axes, then in those of the pair
        let near = around(&prism.nearest(Vec3::zero()), pair.a.radius());
        let (point, normal) = (
            pair.pose_b.axes * near.point,
            pair.pose_b.axes * near.normal,
        );
        let touches = near.distance.lt(pair.margin);
        out.add(cx, touches, point, near.distance, normal);
    }
}

/// A capsule.
pub struct OfCapsule;

impl FieldNarrow for OfCapsule {
    const KIND: Kind = Kind::Capsule;

    #[inline(always)]
    fn half_extents<F: Num>(size: Vec3<F>, axes: &Mat3<F>) -> Vec3<F> {
        // a half height along the axis, and a radius in any direction: |a_i| h + r
        let reach = |i: usize| axes[2][i].abs().fma(size[1], size[0]);
        Vec3([reach(0), reach(1), reach(2)])
    }
    #[inline(always)]
    fn reach<F: Num>(size: Vec3<F>, d: Vec3<F>) -> F {
        d[2].abs().fma(size[1], size[0])
    }
    #[inline(always)]
    fn gap<F: Num>(size: Vec3<F>, axes: &Mat3<F>, prism: &Prism<F>, field: &FieldReach<F>) -> F {
        prism.gap(axes, &SegmentReach(size[1]), size[0], field, true)
    }
    #[inline(always)]
    fn contacts<C: Cx>(
        cx: &mut C,
        pair: &ShapePair<'_, C>,
        axes: &Mat3<C::F>,
        prism: &Prism<C::F>,
        out: &mut Points<C>,
    ) {
        let (radius, half_height) = (pair.a.radius(), pair.a.half_height());
        let shape = PosedCapsule {
            pose: centred(axes),
            radius,
            half_height,
            half: axes[2] * half_height,
        };
        // apart: ends of the axis against the prism, and the axis against edges
        let near = prism.nearest_to_segment(shape.half);
        let apart = around(&near, radius);
        let mut normal = var3(cx, apart.normal);
        let mut point = var3(cx, apart.point);
        let mut distance = cx.var(apart.distance);
        // no face is between them: the axis may pass through the prism
        let (from, to) = (prism.beyond(shape.half), prism.beyond(-shape.half));
        // the largest distance by which both ends are beyond the same face
        let mut gap = C::F::c(-1e18);
        for (x, y) in from.into_iter().zip(to) {
            gap = gap.max(x.min(y));
        }
        when!(cx, !C::F::c(0.0).lt(gap), {
            // separating axes of the capsule's segment; its radius is added below
            let size = PosedShape::<C>::size(&shape) + prism.radius();
            let reach = PosedShape::<C>::reach(&shape);
            let best = prism.best_axis(axes, &reach, axis_tolerance(size), ANY);
            // no axis separates them: depth of the axis in the prism, and the radius
            when!(cx, !C::F::c(0.0).lt(best.gap), {
                let core = PosedShape::<C>::core(&shape);
                let deep = penetration(cx, prism, &core, &best);
                // from the middle for the axis to that for the surface
                let half = deep.normal * (C::F::c(0.5) * radius);
                set3(cx, &mut normal, deep.normal);
                set3(cx, &mut point, deep.point + half);
                cx.set(&mut distance, deep.distance - radius);
            });
        });
        let near = Separation {
            normal: get3(cx, &normal),
            distance: cx.get(&distance),
            point: get3(cx, &point),
        };
        add_touching(cx, pair, &shape, prism, &near, out);
    }
}

/// A box.
pub struct OfBox;

impl FieldNarrow for OfBox {
    const KIND: Kind = Kind::Box;

    #[inline(always)]
    fn half_extents<F: Num>(size: Vec3<F>, axes: &Mat3<F>) -> Vec3<F> {
        box_extents(size, axes)
    }
    #[inline(always)]
    fn reach<F: Num>(size: Vec3<F>, d: Vec3<F>) -> F {
        BoxReach(size).reach(d)
    }
    #[inline(always)]
    fn gap<F: Num>(size: Vec3<F>, axes: &Mat3<F>, prism: &Prism<F>, field: &FieldReach<F>) -> F {
        // edges cost more than they reject
        prism.gap(axes, &BoxReach(size), F::c(0.0), field, false)
    }
    #[inline(always)]
    fn contacts<C: Cx>(
        cx: &mut C,
        pair: &ShapePair<'_, C>,
        axes: &Mat3<C::F>,
        prism: &Prism<C::F>,
        out: &mut Points<C>,
    ) {
        let c = C::F::c;
        let shape = PosedBox {
            pose: centred(axes),
            half: pair.a.half_extents(),
        };
        // the best axis rejects, and is exact in penetration
        let core = PosedShape::<C>::core(&shape);
        let size = PosedShape::<C>::size(&shape) + prism.radius();
        let reach = PosedShape::<C>::reach(&shape);
        let best = prism.best_axis(axes, &reach, axis_tolerance(size), FACING);
        let limit = pair.margin;
        when!(cx, best.gap.lt(limit), {
            let deep = penetration(cx, prism, &core, &best);
            let mut normal = var3(cx, deep.normal);
            let mut point = var3(cx, deep.point);
            let mut distance = cx.var(deep.distance);
            // apart along an axis: GJK goes on from the best one
            when!(cx, c(0.0).lt(best.gap), {
                let start = best.axis.normal;
                let closest = closest_points(cx, &core, prism, start, size, limit, &NoRestart);
                set3(cx, &mut normal, closest.normal);
                set3(cx, &mut point, closest.point);
                cx.set(&mut distance, closest.distance);
            });
            let near = Separation {
                normal: get3(cx, &normal),
                distance: cx.get(&distance),
                point: get3(cx, &point),
            };
            add_touching(cx, pair, &shape, prism, &near, out);
        });
    }
}

/// A cylinder.
pub struct OfCylinder;

impl FieldNarrow for OfCylinder {
    const KIND: Kind = Kind::Cylinder;

    #[inline(always)]
    fn half_extents<F: Num>(size: Vec3<F>, axes: &Mat3<F>) -> Vec3<F> {
        let reach = |i: usize| {
            // h |a_i| + r √(1 - a_i²), where rounding must not make the root's argument negative
            let along = axes[2][i];
            let across = along.fnma(along, F::c(1.0)).max(F::c(0.0)).sqrt();
            size[0].fma(across, size[1] * along.abs())
        };
        Vec3([reach(0), reach(1), reach(2)])
    }
    #[inline(always)]
    fn reach<F: Num>(size: Vec3<F>, d: Vec3<F>) -> F {
        CylinderReach(size[0], size[1]).reach(d)
    }
    #[inline(always)]
    fn gap<F: Num>(size: Vec3<F>, axes: &Mat3<F>, prism: &Prism<F>, field: &FieldReach<F>) -> F {
        let reach = CylinderReach(size[0], size[1]);
        prism.gap(axes, &reach, F::c(0.0), field, true)
    }
    #[inline(always)]
    fn contacts<C: Cx>(
        cx: &mut C,
        pair: &ShapePair<'_, C>,
        axes: &Mat3<C::F>,
        prism: &Prism<C::F>,
        out: &mut Points<C>,
    ) {
        let shape = PosedCylinder {
            pose: centred(axes),
            radius: pair.a.radius(),
            half_height: pair.a.half_height(),
        };
        // the best axis rejects, and is where GJK begins
        let size = PosedShape::<C>::size(&shape) + prism.radius();
        let reach = PosedShape::<C>::reach(&shape);
        let best = prism.best_axis(axes, &reach, axis_tolerance(size), FACING);
        let limit = pair.margin;
        when!(cx, best.gap.lt(limit), {
            // in deep penetration GJK restarts from sampled directions, since a cylinder is curved
            let restart = DirectionSamples {
                axes: *axes,
                center: Vec3::zero(),
                a: reach,
                b: *prism,
                depth: FacetedShape::<C>::restart_depth(&shape),
            };
            let core = PosedShape::<C>::core(&shape);
            let start = best.axis.normal;
            let closest = closest_points(cx, &core, prism, start, size, limit, &restart);
            // the contact along the best axis, where GJK's normal is no way out
            let deep = penetration(cx, prism, &core, &best);
            let near = facing_or(prism, closest, deep);
            add_touching(cx, pair, &shape, prism, &near, out);
        });
    }
}

/// What GJK found, or in penetration along a normal that is no way out what the best axis says.
#[inline(always)]
pub(in crate::step::collide) fn facing_or<F: Num>(
    prism: &Prism<F>,
    closest: Separation<F>,
    deep: Separation<F>,
) -> Separation<F> {
    let c = F::c;
    // within 60° of the triangle's normal, or apart
    let is_out = c(FACING).lt(-prism.up.dot(closest.normal)) | c(0.0).lt(closest.distance);
    Separation {
        normal: select(is_out, closest.normal, deep.normal),
        distance: F::select(is_out, closest.distance, deep.distance),
        point: select(is_out, closest.point, deep.point),
    }
}

/// Does the top of a prism face the shape along the normal?
#[inline(always)]
pub(in crate::step::collide) fn facing<F: Num>(prism: &Prism<F>, near: &Separation<F>) -> F::Mask {
    F::c(0.7).lt(-prism.up.dot(near.normal))
}

/// Adds the contacts of a shape and a prism that are as near as said.
#[inline(always)]
fn add_touching<C: Cx, A: FacetedShape<C>>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    shape: &A,
    prism: &Prism<C::F>,
    near: &Separation<C::F>,
    out: &mut Points<C>,
) {
    when!(cx, near.distance.lt(pair.margin), {
        // a polygon where the triangle lies flat, or a feature of the shape on a triangle that faces it
        let feature = shape.feature(near.normal);
        let on_top = aligned(prism.up, near.normal);
        let features = FeaturePair {
            flat: match A::lies_flat(&feature, near.normal) {
                Some(flat) => on_top | (flat & facing(prism, near)),
                None => on_top,
            },
            clipped: feature,
            clipping: PrismTop(prism),
            side: C::F::c(1.0),
        };
        add_manifold(cx, pair, near, &features, shape.size(), out);
    });
}

/// The separation of a core and a prism along their axis of least depth.
#[inline(always)]
fn penetration<C: Cx>(
    cx: &mut C,
    prism: &Prism<C::F>,
    core: &impl Support<C>,
    best: &PrismAxis<C::F>,
) -> Separation<C::F> {
    let c = C::F::c;
    let n = best.axis.normal;
    // from the shape's surface to the middle: half the (negative) distance along n
    let half = n * (c(0.5) * best.axis.distance);
    // a face of the prism: the other's farthest point
    let corner = core.farthest(cx, n);
    let of_face = corner + half;
    // a face of the other: the prism's farthest corner
    let of_other = Support::<C>::farthest(prism, cx, -n) - half;
    // edges x = p + s d of the prism and x = r + t q of the other, n across both: (p - r + s d - t q) ∥ n
    let ([p, d], q) = (best.edge, best.other);
    // s = ((r - p) · d - (d · q) (r - p) · q)/(1 - (d · q)²); of nearly parallel edges it stays finite
    let mixed = d.dot(q);
    let square = mixed.fnma(mixed, c(1.0)).max(c(1e-7));
    let way = corner - p;
    let s = mixed.fnma(way.dot(q), way.dot(d)).div(square);
    let of_edges = d.scale_add(s, p) - half;
    // kind is 0, 1 or 2
    let (is_other, is_edges) = (c(0.5).lt(best.kind), c(1.5).lt(best.kind));
    Separation {
        normal: n,
        distance: best.axis.distance,
        point: select(is_edges, of_edges, select(is_other, of_other, of_face)),
    }
}
