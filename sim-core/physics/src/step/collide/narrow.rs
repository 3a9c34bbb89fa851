//! The narrow phase: one stage for each pair of shape kinds, and the function that finds its contacts.

use super::collide_group;
use super::convex::hull::Hull;
use super::convex::{hulls, plane_hull};
use super::manifold::points::Points;
use super::primitive::{boxes, capsules, cylinders, ellipsoids, planes, spheres};
use super::reference::{is_reference, reference_contacts};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::clip::Cut;
use crate::constants::contact::{Contacts, Kind};
use crate::constants::hull::HullTables;
use crate::constants::hull::reference::ReferenceSearch;
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::{BlockOf, ConstantsOf, Stage};

type ContactsOf<C> = Contacts<<<C as Cx>::F as Num>::Real>;

/// Size and hull of one shape of a pair.
pub struct Shape<C: Cx> {
    /// See [`Kind`].
    size: Vec3<C::F>,
    /// Its row in the table of hulls; not used by other kinds.
    hull: C::I,
}

impl<C: Cx> Shape<C> {
    /// Reads the first or second shape of a pair.
    #[inline(always)]
    pub fn read(
        cx: &mut C,
        t: &ContactsOf<C>,
        kind: Kind,
        p: C::I,
        size: usize,
        hull: usize,
    ) -> Shape<C> {
        let (scalars, indices) = (t.handles.pair_numbers, t.handles.pair_indices);
        Shape {
            size: Vec3([
                cx.constant(scalars, p, size),
                cx.constant(scalars, p, size + 1),
                cx.constant(scalars, p, size + 2),
            ]),
            // other kinds have no row of hulls, so any index will do
            hull: match kind {
                Kind::Hull => cx.index(indices, p, hull, t.hulls.spans.rows),
                _ => cx.at(0),
            },
        }
    }

    /// A shape of which neither size nor hull is read; any index will do.
    #[inline(always)]
    pub fn none(any: C::I) -> Shape<C> {
        Shape {
            size: Vec3([C::F::c(0.0); 3]),
            hull: any,
        }
    }

    /// Its row in the table of hulls, if it is one.
    #[inline(always)]
    pub(super) fn hull(&self) -> C::I {
        self.hull
    }

    /// Radius of a sphere, capsule or cylinder [m].
    #[inline(always)]
    pub fn radius(&self) -> C::F {
        self.size[0]
    }

    /// Half the length of a capsule's axis, or of a cylinder [m].
    #[inline(always)]
    pub fn half_height(&self) -> C::F {
        self.size[1]
    }

    /// Half extents of a box, or of the bounding box of a hull; radii of an ellipsoid [m].
    #[inline(always)]
    pub fn half_extents(&self) -> Vec3<C::F> {
        self.size
    }

    /// Half extents of the bounding box of a box, cylinder, ellipsoid or hull [m].
    #[inline(always)]
    pub fn bounding_box(&self, kind: Kind) -> Vec3<C::F> {
        let Vec3([x, y, _]) = self.size;
        match kind {
            // a cylinder's size is its radius and its half height
            Kind::Cylinder => Vec3([x, x, y]),
            _ => self.size,
        }
    }
}

/// Axes and centre of a shape, relative to the centre of the pair's first shape.
#[derive(Clone, Copy)]
pub struct ShapePose<F> {
    /// Its axes, by columns [–].
    pub axes: Mat3<F>,
    /// Its centre [m].
    pub center: Vec3<F>,
}

impl<F: Num> ShapePose<F> {
    /// Pose in this frame of a shape at the origin with these axes.
    #[inline(always)]
    pub fn to_local(self, axes: &Mat3<F>) -> ShapePose<F> {
        // the inverse pose: Rᵀ A and -Rᵀ c
        let axes = [
            self.axes.transpose_mul(axes[0]),
            self.axes.transpose_mul(axes[1]),
            self.axes.transpose_mul(axes[2]),
        ];
        ShapePose {
            axes: Mat3(axes),
            center: -self.axes.transpose_mul(self.center),
        }
    }
}

/// Two shapes of which the narrow phase finds the contacts. The centre of the first, `a`, is the origin.
pub struct ShapePair<'a, C: Cx> {
    /// Axes of `a`, by columns [–].
    pub axes_a: &'a Mat3<C::F>,
    /// The first shape.
    pub a: Shape<C>,
    /// Pose of `b`.
    pub pose_b: &'a ShapePose<C::F>,
    /// The second shape.
    pub b: Shape<C>,
    /// Distance below which contacts are found, with a slack for rounding [m].
    pub margin: C::F,
    /// The same without it [m].
    pub reach: C::F,
    /// MuJoCo's search.
    pub reference: &'a ReferenceSearch,
    /// Tables of the model's hulls.
    pub hull_tables: &'a HullTables,
    /// Scratch tables for clipping.
    pub clip_tables: Cut,
    /// Whether capsules and boxes have the points of [`super::primitive::capsule_box`]; the same for all pairs of a model.
    pub two_point_capsule_boxes: bool,
    /// Whether corners of a box are in MuJoCo's order; the same for all pairs of a model.
    pub ordered_corners: bool,
}

impl<'a, C: Cx> ShapePair<'a, C> {
    /// The first shape as a hull.
    #[inline(always)]
    pub(super) fn hull_a(&self) -> Hull<'a, C> {
        Hull {
            tables: self.hull_tables,
            row: self.a.hull,
        }
    }

    /// The second shape as a hull.
    #[inline(always)]
    pub(super) fn hull_b(&self) -> Hull<'a, C> {
        Hull {
            tables: self.hull_tables,
            row: self.b.hull,
        }
    }

    /// Pose of the first shape in the frame of the second.
    #[inline(always)]
    pub(super) fn pose_a_in_b(&self) -> ShapePose<C::F> {
        self.pose_b.to_local(self.axes_a)
    }
}

/// The narrow phase of two kinds of shapes, of which the lower kind is the first.
pub trait Narrow {
    /// The kinds.
    const KINDS: (Kind, Kind);

    /// Adds the contacts of a pair.
    fn contacts<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>);
}

/// Defines a stage for each pair of kinds.
///
/// Each is a type of its own, not a run-time argument: the optimizer then never sees the code of the other pairs, which it
/// would need minutes to remove.
macro_rules! pairs {
    ($($name:ident($first:ident, $second:ident) = $contacts:path;)*) => {
        $(
            #[doc = concat!("Contacts of a ", stringify!($first), " and a ", stringify!($second), ".")]
            pub struct $name;

            impl Narrow for $name {
                const KINDS: (Kind, Kind) = (Kind::$first, Kind::$second);

                #[inline(always)]
                fn contacts<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
                    // in double precision, models from MuJoCo have its points
                    let is_double = <<C::F as Num>::Real as Real>::DOUBLE;
                    if is_double
                        && pair.reference.is_used
                        && is_reference(Self::KINDS)
                        && reference_contacts(cx, Self::KINDS, pair, out)
                    {
                        return;
                    }
                    $contacts(cx, pair, out);
                }
            }

            impl Stage for $name {
                const READS: &'static [A] = &[A::ShapePoses, A::ContactPoints];
                const WRITES: &'static [A] = &[A::ContactPoints];

                fn is_needed<R: Real>(m: &Constants<R>) -> bool {
                    m.contacts.group(Self::KINDS).is_some()
                }

                #[inline(always)]
                fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, _b: &mut BlockOf<C>) {
                    collide_group::<C, $name>(cx, &m.contacts);
                }
            }
        )*
    };
}

pairs! {
    PlaneSphere(Plane, Sphere) = planes::plane_sphere;
    PlaneCapsule(Plane, Capsule) = planes::plane_capsule;
    PlaneBox(Plane, Box) = planes::plane_box;
    PlaneCylinder(Plane, Cylinder) = planes::plane_cylinder;
    PlaneEllipsoid(Plane, Ellipsoid) = ellipsoids::plane_ellipsoid;
    PlaneHull(Plane, Hull) = plane_hull::plane_hull;
    SphereSphere(Sphere, Sphere) = spheres::sphere_sphere;
    SphereCapsule(Sphere, Capsule) = spheres::sphere_capsule;
    SphereBox(Sphere, Box) = spheres::sphere_box;
    SphereCylinder(Sphere, Cylinder) = cylinders::sphere_cylinder;
    SphereEllipsoid(Sphere, Ellipsoid) = ellipsoids::sphere_ellipsoid;
    SphereHull(Sphere, Hull) = hulls::sphere_hull;
    CapsuleCapsule(Capsule, Capsule) = capsules::capsule_capsule;
    CapsuleBox(Capsule, Box) = capsules::capsule_box;
    CapsuleCylinder(Capsule, Cylinder) = cylinders::capsule_cylinder;
    CapsuleEllipsoid(Capsule, Ellipsoid) = ellipsoids::capsule_ellipsoid;
    CapsuleHull(Capsule, Hull) = hulls::capsule_hull;
    BoxBox(Box, Box) = boxes::box_box;
    BoxCylinder(Box, Cylinder) = cylinders::box_cylinder;
    BoxEllipsoid(Box, Ellipsoid) = ellipsoids::box_ellipsoid;
    BoxHull(Box, Hull) = hulls::box_hull;
    CylinderCylinder(Cylinder, Cylinder) = cylinders::cylinder_cylinder;
    CylinderEllipsoid(Cylinder, Ellipsoid) = ellipsoids::cylinder_ellipsoid;
    CylinderHull(Cylinder, Hull) = hulls::cylinder_hull;
    EllipsoidEllipsoid(Ellipsoid, Ellipsoid) = ellipsoids::ellipsoid_ellipsoid;
    EllipsoidHull(Ellipsoid, Hull) = ellipsoids::ellipsoid_hull;
    HullHull(Hull, Hull) = hulls::hull_hull;
}
