//! The narrow phase: which function finds the contacts of two kinds of shapes.

use super::points::{Placed, Points};
use super::{boxes, capsules, cylinders, hulls, planes, spheres};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::model::contact::{Contacts, Kind};

type ContactsOf<C> = Contacts<<<C as Cx>::F as Num>::Real>;

/// A shape of a pair by itself.
pub(super) struct Shape<C: Cx> {
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
            size: [
                cx.constant(numbers, p, size),
                cx.constant(numbers, p, size + 1),
                cx.constant(numbers, p, size + 2),
            ],
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
        let [x, y, z] = self.size;
        match kind {
            Kind::Cylinder => [x, x, y],
            _ => [x, y, z],
        }
    }
}

/// Two shapes, the second where it is relative to the first.
pub(super) struct Two<'a, C: Cx> {
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

/// Contacts of two shapes of these kinds. The kinds are the model's: one call is compiled for each pair of them.
#[inline(always)]
pub(super) fn narrow<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    kinds: (Kind, Kind),
    two: &Two<'_, C>,
    out: &mut Points<C>,
) {
    use Kind::{Box, Capsule, Cylinder, Hull, Plane, Sphere};
    let (x, o, margin) = (two.axes, two.other, two.margin);
    let ([r, h, _], [s, k, _]) = (two.first.size, two.second.size);
    let (a, b) = (two.first.size, two.second.size);
    let (f, g) = (two.first.hull, two.second.hull);
    let (tables, cut) = (&t.hulls, t.memory.cut);
    match kinds {
        (Plane, Sphere) => planes::plane_sphere(cx, x, o, s, margin, out),
        (Plane, Capsule) => planes::plane_capsule(cx, x, o, s, k, margin, out),
        (Plane, Box) => planes::plane_box(cx, x, o, b, margin, out),
        (Plane, Cylinder) => planes::plane_cylinder(cx, x, o, s, k, margin, out),
        (Plane, Hull) => hulls::plane_hull(cx, x, o, g, tables, margin, out),
        (Sphere, Sphere) => spheres::sphere_sphere(cx, r, o, s, margin, out),
        (Sphere, Capsule) => spheres::sphere_capsule(cx, r, o, s, k, margin, out),
        (Sphere, Box) => spheres::sphere_box(cx, r, o, b, margin, out),
        (Sphere, Cylinder) => cylinders::sphere_cylinder(cx, r, o, s, k, margin, out),
        (Sphere, Hull) => hulls::sphere_hull(cx, r, o, g, tables, margin, out),
        (Capsule, Capsule) => capsules::capsule_capsule(cx, x, r, h, o, s, k, margin, out),
        (Capsule, Box) => capsules::capsule_box(cx, x, r, h, o, b, margin, out),
        (Capsule, Cylinder) => {
            cylinders::capsule_cylinder(cx, x, r, h, o, s, k, margin, cut, out);
        }
        (Capsule, Hull) => hulls::capsule_hull(cx, x, r, h, o, g, tables, margin, cut, out),
        (Box, Box) => boxes::box_box(cx, x, a, o, b, margin, out),
        (Box, Cylinder) => cylinders::box_cylinder(cx, x, a, o, s, k, margin, cut, out),
        (Box, Hull) => hulls::box_hull(cx, x, a, o, g, tables, margin, cut, out),
        (Cylinder, Cylinder) => {
            cylinders::cylinder_cylinder(cx, x, r, h, o, s, k, margin, cut, out);
        }
        (Cylinder, Hull) => cylinders::cylinder_hull(cx, x, r, h, o, g, tables, margin, cut, out),
        (Hull, Hull) => hulls::hull_hull(cx, x, f, o, g, tables, margin, cut, out),
        _ => unreachable!("the lower kind is the first"),
    }
}
