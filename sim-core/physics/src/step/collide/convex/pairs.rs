//! Contacts of two convex shapes of which one is a cylinder or a hull: one function for all of these pairs.
//!
//! ```text
//! 1. reject     a few axes of the shapes bound their distance from below
//! 2. separate   GJK at a stand-off from the best of them; for a hull and a shape with few axes, all of their axes
//! 3. clip       features that face each other along the normal, see [`crate::step::collide::manifold::clipped`]
//! ```
//!
//! What differs from pair to pair are the implementations of [`ConvexPair`], and those of [`PosedShape`] that they are made
//! of. All is found in the frame of the pair's second shape.

use super::features::Feature;
use super::gjk::closest_points;
use super::hull::Hull;
use super::hull_axes::{HullAxes, HullAxis, SeparatingAxis, axis_tolerance, bounding_box_axis};
use super::posed::PosedShape;
use super::restart::{NoRestart, Restart};
use super::support::Support;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Vec3, select};
use crate::step::collide::manifold::clipped::{FeaturePair, Separation, add_manifold};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::narrow::ShapePair;
use crate::step::collide::variables::{get3, pick3, set3, var3};
use crate::when;

/// Two convex shapes in the frame of the second.
pub(in crate::step::collide) trait ConvexPair<C: Cx> {
    /// Are all separating axes known? Then they give the depth, and [`ConvexPair::separation`] is used.
    const AXES_ARE_EXACT: bool = false;
    /// Is there a better axis than [`ConvexPair::rejecting_axis`], for what that does not reject?
    const HAS_BETTER_AXIS: bool = false;

    /// Support functions of the cores.
    type First: Support<C>;
    type Second: Support<C>;
    /// Where GJK restarts in penetration.
    type Restart: Restart<C>;
    /// Features, of either shape.
    type Clipped: Feature<C>;
    type Clipping: Feature<C>;

    /// Radius around the first core, if it has one [m].
    fn radius(&self) -> Option<C::F>;
    /// An axis that rejects most pairs.
    fn rejecting_axis(&self, cx: &mut C) -> SeparatingAxis<C::F>;
    /// A better one, where [`ConvexPair::HAS_BETTER_AXIS`].
    #[inline(always)]
    fn better_axis(&self, _: &mut C, _: C::F) -> SeparatingAxis<C::F> {
        unreachable!("the rejecting axis is the best one known")
    }
    /// The separation by axes alone, where [`ConvexPair::AXES_ARE_EXACT`].
    #[inline(always)]
    fn separation(&self, _: &mut C, _: C::F) -> Separation<C::F> {
        unreachable!("the axes are not exact")
    }
    /// The shapes without the radius around them.
    fn cores(&self) -> (Self::First, Self::Second);
    /// Sum of the cores' radii about their centres [m].
    fn cores_size(&self, cx: &mut C) -> C::F;
    /// Where to restart.
    fn restart(&self) -> Self::Restart;
    /// The features that face each other along the normal.
    fn features(
        &self,
        cx: &mut C,
        normal: Vec3<C::F>,
    ) -> FeaturePair<C::F, Self::Clipped, Self::Clipping>;
    /// Radius of the smaller shape about its centre [m].
    fn smaller_size(&self, cx: &mut C) -> C::F;
}

/// Adds the contacts of a convex pair.
#[inline(always)]
pub(in crate::step::collide) fn add_convex_contacts<C: Cx, P: ConvexPair<C>>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    shapes: &P,
    out: &mut Points<C>,
) {
    if P::AXES_ARE_EXACT {
        // separation by all axes; GJK only where the shapes are apart
        let near = shapes.separation(cx, pair.margin);
        add_features(cx, pair, shapes, &near, out);
    } else {
        // cores are farther apart than surfaces, by the radius
        let limit = match shapes.radius() {
            Some(radius) => pair.margin + radius,
            None => pair.margin,
        };
        // the distance along any axis is a lower bound: it rejects pairs before GJK
        let start = shapes.rejecting_axis(cx);
        when!(cx, start.distance.lt(limit), {
            if P::HAS_BETTER_AXIS {
                // a tighter bound, which costs more, for pairs that are left
                let start = shapes.better_axis(cx, limit);
                when!(cx, start.distance.lt(limit), {
                    add_from_axis(cx, pair, shapes, start.normal, limit, out);
                });
            } else {
                add_from_axis(cx, pair, shapes, start.normal, limit, out);
            }
        });
    }
}

/// Adds the contacts of a convex pair by GJK from an axis.
#[inline(always)]
fn add_from_axis<C: Cx, P: ConvexPair<C>>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    shapes: &P,
    start: Vec3<C::F>,
    limit: C::F,
    out: &mut Points<C>,
) {
    // GJK between the cores
    let (first, second) = shapes.cores();
    let (size, restart) = (shapes.cores_size(cx), shapes.restart());
    let core = closest_points(cx, &first, &second, start, size, limit, &restart);
    // the first surface is a radius nearer, so the middle moves by half of it along the normal
    let near = match shapes.radius() {
        Some(radius) => Separation {
            distance: core.distance - radius,
            point: core.normal.scale_add(radius * C::F::c(0.5), core.point),
            ..core
        },
        None => core,
    };
    add_features(cx, pair, shapes, &near, out);
}

/// Adds the contact points of the features along the normal.
#[inline(always)]
fn add_features<C: Cx, P: ConvexPair<C>>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    shapes: &P,
    near: &Separation<C::F>,
    out: &mut Points<C>,
) {
    // features are searched only in worlds where the shapes are within the margin
    when!(cx, near.distance.lt(pair.margin), {
        let features = shapes.features(cx, near.normal);
        let size = shapes.smaller_size(cx);
        add_manifold(cx, pair, near, &features, size, out);
    });
}

/// The separation of a shape and a hull by all of their axes; 1e18 m where they are farther apart than the margin.
///
/// Apart, the closest points may be vertices, along none of the axes: GJK goes on from the best axis. In penetration the best axis
/// is exact, and GJK is not needed.
#[inline(always)]
pub(in crate::step::collide) fn separation_by_axes<C: Cx, A: PosedShape<C>>(
    cx: &mut C,
    hull: &Hull<'_, C>,
    shape: &A,
    margin: C::F,
) -> Separation<C::F> {
    let c = C::F::c;
    let (radius, pose, reach) = (shape.radius(), shape.pose(), shape.reach());
    let radius = radius.unwrap_or(c(0.0));
    let core = shape.core();
    let limit = margin + radius;
    // farther than any margin until an axis search ends within it
    let mut distance = cx.var(c(1e18));
    let mut normal = var3(cx, Vec3::zero());
    let mut point = var3(cx, Vec3::zero());
    // a few axes of the bounding box reject before the hull's faces and edges are searched
    let half = hull.half_extents(cx);
    let outer = bounding_box_axis(half, pose, &reach);
    when!(cx, outer.distance.lt(limit), {
        // all axes of the hull and the core
        let size = shape.size() + hull.radius(cx);
        let axes = HullAxes {
            hull,
            axes: &pose.axes,
            center: pose.center,
            other: &reach,
            limit,
            tolerance: axis_tolerance(size),
        };
        let best = axes.best(cx);
        // apart within the limit, or in penetration; past the limit neither
        let apart = c(0.0).lt(best.axis.distance) & best.axis.distance.lt(limit);
        let inside = !c(0.0).lt(best.axis.distance);
        // closest points that may be vertices: GJK from the best axis
        when!(cx, apart, {
            let start = best.axis.normal;
            let closest = closest_points(cx, &core, hull, start, size, limit, &NoRestart);
            set3(cx, &mut normal, closest.normal);
            set3(cx, &mut point, closest.point);
            cx.set(&mut distance, closest.distance);
        });
        // the best axis is that of least depth
        when!(cx, inside, {
            let x = deepest_point(cx, hull, shape, &core, &best);
            set3(cx, &mut normal, best.axis.normal);
            set3(cx, &mut point, x);
            cx.set(&mut distance, best.axis.distance);
        });
    });
    // the surface is a radius away from the core
    let normal = get3(cx, &normal);
    Separation {
        normal,
        distance: cx.get(&distance) - radius,
        point: normal.scale_add(c(0.5) * radius, get3(cx, &point)),
    }
}

/// The middle of the closest points along the axis of least depth.
#[inline(always)]
fn deepest_point<C: Cx, A: PosedShape<C>>(
    cx: &mut C,
    hull: &Hull<'_, C>,
    shape: &A,
    core: &A::Core,
    best: &HullAxis<C::F>,
) -> Vec3<C::F> {
    let (c, axes) = (C::F::c, &shape.pose().axes);
    let n = best.axis.normal;
    // from the surface of the first to the middle: half the (negative) distance along n
    let half = n * (c(0.5) * best.axis.distance);
    // a face of the hull: the other's farthest point
    let corner = core.farthest(cx, n);
    let middle = [
        corner[0] + half[0],
        corner[1] + half[1],
        corner[2] + half[2],
    ];
    let mut point = var3(cx, Vec3(middle));
    // a face of the other: the hull's farthest vertex
    when!(cx, best.of_other(), {
        let vertex = hull.farthest(cx, -n);
        set3(cx, &mut point, vertex - half);
    });
    when!(cx, best.of_edges(), {
        // the hull's edge x = p + s d and the other's x = r + t q, where n is across both: (p - r + s d - t q) ∥ n
        let edges = hull.tables.edges;
        let (p, d) = (
            pick3(cx, edges, best.edge, 0),
            pick3(cx, edges, best.edge, 3),
        );
        // q, one of the other's axes, which differs per world
        let (first, second) = (best.along.lt(c(0.5)), best.along.lt(c(1.5)));
        let q = select(first, axes[0], select(second, axes[1], axes[2]));
        // s = ((r - p) · d - (d · q) (r - p) · q)/(1 - (d · q)²); of nearly parallel edges it stays finite
        let mixed = d.dot(q);
        let square = mixed.fnma(mixed, c(1.0)).max(c(1e-7));
        let way = corner - p;
        let s = mixed.fnma(way.dot(q), way.dot(d)).div(square);
        set3(cx, &mut point, d.scale_add(s, p) - half);
    });
    get3(cx, &point)
}
