//! A prism of a height field against an ellipsoid: GJK at a stand-off from the best axis, and one point.

use super::ellipsoid::{EllipsoidReach, PosedEllipsoid, smallest};
use super::gjk::closest_points;
use super::hull_axes::{Reach, axis_tolerance};
use super::posed::PosedShape;
use super::prism::Prism;
use super::prism_axes::FieldReach;
use super::prisms::{ANY, FieldNarrow, centred};
use super::restart::DirectionSamples;
use crate::constants::contact::Kind;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::narrow::ShapePair;
use crate::step::collide::primitive::cylinders::DEEP;
use crate::when;

/// An ellipsoid.
pub struct OfEllipsoid;

impl FieldNarrow for OfEllipsoid {
    const KIND: Kind = Kind::Ellipsoid;

    #[inline(always)]
    fn half_extents<F: Num>(size: Vec3<F>, axes: &Mat3<F>) -> Vec3<F> {
        // its reach along x, y and z of the field, which are rows of its axes
        let reach =
            |i: usize| EllipsoidReach(size).reach(Vec3([axes[0][i], axes[1][i], axes[2][i]]));
        Vec3([reach(0), reach(1), reach(2)])
    }
    #[inline(always)]
    fn reach<F: Num>(size: Vec3<F>, d: Vec3<F>) -> F {
        EllipsoidReach(size).reach(d)
    }
    #[inline(always)]
    fn gap<F: Num>(size: Vec3<F>, axes: &Mat3<F>, prism: &Prism<F>, field: &FieldReach<F>) -> F {
        prism.gap(axes, &EllipsoidReach(size), F::c(0.0), field, false)
    }
    #[inline(always)]
    fn contacts<C: Cx>(
        cx: &mut C,
        pair: &ShapePair<'_, C>,
        axes: &Mat3<C::F>,
        prism: &Prism<C::F>,
        out: &mut Points<C>,
    ) {
        // its centre is the origin
        let shape = PosedEllipsoid {
            pose: centred(axes),
            radii: pair.a.half_extents(),
        };
        // the best axis rejects, and is where GJK begins
        let size = PosedShape::<C>::size(&shape) + prism.radius();
        let reach = PosedShape::<C>::reach(&shape);
        let best = prism.best_axis(axes, &reach, axis_tolerance(size), ANY);
        let limit = pair.margin;
        when!(cx, best.gap.lt(limit), {
            // in deep penetration GJK restarts from sampled directions
            let restart = DirectionSamples {
                axes: *axes,
                center: Vec3::zero(),
                a: reach,
                b: *prism,
                depth: smallest(shape.radii) * C::F::c(DEEP),
            };
            let core = PosedShape::<C>::core(&shape);
            let start = best.axis;
            let near = closest_points(cx, &core, prism, start.normal, size, limit, &restart);
            // on a triangle that it lies on, the ellipsoid's own point
            let near = core.on_axis(near, start);
            // in the field's axes, then in those of the pair
            let touches = near.distance.lt(limit);
            let (point, normal) = (
                pair.pose_b.axes * near.point,
                pair.pose_b.axes * near.normal,
            );
            out.add(cx, touches, point, near.distance, normal);
        });
    }
}
