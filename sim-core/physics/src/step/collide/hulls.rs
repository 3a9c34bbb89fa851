//! A plane, sphere, capsule, box, cylinder or hull against a hull.
//!
//! - Plane: the hull's lowest vertices.
//! - Sphere, capsule, box: all separating axes, which are exact in penetration, and GJK from the best of them otherwise.
//! - Cylinder: GJK at a stand-off from the best axis of the hull.
//! - Hull: GJK at a stand-off, and in deep penetration the nearest face of the Minkowski difference.

use super::convex::{ConvexPair, add_convex_contacts, separation_by_axes};
use super::features::{HullFace, aligned};
use super::hull::{Hull, Part, PosedHull, vertex_row};
use super::hull_axes::{
    BoxReach, HullAxes, Reach, SeparatingAxis, axis_tolerance, bounding_box_axis,
};
use super::hull_depth::MinkowskiFaces;
use super::manifold::{FeaturePair, Separation};
use super::narrow::{ShapePair, ShapePose};
use super::points::Points;
use super::posed::{FacetedShape, PosedBox, PosedCapsule, PosedCylinder, PosedSphere};
use super::reduction::ReductionScore;
use super::restart::DirectionSamples;
use super::select::{perpendicular, select};
use super::variables::{get3, set3, var3};
use crate::lane::{Cx, Num, Table};
use crate::math::vec3::{Mat3, Vec3};
use crate::{span, when};

/// Depth past which the nearest axis of two hulls may not be that of least depth, relative to the smaller radius.
const DEEP: f64 = 0.01;
/// Vertices whose heights differ by less than this part of the hull's radius count as equally deep.
const SAME_DEPTH: f64 = 2e-6;
/// Vertices nearer to those chosen than this part of the hull's radius do not widen a contact.
const SPREAD: f64 = 1e-3;

/// Plane and hull: the deepest vertex below the margin, and three others that span most.
#[inline(always)]
pub fn plane_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (hull, b, normal) = (pair.hull_b(), pair.pose_b, pair.axes_a[2]);
    let n = b.axes.transpose_mul(normal);
    let height = normal.dot(b.center);
    let half = hull.half_extents(cx);
    let reach = BoxReach(half).reach(n);
    when!(cx, (height - reach).lt(pair.margin), {
        let size = hull.radius(cx);
        // seen along the normal: two directions across it, and the height
        let u = perpendicular(n);
        let view = Mat3([u, n.cross(u), n]);
        let vertices = Vertices {
            view,
            height,
            size,
            span: hull.span(cx, Part::Vertices),
        };
        let (spots, found) = vertices.choose(cx, pair, &hull);
        for k in 0..4 {
            let x = get3(cx, &spots[k]);
            let distance = x[2] + height;
            // half-way between vertex and plane
            let on_hull = view[0].scale_add(
                x[0],
                view[1].scale_add(x[1], n * (x[2] - C::F::c(0.5) * distance)),
            );
            let is = C::F::c(0.5).lt(cx.get(&found[k]));
            let point = b.axes.mul_add(on_hull, b.center);
            out.add(cx, is, point, distance, normal);
        }
    });
}

/// Vertices of a hull as seen along the normal of a plane.
struct Vertices<F, I> {
    /// Two directions across the normal, and the normal.
    view: Mat3<F>,
    /// Height of the hull's centre above the plane [m].
    height: F,
    /// Radius of the hull [m].
    size: F,
    /// Rows of the vertices.
    span: (I, I),
}

/// Variables of four points and of whether there is one.
type FourPoints<V> = ([[V; 3]; 4], [V; 4]);

impl<F: Num, I: Copy> Vertices<F, I> {
    /// Chooses four vertices.
    #[inline(always)]
    fn choose<C: Cx<F = F, I = I>>(
        &self,
        cx: &mut C,
        pair: &ShapePair<'_, C>,
        hull: &Hull<'_, C>,
    ) -> FourPoints<C::V> {
        let c = F::c;
        let mut spots = [
            var3(cx, Vec3::zero()),
            var3(cx, Vec3::zero()),
            var3(cx, Vec3::zero()),
            var3(cx, Vec3::zero()),
        ];
        let mut found = [
            cx.var(c(0.0)),
            cx.var(c(0.0)),
            cx.var(c(0.0)),
            cx.var(c(0.0)),
        ];
        let deepest = self.deepest(cx, hull);
        set3(cx, &mut spots[0], deepest);
        cx.set(
            &mut found[0],
            F::select((deepest[2] + self.height).lt(pair.margin), c(1.0), c(0.0)),
        );
        for count in 0..3 {
            let chosen: [Vec3<F>; 3] = [
                get3(cx, &spots[0]),
                get3(cx, &spots[1]),
                get3(cx, &spots[2]),
            ];
            let (x, is) = self.farthest(cx, pair, hull, count, chosen);
            set3(cx, &mut spots[count + 1], x);
            cx.set(&mut found[count + 1], is);
        }
        (spots, found)
    }

    /// The deepest vertex; of those that are equally deep the first, so that a resting hull keeps its points.
    #[inline(always)]
    fn deepest<C: Cx<F = F, I = I>>(&self, cx: &mut C, hull: &Hull<'_, C>) -> Vec3<F> {
        let c = F::c;
        let (first, end) = self.span;
        let mut lowest = var3(cx, Vec3([c(0.0), c(0.0), c(1e18)]));
        span!(cx, row in first, end, {
            for point in vertex_row(cx, hull.tables, row) {
                let x = self.view.transpose_mul(point);
                let old = get3(cx, &lowest);
                let deeper = (x[2] + c(SAME_DEPTH) * self.size).lt(old[2]);
                set3(cx, &mut lowest, select(deeper, x, old));
            }
        });
        get3(cx, &lowest)
    }

    /// The vertex below the margin that adds most to the `count` + 1 chosen, and 1 if there is one, else 0.
    #[inline(always)]
    fn farthest<C: Cx<F = F, I = I>>(
        &self,
        cx: &mut C,
        pair: &ShapePair<'_, C>,
        hull: &Hull<'_, C>,
        count: usize,
        chosen: [Vec3<F>; 3],
    ) -> (Vec3<F>, F) {
        let c = F::c;
        let (first, end) = self.span;
        let score = ReductionScore::of(count, chosen);
        let mut best = cx.var(score.threshold(c(SPREAD) * self.size));
        // where none is found the first point stands in, and nothing is found after it
        let mut place = var3(cx, chosen[0]);
        let mut is = cx.var(c(0.0));
        span!(cx, row in first, end, {
            for point in vertex_row(cx, hull.tables, row) {
                let x = self.view.transpose_mul(point);
                let here = score.at(x[0], x[1]);
                let (old, kept, had) = (cx.get(&best), get3(cx, &place), cx.get(&is));
                let farther = old.lt(here) & (x[2] + self.height).lt(pair.margin);
                cx.set(&mut best, F::select(farther, here, old));
                set3(cx, &mut place, select(farther, x, kept));
                cx.set(&mut is, F::select(farther, c(1.0), had));
            }
        });
        (get3(cx, &place), cx.get(&is))
    }
}

/// Sphere and hull: one point.
#[inline(always)]
pub fn sphere_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (hull, b) = (pair.hull_b(), pair.pose_b);
    // in the frame of the hull, then back in that of the pair
    let near = separation_by_axes(cx, &hull, &PosedSphere::of(pair), pair.margin);
    let point = b.axes.mul_add(near.point, b.center);
    let normal = b.axes * near.normal;
    let touches = near.distance.lt(pair.margin);
    out.add(cx, touches, point, near.distance, normal);
}

/// Capsule and hull: two points where it lies on a face, or one.
#[inline(always)]
pub fn capsule_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let shapes = AgainstHull {
        first: PosedCapsule::of(pair),
        hull: pair.hull_b(),
    };
    add_convex_contacts(cx, pair, &shapes, out);
}

/// Box and hull: up to four points.
#[inline(always)]
pub fn box_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let shapes = AgainstHull {
        first: PosedBox::of(pair),
        hull: pair.hull_b(),
    };
    add_convex_contacts(cx, pair, &shapes, out);
}

/// Cylinder and hull: four points where a cap lies on a face, two where the side does, or one.
#[inline(always)]
pub fn cylinder_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let shapes = AgainstHull {
        first: PosedCylinder::of(pair),
        hull: pair.hull_b(),
    };
    add_convex_contacts(cx, pair, &shapes, out);
}

/// Two hulls: up to four points.
#[inline(always)]
pub fn hull_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let pose = pair.pose_a_in_b();
    let (second, own) = (pair.hull_b(), pair.hull_a());
    let shapes = TwoHulls {
        pose,
        own,
        second,
        half_extents: [own.half_extents(cx), second.half_extents(cx)],
        radii: [own.radius(cx), second.radius(cx)],
        edges: pair.clip_tables.edges,
    };
    add_convex_contacts(cx, pair, &shapes, out);
}

/// A shape in the frame of a hull.
struct AgainstHull<'a, C: Cx, A> {
    first: A,
    /// In its own frame.
    hull: Hull<'a, C>,
}

// shapes with few axes need no search; a cylinder starts from the best axis of hull and cylinder
impl<'a, C: Cx, A: FacetedShape<C>> ConvexPair<C> for AgainstHull<'a, C, A> {
    const AXES_ARE_EXACT: bool = A::AXES_ARE_EXACT;
    const HAS_BETTER_AXIS: bool = true;
    type First = A::Core;
    type Second = Hull<'a, C>;
    type Restart = DirectionSamples<C::F, A::Reach, Hull<'a, C>>;
    type Clipped = A::Feature;
    type Clipping = HullFace<'a, C::F>;

    #[inline(always)]
    fn radius(&self) -> Option<C::F> {
        self.first.radius()
    }
    #[inline(always)]
    fn rejecting_axis(&self, cx: &mut C) -> SeparatingAxis<C::F> {
        let half = self.hull.half_extents(cx);
        bounding_box_axis(half, self.first.pose(), &self.first.reach())
    }
    #[inline(always)]
    fn better_axis(&self, cx: &mut C, limit: C::F) -> SeparatingAxis<C::F> {
        let (pose, reach) = (self.first.pose(), self.first.reach());
        let axes = HullAxes {
            hull: &self.hull,
            axes: &pose.axes,
            center: pose.center,
            other: &reach,
            limit,
            tolerance: axis_tolerance(self.cores_size(cx)),
        };
        axes.best(cx).axis
    }
    #[inline(always)]
    fn separation(&self, cx: &mut C, margin: C::F) -> Separation<C::F> {
        separation_by_axes(cx, &self.hull, &self.first, margin)
    }
    #[inline(always)]
    fn cores(&self) -> (A::Core, Hull<'a, C>) {
        (self.first.core(), self.hull)
    }
    #[inline(always)]
    fn cores_size(&self, cx: &mut C) -> C::F {
        self.first.size() + self.hull.radius(cx)
    }
    #[inline(always)]
    fn restart(&self) -> Self::Restart {
        DirectionSamples {
            axes: self.first.pose().axes,
            center: self.first.pose().center,
            a: self.first.reach(),
            b: self.hull,
            depth: self.first.restart_depth(),
        }
    }
    #[inline(always)]
    fn features(
        &self,
        cx: &mut C,
        normal: Vec3<C::F>,
    ) -> FeaturePair<C::F, A::Feature, HullFace<'a, C::F>> {
        // a face of either shape that lies flat makes the contact a polygon
        let feature = self.first.feature(normal);
        let face = HullFace::find(cx, &self.hull, None, -normal);
        let face_is_flat = aligned(face.outward, normal);
        FeaturePair {
            flat: match A::lies_flat(&feature, normal) {
                Some(flat) => flat | face_is_flat,
                None => face_is_flat,
            },
            clipped: feature,
            clipping: face,
            side: C::F::c(1.0),
        }
    }
    #[inline(always)]
    fn smaller_size(&self, cx: &mut C) -> C::F {
        self.first.size().min(self.hull.radius(cx))
    }
}

/// Two hulls in the frame of the second.
struct TwoHulls<'a, C: Cx> {
    /// Pose of the first.
    pose: ShapePose<C::F>,
    /// Both in their own frames.
    own: Hull<'a, C>,
    second: Hull<'a, C>,
    /// Half extents of their bounding boxes, and their radii [m].
    half_extents: [Vec3<C::F>; 2],
    radii: [C::F; 2],
    /// Scratch rows for edges.
    edges: Table,
}

impl<'a, C: Cx> TwoHulls<'a, C> {
    /// The first hull in the frame of the second.
    #[inline(always)]
    fn first(&self) -> PosedHull<'a, C> {
        PosedHull {
            own: self.own,
            axes: self.pose.axes,
            center: self.pose.center,
        }
    }

    /// Radius of the smaller hull [m].
    #[inline(always)]
    fn smaller(&self) -> C::F {
        self.radii[0].min(self.radii[1])
    }
}

// pairs of edges are too many for axes: GJK from the bounding boxes, and all axes only in deep penetration
impl<'a, C: Cx> ConvexPair<C> for TwoHulls<'a, C> {
    type First = PosedHull<'a, C>;
    type Second = Hull<'a, C>;
    type Restart = MinkowskiFaces<'a, C>;
    type Clipped = HullFace<'a, C::F>;
    type Clipping = HullFace<'a, C::F>;

    #[inline(always)]
    fn radius(&self) -> Option<C::F> {
        None
    }
    #[inline(always)]
    fn rejecting_axis(&self, _: &mut C) -> SeparatingAxis<C::F> {
        let [half_a, half_b] = self.half_extents;
        bounding_box_axis(half_b, &self.pose, &BoxReach(half_a))
    }
    #[inline(always)]
    fn cores(&self) -> (PosedHull<'a, C>, Hull<'a, C>) {
        (self.first(), self.second)
    }
    #[inline(always)]
    fn cores_size(&self, _: &mut C) -> C::F {
        self.radii[0] + self.radii[1]
    }
    #[inline(always)]
    fn restart(&self) -> MinkowskiFaces<'a, C> {
        MinkowskiFaces {
            first: self.first(),
            second: self.second,
            depth: self.smaller() * C::F::c(DEEP),
            edges: self.edges,
        }
    }
    #[inline(always)]
    fn features(
        &self,
        cx: &mut C,
        normal: Vec3<C::F>,
    ) -> FeaturePair<C::F, HullFace<'a, C::F>, HullFace<'a, C::F>> {
        // the faces that face each other along the normal
        let first = HullFace::find(cx, &self.own, Some(self.pose), normal);
        let second = HullFace::find(cx, &self.second, None, -normal);
        FeaturePair {
            flat: aligned(second.outward, normal) | aligned(first.outward, normal),
            clipped: first,
            clipping: second,
            side: C::F::c(1.0),
        }
    }
    #[inline(always)]
    fn smaller_size(&self, _: &mut C) -> C::F {
        self.smaller()
    }
}
