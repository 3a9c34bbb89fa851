//! The narrow phase: which function finds the contacts of two kinds of shapes.

use super::points::{Placed, Points};
use super::{boxes, capsules, cylinders, hulls, planes, spheres, touch};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::{Contacts, Kind};
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::{BlockOf, ConstantsOf, Stage};

type ContactsOf<C> = Contacts<<<C as Cx>::F as Num>::Real>;

/// A shape of a pair by itself.
pub struct Shape<C: Cx> {
    /// As its kind has it.
    size: Vec3<C::F>,
    /// Its row in the table of hulls; of other kinds it is not used.
    hull: C::I,
}

impl<C: Cx> Shape<C> {
    /// The first or second shape of a pair.
    #[inline(always)]
    pub fn read(
        cx: &mut C,
        t: &ContactsOf<C>,
        kind: Kind,
        p: C::I,
        size: usize,
        hull: usize,
    ) -> Shape<C> {
        let (numbers, indices) = (t.handles.pair_numbers, t.handles.pair_indices);
        Shape {
            size: Vec3([
                cx.constant(numbers, p, size),
                cx.constant(numbers, p, size + 1),
                cx.constant(numbers, p, size + 2),
            ]),
            hull: match kind {
                Kind::Hull => cx.index(indices, p, hull, t.hulls.spans.rows),
                _ => cx.at(0),
            },
        }
    }
}

impl<C: Cx> Shape<C> {
    /// Half extents of the box around it, of kinds that are no thinner than one.
    #[inline(always)]
    pub fn half(&self, kind: Kind) -> Vec3<C::F> {
        let Vec3([x, y, _]) = self.size;
        match kind {
            Kind::Cylinder => Vec3([x, x, y]),
            _ => self.size,
        }
    }
}

/// Two shapes, the second where it is relative to the first.
pub struct Two<'a, C: Cx> {
    /// Axes of the first.
    pub axes: &'a Mat3<C::F>,
    /// The first.
    pub first: Shape<C>,
    /// Where the second is.
    pub other: &'a Placed<C::F>,
    /// The second.
    pub second: Shape<C>,
    /// Distance below which contacts are found [m].
    pub margin: C::F,
}

/// The narrow phase of two kinds of shapes, of which the lower kind is the first.
pub trait Narrow {
    /// The kinds.
    const KINDS: (Kind, Kind);

    /// Adds the contacts of two shapes.
    fn contacts<C: Cx>(cx: &mut C, t: &ContactsOf<C>, two: &Two<'_, C>, out: &mut Points<C>);
}

/// Defines a stage for each pair of kinds.
///
/// A type for each, and not an argument: the other functions then never reach the compiler's optimizer, which would take
/// minutes to find that they are not called.
macro_rules! pairs {
    ($cx:ident, $out:ident; $x:ident $o:ident $margin:ident $r:ident $h:ident $s:ident $k:ident $a:ident $b:ident $f:ident $g:ident $tables:ident $cut:ident;
     $($name:ident($first:ident, $second:ident): $contacts:expr;)*) => {
        $(
            #[doc = concat!("Contacts of a ", stringify!($first), " and a ", stringify!($second), ".")]
            pub struct $name;

            impl Narrow for $name {
                const KINDS: (Kind, Kind) = (Kind::$first, Kind::$second);

                #[inline(always)]
                #[allow(unused_variables)]
                fn contacts<C: Cx>($cx: &mut C, t: &ContactsOf<C>, two: &Two<'_, C>, $out: &mut Points<C>) {
                    let ($x, $o, $margin) = (two.axes, two.other, two.margin);
                    let (Vec3([$r, $h, _]), Vec3([$s, $k, _])) = (two.first.size, two.second.size);
                    let ($a, $b) = (two.first.size, two.second.size);
                    let ($f, $g) = (two.first.hull, two.second.hull);
                    let ($tables, $cut) = (&t.hulls, t.memory.cut);
                    $contacts
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
                    touch::<C, $name>(cx, &m.contacts);
                }
            }
        )*
    };
}

pairs! { cx, out; x o margin r h s k a b f g tables cut;
    PlaneSphere(Plane, Sphere): planes::plane_sphere(cx, x, o, s, margin, out);
    PlaneCapsule(Plane, Capsule): planes::plane_capsule(cx, x, o, s, k, margin, out);
    PlaneBox(Plane, Box): planes::plane_box(cx, x, o, b, margin, out);
    PlaneCylinder(Plane, Cylinder): planes::plane_cylinder(cx, x, o, s, k, margin, out);
    PlaneHull(Plane, Hull): hulls::plane_hull(cx, x, o, g, tables, margin, out);
    SphereSphere(Sphere, Sphere): spheres::sphere_sphere(cx, r, o, s, margin, out);
    SphereCapsule(Sphere, Capsule): spheres::sphere_capsule(cx, r, o, s, k, margin, out);
    SphereBox(Sphere, Box): spheres::sphere_box(cx, r, o, b, margin, out);
    SphereCylinder(Sphere, Cylinder): cylinders::sphere_cylinder(cx, r, o, s, k, margin, out);
    SphereHull(Sphere, Hull): hulls::sphere_hull(cx, r, o, g, tables, margin, out);
    CapsuleCapsule(Capsule, Capsule): capsules::capsule_capsule(cx, x, r, h, o, s, k, margin, out);
    CapsuleBox(Capsule, Box): capsules::capsule_box(cx, x, r, h, o, b, margin, out);
    CapsuleCylinder(Capsule, Cylinder): cylinders::capsule_cylinder(cx, x, r, h, o, s, k, margin, cut, out);
    CapsuleHull(Capsule, Hull): hulls::capsule_hull(cx, x, r, h, o, g, tables, margin, cut, out);
    BoxBox(Box, Box): boxes::box_box(cx, x, a, o, b, margin, out);
    BoxCylinder(Box, Cylinder): cylinders::box_cylinder(cx, x, a, o, s, k, margin, cut, out);
    BoxHull(Box, Hull): hulls::box_hull(cx, x, a, o, g, tables, margin, cut, out);
    CylinderCylinder(Cylinder, Cylinder): cylinders::cylinder_cylinder(cx, x, r, h, o, s, k, margin, cut, out);
    CylinderHull(Cylinder, Hull): cylinders::cylinder_hull(cx, x, r, h, o, g, tables, margin, cut, out);
    HullHull(Hull, Hull): hulls::hull_hull(cx, x, f, o, g, tables, margin, cut, out);
}
