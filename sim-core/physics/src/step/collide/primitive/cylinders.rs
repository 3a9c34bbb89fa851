//! A sphere, capsule, box or cylinder against a cylinder.
//!
//! A sphere has a closed form. The others are convex pairs ([`crate::step::collide::convex::pairs`]): a few axes reject most pairs, and GJK at a
//! stand-off goes on from the best of them with the cylinder's exact support function.

use crate::lane::{Cx, Num};
use crate::math::vec3::Vec3;
use crate::step::collide::convex::features::CylinderFeature;
use crate::step::collide::convex::hull_axes::{CylinderReach, SeparatingAxis};
use crate::step::collide::convex::pairs::{ConvexPair, add_convex_contacts};
use crate::step::collide::convex::posed::{
    FacetedShape, PosedBox, PosedCapsule, PosedCylinder, cylinder_size, unit_axes,
};
use crate::step::collide::convex::restart::{ClosedForm, DirectionSamples};
use crate::step::collide::convex::start_axes::StartAxes;
use crate::step::collide::convex::support::LocalCylinder;
use crate::step::collide::manifold::clipped::FeaturePair;
use crate::step::collide::manifold::points::Points;
use crate::step::collide::manifold::select::with_sign;
use crate::step::collide::narrow::{ShapePair, ShapePose};

/// Depth past which the nearest axis may not be that of least depth, relative to the cylinder's radius.
pub(in crate::step::collide) const DEEP: f64 = 0.03;

/// Sphere and cylinder: one point, in the half-plane of the cylinder's axis and the sphere's centre.
#[inline(always)]
pub fn sphere_cylinder<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let c = C::F::c;
    let (zero, one) = (c(0.0), c(1.0));
    let (b, radius) = (pair.pose_b, pair.a.radius());
    // the centre of the sphere in the cylinder's axes, and the radial direction to it
    let Vec3([x, y, z]) = -b.axes.transpose_mul(b.center);
    let width = x.fma(x, y * y).sqrt();
    // on the axis any direction across it is as good
    let on_axis = width.lt(c(1e-12));
    let unit = one.div(width.max(c(1e-12)));
    let (rx, ry) = (
        C::F::select(on_axis, one, x * unit),
        C::F::select(on_axis, zero, y * unit),
    );
    // distances from the side and from the cap
    let (beside, above) = (width - pair.b.radius(), z.abs() - pair.b.half_height());
    // outside, the way from the nearest point of the cylinder, along r and z
    let (out_r, out_z) = (beside.max(zero), above.max(zero));
    let length = out_r.fma(out_r, out_z * out_z).sqrt();
    let outside = c(1e-12).lt(length);
    let inverse = one.div(length.max(c(1e-12)));
    // a centre inside leaves through the nearer of both
    let over = beside.lt(above);
    let (radial, axial) = (
        C::F::select(outside, out_r * inverse, C::F::select(over, zero, one)),
        C::F::select(outside, out_z * inverse, C::F::select(over, one, zero)),
    );
    // distance of the centre from the cylinder, negative inside; the normal points back to the cylinder
    let core = C::F::select(outside, length, beside.max(above));
    let normal = [-(rx * radial), -(ry * radial), with_sign(-axial, z)];
    let normal = b.axes * Vec3(normal);
    let distance = core - radius;
    // along the normal the surfaces are at the radius and at `core`
    let point = normal * ((radius + core) * c(0.5));
    out.add(cx, distance.lt(pair.margin), point, distance, normal);
}

/// Capsule and cylinder: two points where they lie along each other, or one.
#[inline(always)]
pub fn capsule_cylinder<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let shapes = AgainstCylinder::new(pair, PosedCapsule::from_pair(pair));
    add_convex_contacts(cx, pair, &shapes, out);
}

/// Box and cylinder: four points where a cap lies on a face, two where the side does, or one.
#[inline(always)]
pub fn box_cylinder<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let shapes = AgainstCylinder::new(pair, PosedBox::from_pair(pair));
    add_convex_contacts(cx, pair, &shapes, out);
}

/// Two cylinders: four points where their caps meet, two where one lies along the other or on its cap, or one.
#[inline(always)]
pub fn cylinder_cylinder<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let shapes = AgainstCylinder::new(pair, PosedCylinder::from_pair(pair));
    add_convex_contacts(cx, pair, &shapes, out);
}

/// A shape in the frame of a cylinder, which lies at the origin along z.
struct AgainstCylinder<F, A> {
    first: A,
    radius: F,
    half_height: F,
}

impl<F: Num, A> AgainstCylinder<F, A> {
    /// A shape and the second of a pair.
    #[inline(always)]
    fn new<C: Cx<F = F>>(pair: &ShapePair<'_, C>, first: A) -> Self {
        AgainstCylinder {
            first,
            radius: pair.b.radius(),
            half_height: pair.b.half_height(),
        }
    }

    /// Both shapes by their reaches.
    #[inline(always)]
    fn axes<C: Cx<F = F>>(&self) -> StartAxes<'_, F, A::Reach, CylinderReach<F>>
    where
        A: FacetedShape<C>,
    {
        StartAxes {
            pose: self.first.pose(),
            a: self.first.reach(),
            b: CylinderReach(self.radius, self.half_height),
        }
    }

    /// Radius of the cylinder about its centre [m].
    #[inline(always)]
    fn cylinder_size(&self) -> F {
        cylinder_size(self.radius, self.half_height)
    }
}

// a curved shape: a few axes reject, GJK finds the normal, sampled directions escape from local minima of depth
impl<C: Cx, A: FacetedShape<C>> ConvexPair<C> for AgainstCylinder<C::F, A> {
    type First = A::Core;
    type Second = LocalCylinder<C::F>;
    type Restart = DirectionSamples<C::F, A::Reach, ClosedForm<CylinderReach<C::F>>>;
    type Clipped = A::Clipped;
    type Clipping = A::Clipping;

    #[inline(always)]
    fn radius(&self) -> Option<C::F> {
        self.first.radius()
    }
    #[inline(always)]
    fn rejecting_axis(&self, _: &mut C) -> SeparatingAxis<C::F> {
        self.first.start_axis(&self.axes())
    }
    #[inline(always)]
    fn cores(&self) -> (A::Core, LocalCylinder<C::F>) {
        let cylinder = LocalCylinder {
            radius: self.radius,
            half_height: self.half_height,
        };
        (self.first.core(), cylinder)
    }
    #[inline(always)]
    fn cores_size(&self, _: &mut C) -> C::F {
        self.first.core_size() + self.cylinder_size()
    }
    #[inline(always)]
    fn restart(&self) -> Self::Restart {
        self.axes().samples(self.radius * C::F::c(DEEP))
    }
    #[inline(always)]
    fn features(
        &self,
        _: &mut C,
        normal: Vec3<C::F>,
    ) -> FeaturePair<C::F, A::Clipped, A::Clipping> {
        // the first shape faces along the normal, the cylinder against it
        let own_frame = ShapePose {
            axes: unit_axes(),
            center: Vec3::zero(),
        };
        let feature = self.first.feature(normal);
        let cylinder = CylinderFeature::find(&own_frame, self.radius, self.half_height, -normal);
        self.first.with_cylinder(feature, cylinder, normal)
    }
    #[inline(always)]
    fn smaller_size(&self, _: &mut C) -> C::F {
        self.first.size().min(self.cylinder_size())
    }
}
