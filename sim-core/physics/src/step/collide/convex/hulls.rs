//! A sphere, capsule, box, cylinder or hull against a hull. A plane is in [`super::plane_hull`].
//!
//! - Sphere, capsule, box: all separating axes, which are exact in penetration, and GJK from the best of them otherwise.
//! - Cylinder: GJK at a stand-off from the best axis of the hull.
//! - Hull: GJK at a stand-off, and in deep penetration the nearest face of the Minkowski difference.

use super::features::{HullFace, aligned};
use super::hull::{Hull, PosedHull};
use super::hull_axes::{BoxReach, HullAxes, SeparatingAxis, axis_tolerance, bounding_box_axis};
use super::hull_depth::MinkowskiFaces;
use super::pairs::{ConvexPair, add_convex_contacts, separation_by_axes};
use super::posed::{FacetedShape, PosedBox, PosedCapsule, PosedCylinder, PosedSphere};
use super::restart::DirectionSamples;
use crate::lane::{Cx, Num, Table};
use crate::math::vec3::Vec3;
use crate::step::collide::manifold::clipped::{FeaturePair, Separation};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::narrow::{ShapePair, ShapePose};

/// Depth past which the nearest axis of two hulls may not be that of least depth, relative to the smaller radius.
const DEEP: f64 = 0.01;
/// Sphere and hull: one point.
#[inline(always)]
pub fn sphere_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (hull, b) = (pair.hull_b(), pair.pose_b);
    // in the frame of the hull, then back in that of the pair
    let near = separation_by_axes(cx, &hull, &PosedSphere::from_pair(pair), pair.margin);
    let point = b.axes.mul_add(near.point, b.center);
    let normal = b.axes * near.normal;
    let touches = near.distance.lt(pair.margin);
    out.add(cx, touches, point, near.distance, normal);
}

/// Capsule and hull: two points where it lies on a face, or one.
#[inline(always)]
pub fn capsule_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let shapes = AgainstHull {
        first: PosedCapsule::from_pair(pair),
        hull: pair.hull_b(),
    };
    add_convex_contacts(cx, pair, &shapes, out);
}

/// Box and hull: up to four points.
#[inline(always)]
pub fn box_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let shapes = AgainstHull {
        first: PosedBox::from_pair(pair),
        hull: pair.hull_b(),
    };
    add_convex_contacts(cx, pair, &shapes, out);
}

/// Cylinder and hull: four points where a cap lies on a face, two where the side does, or one.
#[inline(always)]
pub fn cylinder_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let shapes = AgainstHull {
        first: PosedCylinder::from_pair(pair),
        hull: pair.hull_b(),
    };
    add_convex_contacts(cx, pair, &shapes, out);
}

/// Two hulls: up to four points.
#[inline(always)]
pub fn hull_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let pose = pair.pose_a_in_b();
    let (second, first) = (pair.hull_b(), pair.hull_a());
    let shapes = TwoHulls {
        pose,
        first_hull: first,
        second,
        half_extents: [first.half_extents(cx), second.half_extents(cx)],
        radii: [first.radius(cx), second.radius(cx)],
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
        // of the hull's bounding box: few axes, no loop over faces
        let half = self.hull.half_extents(cx);
        bounding_box_axis(half, self.first.pose(), &self.first.reach())
    }
    #[inline(always)]
    fn better_axis(&self, cx: &mut C, limit: C::F) -> SeparatingAxis<C::F> {
        // all axes of the hull and the core; the search ends past the limit of GJK
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
            // a shape without flat features leaves it to the hull's face
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
    first_hull: Hull<'a, C>,
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
            hull: self.first_hull,
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
        // both hulls as their bounding boxes, the second's axes those of the frame
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
        let first = HullFace::find(cx, &self.first_hull, Some(self.pose), normal);
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
