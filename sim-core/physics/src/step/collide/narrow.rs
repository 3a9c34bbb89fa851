//! The narrow phase: which function finds the contacts of two kinds of shapes.

use super::points::{Placed, Points};
use super::{boxes, capsules, cylinders, hulls, planes, spheres};
use crate::constants::contact::{Contacts, Kind, pair_kinds};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};

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

/// Contacts of two shapes, of the pair of kinds with this number.
///
/// A number of the type and not an argument: the other functions then never reach the compiler's optimizer, which would
/// take minutes to find that they are not called.
#[inline(always)]
pub(super) fn narrow<C: Cx, const KINDS: usize>(
    cx: &mut C,
    t: &ContactsOf<C>,
    two: &Two<'_, C>,
    out: &mut Points<C>,
) {
    use pair_kinds::*;
    let (x, o, margin) = (two.axes, two.other, two.margin);
    let ([r, h, _], [s, k, _]) = (two.first.size, two.second.size);
    let (a, b) = (two.first.size, two.second.size);
    let (f, g) = (two.first.hull, two.second.hull);
    let (tables, cut) = (&t.hulls, t.memory.cut);
    match KINDS {
        PLANE_SPHERE => planes::plane_sphere(cx, x, o, s, margin, out),
        PLANE_CAPSULE => planes::plane_capsule(cx, x, o, s, k, margin, out),
        PLANE_BOX => planes::plane_box(cx, x, o, b, margin, out),
        PLANE_CYLINDER => planes::plane_cylinder(cx, x, o, s, k, margin, out),
        PLANE_HULL => hulls::plane_hull(cx, x, o, g, tables, margin, out),
        SPHERE_SPHERE => spheres::sphere_sphere(cx, r, o, s, margin, out),
        SPHERE_CAPSULE => spheres::sphere_capsule(cx, r, o, s, k, margin, out),
        SPHERE_BOX => spheres::sphere_box(cx, r, o, b, margin, out),
        SPHERE_CYLINDER => cylinders::sphere_cylinder(cx, r, o, s, k, margin, out),
        SPHERE_HULL => hulls::sphere_hull(cx, r, o, g, tables, margin, out),
        CAPSULE_CAPSULE => capsules::capsule_capsule(cx, x, r, h, o, s, k, margin, out),
        CAPSULE_BOX => capsules::capsule_box(cx, x, r, h, o, b, margin, out),
        CAPSULE_CYLINDER => {
            cylinders::capsule_cylinder(cx, x, r, h, o, s, k, margin, cut, out);
        }
        CAPSULE_HULL => hulls::capsule_hull(cx, x, r, h, o, g, tables, margin, cut, out),
        BOX_BOX => boxes::box_box(cx, x, a, o, b, margin, out),
        BOX_CYLINDER => cylinders::box_cylinder(cx, x, a, o, s, k, margin, cut, out),
        BOX_HULL => hulls::box_hull(cx, x, a, o, g, tables, margin, cut, out),
        CYLINDER_CYLINDER => {
            cylinders::cylinder_cylinder(cx, x, r, h, o, s, k, margin, cut, out);
        }
        CYLINDER_HULL => cylinders::cylinder_hull(cx, x, r, h, o, g, tables, margin, cut, out),
        HULL_HULL => hulls::hull_hull(cx, x, f, o, g, tables, margin, cut, out),
        _ => unreachable!("there are no more pairs of kinds"),
    }
}
