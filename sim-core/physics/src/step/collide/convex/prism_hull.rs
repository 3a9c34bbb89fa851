//! A prism of a height field against a convex hull: GJK at a stand-off from the best face of either.

use super::features::{HullFace, aligned};
use super::gjk::closest_points;
use super::hull::{Hull, Part, PosedHull};
use super::hull_axes::{BoxReach, Reach, SeparatingAxis, axis_tolerance};
use super::prism::Prism;
use super::prism_axes::FieldReach;
use super::prisms::{FACING, FieldNarrow, PrismTop, box_extents, centred, facing, facing_or};
use super::restart::NoRestart;
use super::support::{Support, minkowski_support};
use crate::constants::contact::Kind;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::manifold::clipped::{FeaturePair, Separation, add_manifold};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::narrow::ShapePair;
use crate::step::collide::variables::{get3, set3, var3};
use crate::{span, when};

/// A convex hull.
pub struct OfHull;

impl FieldNarrow for OfHull {
    const KIND: Kind = Kind::Hull;

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
        // of its bounding box
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
        let hull = pair.hull_a();
        let size = hull.radius(cx);
        // a few axes of its bounding box reject, its own vertices find the best face of the prism
        let reach = BoxReach(pair.a.half_extents());
        let outer = prism.best_axis(axes, &reach, axis_tolerance(size), FACING);
        let limit = pair.margin;
        when!(cx, outer.gap.lt(limit), {
            let first = PosedHull {
                hull,
                axes: *axes,
                center: Vec3::zero(),
            };
            // `start` is the best face that may be the way out; `gap` bounds the distance from below
            let (start, gap) = best_face(cx, prism, &first);
            when!(cx, gap.lt(limit), {
                let all = size + prism.radius();
                // GJK from that face, and the contact along it for worlds where GJK's normal is no way out
                let closest =
                    closest_points(cx, &first, prism, start.normal, all, limit, &NoRestart);
                let corner = first.farthest(cx, start.normal);
                let deep = Separation {
                    normal: start.normal,
                    distance: start.distance,
                    point: start
                        .normal
                        .scale_add(start.distance * C::F::c(0.5), corner),
                };
                let near = facing_or(prism, closest, deep);
                when!(cx, near.distance.lt(limit), {
                    // a polygon where the triangle lies flat, or a face of the hull on a triangle that faces it
                    let face = hull_face(cx, &hull, axes, near.normal);
                    let features = FeaturePair {
                        flat: aligned(prism.up, near.normal)
                            | (facing(prism, &near) & aligned(face.outward, near.normal)),
                        clipped: face,
                        clipping: PrismTop(prism),
                        side: C::F::c(1.0),
                    };
                    add_manifold(cx, pair, &near, &features, size, out);
                });
            });
        });
    }
}

/// The face of a hull that faces a direction best.
#[inline(always)]
fn hull_face<'a, C: Cx>(
    cx: &mut C,
    hull: &Hull<'a, C>,
    axes: &Mat3<C::F>,
    normal: Vec3<C::F>,
) -> HullFace<'a, C::F> {
    HullFace::find(cx, hull, Some(centred(axes)), normal)
}

/// The best of the normals of a prism's faces and of a hull's.
struct FaceSearch<C: Cx> {
    /// That may be the way out: distance and normal.
    distance: C::V,
    normal: [C::V; 3],
    /// The distance along the best of all.
    gap: C::V,
}

impl<C: Cx> FaceSearch<C> {
    #[inline(always)]
    fn offer(&mut self, cx: &mut C, prism: &Prism<C::F>, n: Vec3<C::F>, x: C::F) {
        // the way out is against the top's normal; any axis bounds the distance
        let (old, widest, kept) = (
            cx.get(&self.distance),
            cx.get(&self.gap),
            get3(cx, &self.normal),
        );
        let is = old.lt(x) & C::F::c(FACING).lt(-n.dot(prism.up));
        cx.set(&mut self.distance, C::F::select(is, x, old));
        cx.set(&mut self.gap, widest.max(x));
        set3(cx, &mut self.normal, select(is, n, kept));
    }
}

/// The best face normal that may be the way out, and the distance along the best of all.
#[inline(always)]
fn best_face<C: Cx>(
    cx: &mut C,
    prism: &Prism<C::F>,
    posed: &PosedHull<'_, C>,
) -> (SeparatingAxis<C::F>, C::F) {
    let c = C::F::c;
    let mut search = FaceSearch {
        distance: cx.var(c(-1e18)),
        normal: var3(cx, -prism.up),
        gap: cx.var(c(-1e18)),
    };
    // normals point from the hull to the prism: inward of the prism. Distance: least (b - a) along them
    for face in prism.normals() {
        let (_, way) = minkowski_support(cx, posed, prism, -face);
        search.offer(cx, prism, -face, -way.dot(face));
    }
    // outward of the hull, whose centre is the origin: distance = least reach of the prism - offset
    let faces = posed.hull.tables.faces;
    let (first, end) = posed.hull.span(cx, Part::Faces);
    span!(cx, face in first, end, {
        let [mx, my, mz, offset] = cx.constants(faces, face, 0);
        let m = posed.axes * Vec3([mx, my, mz]);
        let [low, _] = prism.span(m);
        search.offer(cx, prism, m, low - offset);
    });
    let best = SeparatingAxis {
        normal: get3(cx, &search.normal),
        distance: cx.get(&search.distance),
    };
    (best, cx.get(&search.gap))
}
