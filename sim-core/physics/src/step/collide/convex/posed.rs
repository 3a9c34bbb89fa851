//! Sphere, capsule, box and cylinder as the first shape of a convex pair, posed in the frame of the second.
//!
//! A sphere is a point and a capsule a segment, each with a radius around it (a core, as in Jolt and PhysX): axes and GJK see
//! the core alone, which has few axes and sharp features.

use super::features::{BoxFace, CylinderFeature, Feature, SegmentLine, aligned};
use super::hull_axes::SeparatingAxis;
use super::hull_axes::{BoxReach, CylinderReach, PointReach, Reach, SegmentReach};
use super::start_axes::StartAxes;
use super::support::{BoxCore, CylinderCore, PointCore, SegmentCore, Support};
use crate::lane::{Cx, MaskOf, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::collide::manifold::clipped::FeaturePair;
use crate::step::collide::narrow::{Shape, ShapePair, ShapePose};
use crate::step::collide::primitive::cylinders::DEEP;

/// Cosine past which lines of two shapes lie along each other: 1.8°.
const PARALLEL: f64 = 0.9995;

/// A shape in the frame of another.
pub(in crate::step::collide) trait PosedShape<C: Cx> {
    /// How far the core reaches along a direction of its own axes.
    type Reach: Reach<C::F> + Copy;
    /// Its core.
    type Core: Support<C>;

    /// Its pose.
    fn pose(&self) -> &ShapePose<C::F>;
    /// See [`Reach`].
    fn reach(&self) -> Self::Reach;
    /// See [`Support`].
    fn core(&self) -> Self::Core;
    /// Radius around the core, if it has one [m].
    fn radius(&self) -> Option<C::F>;
    /// Radius of the shape about its centre [m].
    fn size(&self) -> C::F;
    /// Radius of the core about its centre [m].
    #[inline(always)]
    fn core_size(&self) -> C::F {
        self.size()
    }
}

/// A shape with features that can be clipped.
pub(in crate::step::collide) trait FacetedShape<C: Cx>:
    PosedShape<C>
{
    /// Do few axes decide whether it penetrates a hull? Those of a curved shape cannot be listed.
    const AXES_ARE_EXACT: bool;
    /// Its features.
    type Feature: Feature<C>;
    /// The features of it and a cylinder.
    type Clipped: Feature<C>;
    type Clipping: Feature<C>;

    /// Depth in a hull past which the nearest axis may not be that of least depth [m]; not asked for where axes are exact.
    fn restart_depth(&self) -> C::F;
    /// The feature that faces a direction best.
    fn feature(&self, normal: Vec3<C::F>) -> Self::Feature;
    /// Where that feature lies flat, if it can.
    fn lies_flat(feature: &Self::Feature, normal: Vec3<C::F>) -> Option<MaskOf<C>>;
    /// The best of a few axes of it and a cylinder.
    fn start_axis(
        &self,
        axes: &StartAxes<'_, C::F, Self::Reach, CylinderReach<C::F>>,
    ) -> SeparatingAxis<C::F>;
    /// Its feature and that of a cylinder, one to be clipped by the other.
    fn with_cylinder(
        &self,
        feature: Self::Feature,
        cylinder: CylinderFeature<C::F>,
        normal: Vec3<C::F>,
    ) -> FeaturePair<C::F, Self::Clipped, Self::Clipping>;
}

/// A sphere.
pub(in crate::step::collide) struct PosedSphere<F> {
    pub pose: ShapePose<F>,
    pub radius: F,
}

/// A capsule along z of its frame.
pub(in crate::step::collide) struct PosedCapsule<F> {
    pub pose: ShapePose<F>,
    pub radius: F,
    pub half_height: F,
    /// From its centre to one end of its axis.
    pub half: Vec3<F>,
}

/// A box.
pub(in crate::step::collide) struct PosedBox<F> {
    pub pose: ShapePose<F>,
    pub half: Vec3<F>,
}

/// A cylinder along z of its frame.
pub(in crate::step::collide) struct PosedCylinder<F> {
    pub pose: ShapePose<F>,
    pub radius: F,
    pub half_height: F,
}

/// Radius of a ball around a cylinder [m].
#[inline(always)]
pub(in crate::step::collide) fn cylinder_size<F: Num>(radius: F, half_height: F) -> F {
    radius.fma(radius, half_height * half_height).sqrt()
}

/// The identity.
#[inline(always)]
pub(in crate::step::collide) fn unit_axes<F: Num>() -> Mat3<F> {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    Mat3([
        Vec3([one, zero, zero]),
        Vec3([zero, one, zero]),
        Vec3([zero, zero, one]),
    ])
}

impl<F: Num> PosedSphere<F> {
    /// The first shape of a pair.
    #[inline(always)]
    pub fn from_pair<C: Cx<F = F>>(pair: &ShapePair<'_, C>) -> Self {
        // its centre in the frame of the second shape; its axes do not matter
        let b = pair.pose_b;
        PosedSphere {
            pose: ShapePose {
                axes: unit_axes(),
                center: -b.axes.transpose_mul(b.center),
            },
            radius: pair.a.radius(),
        }
    }
}

impl<F: Num> PosedCapsule<F> {
    /// The first shape of a pair.
    #[inline(always)]
    pub fn from_pair<C: Cx<F = F>>(pair: &ShapePair<'_, C>) -> Self {
        // in the frame of the second shape, with the half axis as a vector
        let (pose, a): (_, &Shape<C>) = (pair.pose_a_in_b(), &pair.a);
        PosedCapsule {
            pose,
            radius: a.radius(),
            half_height: a.half_height(),
            half: pose.axes[2] * a.half_height(),
        }
    }
}

impl<F: Num> PosedBox<F> {
    /// The first shape of a pair.
    #[inline(always)]
    pub fn from_pair<C: Cx<F = F>>(pair: &ShapePair<'_, C>) -> Self {
        PosedBox {
            pose: pair.pose_a_in_b(),
            half: pair.a.half_extents(),
        }
    }
}

impl<F: Num> PosedCylinder<F> {
    /// The first shape of a pair.
    #[inline(always)]
    pub fn from_pair<C: Cx<F = F>>(pair: &ShapePair<'_, C>) -> Self {
        PosedCylinder {
            pose: pair.pose_a_in_b(),
            radius: pair.a.radius(),
            half_height: pair.a.half_height(),
        }
    }
}

impl<C: Cx> PosedShape<C> for PosedSphere<C::F> {
    type Reach = PointReach;
    type Core = PointCore<C::F>;

    #[inline(always)]
    fn pose(&self) -> &ShapePose<C::F> {
        &self.pose
    }
    #[inline(always)]
    fn reach(&self) -> PointReach {
        PointReach
    }
    #[inline(always)]
    fn core(&self) -> PointCore<C::F> {
        PointCore(self.pose.center)
    }
    #[inline(always)]
    fn radius(&self) -> Option<C::F> {
        Some(self.radius)
    }
    #[inline(always)]
    fn size(&self) -> C::F {
        self.radius
    }
}

impl<C: Cx> PosedShape<C> for PosedCapsule<C::F> {
    type Reach = SegmentReach<C::F>;
    type Core = SegmentCore<C::F>;

    #[inline(always)]
    fn pose(&self) -> &ShapePose<C::F> {
        &self.pose
    }
    #[inline(always)]
    fn reach(&self) -> SegmentReach<C::F> {
        SegmentReach(self.half_height)
    }
    #[inline(always)]
    fn core(&self) -> SegmentCore<C::F> {
        SegmentCore {
            center: self.pose.center,
            half: self.half,
        }
    }
    #[inline(always)]
    fn radius(&self) -> Option<C::F> {
        Some(self.radius)
    }
    #[inline(always)]
    fn size(&self) -> C::F {
        self.radius + self.half_height
    }
    #[inline(always)]
    fn core_size(&self) -> C::F {
        self.half_height
    }
}

// its feature is a line: two points on a face of the other shape
impl<C: Cx> FacetedShape<C> for PosedCapsule<C::F> {
    const AXES_ARE_EXACT: bool = true;
    type Feature = SegmentLine<C::F>;
    type Clipped = SegmentLine<C::F>;
    type Clipping = CylinderFeature<C::F>;

    #[inline(always)]
    fn restart_depth(&self) -> C::F {
        unreachable!("its axes are exact")
    }
    #[inline(always)]
    fn feature(&self, normal: Vec3<C::F>) -> SegmentLine<C::F> {
        // the line on its surface: the axis, a radius along the normal
        let center = normal.scale_add(self.radius, self.pose.center);
        SegmentLine::new(center, self.half, normal)
    }
    #[inline(always)]
    fn lies_flat(_: &SegmentLine<C::F>, _: Vec3<C::F>) -> Option<MaskOf<C>> {
        None
    }
    #[inline(always)]
    fn start_axis(
        &self,
        axes: &StartAxes<'_, C::F, Self::Reach, CylinderReach<C::F>>,
    ) -> SeparatingAxis<C::F> {
        // across both axes, and from the cylinder's axis to ends and middle of the capsule's
        let (c, center) = (C::F::c, self.pose.center);
        axes.cylinder_axis()
            .or(axes.across_both(2))
            .or(axes.radial(self.half.scale_add(c(-1.0), center)))
            .or(axes.radial(self.half.scale_add(c(1.0), center)))
            .or(axes.radial(center))
            .best
    }
    #[inline(always)]
    fn with_cylinder(
        &self,
        feature: SegmentLine<C::F>,
        cylinder: CylinderFeature<C::F>,
        normal: Vec3<C::F>,
    ) -> FeaturePair<C::F, SegmentLine<C::F>, CylinderFeature<C::F>> {
        // a capsule is a line already: it lies along the side of the cylinder
        let along = !cylinder.cap & lines_along::<C>(&self.pose);
        FeaturePair {
            flat: cylinder.flat(normal) | along,
            clipped: feature,
            clipping: cylinder,
            side: C::F::c(1.0),
        }
    }
}

/// Where z of a pose lies along z of the frame.
#[inline(always)]
fn lines_along<C: Cx>(pose: &ShapePose<C::F>) -> MaskOf<C> {
    C::F::c(PARALLEL).lt(pose.axes[2][2].abs())
}

// no radius: the core is the box itself
impl<C: Cx> PosedShape<C> for PosedBox<C::F> {
    type Reach = BoxReach<C::F>;
    type Core = BoxCore<C::F>;

    #[inline(always)]
    fn pose(&self) -> &ShapePose<C::F> {
        &self.pose
    }
    #[inline(always)]
    fn reach(&self) -> BoxReach<C::F> {
        BoxReach(self.half)
    }
    #[inline(always)]
    fn core(&self) -> BoxCore<C::F> {
        // column j is axis j times its half extent
        let (axes, half) = (&self.pose.axes, self.half);
        BoxCore {
            center: self.pose.center,
            half: Mat3([axes[0] * half[0], axes[1] * half[1], axes[2] * half[2]]),
        }
    }
    #[inline(always)]
    fn radius(&self) -> Option<C::F> {
        None
    }
    #[inline(always)]
    fn size(&self) -> C::F {
        self.half.dot(self.half).sqrt()
    }
}

// its feature is a face
impl<C: Cx> FacetedShape<C> for PosedBox<C::F> {
    const AXES_ARE_EXACT: bool = true;
    type Feature = BoxFace<C::F>;
    type Clipped = CylinderFeature<C::F>;
    type Clipping = BoxFace<C::F>;

    #[inline(always)]
    fn restart_depth(&self) -> C::F {
        unreachable!("its axes are exact")
    }
    #[inline(always)]
    fn feature(&self, normal: Vec3<C::F>) -> BoxFace<C::F> {
        BoxFace::find(&self.pose, self.half, normal)
    }
    #[inline(always)]
    fn lies_flat(face: &BoxFace<C::F>, normal: Vec3<C::F>) -> Option<MaskOf<C>> {
        Some(aligned(face.outward, normal))
    }
    #[inline(always)]
    fn start_axis(
        &self,
        axes: &StartAxes<'_, C::F, Self::Reach, CylinderReach<C::F>>,
    ) -> SeparatingAxis<C::F> {
        // the axes of box and cylinder, their products, and the line of centres, also straight out of the cylinder's side
        let mut start = axes.cylinder_axis();
        for j in 0..3 {
            start = start.or(axes.first_axis(j)).or(axes.across_both(j));
        }
        let center = self.pose.center;
        start.or(axes.radial(center)).or(axes.along(center)).best
    }
    /// A line along the cylinder cannot clip a face, so the cylinder's feature is the one that is clipped.
    #[inline(always)]
    fn with_cylinder(
        &self,
        face: BoxFace<C::F>,
        cylinder: CylinderFeature<C::F>,
        normal: Vec3<C::F>,
    ) -> FeaturePair<C::F, CylinderFeature<C::F>, BoxFace<C::F>> {
        FeaturePair {
            flat: cylinder.flat(normal) | aligned(face.outward, normal),
            clipped: cylinder,
            clipping: face,
            side: C::F::c(-1.0),
        }
    }
}

// no radius: the core is the cylinder itself
impl<C: Cx> PosedShape<C> for PosedCylinder<C::F> {
    type Reach = CylinderReach<C::F>;
    type Core = CylinderCore<C::F>;

    #[inline(always)]
    fn pose(&self) -> &ShapePose<C::F> {
        &self.pose
    }
    #[inline(always)]
    fn reach(&self) -> CylinderReach<C::F> {
        CylinderReach(self.radius, self.half_height)
    }
    #[inline(always)]
    fn core(&self) -> CylinderCore<C::F> {
        CylinderCore {
            axes: self.pose.axes,
            center: self.pose.center,
            radius: self.radius,
            half_height: self.half_height,
        }
    }
    #[inline(always)]
    fn radius(&self) -> Option<C::F> {
        None
    }
    #[inline(always)]
    fn size(&self) -> C::F {
        cylinder_size(self.radius, self.half_height)
    }
}

// its feature is a cap or a line; its side is curved, so no list of axes is complete
impl<C: Cx> FacetedShape<C> for PosedCylinder<C::F> {
    const AXES_ARE_EXACT: bool = false;
    type Feature = CylinderFeature<C::F>;
    type Clipped = CylinderFeature<C::F>;
    type Clipping = CylinderFeature<C::F>;

    #[inline(always)]
    fn restart_depth(&self) -> C::F {
        self.radius * C::F::c(DEEP)
    }
    #[inline(always)]
    fn feature(&self, normal: Vec3<C::F>) -> CylinderFeature<C::F> {
        CylinderFeature::find(&self.pose, self.radius, self.half_height, normal)
    }
    #[inline(always)]
    fn lies_flat(feature: &CylinderFeature<C::F>, normal: Vec3<C::F>) -> Option<MaskOf<C>> {
        Some(feature.flat(normal))
    }
    #[inline(always)]
    fn start_axis(
        &self,
        axes: &StartAxes<'_, C::F, Self::Reach, CylinderReach<C::F>>,
    ) -> SeparatingAxis<C::F> {
        let ShapePose {
            axes: columns,
            center,
        } = &self.pose;
        // the axes of both, their product, and the line of centres, also straight out of either side
        let across = columns[2].scale_add(-columns[2].dot(*center), *center);
        axes.cylinder_axis()
            .or(axes.first_axis(2))
            .or(axes.across_both(2))
            .or(axes.radial(*center))
            .or(axes.along(across))
            .or(axes.along(*center))
            .best
    }
    #[inline(always)]
    fn with_cylinder(
        &self,
        feature: CylinderFeature<C::F>,
        cylinder: CylinderFeature<C::F>,
        normal: Vec3<C::F>,
    ) -> FeaturePair<C::F, CylinderFeature<C::F>, CylinderFeature<C::F>> {
        let c = C::F::c;
        // two lines lie along each other where the axes are parallel
        let lines = !(feature.cap | cylinder.cap);
        let along = lines & lines_along::<C>(&self.pose);
        // a line may be clipped by a cap, but clips only a line beside it
        let swap = feature.cap & !cylinder.cap;
        // `side` is -1 where the cylinder's feature is the one that is clipped
        FeaturePair {
            flat: along | (feature.flat(normal) | cylinder.flat(normal)),
            clipped: CylinderFeature::select(swap, &cylinder, &feature),
            clipping: CylinderFeature::select(swap, &feature, &cylinder),
            side: C::F::select(swap, c(-1.0), c(1.0)),
        }
    }
}
